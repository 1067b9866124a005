//! Presets: the rows of the options define `default`; the others list their differences.

#[cfg(feature = "paper")]
mod paper;

use super::{FrontOptions, MatchSize, MessageOptions, Method, RefinementOptions, ScheduleOptions};
use crate::error::{Error, Result};
use crate::text::one_line;

/// A preset: its row in [`PRESETS`].
#[derive(Clone, Copy, Debug)]
pub struct Preset {
    /// Its name.
    pub name: &'static str,
    /// Its purpose.
    pub about: &'static str,
    make: fn() -> Method,
}

impl Preset {
    /// The method of the preset.
    #[must_use]
    pub fn method(&self) -> Method {
        (self.make)()
    }
}

/// Every preset. The program, Python, C, the page and the tests take them from here.
pub const PRESETS: &[Preset] = &[
    Preset { name: "default", about: "few errors in little time: for most pairs", make: Method::default },
    Preset {
        name: "accurate",
        about: "nearest to the truth, in 7 times the default's time: matches the pair at twice its size, too",
        make: Method::accurate,
    },
    Preset {
        name: "fast",
        about: "matches the pair at half its size, in a sixth of the default's time: for video and robots",
        make: Method::fast,
    },
    #[cfg(feature = "paper")]
    Preset {
        name: "paper",
        about: "the paper's whole method, with its choices wherever it states them",
        make: Method::paper,
    },
    #[cfg(feature = "paper")]
    Preset {
        name: "fgs",
        about: "the paper's predecessor: one resolution, and a left-right check by a second matching",
        make: Method::fgs,
    },
];

impl Method {
    /// The preset called `name`, one of [`PRESETS`].
    ///
    /// # Errors
    /// [`Error::Preset`] when there is no such preset.
    pub fn preset(name: &str) -> Result<Self> {
        let preset = PRESETS.iter().find(|preset| preset.name == name);
        preset.map(Preset::method).ok_or_else(|| Error::Preset {
            name: one_line(name),
            known: PRESETS.iter().map(|preset| preset.name).collect(),
        })
    }

    /// Closest to the truth, in 7 times the default's time: also matches the pair at twice its size.
    #[must_use]
    pub fn accurate() -> Self {
        let schedule = ScheduleOptions { match_size: MatchSize::Double, ..ScheduleOptions::default() };
        Self { schedule, ..Self::default() }
    }

    /// This method for the pair at twice the size, if it is to be matched so. The pair is conditioned
    /// already, and the median covers the same area of the scene.
    pub(crate) fn at_double_size(&self) -> Option<Self> {
        let refinement = &self.refinement;
        (self.schedule.match_size == MatchSize::Double).then(|| Self {
            front: FrontOptions {
                level_rows: false,
                equal_sharpness: false,
                denoise: false,
                ..self.front.clone()
            },
            schedule: ScheduleOptions { match_size: MatchSize::Full, ..self.schedule.clone() },
            refinement: RefinementOptions {
                median_window: (2 * refinement.median_window + 1).min(31),
                median_sigma_space: (2.0 * refinement.median_sigma_space).min(100.0),
                ..refinement.clone()
            },
            ..self.clone()
        })
    }

    /// Matches the pair at half its size, in a sixth of the default's time: for video and robots. The
    /// finest level only receives messages from the coarser ones, and the median is smaller.
    #[must_use]
    pub fn fast() -> Self {
        Self {
            schedule: ScheduleOptions {
                match_size: MatchSize::Half,
                iterations: 2,
                final_iterations: 0,
                looks: 1,
                ..ScheduleOptions::default()
            },
            // At half the size, a larger label step helps in rooms and harms on desks.
            messages: MessageOptions { temperature: 0.35, label_step: 2.0, ..MessageOptions::default() },
            // After fewer iterations, the best label leads by less.
            refinement: RefinementOptions {
                median_window: 9,
                confidence_floor: 8,
                ..RefinementOptions::default()
            },
            ..Self::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_match_their_names() {
        for (i, preset) in PRESETS.iter().enumerate() {
            let (name, method) = (preset.name, preset.method());
            assert_eq!(Method::preset(name).unwrap(), method);
            assert_eq!(method.clone().validated().unwrap(), method, "{name} is within every range");
            for other in &PRESETS[..i] {
                assert!(other.name != name && other.method() != method, "{name} and {}", other.name);
            }
        }
        assert_eq!(Method::preset("default").unwrap(), Method::default());
        let error = Method::preset("best").unwrap_err().to_string();
        let names: Vec<_> = PRESETS.iter().map(|preset| preset.name).collect();
        assert_eq!(error, format!("there is no preset `best`; the presets are {}", names.join(", ")));
    }
}
