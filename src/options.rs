//! Every parameter that determines the bits of the result ([`Method`]), and apart from it what does not
//! ([`Execution`]).
//!
//! A [`Method`] is read from TOML or set key by key; [`keys`] lists each key with its unit, meaning and source.
//! "Section 3.1" and the like are of Shabanian and Balasubramanian, *Multi-Resolution Factor Graph Based Stereo
//! Correspondence Algorithm*; where a meaning says "open", the paper leaves the matter open and the choice is
//! this project's.

use crate::error::{Error, OptionError, RangeError, ReadError, Result};
use crate::text;
use crate::text::one_line;
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
/// Most memory that a match may be given, in MiB: 16 TiB.
pub const MAX_MEMORY: u32 = 1 << 24;
/// A config file is a few dozen lines; no more than this is read of one.
const MAX_CONFIG_BYTES: u64 = 1 << 20;
/// Largest absolute disparity: the fixed-point maps hold 1/256 px in 32 bits with room for differences.
pub const MAX_DISPARITY: i32 = 1 << 20;

impl DisparityRange {
    /// The range `min ..= max`.
    ///
    /// # Errors
    /// [`Error::Range`] when it is empty, or beyond [`MAX_LABELS`] or [`MAX_DISPARITY`].
    pub fn new(min: i32, max: i32) -> Result<Self> {
        if min > max {
            return Err(RangeError::Empty { min, max }.into());
        }
        if min < -MAX_DISPARITY || max > MAX_DISPARITY {
            let disparity = if max > MAX_DISPARITY { max } else { min };
            return Err(RangeError::TooFar { disparity, limit: MAX_DISPARITY }.into());
        }
        if i64::from(max) - i64::from(min) >= MAX_LABELS as i64 {
            return Err(RangeError::TooManyLabels { min, max, limit: MAX_LABELS }.into());
        }
        Ok(Self { min, max })
    }

    /// The range, if any disparity of it leads from some pixel to another within images of `width` columns.
    ///
    /// # Errors
    /// [`Error::Range`] when none does.
    pub fn within(self, width: usize) -> Result<Self> {
        let Self { min, max } = self;
        let reach = i32::try_from(width).unwrap_or(i32::MAX);
        if min >= reach || max <= -reach {
            Err(RangeError::OutsideImages { min, max, width }.into())
        } else {
            Ok(self)
        }
    }

    /// Number of labels.
    #[must_use]
    pub fn labels(self) -> usize {
        (self.max - self.min + 1) as usize
    }
}

/// Correction of the illumination.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Illumination {
    /// None.
    None,
    /// A homomorphic filter: log, minus low-pass, exp.
    Homomorphic,
}

/// Matching cost of a pixel and a label.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Cost {
    /// Mean of the absolute colour difference over a square window (section 2.4), in 8-bit levels.
    Sad,
    /// Hamming distance of 9 x 7 censuses (Zabih and Woodfill 1994), a 32nd a bit, at most 1.25.
    Census,
    /// That plus the colour difference, at most 0.375 and less where the left image has little contrast: on a plain
    /// surface colour changes with the light alone, and misleads (after Mei et al. 2011, who weigh both alike).
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
    /// 0, as the paper has it (section 2.2), up to a cap that acts only on labels long out of the race.
    Hard,
}

/// Which fine and coarse labels agree in a resolution factor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Resolution {
    /// d = 2 z (section 2.2): an odd label agrees with none.
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
    /// The coarsest level first, then with each finer one added all levels so far; in the end level 0 and the coarser ones
    /// in turns, as far as that still changes the result.
    CoarseFirst,
}

/// How the map of the right view is found, with which the disparities are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LeftRightCheck {
    /// It is not: no comparison (the paper, section 2.5).
    Off,
    /// Off the same beliefs: the right pixel takes the best of the labels that see it.
    RightView,
    /// By a second matching with the views exchanged: the left-right check of the paper's predecessor.
    SecondMatch,
}

