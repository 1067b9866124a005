// Weighted median of the disparities around every pixel, sampled at regular steps. One invocation per pixel.
//
// The result is the smallest value at which half of the weight is reached. An interval that contains it
// shrinks to an eighth with every pass over the window, which sums the weights below eight thresholds at
// once. This needs no list, no sort, and only a few registers.

#import image maps

struct Params {
    level: Level,
    @align(16) band: Band,
    // In steps of 2 to `step_bits` pixels.
    radius: u32,
    step_bits: u32,
    // Rows of samples are 2 to this many steps apart.
    row_bits: u32,
    scale: u32,
    doublings: u32,
    // 1 for all pixels, 0 for the filled ones only.
    all: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> left: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> disparity: array<i32>;
@group(0) @binding(3) var<storage, read> flags: array<u32>;
// The weight that distance subtracts, by |dy| and |dx|.
@group(0) @binding(4) var<storage, read> space: array<u32>;
@group(0) @binding(5) var<storage, read_write> smoothed: array<i32>;

const FIRST: vec4<u32> = vec4(1u, 2u, 3u, 4u);
const SECOND: vec4<u32> = vec4(5u, 6u, 7u, 8u);

// The guide: the scaled colour that weights compare.
fn guide(at: u32) -> vec3<u32> {
    return (channels(left[at]) * params.scale) >> vec3(16u);
}

// Weight of the pixel at `at`, `away` steps from the pixel whose guide is `centre`.
fn weight(centre: vec3<u32>, at: u32, away: vec2<u32>) -> u32 {
    let colour = difference(centre, guide(at)) << params.doublings;
    return MEDIAN_WEIGHT - min(colour + space[away.y * (params.radius + 1u) + away.x], MEDIAN_WEIGHT);
}

// Distance between pixels `a` and `b`, in steps.
fn places(a: vec2<u32>, b: vec2<u32>, step_bits: u32) -> vec2<u32> {
    return (max(a, b) - min(a, b)) >> vec2(step_bits);
}

// The median around the pixel in column id.x and row id.y of the band.
fn median(id: vec2<u32>) {
    let pitch = params.level.pixel_pitch;
    let bits = params.step_bits;
    let row_bits = bits + params.row_bits;
    let step = vec2(1u << bits, 1u << row_bits);
    let reach = vec2(params.radius << bits, (params.radius >> params.row_bits) << row_bits);
    let top = halo_start(params.radius << bits);
    let y = params.band.first_row + id.y;
    let here = (y - top) * pitch + id.x;
    let centre = guide(here);
    let flags_here = flags[here];
    var low = disparity[here];
    if has_disparity(flags_here) && (params.all == 1u || (flags_here & FILLED) != 0u) {
        let middle = vec2(id.x, y);
        // The first sample lies in the image and on the grid of samples.
        let raster = vec2(bits, row_bits);
        let first = middle - min(reach, (middle >> raster) << raster);
        let last = min(middle + reach + vec2(1u), vec2(params.level.width, params.level.height));
        var high = low;
        var total = 0u;
        for (var v = first.y; v < last.y; v += step.y) {
            for (var u = first.x; u < last.x; u += step.x) {
                let at = (v - top) * pitch + u;
                if has_disparity(flags[at]) {
                    let value = disparity[at];
                    low = min(low, value);
                    high = max(high, value);
                    total += weight(centre, at, places(vec2(u, v), middle, bits));
                }
            }
        }
        var width = u32(high - low) + 1u;
        while width > 1u {
            let share = (width + 7u) / 8u;
            // Weight of the values below low + k share, k = 1 to 8.
            var below_first = vec4<u32>();
            var below_second = vec4<u32>();
            for (var v = first.y; v < last.y; v += step.y) {
                for (var u = first.x; u < last.x; u += step.x) {
                    let at = (v - top) * pitch + u;
                    let value = disparity[at];
                    if has_disparity(flags[at]) && value < low + i32(8u * share) {
                        let w = vec4(weight(centre, at, places(vec2(u, v), middle, bits)));
                        let offset = vec4(value - low);
                        below_first += select(vec4(0u), w, offset < vec4<i32>(FIRST * share));
                        below_second += select(vec4(0u), w, offset < vec4<i32>(SECOND * share));
                    }
                }
            }
            // The interval ends at the first threshold below which half of the weight lies.
            let short = vec4<u32>(2u * below_first < vec4(total));
            let short_second = vec4<u32>(2u * below_second < vec4(total));
            let skipped = short.x + short.y + short.z + short.w
                + short_second.x + short_second.y + short_second.z + short_second.w;
            low += i32(skipped * share);
            width = share;
        }
    }
    smoothed[id.y * pitch + id.x] = low;
}
