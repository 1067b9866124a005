//! What is known of a scene before it is matched: measured points, or a coarse surface.
//!
//! A [`Prior`] belongs to a single match: see [`Job::prior`](crate::Job::prior). It holds for the left view. Its disparities, each
//! with a standard deviation, enter the factor graph as a unary factor of every level, in addition to the evidence of the images.
//!
//! - Points ([`Prior::points`]) are exact but sparse: of a lidar, a depth sensor or a bundle adjustment. Those that their neighbours
//!   contradict are dropped. The others are spread to the pixels around them, by distance and colour, and where no match can be
//!   trusted they decide.
//! - A surface ([`Prior::map`]) is dense but coarse: a terrain model, the depth map of a phone, or the map of the last frame.
//!   It only shifts the balance between labels.
//!
//! Where the images contradict a prior, it counts less: see [`PriorUse::trust`].

use crate::error::{Error, Result};
use crate::image::{Plane, Rect};
use crate::maps::{FRACTION, Maps, flag};
use crate::options::MAX_DISPARITY;
use serde::{Deserialize, Serialize};

/// Smallest and largest standard deviation, in px; others are set to these.
const SIGMAS: [f64; 2] = [1.0 / 16.0, 255.0];

/// How a prior is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PriorKind {
    /// Sparse, exact points.
    Points,
    /// A dense, coarse surface.
    Surface,
}

impl PriorKind {
    /// How a map is used unless the user says it: points where at most a fifth of the pixels are known (finite).
    #[must_use]
    pub fn of_map(disparity: &Plane<f32>) -> Self {
        let known = disparity.data().iter().filter(|d| d.is_finite()).count();
        if 5 * known <= disparity.data().len() { Self::Points } else { Self::Surface }
    }

    /// The standard deviation of a prior whose own is not known, in px.
    #[must_use]
    pub fn usual_sigma(self) -> f64 {
        match self {
            Self::Points => 0.25,
            Self::Surface => 1.0,
        }
    }
}

/// A point of the left view with known disparity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PriorPoint {
    /// Column in px; whole numbers are centres of pixels.
    pub x: f64,
    /// Row in px.
    pub y: f64,
    /// Disparity in px.
    pub disparity: f64,
    /// Standard deviation of the disparity in px, above 0.
    pub sigma: f64,
}

impl PriorPoint {
    /// The points of a list: a line `x,y,disparity` or `x,y,disparity,sigma` for each, in px. A first line with names is skipped, and so
    /// are empty ones. `sigma` is the standard deviation of all; without it each has its own, or else the usual one.
    ///
    /// # Errors
    /// [`Error::Mismatch`] for another line, with its number, and if no line has a point.
    pub fn listed(text: &str, sigma: Option<f64>) -> Result<Vec<Self>> {
        let value = |field: &str| field.trim().trim_matches('"').parse().ok();
        let lines = text.trim_start_matches('\u{feff}').lines().enumerate();
        let mut points = Vec::new();
        for (row, (i, line)) in lines.filter(|(_, line)| !line.trim().is_empty()).enumerate() {
            let values: Option<Vec<f64>> = line.split(',').map(value).collect();
            let (x, y, disparity, own) = match values.as_deref() {
                Some(&[x, y, disparity]) => (x, y, disparity, PriorKind::Points.usual_sigma()),
                Some(&[x, y, disparity, own]) => (x, y, disparity, own),
                // A line with names of columns.
                None if row == 0 => continue,
                _ => {
                    let reason = "not x,y,disparity or x,y,disparity,sigma in pixels";
                    return Err(Error::Mismatch(format!("line {}: {reason}", i + 1)));
                }
            };
            points.push(Self { x, y, disparity, sigma: sigma.unwrap_or(own) });
        }
        if points.is_empty() {
            return Err(Error::Mismatch("there is no point".into()));
        }
        Ok(points)
    }
}

/// How much of a prior a match has used.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PriorUse {
    /// How it was used.
    pub kind: PriorKind,
    /// Number of pixels for which a disparity was given, at the size of the match, which may be half of that of the pair.
    pub given: usize,
    /// Number of these that their neighbours contradict; they were dropped.
    pub dropped: usize,
    /// How well the images agree with it, 0.0 ..= 1.0, on average over its pixels. Where they contradict it, nothing of it is used, and
    /// where they do so in part, its standard deviation is larger. Below a half it is 0, and the prior is not used at all.
    pub trust: f64,
}

impl PriorUse {
    /// What two blocks of a pair have used together.
    #[must_use]
    pub fn sum(one: Option<Self>, other: Option<Self>) -> Option<Self> {
        let (Some(a), Some(b)) = (one, other) else { return one.or(other) };
        let kept = |used: &Self| (used.given - used.dropped) as f64;
        let all = kept(&a) + kept(&b);
        let trust = if all > 0.0 { (a.trust * kept(&a) + b.trust * kept(&b)) / all } else { a.trust };
        Some(Self { kind: a.kind, given: a.given + b.given, dropped: a.dropped + b.dropped, trust })
    }
}

