//! Rectification of frames, with tracking of a right camera that turns while filming.

use mrfgs::drift::{Drift, Turn};
use mrfgs::image::Pair;
use mrfgs::options::DisparityRange;
use mrfgs::rectification::Rectification;

use crate::failure::Result;

/// Rectifies the frames and tracks whether the calibration still holds.
pub(crate) struct Rectifier {
    /// The rectification of the next frame; `None` if frames arrive rectified and need no correction.
    by: Option<Rectification>,
    /// `None` if the cameras are unknown.
    watched: Option<Watched>,
}

struct Watched {
    calibrated: Rectification,
    drift: Drift,
    range: DisparityRange,
    /// Whether frames are corrected.
    recalibrate: bool,
}

impl Rectifier {
    /// For frames that `by` rectifies, or that are already rectified; then `known` is their calibration as a rectification.
    pub(crate) fn new(
        by: Option<Rectification>,
        known: Option<Rectification>,
        range: DisparityRange,
        recalibrate: bool,
    ) -> Self {
        let watched = by.clone().or(known).and_then(|calibrated| {
            let drift = Drift::of(&calibrated).ok()?;
            Some(Watched { calibrated, drift, range, recalibrate })
        });
        Self { by, watched }
    }

    /// The next frame, rectified, and the turn of the right camera so far.
    pub(crate) fn rectified(&mut self, pair: Pair) -> Result<(Pair, Option<Turn>)> {
        let pair = match &self.by {
            Some(by) => by.apply(&pair)?,
            None => pair,
        };
        let turn = self.followed(&pair)?;
        Ok((pair, turn))
    }

    /// The turn of the right camera, updated with this rectified frame.
    pub(crate) fn followed(&mut self, pair: &Pair) -> Result<Option<Turn>> {
        let Some(Watched { calibrated, drift, range, recalibrate }) = &mut self.watched else {
            return Ok(None);
        };
        drift.follow(pair, *range)?;
        if *recalibrate && let Some(better) = drift.correct(calibrated)? {
            self.by = Some(better);
        }
        Ok(drift.turn())
    }
}

/// Describes the turn of the right camera for messages; `None` if it is negligible.
pub(crate) fn turned(turn: &Turn, recalibrated: bool) -> Option<String> {
    const LEAST: f64 = 0.005;
    if !turn.counts() {
        return None;
    }
    let ways = [["up", "down"], ["to the right", "to the left"], ["clockwise", "counter-clockwise"]];
    let parts: Vec<_> = (turn.degrees().into_iter().zip(ways))
        .filter(|(degrees, _)| degrees.abs() >= LEAST)
        .map(|(degrees, [way, back])| {
            format!("{:.2} {}", degrees.abs(), if degrees > 0.0 { way } else { back })
        })
        .collect();
    let end = if recalibrated {
        "; frames are corrected for this"
    } else {
        "; add --recalibrate, or calibrate again"
    };
    Some(format!(
        "the right camera has turned since the calibration, in degrees: {}. This shifts rows by up to {:.1} px{end}",
        parts.join(", "),
        turn.rows
    ))
}