/// What becomes of the pixels that are invalid after left-right check and region filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fill {
    /// They stay invalid.
    None,
    /// The smaller of the nearest valid disparities to the left and to the right on the row.
    Row,
    /// The same, then the weighted median over a window four times as wide and high, so that what is filled follows the
    /// colours around it and not its row alone.
    Median,
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
    illumination: Illumination, "none | homomorphic", "Correction of both images before all else (sections 2.4 and 3.1: \
         homomorphic filter, 21 x 21).";
    zones: u32, "zones, 1 to 64", "Texture zones of the reference image, by K-means of Gabor responses; used where label_range \
         is (section 3.1: 15).";
    zone_sigmas: f64, "standard deviations, 0 to 100", "Labels of a pixel are limited to the mean disparity of its zone's sparse \
         matches and this many standard deviations on either side; 0 keeps all labels (section 2.4: 1).";
    cost: Cost, "sad | census | ad-census", "Matching cost. The paper's is the SAD (section 2.4).";
    sad_window: u32, "pixels, odd, 1 to 31", "Side of the SAD window (section 3.1: 7).";
    colour_contrast: f64, "8-bit levels, 0 to 128", "Standard deviation of grey around a pixel from which on colour counts \
         in full; below, its weight falls with the variance. Used by ad-census.";
    outside_cost: f64, "the cost's own",
        "Cost of a label that falls outside the right image or on a masked pixel: the same for each, so that \
         none is preferred (open).";
    temperature: f64, "cost per nat", "Cost that makes a label one nat less likely: evidence = cost / temperature \
         (equation 5 read in the logarithmic domain; open).";
    evidence_cap: f64, "nats, up to 63.75", "Largest evidence against a label.";
    evidence_gain: f64, "factor per level, 1 to 4", "How much surer the evidence of a level is than that of the next \
         finer one, being a mean over more pixels (open).";
    pyramid: Pyramid, "low-pass | minimum", "How a level's cost volume comes from the next finer one (section 2.4: \
         low-pass).";
    levels: u32, "levels, 1 to 16", "Resolution levels; fewer where the image is too small for them (open).";
    percentile: f64, "percent, 0 to 100", "Bilateral coefficients at or above this percentile make a pixel a \
         neighbour (section 3.1: 97), taken over the 48 pixels around the centre.";
    sigma_space: f64, "pixels", "Domain parameter of the bilateral coefficients (section 3.1: 3).";
    sigma_range: f64, "of the intensity range 0 to 1", "Range parameter of the bilateral coefficients (section 3.1: \
         0.1).";
    potential: Potential, "soft | exact | hard", "Potential of factors whose members disagree (section 2.2: hard).";
    dependency_truncation: f64, "nats, up to 255.75", "What disagreement costs in a dependency factor; not used by hard \
         potentials.";
    resolution: Resolution, "strict | interpolating", "Which labels of two levels agree (section 2.2: strict).";
    resolution_truncation: f64, "nats, up to 255.75", "What disagreement costs in a resolution factor; not used by hard \
         potentials.";
    schedule: Schedule, "together | coarse-first", "Order of the flooding (algorithm 1: together).";
    iterations: u32, "iterations, 1 to 1000", "Iterations of all levels together, or of all levels so far after each \
         added one but the finest (section 3: 20 to 30).";
    final_iterations: u32, "iterations, 0 to 1000", "Iterations once the finest level has joined: every second one with the \
         messages between levels, the others with those of the coarser levels; not used by the schedule together.";
    tolerance: f64, "pixels", "Stop when the RMS change of the finest map from one iteration to the next is at most \
         this; 0 runs all iterations (algorithm 1).";
    left_right_check: LeftRightCheck, "off | right-view | second-match", "Compare with the map of the right view, and call what \
         disagrees by more than one pixel occluded (the paper does without).";
    speckle_size: u32, "pixels", "Regions smaller than this become invalid; 0 keeps all (open).";
    sub_pixel: bool, "true | false", "Place the disparity between the labels, by the matching cost around the optimum \
         (open).";
    fill: Fill, "none | row | median", "What becomes of invalid pixels.";
    median: Median, "off | filled | all", "Which pixels the weighted median touches (section 2.5).";
    median_window: u32, "pixels, odd, 3 to 31", "Side of the median's window, of which every second row is seen (open).";
    median_sigma_space: f64, "pixels", "Spatial parameter of the median's weights (open).";
    median_sigma_range: f64, "of the intensity range 0 to 1", "Range parameter of the median's weights (open).";
    confidence_floor: u32, "0 to 255", "Confidence below this sets the validity flag for low confidence.";
    memory: u32, "MiB, 1 to 16777216", "Memory that a match may take. A pair that needs more is matched tile by tile, and \
         the maps differ a little from those of a match in one piece; where it is cut follows from size, range and method \
         alone.";
}