/// Known disparities of the left view. See the [module](self).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Prior {
    pub(crate) kind: PriorKind,
    /// In 1/256 px; meaningless where `sigma` is 0.
    pub(crate) disparity: Plane<i32>,
    /// Standard deviation in 1/256 px; 0 where nothing is known.
    pub(crate) sigma: Plane<u16>,
}

impl Prior {
    /// Sparse points of a left view of (width, height) pixels. Of several points in one pixel, the nearest (with the largest
    /// disparity) counts, because it hides the others. Points outside the view are left out.
    ///
    /// # Errors
    /// [`Error::Mismatch`] for values that are not finite, disparities beyond [`MAX_DISPARITY`], standard deviations that are not above
    /// 0, and if no point lies inside the view.
    pub fn points(
        (width, height): (usize, usize),
        points: impl IntoIterator<Item = PriorPoint>,
    ) -> Result<Self> {
        let mut prior = Self::nothing(PriorKind::Points, (width, height));
        let (mut inside, mut all) = (0_usize, 0_usize);
        for point in points {
            let PriorPoint { x, y, disparity, sigma } = point;
            all += 1;
            if ![x, y, disparity, sigma].iter().all(|value| value.is_finite()) {
                return Err(Error::Mismatch(format!(
                    "point {all} of the prior has a value that is not a number"
                )));
            }
            check(disparity, sigma, || format!("point {all} of the prior"))?;
            let (x, y) = ((x + 0.5).floor(), (y + 0.5).floor());
            if x < 0.0 || y < 0.0 || x >= width as f64 || y >= height as f64 {
                continue;
            }
            inside += 1;
            let (at, disparity) = ((x as usize, y as usize), fixed(disparity));
            if prior.sigma[at] == 0 || disparity > prior.disparity[at] {
                (prior.disparity[at], prior.sigma[at]) = (disparity, fixed_sigma(sigma));
            }
        }
        if all > 0 && inside == 0 {
            return Err(Error::Mismatch(format!(
                "none of the {all} points of the prior lies inside the left view of {width} x {height} pixels"
            )));
        }
        Ok(prior)
    }

    /// A map of disparities in px, not finite where nothing is known, all with the same standard deviation in px.
    ///
    /// # Errors
    /// [`Error::Mismatch`] for disparities beyond [`MAX_DISPARITY`], and if `sigma` is not above 0.
    pub fn map(kind: PriorKind, disparity: &Plane<f32>, sigma: f64) -> Result<Self> {
        Self::of_map(kind, disparity, |_| sigma)
    }

    /// Like [`Self::map`], with a standard deviation for each pixel.
    ///
    /// # Errors
    /// [`Error::Mismatch`] for disparities beyond [`MAX_DISPARITY`], for standard deviations that are not above 0 where a disparity is
    /// known, and if the maps differ in size.
    pub fn map_with(kind: PriorKind, disparity: &Plane<f32>, sigma: &Plane<f32>) -> Result<Self> {
        if disparity.size() != sigma.size() {
            let ((w, h), (sw, sh)) = (disparity.size(), sigma.size());
            return Err(Error::Mismatch(format!(
                "the prior has {w} x {h} disparities and {sw} x {sh} standard deviations"
            )));
        }
        Self::of_map(kind, disparity, |at| sigma[at].into())
    }

    /// Like [`Self::map`], for a left view of (width, height) pixels whose map may have another size, if it has the same shape. The
    /// disparities are in pixels of the view. The value of a pixel of the map counts in all of its area, or of points in the middle of it.
    ///
    /// # Errors
    /// The errors of [`Self::map`], and [`Error::Mismatch`] for a map of another shape.
    pub fn resized(
        kind: PriorKind,
        disparity: &Plane<f32>,
        size @ (width, height): (usize, usize),
        sigma: f64,
    ) -> Result<Self> {
        let (w, h) = disparity.size();
        if (w, h) == size {
            return Self::map(kind, disparity, sigma);
        }
        // Of the same shape, within a pixel of the smaller one.
        if (w * height).abs_diff(h * width) > width.max(height) {
            return Err(Error::Mismatch(format!(
                "it has {w} x {h} pixels and the left view {width} x {height}; give a map of the left view, or of the same shape in another \
                 size"
            )));
        }
        if kind == PriorKind::Surface {
            let of = |x: usize, y: usize| {
                disparity[((2 * x + 1) * w / (2 * width), (2 * y + 1) * h / (2 * height))]
            };
            return Self::map(kind, &Plane::from_fn(width, height, of), sigma);
        }
        let middle = |i: usize, own: usize, count: usize| (i as f64 + 0.5) * own as f64 / count as f64 - 0.5;
        let all = (0..h).flat_map(|y| (0..w).map(move |x| (x, y))).filter(|at| disparity[*at].is_finite());
        let point = |(x, y): (usize, usize)| PriorPoint {
            x: middle(x, width, w),
            y: middle(y, height, h),
            disparity: disparity[(x, y)].into(),
            sigma,
        };
        Self::points(size, all.map(point))
    }

