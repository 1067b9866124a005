// The support of every pixel by those around it with nearly its disparity. One invocation per pixel.

#import band maps

struct Params {
    level: Level,
    @align(16) band: Band,
    floor: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> disparity: array<i32>;
@group(0) @binding(2) var<storage, read> flags: array<u32>;
@group(0) @binding(3) var<storage, read_write> next_flags: array<u32>;

// Distance from the middle to the farthest place.
const REACH: u32 = STEP * (PLACES / 2u);

// The row or column of a place around `middle` by its index, clamped to `count`.
fn inside(middle: u32, index: u32, count: u32) -> u32 {
    return min(max(middle + STEP * index, REACH) - REACH, count - 1u);
}

@compute @workgroup_size(GROUP)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let pitch = params.level.pixel_pitch;
    let y = params.band.first_row + id.y;
    let top = halo_start(REACH);
    let here = (y - top) * pitch + id.x;
    var validity = flags[here] & VALIDITY;
    var confidence = 0u;
    if is_valid(validity) {
        var sum = 0u;
        for (var row = 0u; row < PLACES; row++) {
            let start = (inside(y, row, params.level.height) - top) * pitch;
            for (var column = 0u; column < PLACES; column++) {
                let at = start + inside(id.x, column, params.level.width);
                let near = u32(abs(disparity[at] - disparity[here])) <= NEAR;
                sum += select(0u, (flags[at] >> 8u) & 0xffu, near);
            }
        }
        confidence = sum / (PLACES * PLACES);
        if confidence < params.floor {
            validity |= LOW_CONFIDENCE;
        }
    }
    next_flags[id.y * pitch + id.x] = validity | (confidence << 8u);
}