/// Every key of [`Method`], in order.
#[must_use]
pub fn keys() -> Vec<(String, &'static str, &'static str)> {
    KEYS.iter().map(|&(name, unit, meaning)| (name.replace('_', "-"), unit, meaning)).collect()
}

/// Names of the presets, with what each is for.
pub const PRESETS: &[(&str, &str)] = &[
    ("default", "the best this engine does"),
    ("paper", "the paper's whole method, with its choices wherever it states them"),
    ("fgs", "the paper's predecessor: one resolution, and a left-right check by a second matching"),
];

impl Default for Method {
    fn default() -> Self {
        Self {
            illumination: Illumination::None,
            zones: 15,
            zone_sigmas: 0.0,
            cost: Cost::AdCensus,
            sad_window: 7,
            colour_contrast: 5.0,
            outside_cost: 0.7,
            temperature: 0.25,
            evidence_cap: 8.0,
            evidence_gain: 4.0,
            pyramid: Pyramid::Minimum,
            levels: 6,
            percentile: 97.0,
            sigma_space: 3.0,
            sigma_range: 0.1,
            potential: Potential::Soft,
            dependency_truncation: 2.0,
            resolution: Resolution::Interpolating,
            resolution_truncation: 3.0,
            schedule: Schedule::CoarseFirst,
            iterations: 3,
            final_iterations: 3,
            tolerance: 0.0,
            left_right_check: LeftRightCheck::RightView,
            speckle_size: 200,
            sub_pixel: true,
            fill: Fill::Median,
            median: Median::All,
            median_window: 15,
            median_sigma_space: 5.0,
            median_sigma_range: 0.1,
            confidence_floor: 16,
            memory: 4096,
        }
    }
}

impl Method {
    /// The preset called `name`, one of [`PRESETS`].
    ///
    /// # Errors
    /// [`Error::Preset`] when there is no such preset.
    pub fn preset(name: &str) -> Result<Self> {
        match name {
            "default" => Ok(Self::default()),
            "paper" => Ok(Self {
                illumination: Illumination::Homomorphic,
                zone_sigmas: 1.0,
                cost: Cost::Sad,
                outside_cost: 20.0,
                temperature: 0.5,
                evidence_cap: 63.75,
                evidence_gain: 1.0,
                pyramid: Pyramid::LowPass,
                potential: Potential::Hard,
                resolution: Resolution::Strict,
                schedule: Schedule::Together,
                iterations: 30,
                tolerance: 0.1,
                left_right_check: LeftRightCheck::Off,
                speckle_size: 0,
                sub_pixel: false,
                fill: Fill::Row,
                ..Self::default()
            }),
            "fgs" => Ok(Self {
                levels: 1,
                left_right_check: LeftRightCheck::SecondMatch,
                ..Self::preset("paper")?
            }),
            _ => {
                let known = PRESETS.iter().map(|p| p.0).collect();
                Err(Error::Preset { name: one_line(name), known })
            }
        }
    }

    /// Sets `key` to `value`, both as a user writes them (`levels`, `4`).
    ///
    /// # Errors
    /// [`Error::Option`] naming the key when there is no such key or the value does not fit it.
    pub fn set(&mut self, key: &str, value: &str) -> Result<()> {
        self.set_all([(key, value)])
    }

