//! The measurement of one pair, method and device.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::io::Write;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use mrfgs::error::in_words;
use mrfgs::image::Pair;
use mrfgs::low_level::backend::Stage;
use mrfgs::low_level::backend::cpu::Cpu;
use mrfgs::low_level::backend::gpu::Gpu;
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::roofline;
use mrfgs::options::{DeviceChoice, DisparityRange};
use mrfgs::{Error, Matched, Matcher, Timing, threads};

use crate::console;
use crate::failure::{Failure, Result};
use crate::outputs::stage_and_level;
use crate::pairs::folder::{self, Folder};
use crate::process::{peak_memory, processor_time};

use super::args::Args;
use super::findings::{Figures, Findings, Row};

/// A measurement, done in one process.
pub(super) struct Case<'a> {
    pub(super) args: &'a Args,
    /// The folder of the pair; `None` for the generated pair.
    pub(super) dir: Option<&'a Path>,
    /// The preset to measure, or the one that files of `--method` override.
    pub(super) base: &'static str,
    pub(super) device: &'a DeviceChoice,
}

impl Case<'_> {
    /// Measures in a separate process, so that earlier cases do not affect its memory.
    pub(super) fn apart(&self) -> Result<Row> {
        let failed = Failure::Failed;
        let program = std::env::current_exe().map_err(|e| Failure::from(Error::read("this program", e)))?;
        let run = Command::new(program).args(self.arguments()).output();
        let run = run.map_err(|e| {
            failed(format!("a process for a measurement cannot be started: {}", in_words(&e)))
        })?;
        let said = String::from_utf8_lossy(&run.stderr);
        if !run.status.success() {
            let said = said.trim().trim_start_matches("mrfgs: ");
            let ended = format!("{} on {}: {}", self.pair_name(), word(self.device), run.status);
            return Err(failed(if said.is_empty() { ended } else { said.into() }));
        }
        let findings: Findings =
            serde_json::from_slice(&run.stdout).map_err(|e| failed(format!("{}: {e}", self.pair_name())))?;
        let _ = std::io::stderr().write_all(said.as_bytes());
        let row = findings.pairs.into_iter().next();
        row.ok_or_else(|| failed(format!("{}: nothing was measured", self.pair_name())))
    }

    /// The command line that measures only this case.
    fn arguments(&self) -> Vec<OsString> {
        let args = self.args;
        let mut all: Vec<OsString> = vec!["bench".into(), "--json=-".into()];
        let mut flag = |name: &str, value: &dyn AsRef<std::ffi::OsStr>| {
            let mut text = OsString::from(name);
            text.push(value);
            all.push(text);
        };
        flag("--device=", &word(self.device));
        flag("--repeats=", &args.repeats.to_string());
        flag("--max-pixels=", &args.reading.max_pixels.to_string());
        if let Some(value) = args.reading.no_data {
            flag("--no-data=", &value.to_string());
        }
        if args.method.method.is_empty() {
            flag("--method=", &self.base);
        }
        for word in &args.method.method {
            flag("--method=", word);
        }
        for (key, value) in &args.method.set {
            flag("--set=", &format!("{key}={value}"));
        }
        if let Some(memory) = args.method.memory {
            flag("--memory=", &format!("{memory}MiB"));
        }
        if let Some(threads) = args.threads.threads {
            flag("--threads=", &threads.to_string());
        }
        all.extend(args.large.then(|| "--large".into()));
        all.extend(self.dir.into_iter().flat_map(|dir| ["--".into(), dir.into()]));
        all
    }

    fn pair_name(&self) -> String {
        match self.dir {
            Some(dir) => folder::name(dir),
            None => self.args.made_up().name.into(),
        }
    }

    /// Measures in this process.
    pub(super) fn measure(&self) -> Result<Row> {
        let (pair, range) = if let Some(dir) = self.dir {
            Folder::to_match(dir)?.read_pair(self.args.reading.reader())?
        } else {
            let made_up = self.args.made_up();
            (made_up.pair()?, made_up.range()?)
        };
        let (name, device) = (self.pair_name(), word(self.device).to_owned());
        let method = self.args.method.name().unwrap_or_else(|| self.base.into());
        let what = format!("{name}, method {method}, {device}");
        let figures = match self.figures(&pair, range) {
            Err(failure @ Failure::Error(Error::Memory(_))) => {
                console::say(&format!("{what}: skipped: {failure}"));
                None
            }
            figures => Some(figures?),
        };
        if let Some(figures) = &figures {
            console::say(&format!("{what}: {:.1} ms", figures.median_ms));
        }
        let (width, height) = pair.size();
        let devices = BTreeMap::from([(device, figures)]);
        Ok(Row { name, method, width, height, labels: range.labels(), devices })
    }

    fn figures(&self, pair: &Pair, range: DisparityRange) -> Result<Figures> {
        let method = self.args.method.on(self.base)?;
        let mut matcher =
            Matcher::builder().method(method).execution(self.args.threads.execution(self.device)).build()?;
        let mut run = |timings: bool| {
            matcher.keep_time(timings);
            matcher.run(pair, range)
        };
        let Matched { plan, tiles, iterations, ran_on, mut traffic, cells, .. } = run(false)?;
        let (mut runs_ms, mut processor, mut timed) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..self.args.repeats {
            let (start, before) = (Instant::now(), processor_time());
            traffic = run(false)?.traffic;
            runs_ms.push(ms(start.elapsed()));
            processor
                .extend(processor_time().zip(before).map(|(after, before)| ms(after.saturating_sub(before))));
            timed.push(run(true)?.timings);
        }
        let peak_bytes = peak_memory();
        drop(matcher);
        let copy_gb_per_s = giga(match self.device {
            DeviceChoice::Cpu => threads::run(Cpu::copy_rate),
            device => Gpu::new(name(device))?.copy_rate()?,
        });
        let message_time = |timings: &Vec<Timing>| ms(messages(&plan, timings).map(|(_, t)| t.time).sum());
        let message_ms = median(timed.iter().map(message_time));
        let stages = timed[0].iter().enumerate().map(|(i, timing)| {
            (stage_and_level(timing), median(timed.iter().map(|timings| ms(timings[i].time))))
        });
        // Sum over all tiles; every tile has run equally often.
        let counted = |of: &dyn Fn(Stage) -> u64| -> u64 {
            let counts = messages(&plan, &timed[0])
                .map(|(stage, timing)| u64::from(timing.runs) * of(stage) / tiles.count() as u64);
            counts.sum()
        };
        let of_tiles =
            |of: &dyn Fn(&Plan) -> u64| tiles.list().iter().map(|tile| of(&tile.plan)).sum::<u64>();
        let label_updates = counted(&|stage| of_tiles(&|plan| roofline::label_updates(plan, stage)));
        let message_bytes = counted(&|stage| roofline::bytes(&plan, stage, &cells));
        let kept = cells.iter().enumerate().map(|(z, &kept)| {
            let all = of_tiles(&|plan| plan.levels[z].cells());
            100.0 * kept as f64 / all as f64
        });
        let of_device = |count: u64| (traffic.bytes_held > 0).then_some(count);
        let median_ms = median(runs_ms.iter().copied());
        let giga_per_s = |count: u64, ms: f64| giga(1000.0 * count as f64 / ms);
        let message_gb_per_s = giga_per_s(message_bytes, message_ms);
        Ok(Figures {
            ran_on,
            iterations,
            labels_kept: kept.collect(),
            median_ms,
            min_ms: runs_ms.iter().copied().fold(f64::INFINITY, f64::min),
            max_ms: runs_ms.iter().copied().fold(0.0, f64::max),
            processor_ms: (!processor.is_empty()).then(|| median(processor)),
            stages: stages.collect(),
            message_ms,
            label_updates,
            message_gupdates_per_s: giga_per_s(label_updates, message_ms),
            match_gupdates_per_s: giga_per_s(label_updates, median_ms),
            message_bytes,
            message_gb_per_s,
            copy_gb_per_s,
            copy_share: 100.0 * message_gb_per_s / copy_gb_per_s,
            plan_bytes: if traffic.bytes_held > 0 { tiles.bytes_on_device() } else { tiles.bytes() },
            peak_bytes,
            device_bytes: of_device(traffic.bytes_held),
            dispatches: of_device(traffic.dispatches),
            submissions: of_device(traffic.submissions),
            bytes_up: of_device(traffic.bytes_up),
            bytes_down: of_device(traffic.bytes_down),
            runs_ms,
        })
    }
}

