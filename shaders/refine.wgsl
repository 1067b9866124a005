// Refines the disparities of a pair matched at half its size by the full-size views: `census`, `costs`,
// `fit`. A half-size row covers two full-size rows.

#import band maps volume

struct Params {
    level: Level,
    @align(16) band: Band,
    // Elements per full-size row.
    full_pitch: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
// Colours in 8 bits each, | 1 << 24 if masked; grey.
@group(0) @binding(1) var<storage, read> full_left: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read> full_right: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read_write> full_left_census_out: array<u32>;
@group(0) @binding(4) var<storage, read_write> full_right_census_out: array<u32>;
@group(0) @binding(5) var<storage, read> full_left_census: array<u32>;
@group(0) @binding(6) var<storage, read> full_right_census: array<u32>;
// label | best << 16, runner-up.
@group(0) @binding(7) var<storage, read> optima: array<vec2<u32>>;
// Four costs per word: the first words of all pixels of a row, then the second ones, and so on.
@group(0) @binding(8) var<storage, read_write> block_costs_out: array<u32>;
@group(0) @binding(9) var<storage, read> block_costs: array<u32>;
@group(0) @binding(10) var<storage, read_write> raw: array<i32>;
@group(0) @binding(11) var<storage, read_write> disparity: array<i32>;

// 16-bit census of the pixels of both views. One invocation per full-size pixel.
@compute @workgroup_size(GROUP)
fn census(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    let width = 2u * params.level.width;
    if id.x >= 2u * width || id.y >= params.band.rows {
        return;
    }
    let j = id.x / width;
    let x = i32(id.x - j * width);
    let y = i32(2u * (params.band.first_row + id.y) + j);
    let top = max(2u * params.band.first_row, 2u) - 2u;
    let last = vec2(i32(width), i32(2u * params.level.height)) - 1;
    let centre = (u32(y) - top) * params.full_pitch + u32(x);
    let l = full_left[centre];
    let r = full_right[centre];
    var left_bits = 0u;
    var right_bits = 0u;
    for (var dy = -2; dy <= 2; dy++) {
        let row = (u32(clamp(y + dy, 0, last.y)) - top) * params.full_pitch;
        for (var dx = -2; dx <= 2; dx++) {
            // The eight neighbours, and others at distance 2.
            let near = max(abs(dx), abs(dy)) == 1;
            if near || (dx % 2 == 0 && dy % 2 == 0 && (dx != 0 || dy != 0)) {
                let at = row + u32(clamp(x + dx, 0, last.x));
                let a = full_left[at];
                let b = full_right[at];
                left_bits = (left_bits << 1u) | u32(a.y < l.y && (a.x >> 24u) == 0u);
                right_bits = (right_bits << 1u) | u32(b.y < r.y && (b.x >> 24u) == 0u);
            }
        }
    }
    let out = (2u * id.y + j) * params.full_pitch + u32(x);
    full_left_census_out[out] = select(NO_CENSUS, left_bits, (l.x >> 24u) == 0u);
    full_right_census_out[out] = select(NO_CENSUS, right_bits, (r.x >> 24u) == 0u);
}

// The costs of a block around twice the disparity of its label. One invocation per half-size pixel and four costs.
@compute @workgroup_size(GROUP)
fn costs(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    let width = params.level.width;
    let word = id.x / width;
    let x = id.x - word * width;
    if word >= 4u || id.y >= params.band.rows {
        return;
    }
    let label = i32(optima[id.y * params.level.pixel_pitch + x].x & 0xffffu);
    let first = 2 * (params.level.low + label) - BEFORE + i32(4u * word);
    var sums = vec4<u32>();
    for (var j = 0u; j < 2u; j++) {
        let row = (2u * id.y + j) * params.full_pitch;
        for (var i = 0u; i < 2u; i++) {
            let column = 2u * x + i;
            let here = full_left_census[row + column];
            for (var k = 0; k < 4; k++) {
                let other = i32(column) - first - k;
                var there = NO_CENSUS;
                if other >= 0 && other < 2 * i32(width) {
                    there = full_right_census[row + u32(other)];
                }
                sums[k] += countOneBits(here ^ there);
            }
        }
    }
    block_costs_out[4u * id.y * params.level.pixel_pitch + word * params.level.pixel_pitch + x] = pack_narrow(sums);
}

// The sum for one disparity, from sums packed by even and odd index.
fn sum_at(even: vec3<u32>, odd: vec3<u32>, at: u32) -> i32 {
    let pair = select(odd, even, at % 2u == 0u)[at / 4u];
    return i32((pair >> (16u * (at % 4u / 2u))) & 0xffffu);
}

// The disparity of a half-size pixel, from the costs of its neighbourhood.
@compute @workgroup_size(GROUP)
fn fit(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    let width = params.level.width;
    if id.x >= width || id.y >= params.band.rows {
        return;
    }
    let pitch = params.level.pixel_pitch;
    let top = i32(halo_start(1u));
    let x = i32(id.x);
    let y = i32(params.band.first_row + id.y);
    let label = i32(optima[u32(y - top) * pitch + id.x].x & 0xffffu);
    // Packed 16-bit sums: those of the first and third cost of every four, and of the second and fourth.
    var even = vec3<u32>();
    var odd = vec3<u32>();
    for (var v = max(y - 1, 0); v <= min(y + 1, i32(params.level.height) - 1); v++) {
        let row = u32(v - top) * pitch;
        for (var u = max(x - COLUMNS, 0); u <= min(x + COLUMNS, i32(width) - 1); u++) {
            let above = label - i32(optima[row + u32(u)].x & 0xffffu);
            if abs(above) <= 1 {
                let at = 4u * row + u32(u);
                var costs = vec3(block_costs[at], block_costs[at + pitch], block_costs[at + 2u * pitch]);
                // Shift by two disparities per label.
                if above >= 0 {
                    let next = vec3(costs.yz, block_costs[at + 3u * pitch]);
                    costs = select((costs >> vec3(16u)) | (next << vec3(16u)), next, above == 1);
                }
                even += costs & vec3(0xff00ffu);
                odd += (costs >> vec3(8u)) & vec3(0xff00ffu);
            }
        }
    }
    let own = REACH + 1;
    var best = own;
    var least = sum_at(even, odd, u32(own));
    for (var k = 1; k <= REACH; k++) {
        let below = sum_at(even, odd, u32(own - k));
        let above = sum_at(even, odd, u32(own + k));
        if below < least {
            least = below;
            best = own - k;
        }
        if above < least {
            least = above;
            best = own + k;
        }
    }
    let below = sum_at(even, odd, u32(best - 1));
    let above = sum_at(even, odd, u32(best + 1));
    let slope = max(below, above) - least;
    var offset = 0;
    if slope > 0 {
        // Adding one pixel first makes the dividend non-negative, so that the quotient rounds down.
        let most = 2 * slope;
        let difference = clamp(below - above, -most, most);
        offset = (FRACTION * (difference + most) + slope) / most - FRACTION;
    }
    let full = FRACTION * (2 * (params.level.low + label) + best - own) + offset;
    let fixed = (full + 1) >> 1u;
    raw[id.y * pitch + id.x] = fixed;
    disparity[id.y * pitch + id.x] = fixed;
}
