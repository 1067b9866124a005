// Weighted median of the disparities around every pixel, sampled at regular steps. One invocation per pixel.
//
// The result is the smallest value at which half of the weight is reached. An interval that contains it
// shrinks to an eighth with every pass over the window, which sums the weights below eight thresholds. This
// needs no list, no sorting, and few registers.

#import image maps

struct Params {
    level: Level,
    @align(16) band: Band,
    // In steps, of 2^`column_bits` pixels along rows and 2^`row_bits` along columns.
    radius: u32,
    column_bits: u32,
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
// Weight subtracted for distance, by |dy| and |dx|.
@group(0) @binding(4) var<storage, read> space: array<u32>;
@group(0) @binding(5) var<storage, read_write> next_disparity: array<i32>;

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

// Step lengths as powers of two, in pixels.
fn step_bits() -> vec2<u32> {
    return vec2(params.column_bits, params.row_bits);
}

// Distance between pixels `a` and `b`, in steps.
fn places(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    return (max(a, b) - min(a, b)) >> step_bits();
}

// The window of a pixel.
struct Window {
    // The pixel, its index in the bound rows, and its guide.
    middle: vec2<u32>,
    here: u32,
    centre: vec3<u32>,
    // The first place, the end, and the distance between places in pixels. (`start` returns the start of a row.)
    first: vec2<u32>,
    last: vec2<u32>,
    step: vec2<u32>,
    // First bound row.
    top: u32,
}

// The window of the pixel in column id.x and row id.y of the band.
fn window(id: vec2<u32>) -> Window {
    // The first place is inside the image and on the grid of places.
    let raster = step_bits() + vec2(0u, WINDOW_ROW_BITS);
    let reach = vec2(params.radius << raster.x, (params.radius >> WINDOW_ROW_BITS) << raster.y);
    let top = halo_start(params.radius << params.row_bits);
    let middle = vec2(id.x, params.band.first_row + id.y);
    let here = (middle.y - top) * params.level.pixel_pitch + middle.x;
    let first = middle - min(reach, (middle >> raster) << raster);
    let last = min(middle + reach + vec2(1u), vec2(params.level.width, params.level.height));
    return Window(middle, here, guide(here), first, last, vec2(EVERY, 1u) << raster, top);
}

// The column of the first place in row `v` of a window, for all places or a checkerboard of them.
fn start(w: Window, v: u32) -> u32 {
    let away = (vec2<i32>(vec2(w.first.x, v)) - vec2<i32>(w.middle)) >> step_bits();
    let skipped = u32(away.x + away.y / 2) & (EVERY - 1u);
    return w.first.x + (skipped << params.column_bits);
}

// Whether the median changes a pixel with these flags.
fn touched(flags: u32) -> bool {
    return has_disparity(flags) && (params.all == 1u || is_filled(flags));
}

// The disparity at `at` in steps of 2^`bits`, to the nearest.
fn in_steps(at: u32, bits: u32) -> i32 {
    return (disparity[at] + i32((1u << bits) >> 1u)) >> bits;
}

// The median in window `w` in steps of 2^`bits`, or the old disparity if the median does not change the pixel.
fn median(w: Window, bits: u32) -> i32 {
    let pitch = params.level.pixel_pitch;
    var low = disparity[w.here];
    if touched(flags[w.here]) {
        low = in_steps(w.here, bits);
        var high = low;
        var total = 0u;
        for (var v = w.first.y; v < w.last.y; v += w.step.y) {
            for (var u = start(w, v); u < w.last.x; u += w.step.x) {
                let at = (v - w.top) * pitch + u;
                if has_disparity(flags[at]) {
                    let value = in_steps(at, bits);
                    low = min(low, value);
                    high = max(high, value);
                    total += weight(w.centre, at, places(vec2(u, v), w.middle));
                }
            }
        }
        var width = u32(high - low) + 1u;
        while width > 1u {
            let share = (width + 7u) / 8u;
            // Weight of the values below low + k share, k = 1 to 8.
            var below_first = vec4<u32>();
            var below_second = vec4<u32>();
            for (var v = w.first.y; v < w.last.y; v += w.step.y) {
                for (var u = start(w, v); u < w.last.x; u += w.step.x) {
                    let at = (v - w.top) * pitch + u;
                    let value = in_steps(at, bits);
                    if has_disparity(flags[at]) && value < low + i32(8u * share) {
                        let own = vec4(weight(w.centre, at, places(vec2(u, v), w.middle)));
                        let offset = vec4(value - low);
                        below_first += select(vec4(0u), own, offset < vec4<i32>(FIRST * share));
                        below_second += select(vec4(0u), own, offset < vec4<i32>(SECOND * share));
                    }
                }
            }
            // The interval ends at the first threshold with half of the weight below it.
            let short = vec4<u32>(2u * below_first < vec4(total));
            let short_second = vec4<u32>(2u * below_second < vec4(total));
            let skipped = short.x + short.y + short.z + short.w
                + short_second.x + short_second.y + short_second.z + short_second.w;
            low += i32(skipped * share);
            width = share;
        }
        low <<= bits;
    }
    return low;
}
