// Gives pixels without a trusted match the disparity that a prior has for them. One invocation per pixel.

#import band maps

struct Params {
    level: Level,
    @align(16) band: Band,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> anchors: array<i32>;
@group(0) @binding(2) var<storage, read_write> disparity: array<i32>;
@group(0) @binding(3) var<storage, read_write> flags: array<u32>;

@compute @workgroup_size(GROUP)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let at = id.y * params.level.pixel_pitch + id.x;
    let validity = flags[at];
    let anchor = anchors[at];
    if is_valid(validity) || (validity & MASKED) != 0u || anchor == NO_ANCHOR {
        return;
    }
    disparity[at] = anchor;
    flags[at] = FILLED | (ANCHOR_CONFIDENCE << 8u);
}
