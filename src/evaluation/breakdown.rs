//! Breaks the errors of a map down by class: each pixel with known truth is in one class, by what makes it
//! hard to match.

use serde::Serialize;
use serde::ser::Serializer;

use super::dataset::{GroundTruth, same_size};
use super::metrics::{Sum, VISIBLE, average, is_bad, nothing_known, percent};
use crate::error::Result;
use crate::image::{Image, Plane};

/// Radius of a window in pixels: 7 x 7, clipped to the image.
const RADIUS: usize = 3;

/// A window is an edge where its known truths span more than this, in pixels of disparity.
const EDGE: f64 = 4.0;

/// A window is plain where its grey has a standard deviation below this, in 1/256 of an 8-bit level: 4
/// levels.
const PLAIN: u64 = 4 * 256;

/// A truth that changes by at least this, in pixels of disparity per pixel, is slanted.
const SLANTED: f64 = 0.2;

/// What makes a pixel hard to match: the first class that applies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// Its match, x - truth, lies outside the right image: below 0 or above width - 1.
    Border,
    /// Only one view sees it, by the mask (not 255). Without a mask the class is empty.
    Occluded,
    /// The known truths in the 7 x 7 window around it span more than 4 px.
    Edge,
    /// The grey in this window has a standard deviation below 4 eight-bit levels.
    Plain,
    /// The truth changes by at least 0.2 px per pixel along x or y, by the central difference, where both neighbours
    /// are known.
    Slanted,
    /// None of these.
    Other,
}

impl Class {
    /// All classes, in their order.
    pub const ALL: [Self; 6] =
        [Self::Border, Self::Occluded, Self::Edge, Self::Plain, Self::Slanted, Self::Other];

    /// Name of the class in JSON and tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Border => "border",
            Self::Occluded => "occluded",
            Self::Edge => "edge",
            Self::Plain => "plain",
            Self::Slanted => "slanted",
            Self::Other => "other",
        }
    }
}

/// The errors of one class. A pixel is bad as in `bad2.0`: wrong by more than 2 px, or invalid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ClassErrors {
    /// Share of all pixels with known truth, in percent; over all classes these add up to 100.
    pub share: f64,
    /// Share of the class's pixels that are bad, in percent; `None` when it has none.
    #[serde(rename = "bad2.0")]
    pub bad: Option<f64>,
    /// Mean absolute error of its valid pixels; `None` when there are none.
    pub avg: Option<f64>,
    /// Bad pixels of the class in percent of all pixels with known truth; over all classes these add up to
    /// the map's `bad2.0`.
    pub points: f64,
    /// Share of the map's bad pixels, in percent; `None` when it has none.
    pub of_bad: Option<f64>,
    /// Share of the summed squared error of the map's valid pixels, in percent; `None` when that is 0.
    pub of_squares: Option<f64>,
}

/// The errors of a map by class. In JSON it is an object with the names of the classes as keys.
#[derive(Clone, Debug, PartialEq)]
pub struct Breakdown {
    /// In the order of [`Class::ALL`].
    pub parts: [ClassErrors; 6],
}

impl Serialize for Breakdown {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        serializer.collect_map(self.iter().map(|(class, part)| (class.name(), part)))
    }
}

impl Breakdown {
    /// Every class with its errors.
    pub fn iter(&self) -> impl Iterator<Item = (Class, &ClassErrors)> {
        Class::ALL.into_iter().zip(&self.parts)
    }

    /// The average of each field over several pairs, every pair with the same weight; `None` for no pairs.
    ///
    /// A class that a pair lacks counts with a share of 0 and 0 points, so that the means still add up. A
    /// figure that is undefined for one pair (the errors of a class that it lacks, shares of errors that it
    /// does not have) is `None` in the mean, as in [`mean`](super::mean).
    #[must_use]
    pub fn mean(all: &[&Self]) -> Option<Self> {
        if all.is_empty() {
            return None;
        }
        let parts = std::array::from_fn(|i| {
            let every =
                |field: fn(&ClassErrors) -> Option<f64>| average(all.iter().map(|b| field(&b.parts[i])));
            ClassErrors {
                share: every(|p| Some(p.share)).unwrap_or(0.0),
                bad: every(|p| p.bad),
                avg: every(|p| p.avg),
                points: every(|p| Some(p.points)).unwrap_or(0.0),
                of_bad: every(|p| p.of_bad),
                of_squares: every(|p| p.of_squares),
            }
        });
        Some(Self { parts })
    }
}