    fn of_map(
        kind: PriorKind,
        disparity: &Plane<f32>,
        sigma: impl Fn((usize, usize)) -> f64,
    ) -> Result<Self> {
        let (width, height) = disparity.size();
        let mut prior = Self::nothing(kind, (width, height));
        for at in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let d = f64::from(disparity[at]);
            if d.is_finite() {
                let sigma = sigma(at);
                check(d, sigma, || format!("the prior at column {}, row {}", at.0, at.1))?;
                (prior.disparity[at], prior.sigma[at]) = (fixed(d), fixed_sigma(sigma));
            }
        }
        Ok(prior)
    }

    /// The measured disparities of a match as a surface, with the usual standard deviation: what is known of the next frame of cameras that
    /// stand still. [`Matcher::run_following`](crate::Matcher::run_following) does this for all frames.
    #[must_use]
    pub fn of_maps(maps: &Maps) -> Self {
        let sigma = fixed_sigma(PriorKind::Surface.usual_sigma());
        let known = |flags: &u8| if flags & flag::INVALID == 0 { sigma } else { 0 };
        Self { kind: PriorKind::Surface, disparity: maps.disparity.clone(), sigma: maps.validity.map(known) }
    }

    /// A prior that knows nothing of a view of this size.
    pub(crate) fn nothing(kind: PriorKind, (width, height): (usize, usize)) -> Self {
        Self { kind, disparity: Plane::filled(width, height, 0), sigma: Plane::filled(width, height, 0) }
    }

    /// (width, height) of the left view, in pixels.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        self.disparity.size()
    }

    /// How it is used.
    #[must_use]
    pub fn kind(&self) -> PriorKind {
        self.kind
    }

    /// Number of pixels with a known disparity.
    #[must_use]
    pub fn count(&self) -> usize {
        self.sigma.data().iter().filter(|&&sigma| sigma > 0).count()
    }

    /// What is known of `part` of the view.
    #[must_use]
    pub fn crop(&self, part: &Rect) -> Self {
        Self { kind: self.kind, disparity: self.disparity.crop(part), sigma: self.sigma.crop(part) }
    }

    /// The known pixels: (x, y), disparity and standard deviation in 1/256 px.
    pub(crate) fn known(&self) -> impl Iterator<Item = ((usize, usize), i32, u16)> + '_ {
        let width = self.disparity.width();
        let pixels = self.disparity.data().iter().zip(self.sigma.data()).enumerate();
        pixels
            .filter(|(_, (_, sigma))| **sigma > 0)
            .map(move |(i, (&d, &sigma))| ((i % width, i / width), d, sigma))
    }

    /// What is known at half the size, rounded up. Of several known pixels of a block, the nearest counts.
    pub(crate) fn halved(&self) -> Self {
        let (width, height) = self.size();
        let mut half = Self::nothing(self.kind, (width.div_ceil(2), height.div_ceil(2)));
        for ((x, y), disparity, sigma) in self.known() {
            half.add((x / 2, y / 2), (disparity.div_euclid(2), sigma.div_ceil(2)));
        }
        half
    }

    /// What is known at twice the size: the same of all four pixels of a block.
    pub(crate) fn doubled(&self) -> Self {
        let (width, height) = self.size();
        let of = |x: usize, y: usize| (x / 2, y / 2);
        Self {
            kind: self.kind,
            disparity: Plane::from_fn(2 * width, 2 * height, |x, y| 2 * self.disparity[of(x, y)]),
            sigma: Plane::from_fn(2 * width, 2 * height, |x, y| self.sigma[of(x, y)].saturating_mul(2)),
        }
    }

    /// What is known of the left view of the mirrored pair, which is the right view of the pair: each known pixel where it is
    /// seen, the nearest of several.
    pub(crate) fn mirrored(&self) -> Self {
        let (width, height) = self.size();
        let mut mirrored = Self::nothing(self.kind, (width, height));
        for ((x, y), disparity, sigma) in self.known() {
            let seen = x as i32 - (disparity + FRACTION / 2).div_euclid(FRACTION);
            if let Some(seen) = usize::try_from(seen).ok().filter(|seen| *seen < width) {
                mirrored.add((width - 1 - seen, y), (disparity, sigma));
            }
        }
        mirrored
    }

    /// Adds a known disparity, unless a nearer one is known there.
    fn add(&mut self, at: (usize, usize), (disparity, sigma): (i32, u16)) {
        if self.sigma[at] == 0 || disparity > self.disparity[at] {
            (self.disparity[at], self.sigma[at]) = (disparity, sigma);
        }
    }
}

