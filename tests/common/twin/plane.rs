use super::Finest;
use super::median::{Window, changes, places, smooth};
use mrfgs::image::{Pair, Plane};
use mrfgs::low_level::plan::Plan;

/// Asserts that a number of the definition fits in 32 bits.
fn fits(value: i64) -> i64 {
    i32::try_from(value).expect("a number that fits in 32 bits").into()
}

/// The median, then the value of a plane fitted to the same disparities.
pub fn plane(plan: &Plan, pair: &Pair, maps: &mut Finest) {
    let window = Window { checkered: true, ..Window::of(plan) };
    through(plan, pair, maps, &window, |validity| changes(plan, validity));
}

/// [`plane`] for the `touched` pixels, in any window.
pub fn through(
    plan: &Plan,
    pair: &Pair,
    maps: &mut Finest,
    window: &Window,
    touched: impl Fn(i32) -> bool + Copy,
) {
    let before = maps.clone();
    smooth(plan, pair, maps, window, 32, touched);
    let medians = &maps.disparity;
    let (low, high) = (i64::from(plan.range.min) * 256, i64::from(plan.range.max) * 256);
    let (width, height) = plan.size();
    maps.disparity = Plane::from_fn(width, height, |x, y| {
        if !touched(before.validity[(x, y)]) {
            return medians[(x, y)];
        }
        let median = i64::from(medians[(x, y)]);
        let places = places(plan, pair, &before, window, (x, y));
        let (mut a, mut b, mut c) = (0, 0, 0);
        for k in [2, 0] {
            let weighed: Vec<[i64; 4]> = places
                .iter()
                .map(|place| {
                    let (x, y) = place.step;
                    let e = fits(i64::from(place.disparity) - median - (c + a * x + b * y)) >> k;
                    let m = (place.weight * (256 - e.abs()).max(0)) >> 8;
                    [x, y, m, (m * e) >> 3]
                })
                .collect();
            let sum = |f: &dyn Fn([i64; 4]) -> i64| fits(weighed.iter().map(|&place| f(place)).sum());
            let s = sum(&|[_, _, m, _]| m).max(1);
            let mx = sum(&|[x, _, m, _]| m * x);
            let my = sum(&|[_, y, m, _]| m * y);
            let gx = sum(&|[x, _, _, g]| g * x);
            let gy = sum(&|[_, y, _, g]| g * y);
            let u = fits(16 * mx) / s;
            let v = fits(16 * my) / s;
            let t = fits(32 * sum(&|[_, _, _, g]| g)) / s;
            let xx = fits(16 * (sum(&|[x, _, m, _]| m * x * x) - (fits(mx * u) >> 4))) / s + 16;
            let yy = fits(16 * (sum(&|[_, y, m, _]| m * y * y) - (fits(my * v) >> 4))) / s + 16;
            let xy = fits(16 * (sum(&|[x, y, m, _]| m * x * y) - (fits(mx * v) >> 4))) / s;
            let xe = fits(8 * gx - (fits(mx * t) >> 2)) / s;
            let ye = fits(8 * gy - (fits(my * t) >> 2)) / s;
            let n = fits(xx * yy - xy * xy).max(1);
            let grown = |part: i64| fits(fits(part) << (k + 4)) / n;
            let (old_a, old_b) = (a, b);
            a = (a + grown(xe * yy - ye * xy)).clamp(-256, 256);
            b = (b + grown(ye * xx - xe * xy)).clamp(-256, 256);
            let higher = fits((t << (k + 2)) - (a - old_a) * u - (b - old_b) * v + 8) >> 4;
            c = (c + higher).clamp(-1024, 1024);
        }
        (median + c).clamp(low, high) as i32
    });
}
