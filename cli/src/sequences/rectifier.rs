//! A rig whose right camera turns while it is filmed.

use mrfgs::drift::{Drift, Turn};
use mrfgs::image::Pair;
use mrfgs::options::DisparityRange;
use mrfgs::rectification::Rectification;

use crate::failure::Result;

/// Rectifies the frames, and watches whether that is still right.
pub(crate) struct Rectifier {
    /// What rectifies the next frame; `None` where frames are rectified already, and stand as they were calibrated.
    by: Option<Rectification>,
    /// Where the cameras are known.
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
    /// With frames that `by` rectifies, or that are rectified already by a calibration that would be `known` as such.
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

    /// The next frame, rectified, and how the right camera has turned by then.
    pub(crate) fn rectified(&mut self, pair: Pair) -> Result<(Pair, Option<Turn>)> {
        let pair = match &self.by {
            Some(by) => by.apply(&pair)?,
            None => pair,
        };
        let turn = self.followed(&pair)?;
        Ok((pair, turn))
    }

    /// How the right camera has turned by this frame, which is rectified.
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

/// How the right camera has turned in a sequence, for people; `None` where that does not matter.
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
    let end = if recalibrated { "; that is corrected" } else { "; give --recalibrate, or calibrate again" };
    Some(format!(
        "the right camera has turned since the calibration, by these degrees: {}. That moves rows apart by up to {:.1} px{end}",
        parts.join(", "),
        turn.rows
    ))
}
