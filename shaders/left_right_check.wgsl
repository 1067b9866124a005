// The left-right check. One invocation per pixel.

#import band maps

struct Params {
    level: Level,
    @align(16) band: Band,
    // 1, or 0 to flag only masked pixels.
    is_on: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
// label | best << 16, runner-up.
@group(0) @binding(1) var<storage, read> optima: array<vec2<u32>>;
// label | belief << 16.
@group(0) @binding(2) var<storage, read> right_labels: array<u32>;
@group(0) @binding(3) var<storage, read> left: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> flags: array<u32>;

@compute @workgroup_size(GROUP)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let row = id.y * params.level.pixel_pitch;
    var reason = 0u;
    if left[row + id.x].z != 0u {
        reason = MASKED;
    } else if (optima[row + id.x].x & 0xffffu) == NO_LABEL {
        reason = OUTSIDE;
    } else if params.is_on == 1u {
        let label = i32(optima[row + id.x].x & 0xffffu);
        let x = i32(id.x) - params.level.low - label;
        if x < 0 || x >= i32(params.level.width) {
            reason = OUTSIDE;
        } else if abs(i32(right_labels[row + u32(x)] & 0xffffu) - label) > 1 {
            reason = OCCLUDED;
        }
    }
    flags[row + id.x] = (flags[row + id.x] & ~VALIDITY) | reason;
}
