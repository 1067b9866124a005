//! Every parameter that determines the bits of the result ([`Method`]), and apart from it what does not
//! ([`Execution`]).
//!
//! A [`Method`] is read from TOML or set key by key; [`keys`] lists each key with its unit, meaning and source.
//! "Section 4.1" and the like are of Shabanian and Balasubramanian, *Multi-Resolution Factor Graph Based Stereo
//! Correspondence Algorithm*; where a meaning says "open", the paper leaves the matter open and the choice is
//! this project's.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The disparities to search, in pixels, both ends included.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct DisparityRange {
    /// Smallest disparity; may be negative.
    pub min: i32,
    /// Largest disparity, at least `min`.
    pub max: i32,
}

/// Most labels of a range: what 16-bit label indices and every device's limits allow.
pub const MAX_LABELS: usize = 16_384;
/// Largest absolute disparity: the fixed-point maps hold 1/256 px in 32 bits with room for differences.
pub const MAX_DISPARITY: i32 = 1 << 20;

impl DisparityRange {
    /// The range `min ..= max`.
    ///
    /// # Errors
    /// [`Error::Option`] when it is empty, or beyond [`MAX_LABELS`] or [`MAX_DISPARITY`].
    pub fn new(min: i32, max: i32) -> Result<Self> {
        if min > max {
            return Err(Error::option(
                "--max-disparity",
                format!("{max} is below the minimum disparity {min}: raise it or lower --min-disparity"),
            ));
        }
        if min < -MAX_DISPARITY || max > MAX_DISPARITY {
            return Err(Error::option(
                "--max-disparity",
                format!("disparities beyond {MAX_DISPARITY} px are not supported"),
            ));
        }
        let labels = i64::from(max) - i64::from(min) + 1;
        if labels > MAX_LABELS as i64 {
            return Err(Error::option(
                "--max-disparity",
                format!("{min} ..= {max} is {labels} labels; at most {MAX_LABELS} are supported"),
            ));
        }
        Ok(Self { min, max })
    }

    /// Number of labels.
    #[must_use]
    pub fn labels(self) -> usize {
        (self.max - self.min + 1) as usize
    }
}

/// Matching cost of a pixel and a label.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Cost {
    /// Mean of the absolute colour difference over a square window (section 3.4), in 8-bit levels.
    Sad,
    /// (1 - exp(-AD / 10)) + (1 - exp(-Hamming / 30)) with the colour difference AD and a 9 x 7 census
    /// (Mei et al. 2011), between 0 and 2.
    AdCensus,
}

/// How a level's cost volume comes from the next finer one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pyramid {
    /// Binomial low-pass in x, y and d, then every second sample of each (Burt and Adelson 1983).
    LowPass,
    /// Binomial low-pass in x and y; in d the minimum over the labels within one of twice the coarse label.
    Minimum,
}

/// Potential of a factor whose members disagree, against 1 where they agree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Potential {
    /// exp(-cut), with each message cut after its minimum is taken off, so that a factor whose members
    /// disagree still speaks.
    Soft,
    /// exp(-cut) exactly: the P^n Potts model (Kohli et al. 2007).
    Exact,
    /// 0, as the paper has it (section 3.2), up to a cap that acts only on labels long out of the race.
    Hard,
}

/// Which fine and coarse labels agree in a resolution factor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Resolution {
    /// d = 2 z (section 3.2): an odd label agrees with none.
    Strict,
    /// |d - 2 z| <= 1: an odd label agrees with both its coarse neighbours.
    Interpolating,
}

/// The order in which levels exchange messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Schedule {
    /// All levels in every iteration (algorithm 1).
    Together,
    /// The coarsest level first, then with each finer one added all levels so far.
    CoarseFirst,
}

/// What becomes of the pixels that are invalid after visibility and region filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fill {
    /// They stay invalid.
    None,
    /// The smaller of the nearest valid disparities to the left and to the right on the row.
    Row,
}