/// The counts of a class.
#[derive(Clone, Copy, Default)]
struct Tally {
    pixels: u64,
    bad: u64,
    valid: u64,
    errors: Sum,
    squares: Sum,
}

impl GroundTruth {
    /// The class of every pixel of the reference view, whose image is `reference`; `None` where the truth is unknown.
    ///
    /// # Errors
    /// [`Error::Mismatch`](crate::Error::Mismatch) when the sizes differ.
    pub fn classes(&self, reference: &Image) -> Result<Plane<Option<Class>>> {
        let Self { truth, mask } = self;
        let (width, height) = truth.size();
        same_size("reference image", reference.pixels.size(), truth.size())?;
        let spread = spread(truth);
        let plain = plain(reference);
        Ok(Plane::from_fn(width, height, |x, y| {
            let t = truth[(x, y)];
            let matched = x as f64 - f64::from(t);
            if !t.is_finite() {
                None
            } else if matched < 0.0 || matched > (width - 1) as f64 {
                Some(Class::Border)
            } else if mask.as_ref().is_some_and(|mask| mask[(x, y)] != VISIBLE) {
                Some(Class::Occluded)
            } else if spread[(x, y)] > EDGE {
                Some(Class::Edge)
            } else if plain[(x, y)] {
                Some(Class::Plain)
            } else if slant(truth, x, y) >= SLANTED {
                Some(Class::Slanted)
            } else {
                Some(Class::Other)
            }
        }))
    }

    /// The errors of `estimate` (not finite = invalid) by class; `reference` is the image of the reference view.
    ///
    /// # Errors
    /// [`Error::Mismatch`](crate::Error::Mismatch) when the sizes differ or no truth is known.
    pub fn breakdown(&self, estimate: &Plane<f32>, reference: &Image) -> Result<Breakdown> {
        same_size("disparity map", estimate.size(), self.truth.size())?;
        let mut tallies = [Tally::default(); 6];
        let classes = self.classes(reference)?;
        for ((&d, &t), class) in estimate.data().iter().zip(self.truth.data()).zip(classes.data()) {
            let Some(class) = class else { continue };
            let tally = &mut tallies[*class as usize];
            tally.pixels += 1;
            tally.bad += u64::from(is_bad(d, t));
            if d.is_finite() {
                let error = (f64::from(d) - f64::from(t)).abs();
                tally.valid += 1;
                tally.errors.add(error);
                tally.squares.add(error * error);
            }
        }
        let pixels = tallies.iter().map(|t| t.pixels).sum::<u64>() as f64;
        let bad = tallies.iter().map(|t| t.bad).sum::<u64>() as f64;
        let squares = tallies.iter().map(|t| t.squares.value()).sum::<f64>();
        if pixels == 0.0 {
            return Err(nothing_known());
        }
        let parts = tallies.map(|t| ClassErrors {
            share: 100.0 * t.pixels as f64 / pixels,
            bad: percent(t.bad as f64, t.pixels as f64),
            avg: (t.valid > 0).then(|| t.errors.value() / t.valid as f64),
            points: 100.0 * t.bad as f64 / pixels,
            of_bad: percent(t.bad as f64, bad),
            of_squares: percent(t.squares.value(), squares),
        });
        Ok(Breakdown { parts })
    }
}