    /// Sets each key to its value, the last one where a key comes twice. What depends on two keys is checked once
    /// all are set, so that their order does not matter.
    ///
    /// # Errors
    /// As [`Method::set`].
    pub fn set_all<'a>(&mut self, pairs: impl IntoIterator<Item = (&'a str, &'a str)>) -> Result<()> {
        // Bare words (`cost=sad`) are strings, everything else is TOML already.
        let value = |text: &str| match format!("value = {text}").parse::<toml::Table>() {
            Ok(mut table) if table.len() == 1 => table.remove("value"),
            _ => None,
        };
        let changes = pairs
            .into_iter()
            .map(|(key, text)| (key.to_owned(), value(text).unwrap_or_else(|| text.into())))
            .collect();
        *self = self.merged(changes).map_err(|(key, cause)| Error::option(one_line(&key), cause))?;
        Ok(())
    }

    /// Sets every key that the TOML file `path` holds.
    ///
    /// # Errors
    /// [`Error::Read`] when the file cannot be read, is no TOML, or holds a key or a value that does not fit; it names
    /// the line.
    pub fn load(&mut self, path: &Path) -> Result<()> {
        let text = String::from_utf8(text::read(path, MAX_CONFIG_BYTES, "config file")?)
            .map_err(|_| Error::read(path, "is no text; give a TOML file"))?;
        let line = |at: usize| text[..at].matches('\n').count() + 1;
        let table = text.parse::<toml::Table>().map_err(|e| {
            let place = e.span().map(|s| format!("line {}: ", line(s.start.min(text.len()))));
            Error::read(path, format!("{}{}", place.unwrap_or_default(), one_line(e.message())))
        })?;
        *self = self.merged(table).map_err(|(key, cause)| {
            let place = text.lines().position(|l| {
                l.trim_start()
                    .strip_prefix(&key)
                    .is_some_and(|rest| rest.trim_start().starts_with(['=', '.']))
            });
            let line = place.map(|n| n + 1);
            Error::read(path, ReadError::Option { line, key: one_line(&key), cause })
        })?;
        Ok(())
    }

    /// This method with the keys of `changes` replaced; else the key that does not fit, and why.
    fn merged(&self, changes: toml::Table) -> Result<Self, (String, OptionError)> {
        let mut table = self.table();
        let mut method = self.clone();
        for (key, value) in changes {
            let Some(old) = table.get(&key) else {
                return Err((key, OptionError::Unknown));
            };
            // A whole number is a fine value for a real parameter.
            let value = match (old, value) {
                (toml::Value::Float(_), toml::Value::Integer(i)) => toml::Value::Float(i as f64),
                (_, value) => value,
            };
            table.insert(key.clone(), value.clone());
            method = table.clone().try_into().map_err(|_| {
                let expected = keys().into_iter().find(|k| k.0 == key).map_or("", |k| k.1).into();
                (key, OptionError::WrongKind { expected, found: one_line(&value.to_string()) })
            })?;
        }
        method.check()?;
        Ok(method)
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
        self.check().map_err(|(key, cause)| Error::option(key, cause))?;
        Ok(self)
    }

    /// Names the first key that is out of its range.
    fn check(&self) -> Result<(), (String, OptionError)> {
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
                Err((name.to_owned(), OptionError::OutOfRange { value, low, high }))
            }
        };
        let odd = |name: &str, value: u32| {
            if value % 2 == 1 { Ok(()) } else { Err((name.to_owned(), OptionError::NotOdd { value })) }
        };
        within("zones", 1.0, 64.0)?;
        within("zone-sigmas", 0.0, 100.0)?;
        within("sad-window", 1.0, 31.0)?;
        odd("sad-window", self.sad_window)?;
        within("colour-contrast", 0.0, 128.0)?;
        within("outside-cost", 0.0, if self.cost == Cost::Sad { 254.0 } else { 1.625 })?;
        within("temperature", 1e-3, 1e6)?;
        within("evidence-cap", 0.25, 63.75)?;
        within("evidence-gain", 1.0, 4.0)?;
        within("levels", 1.0, 16.0)?;
        within("percentile", 0.0, 100.0)?;
        within("sigma-space", 0.1, 100.0)?;
        within("sigma-range", 1e-3, 10.0)?;
        within("dependency-truncation", 0.25, 255.75)?;
        within("resolution-truncation", 0.25, 255.75)?;
        within("iterations", 1.0, 1000.0)?;
        within("final-iterations", 0.0, 1000.0)?;
        within("tolerance", 0.0, 1e6)?;
        within("median-window", 3.0, 31.0)?;
        odd("median-window", self.median_window)?;
        within("median-sigma-space", 0.1, 100.0)?;
        within("median-sigma-range", 1e-3, 10.0)?;
        within("confidence-floor", 0.0, 255.0)?;
        within("memory", 1.0, f64::from(MAX_MEMORY))
    }
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
    /// Whether to take the time of every stage.
    pub timings: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_written_as_in_toml_or_bare() {
        let mut method = Method::default();
        method.set("cost", "sad").unwrap();
        method.set("cost", "\"sad\"").unwrap();
        method.set("temperature", "2").unwrap();
        method.set("left-right-check", "off").unwrap();
        method.set_all([("levels", "3"), ("levels", "4")]).unwrap();
        let expected = Method {
            cost: Cost::Sad,
            temperature: 2.0,
            left_right_check: LeftRightCheck::Off,
            levels: 4,
            ..Method::default()
        };
        assert_eq!(method, expected);
    }

    #[test]
    fn what_depends_on_two_keys_is_checked_at_the_end() {
        for order in [[0, 1], [1, 0]] {
            let pairs = [("cost", "ad-census"), ("outside-cost", "0.5")];
            let mut method = Method::preset("paper").unwrap();
            method.set_all(order.map(|i| pairs[i])).unwrap();
            assert_eq!((method.cost, method.outside_cost), (Cost::AdCensus, 0.5));
        }
        let error = Method::preset("paper").unwrap().set("cost", "ad-census").unwrap_err().to_string();
        assert_eq!(error, "outside-cost: 20 is outside 0 to 1.625");
    }

    #[test]
    fn errors_name_the_key_and_what_it_takes() {
        for (key, value, words) in [
            ("colour", "red", "colour: there is no such key"),
            ("cost", "ncc", "cost: expected sad | census | ad-census, not \"ncc\""),
            ("levels", "2.5", "levels: expected levels, 1 to 16, not 2.5"),
            ("levels", "-1", "levels: expected levels, 1 to 16, not -1"),
            ("levels", "", "levels: expected levels, 1 to 16, not \"\""),
            ("levels", "17", "levels: 17 is outside 1 to 16"),
            ("levels", "3\ncost = \"sad\"", "levels: expected"),
            ("temperature", "nan", "temperature: NaN is outside 0.001 to 1000000"),
            ("median-window", "4", "median-window: 4 is not odd; take 3 or 5"),
            ("two\nlines\u{1b}[2J", "4", "two lines [2J: there is no such key"),
            (&"keys".repeat(99), "4", &format!("{}...: there is no such key", "keys".repeat(40))),
        ] {
            let mut method = Method::default();
            let error = method.set(key, value).unwrap_err().to_string();
            assert!(error.starts_with(words) && !error.contains('\n'), "{error}");
            assert_eq!(method, Method::default(), "{key}={value} changes nothing");
        }
    }

    #[test]
    fn errors_in_a_file_name_the_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("method.toml");
        for (text, words) in [
            ("levels = 3\ncost sad\n", "method.toml: line 2: "),
            ("levels = 3\nlevels = 3\n", "method.toml: line 2: duplicate key"),
            ("# levels\n\nlevels = 99", "method.toml: line 3: levels: 99 is outside 1 to 16"),
            ("[levels]\nx = 1", "method.toml: levels: expected levels, 1 to 16, not"),
            ("cost = \"sad", "method.toml: line 1: "),
            ("\nsad_window = 3", "method.toml: line 2: sad_window: there is no such key"),
        ] {
            std::fs::write(&path, text).unwrap();
            let error = Method::default().load(&path).unwrap_err().to_string();
            assert!(error.contains(words) && !error.contains('\n'), "{error}");
        }
        let error = Method::default().load(&folder.path().join("none.toml")).unwrap_err().to_string();
        assert!(error.contains("none.toml: there is no such file"), "{error}");
    }

    #[test]
    fn every_preset_survives_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("method.toml");
        for (name, _) in PRESETS {
            let preset = Method::preset(name).unwrap().validated().unwrap();
            std::fs::write(&path, preset.table().to_string()).unwrap();
            for (other, _) in PRESETS {
                let mut method = Method::preset(other).unwrap();
                method.load(&path).unwrap();
                assert_eq!(method, preset);
            }
        }
        assert!(Method::preset("none").unwrap_err().to_string().contains("default, paper"));
    }

    #[test]
    fn ranges_that_make_no_sense_are_refused() {
        assert_eq!(DisparityRange::new(-3, -3).unwrap().labels(), 1);
        for (min, max, words) in [
            (5, 4, ["4 is", "below the minimum disparity 5"]),
            (0, 2_000_000, ["2000000", "out of reach"]),
            (-2_000_000, 0, ["-2000000", "out of reach"]),
            (i32::MIN, i32::MAX, ["disparity", "out of reach"]),
            (0, 16_384, ["16385 labels", "at most 16384 fit"]),
        ] {
            let error = DisparityRange::new(min, max).unwrap_err().to_string();
            assert!(words.iter().all(|w| error.contains(w)), "{error}");
        }
    }
}
