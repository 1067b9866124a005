//! Rectification without a calibration: by matches of the pair alone.

use super::trust::Trust;
use super::two_views::{Correspondence, TwoViews};
use super::{Options, Rectification, views};
use crate::calibration::cameras::Views;
use crate::calibration::matrix::{IDENTITY, rotation};
use crate::error::{RectificationError, Result};
use crate::image::calib::{Camera, Unit};

/// Fewer matches than this that agree show no geometry.
const LEAST: usize = 30;
/// Of all matches at least one in this many must agree.
const ONE_IN: usize = 2;
/// The least share of matches that one plane does not explain (open).
const OFF_ONE_PLANE: f64 = 0.05;
/// The image is divided into this many parts along each side, to see how much of it has matches.
const PARTS: usize = 8;

impl Rectification {
    /// The rectification of images of `size` by `matches` of theirs alone, without a calibration: for two photographs of one camera
    /// that was moved to the side, by hand.
    ///
    /// Both images are taken for those of one pinhole with its axis in the middle; its focal length and how it moved are found
    /// (Fusiello and Irsara 2008), and the views are then chosen as by [`Rectification::new`]. What is infinitely far has a disparity of
    /// about 0, or of some pixels of either sign, where the matches say little of the focal length. There is no scale, so
    /// [`Rectification::calibration`] is an error.
    ///
    /// # Errors
    /// [`Error::Rectification`](crate::Error::Rectification) where too few matches agree, where one plane or a mere turn of the camera
    /// explains them all, and where the camera moved forward; [`Error::Calibration`](crate::Error::Calibration) for an alpha outside of 0
    /// to 1.
    pub fn of_matches(matches: &[Correspondence], size: (usize, usize), options: &Options) -> Result<Self> {
        options.check()?;
        let (views, agreeing) = geometry(matches, size)?;
        let off_one_plane = views.share_off_one_plane(&agreeing);
        if is_flat(off_one_plane) {
            return Err(RectificationError::Flat.into());
        }
        let mut found = Self::of_geometry(&views, &agreeing, size, options)?;
        let mut rows: Vec<f64> = agreeing.iter().map(|of| found.rows_apart(of)).collect();
        rows.sort_unstable_by(f64::total_cmp);
        let mut parts = [false; PARTS * PARTS];
        for [[x, y], _] in &agreeing {
            let part = |v: f64, side: usize| ((v * PARTS as f64 / side as f64) as usize).min(PARTS - 1);
            parts[part(*y, size.1) * PARTS + part(*x, size.0)] = true;
        }
        let trust = Trust {
            matches: matches.len(),
            agreeing: agreeing.len(),
            median: rows[rows.len() / 2],
            percentile95: rows[rows.len() * 95 / 100],
            coverage: parts.iter().filter(|some| **some).count() as f64 / parts.len() as f64,
            off_one_plane,
        };
        found.doubts = trust.doubts(TwoViews::tolerance(size));
        found.trust = Some(trust);
        Ok(found)
    }

    /// The same without a look at what it is worth, and the matches that agree: for a better one to follow.
    pub(crate) fn roughly(
        matches: &[Correspondence],
        size: (usize, usize),
    ) -> Result<(Self, Vec<Correspondence>)> {
        let (views, agreeing) = geometry(matches, size)?;
        Ok((Self::of_geometry(&views, &agreeing, size, &Options::default())?, agreeing))
    }

    /// What turns the right view alone, counter-clockwise by an angle in radians: for a search of views that differ by about that.
    pub(crate) fn turning_right(size: (usize, usize), angle: f64) -> Result<Self> {
        let start = TwoViews::start(size);
        let lens = start.lens()?;
        let camera = Camera { focal_length: lens.focal_length, principal_point: lens.principal_point };
        let views = Views {
            rotations: [IDENTITY, rotation([0.0, 0.0, -angle])],
            cameras: [camera; 2],
            translation: [-1.0, 0.0],
            size: None,
        };
        Ok(Self {
            lenses: [lens; 2],
            views,
            images: [size; 2],
            size,
            unit: Unit::default(),
            exchanged: false,
            doubts: Vec::new(),
            trust: None,
            places: None,
        })
    }

    fn of_geometry(
        found: &TwoViews,
        agreeing: &[Correspondence],
        size: (usize, usize),
        options: &Options,
    ) -> Result<Self> {
        let lens = found.lens()?;
        let views = views::choose(&[lens; 2], &found.pose(agreeing), size, options);
        views
            .and_then(
                |views| {
                    if views.is_exchanged() { Err(RectificationError::Forward.into()) } else { Ok(views) }
                },
            )
            .and_then(|views| Self::of_views(&[lens; 2], views, [size; 2], Unit::default(), Vec::new()))
            .map_err(|_| RectificationError::Forward.into())
    }

    /// How far apart the rows of a match are in the rectified views, in pixels.
    fn rows_apart(&self, of: &Correspondence) -> f64 {
        let [left, right] = [0, 1].map(|view| self.rectified(view, of[view]));
        (left[1] - right[1]).abs()
    }

    /// Where a rectified view shows a pixel of its image.
    pub(crate) fn rectified(&self, view: usize, pixel: [f64; 2]) -> [f64; 2] {
        let camera = &self.views.cameras[view];
        let at = views::seen(&self.lenses[view], &self.views.rotations[view], pixel);
        [0, 1].map(|i| camera.focal_length[i] * at[i] + camera.principal_point[i])
    }

    /// How far it can be trusted, where it comes [from matches alone](Self::of_matches).
    #[must_use]
    pub fn trust(&self) -> Option<&Trust> {
        self.trust.as_ref()
    }
}

/// Whether one plane explains all matches but this share.
fn is_flat(off_one_plane: f64) -> bool {
    off_one_plane < OFF_ONE_PLANE
}

/// How the views stand, and the matches that agree with it.
fn geometry(matches: &[Correspondence], size: (usize, usize)) -> Result<(TwoViews, Vec<Correspondence>)> {
    let few = |agreeing| RectificationError::Few { agreeing, matches: matches.len(), least: LEAST };
    let views = TwoViews::of(matches, size).ok_or_else(|| few(0))?;
    let tolerance = TwoViews::tolerance(size);
    let agreeing: Vec<_> =
        matches.iter().filter(|of| views.distance(of).abs() <= tolerance).copied().collect();
    if agreeing.len() < LEAST || ONE_IN * agreeing.len() < matches.len() {
        return Err(few(agreeing.len()).into());
    }
    // Where one plane explains all, the way may be any.
    match views.is_forward() {
        true if is_flat(views.share_off_one_plane(&agreeing)) => Err(RectificationError::Flat.into()),
        true => Err(RectificationError::Forward.into()),
        false => Ok((views, agreeing)),
    }
}