/// The largest minus the smallest known truth of the window around each pixel; negative where none is known.
fn spread(truth: &Plane<f32>) -> Plane<f64> {
    const NONE: (f32, f32) = (f32::INFINITY, f32::NEG_INFINITY);
    let ends = truth.map(|&t| if t.is_finite() { (t, t) } else { NONE });
    let ends = windows(&ends, NONE, |(a, b), (c, d)| (a.min(c), b.max(d)));
    ends.map(|&(min, max)| f64::from(max) - f64::from(min))
}

/// Whether the window around a pixel has hardly any texture, by the variance of its grey times the square of
/// its number of pixels, in exact integers. Masked pixels do not count.
fn plain(image: &Image) -> Plane<bool> {
    let moments = Plane::from_fn(image.width(), image.height(), |x, y| {
        let grey = u64::from(image.pixels[(x, y)][3]);
        if image.masked[(x, y)] { [0; 3] } else { [1, grey, grey * grey] }
    });
    let moments = windows(&moments, [0; 3], |[a, b, c], [d, e, f]| [a + d, b + e, c + f]);
    moments.map(|&[pixels, sum, squares]| pixels * squares - sum * sum < (PLAIN * pixels) * (PLAIN * pixels))
}

/// The larger of the truth's central differences along x and y, in pixels of disparity per pixel; 0 where a neighbour
/// is missing or unknown.
fn slant(truth: &Plane<f32>, x: usize, y: usize) -> f64 {
    let (width, height) = truth.size();
    let slope = |before: (usize, usize), after: (usize, usize)| {
        let difference = f64::from(truth[after]) - f64::from(truth[before]);
        if difference.is_finite() { difference.abs() / 2.0 } else { 0.0 }
    };
    let across = if x > 0 && x + 1 < width { slope((x - 1, y), (x + 1, y)) } else { 0.0 };
    let down = if y > 0 && y + 1 < height { slope((x, y - 1), (x, y + 1)) } else { 0.0 };
    across.max(down)
}

/// All values of the window around each pixel, combined by `join`, along rows first; `empty` is its neutral
/// element.
fn windows<T: Copy>(values: &Plane<T>, empty: T, join: impl Fn(T, T) -> T) -> Plane<T> {
    let (width, height) = values.size();
    let around = |at: usize, size: usize| at.saturating_sub(RADIUS)..(at + RADIUS + 1).min(size);
    let rows = Plane::from_fn(width, height, |x, y| {
        values.row(y)[around(x, width)].iter().copied().fold(empty, &join)
    });
    Plane::from_fn(width, height, |x, y| around(y, height).map(|y| rows[(x, y)]).fold(empty, &join))
}

#[cfg(test)]
mod tests {
    use super::super::cases::{close, ground, row};
    use super::*;
    use crate::Error;

    const INF: f32 = f32::INFINITY;

    /// A checkerboard of grey, 0 and `contrast` levels: its standard deviation is about half of `contrast`.
    fn chequered(width: usize, height: usize, contrast: impl Fn(usize) -> u8) -> Image {
        Image::from_rgb8(&Plane::from_fn(width, height, |x, y| {
            if (x + y) % 2 == 0 { [0; 3] } else { [contrast(x); 3] }
        }))
    }

