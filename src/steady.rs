//! Temporal smoothing of the maps of a video.

use crate::image::{Image, Plane};
use crate::maps::{FRACTION, Maps, flag, has_disparity};

/// A temporal filter for disparity maps: where the image is unchanged, it averages over time by confidence.
///
/// Each map is computed without the frames before, so noise makes static surfaces flicker. The filter keeps a
/// mean of the last frames (open) wherever the left view does not change. Where something moves, the
/// disparity is that of the frame alone, so moving objects leave no trail; with a moving camera, that is
/// almost everywhere. Raw disparities, confidence, validity and the map of the right view do not change.
///
/// It works in integers, so the maps depend on the sequence alone, on every device.
///
/// ```
/// use mrfgs::steady::Steady;
/// use mrfgs::{Matcher, Pair};
///
/// # fn main() -> mrfgs::Result<()> {
/// # let frames = [Pair::open("testdata/slanted/im0.png", "testdata/slanted/im1.png")?];
/// let mut matcher = Matcher::new()?;
/// let mut steady = Steady::new();
/// for pair in &frames {
///     let mut found = matcher.run(pair, 0..=31)?;
///     steady.follow(pair.left(), &mut found.maps);
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, Default)]
pub struct Steady {
    past: Option<Past>,
}

/// The state from the frames before.
#[derive(Clone, Debug)]
struct Past {
    /// The grey left view: a mean of the last frames where it did not change, else the last frame.
    view: Plane<u16>,
    /// The mean disparity, in 1/256 px.
    disparity: Plane<i32>,
    /// The weight of the disparity, in 1/16 of a step of confidence; 0 where there is none.
    weight: Plane<u16>,
}

/// A measured pixel of a frame weighs 16 (confidence + 1), a filled one 16.
const UNIT: u16 = 16;
/// The past loses 1/8 of its weight with each frame, so it spans about eight frames.
const FADING: u16 = 8;
/// Disparities that differ by at most half a pixel count as the same measurement with noise.
const SAME: u32 = FRACTION as u32 / 2;
/// One level of 8 bits.
const LEVEL: u32 = 256;
/// Changes are summed over windows of 5 x 5 pixels.
const RADIUS: usize = 2;
/// Pixels of a window.
const WINDOW: u32 = 25;

impl Steady {
    /// A filter without a past.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Smooths the disparities of the next frame. `left` is the left view that was matched. A frame of
    /// another size begins a new sequence.
    ///
    /// # Panics
    /// When maps and image differ in size.
    pub fn follow(&mut self, left: &Image, maps: &mut Maps) {
        let Maps { disparity, confidence, validity, .. } = maps;
        assert_eq!(left.pixels.size(), disparity.size(), "the maps of this image");
        let (width, height) = left.pixels.size();
        // Masked pixels are never read.
        let pixels = left.pixels.data().iter().zip(left.masked.data());
        let grey = pixels.map(|(&[.., grey], masked)| if *masked { 0 } else { grey });
        let mut view = Plane::new(width, height, grey.collect());
        let weights = confidence.data().iter().zip(validity.data()).map(|(c, v)| weight(*c, *v));
        let mut weight = Plane::new(width, height, weights.collect());
        if let Some(past) = self.past.as_ref().filter(|past| past.view.size() == (width, height)) {
            past.lead(&mut view, disparity, &mut weight);
        }
        self.past = Some(Past { view, disparity: disparity.clone(), weight });
    }
}

/// The weight of a pixel of one frame.
fn weight(confidence: u8, validity: u8) -> u16 {
    match (has_disparity(validity), validity & flag::INVALID) {
        (false, _) => 0,
        (true, 0) => UNIT * (u16::from(confidence) + 1),
        (true, _) => UNIT,
    }
}

impl Past {
    /// Merges the past into the view, the disparity and the weight of the next frame.
    fn lead(&self, view: &mut Plane<u16>, disparity: &mut Plane<i32>, weight: &mut Plane<u16>) {
        let width = view.width();
        let rows = self.view.data().chunks(width).zip(view.data().chunks(width));
        let changed = |(a, b): (&[u16], &[u16])| a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).collect();
        let changes = window_sums(width, rows.map(changed));
        let limit = noise(view) + LEVEL / 4 * WINDOW;
        let now = view.data_mut().iter_mut().zip(disparity.data_mut()).zip(weight.data_mut());
        let before = self.view.data().iter().zip(self.disparity.data()).zip(self.weight.data());
        for ((((shown, d), w), ((&showed, &before), &weighed)), change) in now.zip(before).zip(&changes) {
            if *change > limit {
                continue;
            }
            // The view is averaged too, so a slow motion adds up to a change.
            *shown = (i32::from(showed) + (i32::from(*shown) - i32::from(showed)) / i32::from(FADING)) as u16;
            if *w == 0 || weighed == 0 {
                continue;
            }
            if d.abs_diff(before) <= SAME {
                let both = weighed - weighed / FADING + *w;
                let (whole, moved) = (i32::from(both), i32::from(*w) * (*d - before));
                // Round to the nearest.
                *d = before + (2 * moved + whole).div_euclid(2 * whole);
                *w = both;
            } else if weighed / 2 > *w {
                // A less confident frame disagrees: keep the past at half its weight; lasting changes win.
                (*d, *w) = (before, weighed / 2);
            }
        }
    }
}

/// The most noise to expect in the windows of a view: the differences between neighbours where these are
/// smallest, as no surface is smoother than its noise. Motion does not affect it.
fn noise(view: &Plane<u16>) -> u32 {
    let sums = window_sums(view.width(), view.data().chunks(view.width()).map(beside));
    // Borders of one colour and overexposed areas have no noise. A sample of the windows suffices.
    let mut some: Vec<u32> = sums.into_iter().step_by(7).filter(|sum| *sum > 0).collect();
    if some.is_empty() {
        return 0;
    }
    let twentieth = some.len() / 20;
    let (_, plainest, _) = some.select_nth_unstable(twentieth);
    (*plainest).min(8 * LEVEL * WINDOW)
}

