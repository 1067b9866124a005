// How much colour counts at every pixel of the left image: by the variance of grey in the window of the census. One
// invocation a pixel.

@group(0) @binding(1) var<storage, read> image: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read_write> weight: array<u32>;

const RADIUS_X: i32 = 4;
const RADIUS_Y: i32 = 3;
const PLACES: u32 = 63u;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    let width = params.level.width;
    if id.x >= width || id.y >= params.rows {
        return;
    }
    let x = i32(id.x);
    let y = i32(params.first_row + id.y);
    let top = halo_start(u32(RADIUS_Y));
    let pitch = params.level.pixel_pitch;
    let centre = image[(u32(y) - top) * pitch + id.x].y >> 24u;
    var sum = 0u;
    var squares = 0u;
    for (var dy = -RADIUS_Y; dy <= RADIUS_Y; dy++) {
        let row = (u32(clamp(y + dy, 0, i32(params.level.height) - 1)) - top) * pitch;
        for (var dx = -RADIUS_X; dx <= RADIUS_X; dx++) {
            let pixel = image[row + u32(clamp(x + dx, 0, i32(width) - 1))];
            let grey = select(centre, pixel.y >> 24u, pixel.z == 0u);
            sum += grey;
            squares += grey * grey;
        }
    }
    let most = params.colour_variance;
    var w = params.colour_weight;
    if most > 0u {
        w = w * min(PLACES * squares - sum * sum, most) / most;
    }
    weight[id.y * pitch + id.x] = w;
}
