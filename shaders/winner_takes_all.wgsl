// Winner takes all: the optimum of every pixel and its runner-up. One invocation per pixel.

#import band volume windows messages

struct Params {
    level: Level,
    @align(16) band: Band,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> belief: array<Quad>;
// label | best << 16, runner-up.
@group(0) @binding(2) var<storage, read_write> optima: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read> windows: array<u32>;

fn load(index: u32, quad: u32) -> vec4<u32> {
    let b = unpack(belief[index]);
    return select(vec4(NO_RUNNER_UP), b, are_labels(quad) & (b != vec4(MOST)));
}

@compute @workgroup_size(GROUP)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let row = id.y * params.level.pitch;
    let own = quads_of(window_of(id.x, params.band.first_row + id.y));
    // Belief and label in one key: the smallest key is the smallest belief at its lowest label.
    var least = vec4(0xffffffffu);
    for (var quad = own.x; quad < own.y; quad++) {
        least = min(least, (load(row + place_of(quad, id.x), quad) << vec4(16u)) | labels_of(quad));
    }
    let key = smallest(least);
    let label = i32(key & 0xffffu);
    var runner_up = vec4(NO_RUNNER_UP);
    for (var quad = own.x; quad < own.y; quad++) {
        let away = abs(vec4<i32>(labels_of(quad)) - vec4(label)) > vec4(1);
        runner_up = min(runner_up, select(vec4(NO_RUNNER_UP), load(row + place_of(quad, id.x), quad), away));
    }
    optima[id.y * params.level.pixel_pitch + id.x] = vec2(u32(label) | (key & 0xffff0000u), smallest(runner_up));
}