/// Which pixels the weighted median touches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Median {
    /// None.
    Off,
    /// Those that were filled.
    Filled,
    /// All.
    All,
}

macro_rules! method {
    ($( $field:ident: $type:ty, $unit:literal, $meaning:literal; )*) => {
        /// Every parameter that determines the bits of the result, given the pair and the range.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(rename_all = "kebab-case", deny_unknown_fields)]
        #[non_exhaustive]
        pub struct Method {
            $( #[doc = $meaning] #[doc = concat!("\n\nUnit: ", $unit, ".")] pub $field: $type, )*
        }

        const KEYS: &[(&str, &str, &str)] = &[ $( (stringify!($field), $unit, $meaning), )* ];
    };
}

method! {
    cost: Cost, "sad | ad-census", "Matching cost. The paper's is the SAD (section 3.4).";
    sad_window: u32, "pixels, odd, 1 to 31", "Side of the SAD window (section 4.1: 7).";
    outside_cost: f64, "the cost's own",
        "Cost of a label that falls outside the right image or on a masked pixel: the same for each, so that \
         none is preferred (open).";
    temperature: f64, "cost per nat", "Cost that makes a label one nat less likely: evidence = cost / temperature \
         (equation 6 read in the logarithmic domain; open).";
    evidence_cap: f64, "nats, up to 63.75", "Largest evidence against a label.";
    evidence_gain: f64, "factor per level, 1 to 4", "How much surer the evidence of a level is than that of the next \
         finer one, being a mean over more pixels (open).";
    pyramid: Pyramid, "low-pass | minimum", "How a level's cost volume comes from the next finer one (section 3.4: \
         low-pass).";
    levels: u32, "levels, 1 to 16", "Resolution levels; fewer where the image is too small for them (open).";
    percentile: f64, "percent, 0 to 100", "Bilateral coefficients at or above this percentile make a pixel a \
         neighbour (section 4.1: 97), taken over the 48 pixels around the centre.";
    sigma_space: f64, "pixels", "Domain parameter of the bilateral coefficients (section 4.1: 3).";
    sigma_range: f64, "of the intensity range 0 to 1", "Range parameter of the bilateral coefficients (section 4.1: \
         0.1).";
    potential: Potential, "soft | exact | hard", "Potential of factors whose members disagree (section 3.2: hard).";
    dependency_cut: f64, "nats, up to 255.75", "What disagreement costs in a dependency factor; not used by hard \
         potentials.";
    resolution: Resolution, "strict | interpolating", "Which labels of two levels agree (section 3.2: strict).";
    resolution_cut: f64, "nats, up to 255.75", "What disagreement costs in a resolution factor; not used by hard \
         potentials.";
    schedule: Schedule, "together | coarse-first", "Order of the flooding (algorithm 1: together).";
    iterations: u32, "iterations, 1 to 1000", "Iterations of all levels together, or after each added level but the \
         finest (section 4: 20 to 30).";
    final_iterations: u32, "iterations, 0 to 1000", "Iterations once the finest level has joined; not used by the \
         schedule together.";
    tolerance: f64, "pixels", "Stop when the RMS change of the finest map from one iteration to the next is at most \
         this; 0 runs all iterations (algorithm 1).";
    visibility: bool, "true | false", "Compare with the map of the right view, read off the same beliefs, and call \
         what disagrees by more than one pixel occluded (the paper does without).";
    region_size: u32, "pixels", "Regions smaller than this become invalid; 0 keeps all (open).";
    sub_pixel: bool, "true | false", "Place the disparity between the labels, by the matching cost around the optimum \
         (open).";
    fill: Fill, "none | row", "What becomes of invalid pixels.";
    median: Median, "off | filled | all", "Which pixels the weighted median touches (section 3.5).";
    median_window: u32, "pixels, odd, 3 to 31", "Side of the median's window (open).";
    median_sigma_space: f64, "pixels", "Spatial parameter of the median's weights (open).";
    median_sigma_range: f64, "of the intensity range 0 to 1", "Range parameter of the median's weights (open).";
    confidence_floor: u32, "0 to 255", "Confidence below this sets the validity flag for low confidence.";
}

/// Every key of [`Method`], in order.
#[must_use]
pub fn keys() -> Vec<(String, &'static str, &'static str)> {
    KEYS.iter().map(|&(name, unit, meaning)| (name.replace('_', "-"), unit, meaning)).collect()
}

/// Names of the presets, with what each is for.
pub const PRESETS: &[(&str, &str)] = &[
    ("default", "the best this engine does"),
    ("paper", "the paper's choices wherever it states them, from the cost volume on"),
];

impl Default for Method {
    fn default() -> Self {
        Self {
            cost: Cost::AdCensus,
            sad_window: 7,
            outside_cost: 0.8,
            temperature: 0.5,
            evidence_cap: 8.0,
            evidence_gain: 4.0,
            pyramid: Pyramid::Minimum,
            levels: 6,
            percentile: 92.0,
            sigma_space: 3.0,
            sigma_range: 0.2,
            potential: Potential::Soft,
            dependency_cut: 2.0,
            resolution: Resolution::Interpolating,
            resolution_cut: 4.0,
            schedule: Schedule::CoarseFirst,
            iterations: 5,
            final_iterations: 3,
            tolerance: 0.0,
            visibility: true,
            region_size: 200,
            sub_pixel: true,
            fill: Fill::Row,
            median: Median::All,
            median_window: 15,
            median_sigma_space: 5.0,
            median_sigma_range: 0.1,
            confidence_floor: 16,
        }
    }
}

impl Method {
    /// The preset called `name`, one of [`PRESETS`].
    ///
    /// # Errors
    /// [`Error::Option`] when there is no such preset.
    pub fn preset(name: &str) -> Result<Self> {
        match name {
            "default" => Ok(Self::default()),
            "paper" => Ok(Self {
                cost: Cost::Sad,
                outside_cost: 20.0,
                temperature: 4.0,
                evidence_cap: 63.75,
                evidence_gain: 1.0,
                pyramid: Pyramid::LowPass,
                percentile: 97.0,
                sigma_range: 0.1,
                potential: Potential::Hard,
                resolution: Resolution::Strict,
                schedule: Schedule::Together,
                iterations: 30,
                tolerance: 0.1,
                visibility: false,
                region_size: 0,
                sub_pixel: false,
                ..Self::default()
            }),
            _ => {
                let names: Vec<_> = PRESETS.iter().map(|p| p.0).collect();
                Err(Error::option(
                    "--preset",
                    format!("there is no preset `{name}`; there are {}", names.join(", ")),
                ))
            }
        }
    }

    /// Sets `key` to `value`, both as a user writes them (`levels`, `4`).
    ///
    /// # Errors
    /// [`Error::Option`] naming the key when there is no such key or the value does not fit it.
    pub fn set(&mut self, key: &str, value: &str) -> Result<()> {
        // Bare words (`cost=sad`) are strings, everything else is TOML already.
        let text = [format!("{key} = {value}"), format!("{key} = \"{value}\"")];
        let table = text.iter().find_map(|t| t.parse::<toml::Table>().ok()).ok_or_else(|| {
            Error::option(format!("--set {key}"), format!("cannot understand the value `{value}`"))
        })?;
        *self = self.merged(table).map_err(|e| Error::option(format!("--set {key}"), e))?;
        Ok(())
    }

    /// Sets every key that the TOML file `path` holds.
    ///
    /// # Errors
    /// [`Error::Read`] when the file cannot be read, is no TOML, or holds a key or a value that does not fit.
    pub fn load(&mut self, path: &Path) -> Result<()> {
        let text = std::fs::read_to_string(path).map_err(|e| Error::read(path, e))?;
        let table = text.parse::<toml::Table>().map_err(|e| Error::read(path, one_line(&e)))?;
        *self = self.merged(table).map_err(|e| Error::read(path, e))?;
        Ok(())
    }

    /// This method with the keys of `changes` replaced.
    fn merged(&self, changes: toml::Table) -> std::result::Result<Self, String> {
        let mut table = self.table();
        for (key, value) in changes {
            let Some(old) = table.get(&key) else {
                return Err(format!("there is no key `{key}`; `mrfgs presets` lists them"));
            };
            // A whole number is a fine value for a real parameter.
            let value = match (old, value) {
                (toml::Value::Float(_), toml::Value::Integer(i)) => toml::Value::Float(i as f64),
                (_, value) => value,
            };
            let unit = keys().into_iter().find(|k| k.0 == key).map_or("", |k| k.1);
            table.insert(key.clone(), value.clone());
            table
                .clone()
                .try_into::<Self>()
                .map_err(|_| format!("`{key}` cannot be {value}; it takes {unit}"))?;
        }
        let method: Self = table.try_into().map_err(|e| one_line(&e))?;
        method.validated().map_err(|e| e.to_string())
    }

    /// All keys with their values.
    ///
    /// # Panics
    /// Never: every field is a plain value.
    #[must_use]
    pub fn table(&self) -> toml::Table {
        toml::Table::try_from(self).expect("plain values serialise")
    }

    /// This method, if every value is in its range.
    ///
    /// # Errors
    /// [`Error::Option`] naming the first key that is out of its range, and the range.
    pub fn validated(self) -> Result<Self> {
        let table = self.table();
        let within = |name: &str, low: f64, high: f64| {
            let value = match &table[name] {
                toml::Value::Float(v) => *v,
                toml::Value::Integer(v) => *v as f64,
                _ => unreachable!("only numbers have ranges"),
            };
            if value >= low && value <= high {
                Ok(())
            } else {
                Err(Error::option(name, format!("{value} is outside {low} to {high}")))
            }
        };
        let odd = |name: &str, value: u32| {
            if value % 2 == 1 { Ok(()) } else { Err(Error::option(name, format!("{value} is not odd"))) }
        };
        within("sad-window", 1.0, 31.0)?;
        odd("sad-window", self.sad_window)?;
        within("outside-cost", 0.0, if self.cost == Cost::Sad { 254.0 } else { 2.0 })?;
        within("temperature", 1e-3, 1e6)?;
        within("evidence-cap", 0.25, 63.75)?;
        within("evidence-gain", 1.0, 4.0)?;
        within("levels", 1.0, 16.0)?;
        within("percentile", 0.0, 100.0)?;
        within("sigma-space", 0.1, 100.0)?;
        within("sigma-range", 1e-3, 10.0)?;
        within("dependency-cut", 0.25, 255.75)?;
        within("resolution-cut", 0.25, 255.75)?;
        within("iterations", 1.0, 1000.0)?;
        within("final-iterations", 0.0, 1000.0)?;
        within("tolerance", 0.0, 1e6)?;
        within("median-window", 3.0, 31.0)?;
        odd("median-window", self.median_window)?;
        within("median-sigma-space", 0.1, 100.0)?;
        within("median-sigma-range", 1e-3, 10.0)?;
        within("confidence-floor", 0.0, 255.0)?;
        Ok(self)
    }
}

/// The first line of a message, for errors that must be one line.
fn one_line(e: &impl ToString) -> String {
    e.to_string().lines().map(str::trim).filter(|l| !l.is_empty()).collect::<Vec<_>>().join(" ")
}

/// Which backend runs the stages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Choice {
    /// A discrete GPU, else an integrated one, else the CPU path.
    #[default]
    Auto,
    /// A GPU, or any Vulkan or Metal driver: an error where there is none.
    Gpu,
    /// The CPU path.
    Cpu,
}

/// Where and how the work runs; nothing here changes a bit of the result.
#[derive(Clone, Debug, Default)]
pub struct Execution {
    /// Which backend.
    pub backend: Choice,
    /// An adapter, by its index in `mrfgs devices` or a part of its name.
    pub device: Option<String>,
    /// Threads of the CPU path; `None` takes one a core.
    pub threads: Option<usize>,
}
