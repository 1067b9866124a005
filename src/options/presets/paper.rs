//! The presets that follow the paper and its predecessor.

use crate::options::{
    Agreement, CostOptions, Fill, FrontOptions, GraphOptions, Illumination, LeftRightCheck, MatchingCost,
    MessageOptions, Method, Order, Potential, Pyramid, RefinementOptions, ScheduleOptions,
};

impl Method {
    /// The paper's whole method, with its choices wherever it states them. Where it leaves one open, the
    /// preset takes what brings the printed tables closest, the same for all pairs; see `docs/paper.md`.
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
                sad_steps: 16,
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
                looks: 1,
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

    pub(super) fn fgs() -> Self {
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
