// Upsamples the maps of a pair matched at half its size. One invocation per full-size pixel.

#import band image maps

struct Params {
    level: Level,
    @align(16) band: Band,
    // Elements per full-size row.
    full_pitch: u32,
    // The range at full size, in 1/256 px.
    low: i32,
    high: i32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> left: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> raw: array<i32>;
@group(0) @binding(3) var<storage, read> disparity: array<i32>;
@group(0) @binding(4) var<storage, read> flags: array<u32>;
// Colours in 8 bits each, | 1 << 24 if masked; grey.
@group(0) @binding(5) var<storage, read> full_left: array<vec2<u32>>;
@group(0) @binding(6) var<storage, read_write> full_raw: array<i32>;
@group(0) @binding(7) var<storage, read_write> full_disparity: array<i32>;
@group(0) @binding(8) var<storage, read_write> full_flags: array<u32>;

// The full-size disparity of a half-size pixel, minus the smallest one.
fn above_low(at: u32) -> i32 {
    return clamp(2 * disparity[at], params.low, params.high) - params.low;
}

// Colour difference of a half-size pixel from another colour, in 8-bit levels.
fn unlike(at: u32, colour: vec3<u32>) -> i32 {
    return i32(difference(channels(left[at]) >> vec3(8u), colour));
}

@compute @workgroup_size(GROUP)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    let size = vec2(i32(params.level.width), i32(params.level.height));
    let width = 2u * params.level.width;
    if id.x >= 2u * width || id.y >= params.band.rows {
        return;
    }
    let j = id.x / width;
    let column = id.x - j * width;
    let pitch = params.level.pixel_pitch;
    let top = i32(halo_start(1u));
    let own = vec2(i32(column / 2u), i32(params.band.first_row + id.y));
    let own_at = u32(own.y - top) * pitch + u32(own.x);
    let out = (2u * id.y + j) * params.full_pitch + column;
    let word = full_left[out].x;
    let colour = (vec3(word) >> vec3(0u, 8u, 16u)) & vec3(0xffu);
    var value = above_low(own_at);
    var like = own_at;
    let masked = (word >> 24u) != 0u;
    if has_disparity(flags[own_at]) && !masked {
        // The span of the disparities around it, and the most similar pixel.
        var least = value;
        var most = value;
        var best = 0x7fffffff;
        let rows = vec2(max(own.y - 1, 0), min(own.y + 1, size.y - 1));
        let columns = vec2(max(own.x - 1, 0), min(own.x + 1, size.x - 1));
        for (var v = rows.x; v <= rows.y; v++) {
            for (var u = columns.x; u <= columns.y; u++) {
                let at = u32(v - top) * pitch + u32(u);
                if has_disparity(flags[at]) {
                    let here = above_low(at);
                    least = min(least, here);
                    most = max(most, here);
                    let away = away(vec2(u, v), column, own.y, j);
                    let unlikeness = unlike(at, colour) + AWAY * away;
                    if unlikeness < best {
                        best = unlikeness;
                        like = at;
                    }
                }
            }
        }
        if most - least <= FRACTION {
            like = own_at;
            let side = vec2(select(own.x - 1, own.x + 1, column % 2u == 1u), select(own.y - 1, own.y + 1, j == 1u));
            let beside = clamp(side, vec2(0), size - 1);
            let row = u32(own.y - top) * pitch;
            let next = u32(beside.y - top) * pitch;
            let x = above_low_or(row + u32(beside.x), own_at);
            let y = above_low_or(next + u32(own.x), own_at);
            let both = above_low_or(next + u32(beside.x), own_at);
            value = (9 * value + 3 * x + 3 * y + both + 8) >> 4u;
        } else {
            let centre = above_low(like);
            var sum = 0;
            var weights = 0;
            for (var v = rows.x; v <= rows.y; v++) {
                for (var u = columns.x; u <= columns.y; u++) {
                    let at = u32(v - top) * pitch + u32(u);
                    let apart = above_low(at) - centre;
                    if has_disparity(flags[at]) && abs(apart) <= FRACTION {
                        let away = away(vec2(u, v), column, own.y, j);
                        let weight = max(NEAR + best - unlike(at, colour) - AWAY * away, 0);
                        sum += weight * apart;
                        weights += weight;
                    }
                }
            }
            value = centre + sum / weights;
        }
    }
    full_raw[out] = clamp(2 * raw[own_at], params.low, params.high);
    full_disparity[out] = params.low + value;
    full_flags[out] = select(flags[like], MASKED, masked);
}

// City block distance of a half-size pixel, in full-size pixels.
fn away(at: vec2<i32>, column: u32, own_row: i32, j: u32) -> i32 {
    let place = vec2(i32(column), 2 * own_row + i32(j));
    let halves = abs(4 * at + 1 - 2 * place);
    return (halves.x + halves.y) / 2;
}

// `above_low` of `at`, or of `own` if `at` has no disparity.
fn above_low_or(at: u32, own: u32) -> i32 {
    return above_low(select(own, at, has_disparity(flags[at])));
}
