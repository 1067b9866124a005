// Labels of the mirrored pair in the geometry of the pair. One invocation per pixel.

#import band

struct Params {
    level: Level,
    @align(16) band: Band,
}

@group(0) @binding(0) var<uniform> params: Params;
// label | best << 16, runner-up.
@group(0) @binding(1) var<storage, read> optima: array<vec2<u32>>;
// label | best << 16.
@group(0) @binding(2) var<storage, read_write> right_labels: array<u32>;

@compute @workgroup_size(GROUP)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    let width = params.level.width;
    if id.x >= width || id.y >= params.band.rows {
        return;
    }
    let row = id.y * params.level.pixel_pitch;
    right_labels[row + width - 1u - id.x] = optima[row + id.x].x;
}
