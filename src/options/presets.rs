//! Presets: `default` is what the rows state, the others say what differs.

use super::{
    Agreement, CostOptions, Fill, FrontOptions, GraphOptions, Illumination, LeftRightCheck, MatchingCost,
    MessageOptions, Method, Order, Potential, Pyramid, RefinementOptions, ScheduleOptions,
};
use crate::error::{Error, Result};
use crate::text::one_line;

/// Names of the presets, with what each is for.
pub const PRESETS: &[(&str, &str)] = &[
    ("default", "few errors in little time: for most pairs"),
    (
        "accurate",
        "nearest to the truth, in 7 times the default's time: matches the pair at twice its size, too",
    ),
    ("fast", "nine tenths of the default's time for a few more errors: for video and robots"),
    ("paper", "the paper's whole method, with its choices wherever it states them"),
    ("fgs", "the paper's predecessor: one resolution, and a left-right check by a second matching"),
];

impl Method {
    /// The preset called `name`, one of [`PRESETS`].
    ///
    /// # Errors
    /// [`Error::Preset`] when there is no such preset.
    pub fn preset(name: &str) -> Result<Self> {
        match name {
            "default" => Ok(Self::default()),
            "accurate" => Ok(Self::accurate()),
            "fast" => Ok(Self::fast()),
            "paper" => Ok(Self::paper()),
            "fgs" => Ok(Self::fgs()),
            _ => {
                let known = PRESETS.iter().map(|p| p.0).collect();
                Err(Error::Preset { name: one_line(name), known })
            }
        }
    }

    /// Nearest to the truth, in 7 times the default's time: matches the pair at twice its size, too.
    #[must_use]
    pub fn accurate() -> Self {
        let default = Self::default();
        Self { refinement: RefinementOptions { double_size: true, ..default.refinement }, ..default }
    }

    /// This method for a pair at twice the size, where it asks for one. The pair has been conditioned, and the median sees as much of the
    /// scene as in the pair itself.
    pub(crate) fn at_double_size(&self) -> Option<Self> {
        let refinement = &self.refinement;
        refinement.double_size.then(|| Self {
            front: FrontOptions {
                level_rows: false,
                equal_sharpness: false,
                denoise: false,
                ..self.front.clone()
            },
            refinement: RefinementOptions {
                double_size: false,
                median_window: (2 * refinement.median_window + 1).min(31),
                median_sigma_space: (2.0 * refinement.median_sigma_space).min(100.0),
                ..refinement.clone()
            },
            ..self.clone()
        })
    }

    /// Nine tenths of the default's time for a few more errors: for video and robots. The finest level only listens to the
    /// coarser ones, and the median is smaller.
    #[must_use]
    pub fn fast() -> Self {
        Self {
            schedule: ScheduleOptions { iterations: 2, final_iterations: 0, ..ScheduleOptions::default() },
            refinement: RefinementOptions { median_window: 9, ..RefinementOptions::default() },
            ..Self::default()
        }
    }

    /// The paper's whole method, with its choices wherever it states them. Where it leaves one open, the preset takes what brings
    /// the printed tables nearest, the same for all pairs; `docs/paper.md` tells what that is.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            front: FrontOptions {
                illumination: Illumination::Homomorphic,
                level_rows: false,
                equal_sharpness: false,
                denoise: false,
                zone_sigmas: 1.0,
                ..FrontOptions::default()
            },
            cost: CostOptions {
                matching: MatchingCost::Sad,
                outside_cost: 10.0,
                pyramid: Pyramid::Minimum,
                ..CostOptions::default()
            },
            messages: MessageOptions {
                temperature: 0.1,
                evidence_cap: 8.0,
                evidence_gain: 1.0,
                potential: Potential::Hard,
                agreement: Agreement::Interpolating,
                ..MessageOptions::default()
            },
            schedule: ScheduleOptions {
                order: Order::Together,
                iterations: 30,
                tolerance: 0.1,
                ..ScheduleOptions::default()
            },
            refinement: RefinementOptions {
                left_right_check: LeftRightCheck::Off,
                speckle_size: 0,
                sub_pixel: false,
                fill: Fill::Row,
                median_window: 21,
                median_sigma_space: 10.0,
                plane: false,
                ..RefinementOptions::default()
            },
            ..Self::default()
        }
    }

    /// The paper's predecessor: one resolution, and a left-right check by a second matching.
    #[must_use]
    pub fn fgs() -> Self {
        let paper = Self::paper();
        Self {
            graph: GraphOptions { levels: 1, ..paper.graph },
            refinement: RefinementOptions {
                left_right_check: LeftRightCheck::SecondMatch,
                ..paper.refinement
            },
            ..paper
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_are_what_their_names_say() {
        let presets = [Method::default(), Method::accurate(), Method::fast(), Method::paper(), Method::fgs()];
        for ((name, _), expected) in PRESETS.iter().zip(presets) {
            let preset = Method::preset(name).unwrap();
            assert_eq!(preset, expected);
            assert_eq!(preset.clone().validated().unwrap(), preset, "{name} is within every range");
        }
        let error = Method::preset("best").unwrap_err().to_string();
        assert_eq!(error, "there is no preset `best`; the presets are default, accurate, fast, paper, fgs");
    }
}
