//! Records of a match in JSON, for `mrfgs match --json` and batches.

use std::collections::BTreeMap;
use std::time::Duration;

use mrfgs::maps::{FRACTION, Maps, flag, has_disparity};
use mrfgs::options::{DisparityRange, Method};
use mrfgs::prior::PriorUse;
use mrfgs::rectification::Trust;
use mrfgs::{Conditioning, Matched, Timing};
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
    /// Number of blocks, if the pair was matched in blocks.
    #[serde(skip_serializing_if = "Option::is_none")]
    blocks: Option<usize>,
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

/// What a match has found beside its maps.
pub(crate) struct Found<'a> {
    pub(crate) method: &'a Method,
    pub(crate) range: DisparityRange,
    pub(crate) ran_on: &'a str,
    pub(crate) driver: Option<&'a str>,
    pub(crate) note: Option<String>,
    /// The tiles of the block with the most.
    pub(crate) tiles: usize,
    pub(crate) blocks: usize,
    pub(crate) conditioning: Conditioning,
    pub(crate) prior: Option<PriorUse>,
    pub(crate) iterations: u32,
    pub(crate) timings: &'a [Timing],
}

impl<'a> Found<'a> {
    pub(crate) fn of(matched: &'a Matched) -> Self {
        Self {
            method: &matched.plan.method,
            range: matched.range(),
            ran_on: &matched.ran_on,
            driver: matched.driver.as_deref(),
            note: matched.note.as_ref().map(|note| remedy::error(note, &remedy::FLAGS)),
            tiles: matched.tiles.count(),
            blocks: matched.blocks,
            conditioning: matched.conditioning,
            prior: matched.prior,
            iterations: matched.iterations,
            timings: &matched.timings,
        }
    }
}

/// Counts of the pixels of maps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Tally {
    all: usize,
    measured: usize,
    filled: usize,
    /// Sum of the confidences of measured pixels.
    confidence: u64,
}

impl Tally {
    /// Adds the pixels of `maps`.
    pub(crate) fn add(&mut self, maps: &Maps) {
        for (&validity, &confidence) in maps.validity.data().iter().zip(maps.confidence.data()) {
            self.all += 1;
            if validity & flag::FILLED != 0 {
                self.filled += 1;
            } else if has_disparity(validity) {
                self.measured += 1;
                self.confidence += u64::from(confidence);
            }
        }
    }
}

impl<'a> MatchRecord<'a> {
    pub(crate) fn new(files: &'a Files, matched: &'a Matched, time: Duration, sign: Sign) -> Self {
        let mut tally = Tally::default();
        tally.add(&matched.maps);
        Self::of(files, Found::of(matched), matched.maps.disparity.size(), tally, time, sign)
    }

    /// The record of maps of this size.
    pub(crate) fn of(
        files: &'a Files,
        found: Found<'a>,
        (width, height): (usize, usize),
        tally: Tally,
        time: Duration,
        sign: Sign,
    ) -> Self {
        let percent = |count: usize| 100.0 * count as f64 / tally.all as f64;
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
            range: sign.range(found.range),
            labels: found.range.labels(),
            method: found.method,
            ran_on: found.ran_on,
            driver: found.driver,
            note: found.note,
            tiles: found.tiles,
            blocks: (found.blocks > 1).then_some(found.blocks),
            moved_up: f64::from(found.conditioning.offset) / f64::from(FRACTION),
            smoothed: found.conditioning.smoothing,
            prior: found.prior,
            iterations: found.iterations,
            seconds: time.as_secs_f64(),
            stages: found.timings.iter().map(|t| (stage_and_level(t), ms(t.time))).collect(),
            density: percent(tally.measured + tally.filled),
            measured: percent(tally.measured),
            filled: percent(tally.filled),
            mean_confidence: (tally.measured > 0).then(|| tally.confidence as f64 / tally.measured as f64),
        }
    }
}

/// The name of a timing: "dependency, level 0".
pub(crate) fn stage_and_level(timing: &Timing) -> String {
    let level = timing.level.map_or(String::new(), |z| format!(", level {z}"));
    format!("{}{level}", timing.stage)
}
