// The lead of each pixel's optimum over its runner-up. One invocation per pixel.

#import band maps

struct Params {
    level: Level,
    @align(16) band: Band,
}

@group(0) @binding(0) var<uniform> params: Params;
// label | best << 16, runner-up.
@group(0) @binding(1) var<storage, read> optima: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read_write> flags: array<u32>;

@compute @workgroup_size(GROUP)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let at = id.y * params.level.pixel_pitch + id.x;
    let validity = flags[at] & VALIDITY;
    var confidence = 0u;
    if is_valid(validity) {
        let optimum = optima[at];
        confidence = min(2u * (optimum.y - (optimum.x >> 16u)), 255u);
    }
    flags[at] = validity | (confidence << 8u);
}
