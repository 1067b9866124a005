//! Records of a match in JSON, for `mrfgs match --json` and batches.

use std::collections::BTreeMap;
use std::time::Duration;

use mrfgs::maps::{FRACTION, flag, has_disparity};
use mrfgs::options::{DisparityRange, Method};
use mrfgs::prior::PriorUse;
use mrfgs::rectification::Trust;
use mrfgs::{Matched, Timing};
use serde::Serialize;

use crate::args::Sign;
use crate::remedy;

/// The paths of a match, as the user wrote them.
#[derive(Serialize)]
pub(crate) struct Files {
    pub(crate) left: String,
    pub(crate) right: String,
    pub(crate) mask: Option<String>,
    pub(crate) calibration: Option<String>,
    /// The file of known disparities of the left view; `None` without a prior.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) prior: Option<String>,
    /// `None` if no map is written.
    pub(crate) output: Option<String>,
}

/// A match in JSON. The help of `mrfgs match --json` explains the fields.
#[derive(Serialize)]
pub(crate) struct MatchRecord<'a> {
    version: &'static str,
    files: &'a Files,
    /// Whether the images were rectified first.
    pub(crate) rectified: bool,
    /// First column and row of the maps in the left view, for a region.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) region: Option<[usize; 2]>,
    /// The quality of a rectification without a calibration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) trust: Option<Trust>,
    width: usize,
    height: usize,
    sign: Sign,
    range: DisparityRange,
    labels: usize,
    method: &'a Method,
    ran_on: &'a str,
    driver: Option<&'a str>,
    note: Option<String>,
    tiles: usize,
    /// How far the right view was shifted up, in pixels.
    moved_up: f64,
    /// How much the left and the right view were smoothed, in pixels.
    smoothed: [f64; 2],
    /// How much of a prior was used, with one.
    #[serde(skip_serializing_if = "Option::is_none")]
    prior: Option<PriorUse>,
    iterations: u32,
    seconds: f64,
    /// Milliseconds by stage and level, if measured.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    stages: BTreeMap<String, f64>,
    density: f64,
    measured: f64,
    filled: f64,
    mean_confidence: Option<f64>,
}

impl<'a> MatchRecord<'a> {
    pub(crate) fn new(files: &'a Files, matched: &'a Matched, time: Duration, sign: Sign) -> Self {
        let Matched { maps, plan, .. } = matched;
        let (width, height) = maps.disparity.size();
        let percent = |count: usize| 100.0 * count as f64 / (width * height) as f64;
        let filled = maps.validity.data().iter().filter(|&v| v & flag::FILLED != 0).count();
        let measured = |validity: u8| has_disparity(validity) && validity & flag::FILLED == 0;
        let pixels = maps.validity.data().iter().zip(maps.confidence.data());
        let (count, sum) = pixels
            .filter(|(validity, _)| measured(**validity))
            .fold((0, 0), |(count, sum), (_, confidence)| (count + 1, sum + u64::from(*confidence)));
        let ms = |time: Duration| 1000.0 * time.as_secs_f64();
        Self {
            version: env!("CARGO_PKG_VERSION"),
            files,
            rectified: false,
            region: None,
            trust: None,
            width,
            height,
            sign,
            range: sign.range(matched.range()),
            labels: matched.range().labels(),
            method: &plan.method,
            ran_on: &matched.ran_on,
            driver: matched.driver.as_deref(),
            note: matched.note.as_ref().map(|note| remedy::error(note, &remedy::FLAGS)),
            tiles: matched.tiles.count(),
            moved_up: f64::from(matched.conditioning.offset) / f64::from(FRACTION),
            smoothed: matched.conditioning.smoothing,
            prior: matched.prior,
            iterations: matched.iterations,
            seconds: time.as_secs_f64(),
            stages: matched.timings.iter().map(|t| (stage_and_level(t), ms(t.time))).collect(),
            density: percent(count + filled),
            measured: percent(count),
            filled: percent(filled),
            mean_confidence: (count > 0).then(|| sum as f64 / count as f64),
        }
    }
}

/// The name of a timing: "dependency, level 0".
pub(crate) fn stage_and_level(timing: &Timing) -> String {
    let level = timing.level.map_or(String::new(), |z| format!(", level {z}"));
    format!("{}{level}", timing.stage)
}
