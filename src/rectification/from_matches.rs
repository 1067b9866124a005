//! Rectification by the matches of a pair, without a calibration.

use super::trust::Trust;
use super::two_views::{Correspondence, TwoViews};
use super::{Options, Rectification, views};
use crate::calibration::cameras::RectifiedViews;
use crate::calibration::matrix::{IDENTITY, rotation};
use crate::error::{RectificationError, Result};
use crate::image::calib::{Camera, Unit};

/// Fewest agreeing matches that show the geometry.
const LEAST: usize = 30;
/// At least one in this many of all matches must agree.
const ONE_IN: usize = 2;
/// The least share of matches off any single plane (open).
const OFF_ONE_PLANE: f64 = 0.05;
/// Parts along each side of the image, in which matches are counted.
const PARTS: usize = 8;

impl Rectification {
    /// The rectification of images of `size` by their `matches`, without a calibration: for two photographs
    /// of one camera that was moved to the side by hand.
    ///
    /// Both images are assumed to be from one pinhole camera with its axis in the middle; its focal length and
    /// motion are estimated (Fusiello and Irsara 2008), and a zoom between the images if the motion were unlikely without it. The
    /// views are then chosen as in [`Rectification::new`].
    /// Points at infinity have a disparity of about 0, or of some pixels of either sign if the matches determine
    /// the focal length poorly. There is no scale, so [`Rectification::calibration`] is an error.
    ///
    /// # Errors
    /// [`Error::Rectification`](crate::Error::Rectification) when too few matches agree, when all fit one
    /// plane or a mere rotation of the camera, and when the camera moved forward;
    /// [`Error::Calibration`](crate::Error::Calibration) for an alpha outside 0 to 1.
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

    /// A rectification without an assessment, and the matches that agree, to be refined.
    pub(crate) fn roughly(
        matches: &[Correspondence],
        size: (usize, usize),
    ) -> Result<(Self, Vec<Correspondence>)> {
        let (views, agreeing) = geometry(matches, size)?;
        Ok((Self::of_geometry(&views, &agreeing, size, &Options::default())?, agreeing))
    }

    /// Rotates the right view alone, counter-clockwise by an angle in radians: to search views that differ by about that.
    pub(crate) fn turning_right(size: (usize, usize), angle: f64) -> Result<Self> {
        let start = TwoViews::start(size);
        let [lens, _] = start.lenses()?;
        let camera = Camera { focal_length: lens.focal_length, principal_point: lens.principal_point };
        let views = RectifiedViews {
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
        let lenses = found.lenses()?;
        let views = views::choose(&lenses, &found.pose(agreeing), size, options);
        views
            .and_then(
                |views| {
                    if views.is_exchanged() { Err(RectificationError::Forward.into()) } else { Ok(views) }
                },
            )
            .and_then(|views| Self::of_views(&lenses, views, [size; 2], Unit::default(), Vec::new()))
            .map_err(|_| RectificationError::Forward.into())
    }

    /// The row distance of a match in the rectified views, in pixels.
    fn rows_apart(&self, of: &Correspondence) -> f64 {
        let [left, right] = [0, 1].map(|view| self.rectified(view, of[view]));
        (left[1] - right[1]).abs()
    }

    /// The position in a rectified view of a pixel of its image.
    pub(crate) fn rectified(&self, view: usize, pixel: [f64; 2]) -> [f64; 2] {
        let camera = &self.views.cameras[view];
        let at = views::seen(&self.lenses[view], &self.views.rotations[view], pixel);
        [0, 1].map(|i| camera.focal_length[i] * at[i] + camera.principal_point[i])
    }

    /// How reliable the rectification is, if it comes [from matches alone](Self::of_matches).
    #[must_use]
    pub fn trust(&self) -> Option<&Trust> {
        self.trust.as_ref()
    }
}

/// Whether one plane explains all matches but this share.
fn is_flat(off_one_plane: f64) -> bool {
    off_one_plane < OFF_ONE_PLANE
}

/// The geometry of the views, and the matches that agree with it.
fn geometry(matches: &[Correspondence], size: (usize, usize)) -> Result<(TwoViews, Vec<Correspondence>)> {
    let few = |agreeing| RectificationError::Few { agreeing, matches: matches.len(), least: LEAST };
    let views = TwoViews::estimate(matches, size).ok_or_else(|| few(0))?;
    let tolerance = TwoViews::tolerance(size);
    let agreeing: Vec<_> =
        matches.iter().filter(|of| views.distance(of).abs() <= tolerance).copied().collect();
    if agreeing.len() < LEAST || ONE_IN * agreeing.len() < matches.len() {
        return Err(few(agreeing.len()).into());
    }
    // Matches on one plane leave the direction undetermined.
    match views.is_forward() {
        true if is_flat(views.share_off_one_plane(&agreeing)) => Err(RectificationError::Flat.into()),
        true => Err(RectificationError::Forward.into()),
        false => Ok((views, agreeing)),
    }
}