fn check(disparity: f64, sigma: f64, name: impl Fn() -> String) -> Result<()> {
    if disparity.abs() > f64::from(MAX_DISPARITY) {
        return Err(Error::Mismatch(format!(
            "{} has a disparity of {disparity} px; the most is {MAX_DISPARITY}",
            name()
        )));
    }
    if !(sigma > 0.0 && sigma.is_finite()) {
        return Err(Error::Mismatch(format!(
            "{} has a standard deviation of {sigma} px, which is not above 0",
            name()
        )));
    }
    Ok(())
}

fn fixed(disparity: f64) -> i32 {
    (disparity * f64::from(FRACTION) + 0.5).floor() as i32
}

fn fixed_sigma(sigma: f64) -> u16 {
    (sigma.clamp(SIGMAS[0], SIGMAS[1]) * f64::from(FRACTION) + 0.5).floor() as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(x: f64, y: f64, disparity: f64) -> PriorPoint {
        PriorPoint { x, y, disparity, sigma: 0.25 }
    }

    #[test]
    fn the_nearest_point_of_a_pixel_counts() {
        let points = [point(1.4, 0.6, 3.0), point(0.8, 1.2, 7.5), point(1.0, 1.0, 5.0), point(9.0, 0.0, 1.0)];
        let prior = Prior::points((4, 3), points).unwrap();
        assert_eq!(prior.known().collect::<Vec<_>>(), [((1, 1), 1920, 64)]);
        assert_eq!(prior.halved().known().collect::<Vec<_>>(), [((0, 0), 960, 32)]);
        assert_eq!(prior.doubled().count(), 4);
    }

    #[test]
    fn points_are_listed_with_and_without_names_and_sigma() {
        let list = |text: &str| PriorPoint::listed(text, None).map_err(|e| e.to_string());
        let all = [PriorPoint { sigma: 0.5, ..point(1.0, 2.0, 3.5) }, point(4.0, 5.0, 6.0)];
        assert_eq!(list("\u{feff}x,y,d,sigma\r\n1,2,3.5,0.5\r\n\r\n 4, \"5\" , 6\r\n").unwrap(), all);
        assert_eq!(list("1,2,3.5,0.5\n4,5,6").unwrap(), all);
        let same = PriorPoint::listed("1,2,3.5,0.5\n4,5,6", Some(2.0)).unwrap();
        assert_eq!(same, all.map(|point| PriorPoint { sigma: 2.0, ..point }));
        for (text, line) in
            [("1,2,3\n\n1,2,x\n", "line 3: "), ("x,y,d\nx,y,d\n", "line 2: "), ("1,2\n", "line 1: ")]
        {
            let error = list(text).unwrap_err();
            assert!(error.starts_with(line) && error.contains("not x,y,disparity"), "{error}");
        }
        assert_eq!([list(""), list("x,y,d\n")], ["there is no point"; 2].map(|error| Err(error.into())));
    }

    #[test]
    fn known_pixels_are_seen_in_the_mirrored_pair() {
        let points = [point(6.0, 0.0, 2.0), point(7.0, 0.0, 3.0), point(1.0, 0.0, 2.0)];
        let mirrored = Prior::points((8, 1), points).unwrap().mirrored();
        // Columns 4 and 4 of the right view: the nearer of both. Column -1 is outside.
        assert_eq!(mirrored.known().collect::<Vec<_>>(), [((3, 0), 768, 64)]);
    }

    #[test]
    fn bad_values_are_named() {
        let error = |points: &[PriorPoint]| Prior::points((4, 4), points.to_vec()).unwrap_err().to_string();
        assert!(error(&[point(0.0, 0.0, 1.0), point(f64::NAN, 0.0, 1.0)]).contains("point 2 of the prior"));
        assert!(error(&[PriorPoint { sigma: -1.0, ..point(0.0, 0.0, 1.0) }]).contains("-1 px"));
        assert!(error(&[point(4.0, 0.0, 1.0)]).contains("none of the 1 points"));
        assert!(error(&[point(0.0, 0.0, 1e7)]).contains("10000000 px"));
        let map = Plane::new(2, 1, vec![1.0, f32::INFINITY]);
        assert_eq!(Prior::map(PriorKind::Surface, &map, 1.0).unwrap().count(), 1);
        assert!(Prior::map(PriorKind::Surface, &map, 0.0).is_err());
        let sigma = Plane::new(1, 1, vec![1.0]);
        assert!(Prior::map_with(PriorKind::Surface, &map, &sigma).unwrap_err().to_string().contains("2 x 1"));
    }
}
