//! Different sharpness: one camera is out of focus, or has a worse lens.

use crate::front::filter::{smooth, smoothed};
use crate::image::{Image, Pair};

/// The standard deviations by which a view may be smoothed, in pixels.
const SIGMAS: [f64; 12] = [0.5, 0.6, 0.7, 0.85, 1.0, 1.2, 1.4, 1.7, 2.0, 2.4, 2.8, 3.4];
/// Views are equally sharp if the detail of one is at least this share of the other's (open). That holds for
/// all of 49 real pairs, and for none of eight of them after blurring one view by 1.5 px.
const EQUAL: f64 = 0.7;

/// The standard deviations by which to smooth the left and the right view for equal sharpness; at least one
/// is 0. `halves` is the pair at half its size.
pub(super) fn smoothing(pair: &Pair, halves: &Pair) -> [f64; 2] {
    let (left, right) = (detail(halves.left()), detail(halves.right()));
    if right < EQUAL * left {
        [blur(pair.left(), right), 0.0]
    } else if left < EQUAL * right {
        [0.0, blur(pair.right(), left)]
    } else {
        [0.0; 2]
    }
}

/// The standard deviation that brings the detail of a view closest to `wanted`, by ratio.
fn blur(view: &Image, wanted: f64) -> f64 {
    let details = |sigma: f64| detail(&smoothed(view, sigma).downsampled());
    let after = SIGMAS.partition_point(|&sigma| details(sigma) > wanted).clamp(1, SIGMAS.len() - 1);
    let [less, more] = [SIGMAS[after - 1], SIGMAS[after]];
    if wanted * wanted > details(less) * details(more) { less } else { more }
}

/// The energy of the detail of an image at half its size, where noise hardly counts, relative to that at a
/// quarter. The ratio is independent of gain and contrast.
fn detail(half: &Image) -> f64 {
    let coarse = energy(&half.downsampled());
    if coarse > 0 { energy(half) as f64 / coarse as f64 } else { 0.0 }
}

/// The sum of the squared differences between grey and its local mean.
fn energy(image: &Image) -> u64 {
    let grey = image.pixels.map(|pixel| pixel[3]);
    let around = smooth(&grey, &image.masked, 1.0);
    let pixels = grey.data().iter().zip(around.data()).zip(image.masked.data());
    let seen = pixels.filter(|(_, masked)| !**masked);
    seen.map(|((grey, around), _)| u64::from(grey.abs_diff(*around)).pow(2)).sum()
}
