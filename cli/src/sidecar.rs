//! What `mrfgs match --json` writes beside a map.

use std::collections::BTreeMap;
use std::time::Duration;

use mrfgs::Matched;
use mrfgs::maps::{flag, has_disparity};
use mrfgs::options::{DisparityRange, Method};
use serde::Serialize;

use crate::sign::Sign;

/// Where a match took its input from and put its map, as the user wrote it.
#[derive(Serialize)]
pub(super) struct Files {
    pub(super) left: String,
    pub(super) right: String,
    pub(super) mask: Option<String>,
    pub(super) calibration: Option<String>,
    pub(super) output: String,
}

/// A match in JSON. What the fields hold is told by the help.
#[derive(Serialize)]
pub(super) struct Sidecar<'a> {
    version: &'static str,
    files: &'a Files,
    width: usize,
    height: usize,
    sign: Sign,
    range: DisparityRange,
    labels: usize,
    method: &'a Method,
    ran_on: &'a str,
    driver: Option<&'a str>,
    note: Option<&'a str>,
    tiles: usize,
    iterations: u32,
    seconds: f64,
    stages: BTreeMap<String, f64>,
    density: f64,
    measured: f64,
    filled: f64,
    mean_confidence: Option<f64>,
}

impl<'a> Sidecar<'a> {
    pub(super) fn new(files: &'a Files, matched: &'a Matched, time: Duration, sign: Sign) -> Self {
        let Matched { maps, plan, .. } = matched;
        let (width, height) = plan.size();
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
            width,
            height,
            sign,
            range: sign.range(plan.range),
            labels: plan.range.labels(),
            method: &plan.method,
            ran_on: &matched.ran_on,
            driver: matched.driver.as_deref(),
            note: matched.note.as_deref(),
            tiles: matched.tiles.count(),
            iterations: matched.iterations,
            seconds: time.as_secs_f64(),
            stages: matched.timings.iter().map(|t| (crate::stage_and_level(t), ms(t.time))).collect(),
            density: percent(count + filled),
            measured: percent(count),
            filled: percent(filled),
            mean_confidence: (count > 0).then(|| sum as f64 / count as f64),
        }
    }
}
