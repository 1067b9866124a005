//! The results of a bench, as JSON and as text.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

use mrfgs::options::Method;
use serde::{Deserialize, Serialize};

use crate::table::Table;
use crate::text::{bytes, figure, plural};

/// All results. The help explains the fields.
#[derive(Serialize, Deserialize)]
pub(super) struct Findings {
    pub(super) version: String,
    pub(super) threads: usize,
    pub(super) repeats: u16,
    pub(super) methods: BTreeMap<String, Method>,
    pub(super) pairs: Vec<Row>,
}

/// One pair by one method.
#[derive(Serialize, Deserialize)]
pub(super) struct Row {
    pub(super) name: String,
    pub(super) method: String,
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) labels: usize,
    pub(super) devices: BTreeMap<String, Option<Figures>>,
}

/// The figures of one device.
#[derive(Serialize, Deserialize)]
pub(super) struct Figures {
    pub(super) ran_on: String,
    pub(super) iterations: u32,
    pub(super) labels_kept: Vec<f64>,
    pub(super) median_ms: f64,
    pub(super) min_ms: f64,
    pub(super) max_ms: f64,
    pub(super) runs_ms: Vec<f64>,
    pub(super) processor_ms: Option<f64>,
    pub(super) stages: BTreeMap<String, f64>,
    pub(super) message_ms: f64,
    pub(super) label_updates: u64,
    pub(super) message_gupdates_per_s: f64,
    pub(super) match_gupdates_per_s: f64,
    pub(super) message_bytes: u64,
    pub(super) message_gb_per_s: f64,
    pub(super) copy_gb_per_s: f64,
    pub(super) copy_share: f64,
    pub(super) plan_bytes: u64,
    pub(super) peak_bytes: Option<u64>,
    pub(super) device_bytes: Option<u64>,
    pub(super) dispatches: Option<u64>,
    pub(super) submissions: Option<u64>,
    pub(super) bytes_up: Option<u64>,
    pub(super) bytes_down: Option<u64>,
}

/// A line of the table: its name, and the text for the figures of a device.
type Line = (&'static str, fn(&Figures) -> String);

const LINES: [Line; 21] = [
    ("match, median (ms)", |f| format!("{:.1}", f.median_ms)),
    ("  least", |f| format!("{:.1}", f.min_ms)),
    ("  most", |f| format!("{:.1}", f.max_ms)),
    ("  processor time", |f| figure(f.processor_ms, 1)),
    ("message stages (ms)", |f| format!("{:.1}", f.message_ms)),
    ("iterations", |f| f.iterations.to_string()),
    ("labels kept, from level 0 up (%)", |f| {
        let kept: Vec<_> = f.labels_kept.iter().map(|share| format!("{share:.0}")).collect();
        kept.join(" ")
    }),
    ("label updates (G)", |f| format!("{:.2}", giga(f.label_updates))),
    ("  per second of the message stages", |f| format!("{:.2}", f.message_gupdates_per_s)),
    ("  per second of the match", |f| format!("{:.2}", f.match_gupdates_per_s)),
    ("message stages move at least (GB)", |f| format!("{:.2}", giga(f.message_bytes))),
    ("  per second of their time", |f| format!("{:.1}", f.message_gb_per_s)),
    ("  share of the copy rate (%)", |f| format!("{:.0}", f.copy_share)),
    ("copy rate (GB/s)", |f| format!("{:.1}", f.copy_gb_per_s)),
    ("memory: plan", |f| size(Some(f.plan_bytes))),
    ("  peak of the process", |f| size(f.peak_bytes)),
    ("  buffers on the device", |f| size(f.device_bytes)),
    ("dispatches of a match", |f| count(f.dispatches)),
    ("  submissions", |f| count(f.submissions)),
    ("  bytes to the device", |f| size(f.bytes_up)),
    ("  bytes from the device", |f| size(f.bytes_down)),
];

fn size(count: Option<u64>) -> String {
    count.map_or_else(|| "-".into(), bytes)
}

fn count(count: Option<u64>) -> String {
    count.map_or_else(|| "-".into(), |count| count.to_string())
}

fn giga(count: u64) -> f64 {
    count as f64 / 1e9
}

impl Findings {
    /// The table for a terminal, with the devices side by side.
    pub(super) fn text(&self) -> String {
        let (repeats, ending) = (self.repeats, plural(self.repeats.into()));
        let mut out =
            format!("mrfgs {}, {repeats} repeat{ending} after one match to warm up\n", self.version);
        for row in &self.pairs {
            let Row { name, method, width, height, labels, devices } = row;
            let ending = plural(*labels);
            let _ =
                writeln!(out, "\n{name}, method {method}: {width} x {height} pixels, {labels} label{ending}");
            for (device, figures) in devices {
                let ran_on = figures.as_ref().map_or("skipped: too little memory", |f| &f.ran_on);
                let _ = writeln!(out, "{device}: {ran_on}");
            }
            if devices.values().any(Option::is_some) {
                let _ = write!(out, "\n{}", row.table());
            }
        }
        out
    }
}

impl Row {
    fn table(&self) -> Table {
        let mut table = Table::new(&format!("l{}", "|r".repeat(self.devices.len())));
        table.row(std::iter::once("").chain(self.devices.keys().map(String::as_str)));
        table.rule();
        for (name, text) in LINES {
            let cell = |figures: &Option<Figures>| figures.as_ref().map_or_else(|| "-".into(), text);
            table.row(std::iter::once(name.to_owned()).chain(self.devices.values().map(cell)));
        }
        table.rule();
        table.row(["stages, all levels (ms)"]);
        let all = self.devices.values().flatten().flat_map(|f| f.stages.keys()).map(|name| stage(name));
        let all: BTreeSet<&str> = all.collect();
        let time = |figures: &Option<Figures>, wanted: &str| {
            let of_stage = figures.as_ref()?.stages.iter().filter(|(name, _)| stage(name) == wanted);
            // Backends time a sweep as a whole or in parts.
            of_stage.map(|(_, ms)| *ms).reduce(|sum, ms| sum + ms)
        };
        let times = |stage| self.devices.values().map(|figures| time(figures, stage)).collect::<Vec<_>>();
        let mut stages: Vec<_> = all.into_iter().map(|stage| (stage, times(stage))).collect();
        // The slowest first.
        let sum = |(_, times): &(&str, Vec<Option<f64>>)| times.iter().flatten().sum::<f64>();
        stages.sort_by(|a, b| sum(b).total_cmp(&sum(a)));
        for (stage, times) in stages {
            let times = times.into_iter().map(|ms| figure(ms, 2));
            table.row(std::iter::once(format!("  {stage}")).chain(times));
        }
        table
    }
}

/// The stage of a name such as "dependency, level 0".
fn stage(name: &str) -> &str {
    name.split(',').next().unwrap_or(name)
}