/// The absolute differences between the pixels of a row and their next ones.
fn beside(row: &[u16]) -> Vec<u16> {
    let next = row.iter().skip(1).chain(row.last());
    row.iter().zip(next).map(|(a, b)| a.abs_diff(*b)).collect()
}

/// Window sums of each pixel from the rows of a plane, whose border is repeated.
fn window_sums(width: usize, rows: impl Iterator<Item = Vec<u16>>) -> Vec<u32> {
    let mut padded = vec![0; width + 2 * RADIUS];
    let across: Vec<Vec<u32>> = rows
        .map(|row| {
            let (inside, beyond) = padded[RADIUS..].split_at_mut(width);
            inside.iter_mut().zip(&row).for_each(|(to, value)| *to = u32::from(*value));
            beyond.fill(inside[width - 1]);
            let first = padded[RADIUS];
            padded[..RADIUS].fill(first);
            let mut sums = vec![0; width];
            for shift in 0..=2 * RADIUS {
                add(&mut sums, &padded[shift..]);
            }
            sums
        })
        .collect();
    let mut sums = vec![0; width * across.len()];
    for (y, sums) in sums.chunks_mut(width).enumerate() {
        for at in y..=y + 2 * RADIUS {
            add(sums, &across[at.saturating_sub(RADIUS).min(across.len() - 1)]);
        }
    }
    sums
}

fn add(sums: &mut [u32], values: &[u32]) {
    sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (24, 20);

    /// A view whose right half changes from `step` 1 on, if `changed`.
    fn view(step: u32, changed: bool) -> Image {
        let level = |x: usize, y: usize| {
            let noise = (x as u32 * 7 + y as u32 * 13 + step * 5) % 3;
            let shown = (x * 37 + y * 91) as u32 % 150 + if changed && x >= 12 { 60 } else { 0 };
            (shown + noise) as u8
        };
        Image::from_rgb8(&Plane::from_fn(SIZE.0, SIZE.1, |x, y| [level(x, y); 3]))
    }

    fn maps(disparity: i32, confidence: u8, validity: u8) -> Maps {
        let plane = Plane::filled(SIZE.0, SIZE.1, disparity);
        Maps {
            raw: plane.clone(),
            disparity: plane,
            confidence: Plane::filled(SIZE.0, SIZE.1, confidence),
            validity: Plane::filled(SIZE.0, SIZE.1, validity),
            right: None,
        }
    }

    /// The disparities of the last frame at (4, 10) and at (20, 10), of which the second may change.
    fn after(frames: &[(i32, u8, u8)], changed: bool) -> [i32; 2] {
        let mut steady = Steady::new();
        let mut found = maps(0, 0, 0);
        for (step, &(disparity, confidence, validity)) in frames.iter().enumerate() {
            found = maps(disparity, confidence, validity);
            steady.follow(&view(step as u32, changed && step > 0), &mut found);
            assert!(
                found == Maps { disparity: found.disparity.clone(), ..maps(disparity, confidence, validity) }
            );
        }
        [found.disparity[(4, 10)], found.disparity[(20, 10)]]
    }

    #[test]
    fn a_static_view_gives_a_mean_weighted_by_confidence() {
        // The past has lost an eighth of its weight: 1000 at 14 of 16, 1064 at 16.
        assert_eq!(after(&[(1000, 59, 0), (1064, 59, 0)], false), [1034; 2]);
        // Filled pixels hardly count.
        assert_eq!(after(&[(1000, 59, 0), (1064, 59, flag::OCCLUDED | flag::FILLED)], false), [1001; 2]);
        assert_eq!(after(&[(1000, 59, flag::OCCLUDED | flag::FILLED), (1064, 59, 0)], false), [1063; 2]);
    }

    #[test]
    fn a_change_of_the_view_discards_the_past() {
        assert_eq!(after(&[(1000, 59, 0), (1064, 59, 0)], true), [1034, 1064]);
    }

    #[test]
    fn a_jump_wins_if_it_persists_or_is_more_confident() {
        let far = 5000;
        assert_eq!(after(&[(1000, 59, 0), (far, 20, 0)], false), [1000; 2]);
        assert_eq!(after(&[(1000, 59, 0), (far, 20, 0), (far, 20, 0)], false), [far; 2]);
        assert_eq!(after(&[(1000, 59, 0), (far, 59, 0)], false), [far; 2]);
        // Half a pixel is no jump.
        assert_eq!(after(&[(1000, 59, 0), (1128, 59, 0)], false), [1068; 2]);
        assert_eq!(after(&[(1000, 59, 0), (1129, 59, 0)], false), [1129; 2]);
    }

    #[test]
    fn pixels_without_a_disparity_do_not_count() {
        let none = flag::OCCLUDED;
        assert_eq!(after(&[(1000, 59, none), (1064, 59, 0)], false), [1064; 2]);
        assert_eq!(after(&[(1000, 59, 0), (7, 0, none), (1064, 59, 0)], false), [1064; 2]);
    }

    #[test]
    fn another_size_begins_a_new_sequence() {
        let mut steady = Steady::new();
        let mut found = maps(1000, 59, 0);
        steady.follow(&view(0, false), &mut found);
        let part = crate::image::Rect { x: 0..20, y: 0..20 };
        let mut small = maps(1064, 59, 0).crop(&part);
        steady.follow(&view(1, false).crop(&part), &mut small);
        assert!(small.disparity.data().iter().all(|d| *d == 1064));
    }
}