    #[test]
    fn each_class_is_found_and_the_first_one_counts() {
        // 40 x 9: a ramp of 0.5 px per pixel up to x = 9, a step of 5 px before x = 20, little contrast from x = 29 on.
        let mut truth = Plane::from_fn(40, 9, |x, _| if x < 20 { x.min(9) as f32 / 2.0 } else { 9.5 });
        truth[(0, 4)] = 0.25; // match at -0.25
        truth[(39, 4)] = -0.25; // match at 39.25
        truth[(5, 8)] = INF;
        let mut mask = Plane::filled(40, 9, 255);
        mask[(15, 2)] = 128; // nothing else about it
        mask[(18, 2)] = 0; // on the edge, and hidden
        mask[(0, 4)] = 128; // outside, and hidden
        let image = chequered(40, 9, |x| if x < 29 { 90 } else { 6 });
        let found = ground(&truth, Some(&mask)).classes(&image).unwrap();
        for (at, class) in [
            ((5, 8), None),
            ((0, 4), Some(Class::Border)),
            ((39, 4), Some(Class::Border)),
            ((0, 1), Some(Class::Other)), // no left neighbour
            ((15, 2), Some(Class::Occluded)),
            ((18, 2), Some(Class::Occluded)),
            ((16, 2), Some(Class::Other)), // the step is 4 px away
            ((17, 2), Some(Class::Edge)),
            ((22, 2), Some(Class::Edge)),
            ((23, 2), Some(Class::Other)),
            ((35, 2), Some(Class::Plain)),
            ((31, 2), Some(Class::Other)), // some of the strong contrast
            ((5, 2), Some(Class::Slanted)),
            ((5, 7), Some(Class::Slanted)), // one neighbour unknown, but along x all are known
            ((12, 2), Some(Class::Other)),
            ((1, 4), Some(Class::Slanted)), // near the odd values the truths still span less than 4 px
        ] {
            assert_eq!(found[at], class, "{at:?}");
        }
        // Without a mask, an occluded pixel gets the next class that applies.
        let found = ground(&truth, None).classes(&image).unwrap();
        assert_eq!((found[(15, 2)], found[(18, 2)]), (Some(Class::Other), Some(Class::Edge)));
        // Edge before plain, plain before slanted.
        let found = ground(&truth, None).classes(&chequered(40, 9, |_| 6)).unwrap();
        assert_eq!((found[(18, 2)], found[(5, 2)]), (Some(Class::Edge), Some(Class::Plain)));
    }

    #[test]
    fn thresholds_are_where_they_are_said_to_be() {
        let image = chequered(9, 9, |_| 200);
        let flat = |d: f32| Plane::filled(9, 9, d);
        let half = |step: f32| Plane::from_fn(9, 9, |x, _| if x < 4 { -2.0 } else { step - 2.0 });
        let ramp = |slope: f32| Plane::from_fn(9, 9, move |_, y| 1.0 + slope * y as f32);
        let mut broken = ramp(0.25);
        broken[(4, 3)] = f32::NAN;
        let mut spot = chequered(9, 9, |_| 0);
        spot.pixels[(5, 5)] = [65_280; 4];
        let mut masked = spot.clone();
        masked.masked[(5, 5)] = true;
        for (truth, image, class) in [
            // A span of 4 px is no edge; the central difference is 2.
            (half(4.0), &image, Class::Slanted),
            (half(f32::from_bits(4.0_f32.to_bits() + 2)), &image, Class::Edge),
            // A match exactly at 0 or width - 1 is inside.
            (flat(4.0), &image, Class::Other),
            (flat(-4.0), &image, Class::Other),
            (flat(-4.001), &image, Class::Border),
            // Along y as along x; 0.1875 is less than 0.2, 0.25 is not.
            (ramp(0.1875), &image, Class::Other),
            (ramp(0.25), &image, Class::Slanted),
            // With an unknown neighbour the slope is unknown.
            (broken, &image, Class::Other),
            // 24 of 49 pixels at c: the deviation is c sqrt(24 x 25) / 49, which is 4 at c = 8.0017.
            (flat(2.0), &chequered(9, 9, |_| 8), Class::Plain),
            (flat(2.0), &chequered(9, 9, |_| 9), Class::Other),
            // A masked pixel does not count as texture.
            (flat(2.0), &spot, Class::Other),
            (flat(2.0), &masked, Class::Plain),
        ] {
            let found = ground(&truth, None).classes(image).unwrap();
            assert_eq!(found[(4, 4)], Some(class), "{:?}", truth.data());
        }
    }

    #[test]
    fn windows_are_clipped() {
        let values = Plane::from_fn(9, 5, |x, y| 10 * y + x);
        let sums = windows(&values, 0, |a, b| a + b);
        for (x, y) in [(0, 0), (4, 2), (8, 4), (7, 0)] {
            let near =
                values.data().iter().filter(|v| (*v % 10).abs_diff(x) <= 3 && (*v / 10).abs_diff(y) <= 3);
            assert_eq!(sums[(x, y)], near.sum::<usize>(), "{x}, {y}");
        }
    }

