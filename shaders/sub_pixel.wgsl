// Every pixel's disparity: its label plus the sub-pixel offset from the matching costs around it. One
// invocation per pixel.

#import band volume maps

struct Params {
    level: Level,
    @align(16) band: Band,
    // 1, or 0 to leave the disparity at its label.
    is_on: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> cost: array<u32>;
// label | best << 16, runner-up.
@group(0) @binding(2) var<storage, read> optima: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read_write> raw: array<i32>;
@group(0) @binding(4) var<storage, read_write> disparity: array<i32>;

@compute @workgroup_size(GROUP)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let pitch = params.level.pixel_pitch;
    let top = i32(halo_start(1u));
    let x = i32(id.x);
    let y = i32(params.band.first_row + id.y);
    let label = i32(optima[u32(y - top) * pitch + id.x].x & 0xffffu);
    var offset = 0;
    if params.is_on == 1u && label > 0 && label + 1 < i32(params.level.labels) {
        // The costs at the label below, at the label and above are bytes of one word, or of two. In one word,
        // `high` is the same word, and its shifted bits are masked.
        let first = u32(label - 1);
        let shift = 8u * (first % 4u);
        // Sums below and above in 16 bits each, and sum at the label.
        var outer = 0u;
        var inner = 0u;
        for (var v = max(y - 1, 0); v <= min(y + 1, i32(params.level.height) - 1); v++) {
            for (var u = max(x - 2, 0); u <= min(x + 2, i32(params.level.width) - 1); u++) {
                if abs(i32(optima[u32(v - top) * pitch + u32(u)].x & 0xffffu) - label) <= 2 {
                    let row = u32(v - top) * params.level.pitch;
                    let low = cost[row + place_of(first / 4u, u32(u))] >> shift;
                    let high = cost[row + place_of((first + 2u) / 4u, u32(u))] << ((32u - shift) & 31u);
                    outer += (low | high) & 0xff00ffu;
                    inner += ((low | high) >> 8u) & 0xffu;
                }
            }
        }
        let sums = vec3(i32(outer & 0xffffu), i32(inner), i32(outer >> 16u));
        let slope = max(sums.x, sums.z) - sums.y;
        if slope > 0 {
            // Adding one pixel first makes the dividend non-negative, so that the quotient rounds down.
            let most = 2 * slope;
            let difference = clamp(sums.x - sums.z, -most, most);
            offset = (FRACTION * (difference + most) + slope) / most - FRACTION;
        }
    }
    // A pixel without a label takes the last one.
    let fixed = FRACTION * (params.level.low + min(label, i32(params.level.labels) - 1)) + offset;
    raw[id.y * pitch + id.x] = fixed;
    disparity[id.y * pitch + id.x] = fixed;
}
