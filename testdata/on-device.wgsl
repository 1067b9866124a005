// The shaders of the example on-device: a scene as one of two cameras sees it, and the left view relit by the depth that was matched.

struct View {
    // Columns and rows of a view.
    size: vec2u,
    // Words from row to row of the map.
    pitch: u32,
    // How far the camera is to the right of the left one, in metres.
    shift: f32,
}

// In pixels, and in metres.
const FOCAL_LENGTH = 576.0;
const BASELINE = 0.12;
// Disparities are in 1/256 px.
const FRACTION = 256.0;
const FAR = 1e9;

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var painted: texture_storage_2d<rgba8unorm, write>;
@group(0) @binding(2) var<storage, read> disparity: array<i32>;
@group(0) @binding(3) var left: texture_2d<f32>;

fn hash(cell: vec3i) -> f32 {
    let c = vec3u(cell);
    var h = (c.x * 0x9e3779b1u) ^ (c.y * 0x85ebca77u) ^ (c.z * 0xc2b2ae3du);
    h = (h ^ (h >> 15u)) * 0x2c1b3c6du;
    h = (h ^ (h >> 12u)) * 0x297a2d39u;
    return f32((h ^ (h >> 15u)) >> 8u) / 16777216.0;
}

// Noise of two scales, 0 to 1.
fn grain(at: vec3f) -> f32 {
    return 0.6 * hash(vec3i(floor(30.0 * at))) + 0.4 * hash(vec3i(floor(90.0 * at)));
}

// The distance to a sphere along a ray of length 1.
fn to_sphere(start: vec3f, ray: vec3f, middle: vec3f, radius: f32) -> f32 {
    let away = start - middle;
    let along = dot(away, ray);
    let inside = along * along - dot(away, away) + radius * radius;
    return select(FAR, -along - sqrt(max(inside, 0.0)), inside > 0.0 && along < 0.0);
}

// x right, y down, z forward of the left camera.
fn direction(at: vec2f) -> vec3f {
    return vec3f((at - 0.5 * vec2f(view.size)) / FOCAL_LENGTH, 1.0);
}

@compute @workgroup_size(8, 8)
fn scene(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= view.size) {
        return;
    }
    let spheres = array(vec4f(-0.5, 0.15, 2.2, 0.35), vec4f(0.45, 0.25, 1.7, 0.25), vec4f(0.1, -0.2, 3.2, 0.4));
    let colours = array(vec3f(0.95, 0.5, 0.3), vec3f(0.35, 0.7, 0.95), vec3f(0.6, 0.85, 0.4));
    var sum = vec3f(0.0);
    // Nine rays a pixel.
    for (var i = 0u; i < 9u; i++) {
        let start = vec3f(view.shift, 0.0, 0.0);
        let ray = normalize(direction(vec2f(id.xy) + (vec2f(f32(i % 3u), f32(i / 3u)) + 0.5) / 3.0));
        // A wall, and a floor.
        var away = 5.0 / ray.z;
        var colour = vec3f(0.75, 0.7, 0.65);
        let floor_away = select(FAR, 0.5 / ray.y, ray.y > 0.0);
        if floor_away < away {
            away = floor_away;
            colour = vec3f(0.6, 0.5, 0.4);
        }
        for (var k = 0u; k < 3u; k++) {
            let to = to_sphere(start, ray, spheres[k].xyz, spheres[k].w);
            if to < away {
                away = to;
                colour = colours[k];
            }
        }
        sum += colour * (0.35 + 0.65 * grain(start + away * ray));
    }
    textureStore(painted, id.xy, vec4f(sum / 9.0, 1.0));
}

fn place(x: u32, y: u32) -> vec3f {
    let at = min(vec2u(x, y), view.size - 1u);
    let found = f32(disparity[at.y * view.pitch + at.x]) / FRACTION;
    return direction(vec2f(at) + 0.5) * FOCAL_LENGTH * BASELINE / max(found, 1.0);
}

@compute @workgroup_size(8, 8)
fn relit(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= view.size) {
        return;
    }
    let here = place(id.x, id.y);
    let across = place(id.x + 3u, id.y) - here;
    let down = place(id.x, id.y + 3u) - here;
    let normal = normalize(cross(down, across) + vec3f(0.0, 0.0, -1e-9));
    // A lamp at the upper right, and haze.
    let lamp = vec3f(1.2, -1.0, 1.0) - here;
    let light = 0.3 + 4.0 * max(dot(normal, normalize(lamp)), 0.0) / (0.5 + dot(lamp, lamp));
    let clear = exp(-0.12 * here.z);
    let seen = textureLoad(left, id.xy, 0).rgb * light;
    textureStore(painted, id.xy, vec4f(mix(vec3f(0.55, 0.6, 0.7), seen, clear), 1.0));
}
