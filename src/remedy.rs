//! Remedies for errors and warnings, in the terms of a front end.
//!
//! The library names causes. The remedy is often a flag, an argument or a field that only the front end knows. There
//! is one row for each cause here, and a [`Vocabulary`] has the front end's names for the few things that help.

use crate::error::{
    BudgetError, DeviceError, Error, ExecutionError, MemoryError, OptionError, Purpose, RangeError,
    ReadError, RectificationError,
};
use crate::front::check::Warning;
use crate::maps::FRACTION;
#[cfg(feature = "cameras")]
use crate::rectification::Doubt;

/// A front end's names for its options; `None` for options that it does not have.
#[derive(Clone, Copy, Debug)]
pub struct Vocabulary {
    /// The text before and after the name of a key of the method.
    pub key: [&'static str; 2],
    /// How to list the keys.
    pub keys: Option<&'static str>,
    /// The preset.
    pub preset: &'static str,
    /// The smallest disparity.
    pub min: &'static str,
    /// The largest disparity.
    pub max: &'static str,
    /// The range of disparities, if the front end takes both ends as one option.
    pub range: Option<&'static str>,
    /// The device.
    pub device: &'static str,
    /// How to list the devices.
    pub devices: Option<&'static str>,
    /// What to do if no device works.
    pub cpu: &'static str,
    /// What to do if there is no driver, and if it gives wrong results.
    pub driver: [&'static str; 2],
    /// How to start a process that may open devices although its parent has.
    pub fork: &'static str,
    /// The number of threads.
    pub threads: &'static str,
    /// The memory that is granted to a match, and the unit that follows its number.
    pub memory: Option<[&'static str; 2]>,
    /// The option that shows the steps of a match.
    pub steps: Option<&'static str>,
    /// What to do about pixels that show no scene.
    pub mask: Option<&'static str>,
    /// The largest number of pixels.
    pub max_pixels: Option<&'static str>,
    /// The scale of whole numbers in a disparity map or a ground truth.
    pub truth_scale: Option<&'static str>,
    /// The value that stands for no data.
    pub no_data: Option<&'static str>,
    /// The calibration that rectifies a pair.
    pub calibration: &'static str,
    /// The option that turns images upright.
    pub orient: Option<&'static str>,
    /// How to rectify a pair, as an instruction.
    pub rectify: Option<&'static str>,
    /// What to do about a wrong unit.
    pub unit: Option<&'static str>,
    /// The option that says which part of the calibrated images the images are.
    pub crop: Option<&'static str>,
}

impl Vocabulary {
    /// The names of the library, without optional remedies. Each front end sets its own `cpu`.
    pub const PLAIN: Self = Self {
        key: ["", ""],
        keys: None,
        preset: "preset",
        min: "min",
        max: "max",
        range: None,
        device: "device",
        devices: None,
        cpu: "",
        driver: ["install the driver of the GPU", "update its driver"],
        fork: "open devices in such processes alone",
        threads: "threads",
        memory: None,
        steps: None,
        mask: None,
        max_pixels: None,
        truth_scale: None,
        no_data: None,
        calibration: "a calibration",
        orient: None,
        rectify: None,
        unit: None,
        crop: None,
    };
}

/// An error with its remedy.
#[must_use]
pub fn error(error: &Error, words: &Vocabulary) -> String {
    match error {
        Error::Option { key, cause } => format!("{}: {cause}{}", words.key(key), words.of_key(cause)),
        Error::Preset { .. } => format!("{}: {error}", words.preset),
        Error::Range(cause) => words.range(cause),
        Error::Execution(cause) => words.execution(cause),
        Error::Budget(cause) => words.budget(cause),
        Error::Rectification(cause) => format!("{error}: {}", words.rectification(cause)),
        Error::Read { cause, .. } => format!("{error}{}", words.reading(cause)),
        Error::Device(cause) => format!("{error}{}", words.device(cause)),
        Error::Memory(cause) => format!("{error}{}", words.memory(cause)),
        _ => error.to_string(),
    }
}

/// A warning with its remedy.
#[must_use]
pub fn warning(warning: &Warning, words: &Vocabulary) -> String {
    let Vocabulary { min, max, mask, orient, .. } = words;
    let remedy = match warning {
        Warning::Oriented { .. } => and(": turn them upright with ", *orient),
        Warning::NotRectified { .. } => format!(": {}", words.rectified()),
        Warning::Saturated { .. } => format!(": expose both alike{}", and(", or ", *mask)),
        Warning::Swapped { .. } => {
            format!(": swap the two images, or lower {min} below 0 if the cameras converge")
        }
        Warning::Clipped { upper: true, .. } => format!(": raise {max}"),
        Warning::Clipped { upper: false, .. } => format!(": lower {min}"),
        _ => String::new(),
    };
    format!("{warning}{remedy}")
}

/// Like [`warning`], for a pair that was rectified by a calibration or by its own matches: rectifying is no remedy any more.
#[must_use]
pub fn of_rectified(warning: &Warning, calibrated: bool, words: &Vocabulary) -> String {
    let Warning::NotRectified { offset } = warning else { return self::warning(warning, words) };
    let why = if calibrated {
        "the calibration is out of date, or for images of another size: calibrate the cameras again"
    } else {
        "the lens may bend lines, or the scene has moved: calibrate the cameras"
    };
    let rows = f64::from(*offset) / f64::from(FRACTION);
    format!("after rectification matches lie {rows:.1} px above or below their row: {why}")
}

/// A doubt about a rectification, or about the calibration of a rectified pair, with its remedy.
#[cfg(feature = "cameras")]
#[must_use]
pub fn doubt(doubt: &Doubt, Vocabulary { unit, crop, .. }: &Vocabulary) -> String {
    let remedy = match doubt {
        Doubt::OtherSize { .. } => and("; if they show another part, give it with ", *crop),
        Doubt::Baseline { .. } => and(": ", *unit),
        Doubt::FocalLength { .. } => {
            ": give it in pixels: the millimetres divided by the width of one pixel on the sensor".into()
        }
        _ => String::new(),
    };
    format!("{doubt}{remedy}")
}

/// `word` after `joint`; empty if there is no word.
fn and(joint: &str, word: Option<&str>) -> String {
    word.map_or_else(String::new, |word| format!("{joint}{word}"))
}

impl Vocabulary {
    fn key(&self, key: &str) -> String {
        let [before, after] = self.key;
        format!("{before}{key}{after}")
    }

    fn of_key(&self, cause: &OptionError) -> String {
        match cause {
            OptionError::Unknown => and("; ", self.keys),
            _ => String::new(),
        }
    }

    fn range(&self, cause: &RangeError) -> String {
        let Self { min, max, range, .. } = *self;
        let (end, remedy) = match cause {
            RangeError::Empty { .. } => {
                (max, format!(": raise {} or lower {min}", range.map_or("it", |_| max)))
            }
            RangeError::TooFar { disparity, .. } if *disparity < 0 => (min, String::new()),
            RangeError::TooManyLabels { .. } => (max, ": narrow the range".into()),
            RangeError::OutsideImages { .. } => (max, ": give a range that fits the pair".into()),
            RangeError::NotFound { cause: Some(_) } => return cause.to_string(),
            RangeError::NotFound { cause: None } => {
                let range = self.given_range();
                return format!("{cause}: check that both show the same scene, or give {range}");
            }
            RangeError::NotRectified => {
                return format!("{cause}: {}, or give {}", self.rectified(), self.given_range());
            }
            RangeError::TooFar { .. } => (max, String::new()),
        };
        format!("{}: {cause}{remedy}", range.unwrap_or(end))
    }

    /// How to rectify a pair.
    fn rectified(&self) -> &'static str {
        self.rectify.unwrap_or("rectify it first, with or without a calibration")
    }

    /// The option that gives a range.
    fn given_range(&self) -> String {
        self.range.map_or(self.max.into(), |range| format!("the {range}"))
    }

    fn execution(&self, cause: &ExecutionError) -> String {
        match cause {
            ExecutionError::NoSuchDevice { .. } => {
                format!("{}: {cause}{}", self.device, and("; ", self.devices))
            }
            ExecutionError::Forked => cause.to_string(),
            _ => format!("{}: {cause}", self.threads),
        }
    }

    fn budget(&self, cause: &BudgetError) -> String {
        let Some([memory, unit]) = self.memory else {
            return format!("{cause}; use a smaller image or range");
        };
        match cause {
            BudgetError::NoTileFits { needed, .. } => {
                format!("{memory}: {cause}; give at least {needed}{unit}, or a smaller image or range")
            }
            BudgetError::Steps { needed } => {
                let steps = self.steps.map_or_else(String::new, |steps| format!("{steps}: "));
                format!("{steps}{cause}; give {memory} {needed}{unit}")
            }
        }
    }

    fn rectification(&self, cause: &RectificationError) -> String {
        let first = match cause {
            RectificationError::Few { .. } => {
                "check that both images show the same scene, taken from nearby places"
            }
            RectificationError::Flat => {
                "step to the side between the two photos, and show things at different distances"
            }
            RectificationError::Forward => "step to the side between the two photos",
        };
        format!("{first}, or give {}", self.calibration)
    }

    fn reading(&self, cause: &ReadError) -> String {
        let raised = || self.max_pixels.map_or_else(String::new, |pixels| format!("raise {pixels} or "));
        match cause {
            ReadError::TooManyPixels { .. } => format!("; if it really is that large, {}crop it", raised()),
            ReadError::TooManyBytes { .. } => format!("; {}crop it", raised()),
            ReadError::UnknownScale => and("; give the scale with ", self.truth_scale),
            ReadError::NeedlessScale => and("; remove ", self.truth_scale),
            ReadError::NoData { .. } => and("; give one with ", self.no_data),
            ReadError::Option { cause, .. } => self.of_key(cause),
            ReadError::Memory(cause) => self.memory(cause),
            ReadError::Other(_) => String::new(),
        }
    }

    fn device(&self, cause: &DeviceError) -> String {
        let Self { device, cpu, driver: [install, update], fork, .. } = self;
        match cause {
            DeviceError::NoDriver => format!(": {install}, or {cpu}"),
            DeviceError::Forked => format!(": {fork}, or {cpu}"),
            DeviceError::WrongMaps { .. } => format!(": {update}, or {cpu}"),
            DeviceError::TooLargeForShader { .. } => format!(": {cpu}"),
            DeviceError::Failed { .. } => format!("; use another {device}, or {cpu}"),
        }
    }

    fn memory(&self, cause: &MemoryError) -> String {
        let Self { min, max, device, cpu, .. } = self;
        match cause {
            MemoryError::Machine { purpose: Purpose::Match, .. } => {
                let Some([memory, _]) = self.memory else {
                    return format!(": {cpu}, or use a smaller image or a narrower range");
                };
                format!(
                    ": give a smaller {memory}, or use a smaller image, a narrower range ({min}, {max}) or fewer \
                     neighbours (a higher {})",
                    self.key("percentile")
                )
            }
            MemoryError::Machine { purpose: Purpose::Image, .. } => {
                ": use a smaller image, or a part of it".into()
            }
            MemoryError::Device { .. } => {
                let memory = self.memory.map_or_else(String::new, |[memory, _]| format!("{memory}, "));
                format!(": {cpu}, or use a smaller {memory}image or range")
            }
            MemoryError::Buffer { .. } => format!(": {cpu}, or use a smaller image or range"),
            MemoryError::Exhausted { .. } => {
                format!(": {cpu}, or use another {device}, or a smaller image or range")
            }
        }
    }
}
