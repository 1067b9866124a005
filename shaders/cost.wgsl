// Matching cost of level 0: `sad`, or `census` and then `ad_census`.

#import band volume image

struct Params {
    level: Level,
    @align(16) band: Band,
    outside_cost: u32,
    // Cost of the largest colour difference, and the variance above which colour has full weight.
    colour_weight: u32,
    colour_variance: u32,
    sad_radius: i32,
    // Steps per 8-bit level.
    sad_steps: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> left: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> right: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> cost: array<u32>;
@group(0) @binding(4) var<storage, read> left_census: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read> right_census: array<vec2<u32>>;
// Weight of colour at each pixel.
@group(0) @binding(6) var<storage, read> contrast: array<u32>;
@group(0) @binding(7) var<storage, read_write> left_census_out: array<vec2<u32>>;
@group(0) @binding(8) var<storage, read_write> right_census_out: array<vec2<u32>>;
@group(0) @binding(9) var<storage, read_write> contrast_out: array<u32>;

// Matching cost by the mean colour difference over a window. One invocation per SAD_RUN pixels of a row and
// quad of labels, which computes each column of the window once.
@compute @workgroup_size(GROUP)
fn sad(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    let width = i32(params.level.width);
    let runs = u32((width + SAD_RUN - 1) / SAD_RUN);
    let quad = id.x / runs;
    let x0 = i32(id.x - quad * runs) * SAD_RUN;
    if quad >= params.level.quads || id.y >= params.band.rows {
        return;
    }
    let pitch = i32(params.level.pixel_pitch);
    let radius = params.sad_radius;
    let top = i32(halo_start(u32(radius)));
    let y = i32(params.band.first_row + id.y);
    let y_first = max(y - radius, 0);
    let y_last = min(y + radius, i32(params.level.height) - 1);
    let shifts = vec4(params.level.low + i32(4u * quad)) + vec4(0, 1, 2, 3);
    var sums: array<vec4<u32>, SAD_RUN>;
    var counts: array<vec4<u32>, SAD_RUN>;
    for (var x = max(x0 - radius, 0); x <= min(x0 + SAD_RUN - 1 + radius, width - 1); x++) {
        var sum = vec4<u32>();
        var count = vec4<u32>();
        for (var v = y_first; v <= y_last; v++) {
            let row = (v - top) * pitch;
            let pixel = left[row + x];
            for (var i = 0; i < 4; i++) {
                let xr = x - shifts[i];
                if xr >= 0 && xr < width {
                    let other = right[row + xr];
                    if (pixel.z | other.z) == 0u {
                        sum[i] += difference(channels(pixel), channels(other));
                        count[i] += 1u;
                    }
                }
            }
        }
        for (var i = 0; i < SAD_RUN; i++) {
            if abs(x - (x0 + i)) <= radius {
                sums[i] += sum;
                counts[i] += count;
            }
        }
    }
    for (var i = 0; i < SAD_RUN; i++) {
        let x = x0 + i;
        if x < width {
            let pixel = left[(y - top) * pitch + x];
            var costs = vec4<u32>();
            for (var j = 0; j < 4; j++) {
                let xr = x - shifts[j];
                var c = params.outside_cost;
                if xr >= 0 && xr < width {
                    if (pixel.z | right[(y - top) * pitch + xr].z) == 0u {
                        let n = counts[i][j];
                        c = min((params.sad_steps * sums[i][j] + 384u * n) / (768u * n), COST_MAX);
                    }
                }
                costs[j] = c;
            }
            cost[id.y * params.level.pitch + place_of(quad, u32(x))] = pack_narrow(costs);
        }
    }
}

// Appends a bit to a census.
fn with_bit(bits: vec2<u32>, bit: bool) -> vec2<u32> {
    return vec2((bits.x << 1u) | u32(bit), (bits.y << 1u) | (bits.x >> 31u));
}

// Census of both images: a bit for each other pixel of the 9 x 7 window in raster order, set if its grey is
// below that of the centre. Also the weight of colour at each left pixel, by the variance of grey in the
// window. One invocation per pixel.
@compute @workgroup_size(GROUP)
fn census(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    let width = params.level.width;
    if id.x >= width || id.y >= params.band.rows {
        return;
    }
    let x = i32(id.x);
    let y = i32(params.band.first_row + id.y);
    let top = halo_start(u32(CENSUS_RADIUS_Y));
    let pitch = params.level.pixel_pitch;
    let centre = (u32(y) - top) * pitch + id.x;
    let left_grey = left[centre].y >> 16u;
    let right_grey = right[centre].y >> 16u;
    var left_bits = vec2<u32>();
    var right_bits = vec2<u32>();
    var sum = 0u;
    var squares = 0u;
    for (var dy = -CENSUS_RADIUS_Y; dy <= CENSUS_RADIUS_Y; dy++) {
        let row = (u32(clamp(y + dy, 0, i32(params.level.height) - 1)) - top) * pitch;
        for (var dx = -CENSUS_RADIUS_X; dx <= CENSUS_RADIUS_X; dx++) {
            let at = row + u32(clamp(x + dx, 0, i32(width) - 1));
            let l = left[at];
            let r = right[at];
            if dx != 0 || dy != 0 {
                left_bits = with_bit(left_bits, (l.y >> 16u) < left_grey && l.z == 0u);
                right_bits = with_bit(right_bits, (r.y >> 16u) < right_grey && r.z == 0u);
            }
            let grey = select(left_grey >> 8u, l.y >> 24u, l.z == 0u);
            sum += grey;
            squares += grey * grey;
        }
    }
    let most = params.colour_variance;
    var w = params.colour_weight;
    if most > 0u {
        w = w * min(CENSUS_PLACES * squares - sum * sum, most) / most;
    }
    let out = id.y * pitch + id.x;
    left_census_out[out] = left_bits;
    right_census_out[out] = right_bits;
    contrast_out[out] = w;
}

// Matching cost by census and colour difference. One invocation per pixel and quad of labels.
@compute @workgroup_size(GROUP)
fn ad_census(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    let width = params.level.width;
    let quad = id.x / width;
    let x = id.x - quad * width;
    if quad >= params.level.quads || id.y >= params.band.rows {
        return;
    }
    let row = id.y * params.level.pixel_pitch;
    let pixel = left[row + x];
    let levels = channels(pixel) >> vec3(8u);
    let bits = left_census[row + x];
    let w = contrast[row + x];
    var costs = vec4<u32>();
    for (var i = 0u; i < 4u; i++) {
        let xr = i32(x) - params.level.low - i32(4u * quad + i);
        var c = params.outside_cost;
        if xr >= 0 && xr < i32(width) {
            let other = right[row + u32(xr)];
            if (pixel.z | other.z) == 0u {
                let ones = countOneBits(bits ^ right_census[row + u32(xr)]);
                let colour = min(difference(levels, channels(other) >> vec3(8u)), COLOUR_MOST);
                c = CENSUS_BIT_COST * min(ones.x + ones.y, CENSUS_BITS) + (w * colour + COLOUR_MOST / 2u) / COLOUR_MOST;
            }
        }
        costs[i] = c;
    }
    cost[id.y * params.level.pitch + id.x] = pack_narrow(costs);
}
