// The value at each pixel of a plane fitted around it, from the weighted median on. One invocation per pixel.

#import band weighted_median

// A plane: its value at the pixel relative to the median, and its slopes.
struct Plane {
    value: i32,
    slopes: vec2<i32>,
}

// A round of least squares over window `w`, from `plane` relative to `median`. Disparities count up to 2^(8 +
// `bits`) / 256 px from the plane.
fn fit(w: Window, median: i32, plane: Plane, bits: u32) -> Plane {
    let base = median + plane.value;
    var all = 0;
    var sum = vec2<i32>();
    var squares = vec2<i32>();
    var product = 0;
    var error = 0;
    var errors = vec2<i32>();
    for (var v = w.first.y; v < w.last.y; v += w.step.y) {
        for (var u = start(w, v); u < w.last.x; u += w.step.x) {
            let at = (v - w.top) * params.level.pixel_pitch + u;
            if has_disparity(flags[at]) {
                let away = (vec2<i32>(vec2(u, v)) - vec2<i32>(w.middle)) >> step_bits();
                let e = (disparity[at] - base - dot(plane.slopes, away)) >> bits;
                let own = i32(weight(w.centre, at, places(vec2(u, v), w.middle)));
                let m = (own * max(256 - abs(e), 0)) >> 8u;
                if m > 0 {
                    let g = (m * e) >> 3u;
                    all += m;
                    sum += m * away;
                    squares += m * away * away;
                    product += m * away.x * away.y;
                    error += g;
                    errors += g * away;
                }
            }
        }
    }
    all = max(all, 1);
    let centre = 16 * sum / all;
    let mean = 32 * error / all;
    let square = 16 * (squares - ((sum * centre) >> vec2(4u))) / all + 16;
    let mixed = 16 * (product - ((sum.x * centre.y) >> 4u)) / all;
    let tilt = (8 * errors - ((sum * mean) >> vec2(2u))) / all;
    let n = max(square.x * square.y - mixed * mixed, 1);
    let grown = ((tilt * square.yx - tilt.yx * mixed) << vec2(bits + 4u)) / n;
    let slopes = clamp(plane.slopes + grown, vec2(-STEEPEST), vec2(STEEPEST));
    let higher = ((mean << (bits + 2u)) - dot(slopes - plane.slopes, centre) + 8) >> 4u;
    return Plane(clamp(plane.value + higher, -FARTHEST, FARTHEST), slopes);
}

@compute @workgroup_size(GROUP)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x < params.level.width && id.y < params.band.rows {
        let w = window(id);
        var value = median(w, START_BITS);
        if touched(flags[w.here]) {
            let rough = fit(w, value, Plane(0, vec2(0)), FIRST_BITS);
            let plane = fit(w, value, rough, SECOND_BITS);
            let low = params.level.low;
            let range = FRACTION * vec2(low, low + i32(params.level.labels) - 1);
            value = clamp(value + plane.value, range.x, range.y);
        }
        next_disparity[id.y * params.level.pixel_pitch + id.x] = value;
    }
}