/// A device as written after --device.
fn word(device: &DeviceChoice) -> &str {
    match device {
        DeviceChoice::Auto => "auto",
        DeviceChoice::Cpu => "cpu",
        DeviceChoice::Gpu => "gpu",
        DeviceChoice::Named(name) => name,
    }
}

/// The index or name of a named device.
pub(super) fn name(device: &DeviceChoice) -> Option<&str> {
    matches!(device, DeviceChoice::Named(_)).then(|| word(device))
}

/// The message stages among `timings`.
fn messages<'a>(plan: &Plan, timings: &'a [Timing]) -> impl Iterator<Item = (Stage, &'a Timing)> {
    roofline::message_stages(plan).filter_map(|stage| {
        Some((stage, timings.iter().find(|t| (t.stage, t.level) == (stage.name(), stage.level()))?))
    })
}

fn ms(time: Duration) -> f64 {
    1000.0 * time.as_secs_f64()
}

fn giga(count: f64) -> f64 {
    count / 1e9
}

/// The median of at least one value.
fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len() % 2 == 1 { values[middle] } else { f64::midpoint(values[middle - 1], values[middle]) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_lie_in_the_middle() {
        for (values, expected) in [(&[3.0][..], 3.0), (&[5.0, 1.0, 4.0], 4.0), (&[8.0, 1.0, 4.0, 2.0], 3.0)] {
            assert!((median(values.iter().copied()) - expected).abs() < 1e-12, "{values:?}");
        }
    }
}