    /// Eight pixels of 2: the first two border, the next two occluded, the others plain; one is unknown.
    fn case() -> (Plane<f32>, Plane<u8>, Image) {
        let truth = row(&[2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, INF]);
        (truth, row(&[128, 128, 128, 0, 255, 255, 255, 255]), chequered(8, 1, |_| 0))
    }

    /// The errors of a map of [`case`].
    fn found() -> Breakdown {
        let (truth, mask, image) = case();
        let estimate = row(&[5.0, 2.0, 6.0, INF, 2.0, 3.0, 4.0, 9.0]);
        ground(&truth, Some(&mask)).breakdown(&estimate, &image).unwrap()
    }

    #[test]
    fn a_case_computed_by_hand() {
        let found = found();
        let [border, occluded, edge, plain, slanted, other] = found.parts;
        for (got, expected) in [
            (Some(border.share), 200.0 / 7.0),
            (border.bad, 50.0),
            (border.avg, 1.5),
            (Some(border.points), 100.0 / 7.0),
            (border.of_bad, 100.0 / 3.0),
            (border.of_squares, 900.0 / 30.0),
            (occluded.bad, 100.0),
            (occluded.avg, 4.0),
            (occluded.of_bad, 200.0 / 3.0),
            (occluded.of_squares, 1600.0 / 30.0),
            (Some(plain.share), 300.0 / 7.0),
            // An error at the threshold is not above it.
            (plain.bad, 0.0),
            (plain.avg, 1.0),
            (plain.of_squares, 500.0 / 30.0),
        ] {
            close(got, expected);
        }
        for part in [edge, slanted, other] {
            let nothing = (part.share, part.points, part.of_bad, part.of_squares);
            assert_eq!(nothing, (0.0, 0.0, Some(0.0), Some(0.0)));
            assert_eq!((part.bad, part.avg), (None, None));
        }
        let json = serde_json::to_value(&found).unwrap();
        assert_eq!(json["edge"], serde_json::to_value(edge).unwrap());
        assert_eq!(json["border"]["bad2.0"], 50.0);
    }

    #[test]
    fn means_add_up_and_omit_what_a_pair_lacks() {
        let (truth, _, image) = case();
        let one = found();
        let perfect = ground(&truth, None).breakdown(&truth, &image).unwrap();
        assert_eq!(perfect.parts.map(|p| (p.of_bad, p.of_squares)), [(None, None); 6]);
        let mean = Breakdown::mean(&[&one, &perfect]).unwrap();
        close(mean.parts.iter().map(|p| p.share).sum::<f64>(), 100.0);
        close(mean.parts.iter().map(|p| p.points).sum::<f64>(), 150.0 / 7.0);
        let [border, occluded, ..] = mean.parts;
        close(border.bad, 25.0);
        close(occluded.share, 100.0 / 7.0);
        assert_eq!((occluded.bad, occluded.avg, border.of_bad, border.of_squares), (None, None, None, None));
        assert_eq!(Breakdown::mean(&[&one]).unwrap(), one);
        assert_eq!(Breakdown::mean(&[]), None);
    }

    #[test]
    fn sizes_must_agree_and_some_truth_be_known() {
        let (truth, mask, image) = case();
        let masked = ground(&truth, Some(&mask));
        let error = masked.breakdown(&Plane::filled(7, 1, 2.0), &image).unwrap_err().to_string();
        assert!(error.contains("disparity map is 7 x 1"), "{error}");
        let error = masked.breakdown(&truth, &chequered(8, 2, |_| 0)).unwrap_err().to_string();
        assert!(error.contains("reference image is 8 x 2"), "{error}");
        let unknown = ground(&Plane::filled(8, 1, INF), None);
        assert!(matches!(unknown.breakdown(&truth, &image), Err(Error::Mismatch(_))));
    }
}
