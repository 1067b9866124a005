//! The maps of a match before they are results.

use crate::plan::Plan;

/// Marks pixels of the right view to which no left pixel projects.
pub const NO_LABEL: u16 = u16::MAX;

/// Marks pixels of which a prior says too little to take its disparity.
pub const NO_ANCHOR: i32 = i32::MIN;

/// Stands for "no runner-up".
pub(crate) const NO_RUNNER_UP: u16 = u16::MAX;

/// An intermediate or final map of a match, one value per pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Map {
    /// Index of the label with the smallest belief, the lowest on ties.
    Label,
    /// Belief of that label, in units.
    Best,
    /// The smallest belief of labels more than one away from it; `NO_RUNNER_UP` if there are none.
    RunnerUp,
    /// Label index of each pixel of the right view; [`NO_LABEL`] where no left pixel projects.
    RightLabel,
    /// Belief of that label, in units; [`u16::MAX`] where no left pixel projects.
    RightBest,
    /// Disparity before post-processing, in 1/256 px.
    Raw,
    /// Disparity after the post-processing so far, in 1/256 px.
    Disparity,
    /// Bits of [`crate::maps::flag`].
    Validity,
    /// Confidence, 0 ..= 255.
    Confidence,
    /// Disparity that a prior gives where no match can be trusted, in 1/256 px; [`NO_ANCHOR`] where it gives none.
    Anchor,
    /// [`Self::Raw`] at full size, if the pair is matched at half its size.
    FullRaw,
    /// [`Self::Disparity`] at full size.
    FullDisparity,
    /// [`Self::Validity`] at full size.
    FullValidity,
    /// [`Self::Confidence`] at full size.
    FullConfidence,
}

impl Map {
    /// Every map of the size of the finest level that a match computes.
    pub const MATCHED: [Self; 9] = [
        Self::Label,
        Self::Best,
        Self::RunnerUp,
        Self::RightLabel,
        Self::RightBest,
        Self::Raw,
        Self::Disparity,
        Self::Validity,
        Self::Confidence,
    ];

    /// Every map of the full size.
    pub const FULL: [Self; 4] =
        [Self::FullRaw, Self::FullDisparity, Self::FullValidity, Self::FullConfidence];

    /// Every map of a match by `plan`.
    #[must_use]
    pub fn all(plan: &Plan) -> Vec<Self> {
        let full: &[Self] = if plan.full.is_some() { &Self::FULL } else { &[] };
        let prior: &[Self] = if plan.prior { &[Self::Anchor] } else { &[] };
        [&Self::MATCHED, prior, full].concat()
    }

    /// Words per pixel of the device array that holds this map, shared with other maps.
    #[must_use]
    pub fn words(self) -> usize {
        if matches!(self, Self::Label | Self::Best | Self::RunnerUp) { 2 } else { 1 }
    }

    /// (width, height) in pixels. At full size, the blocks of 2 x 2 pixels are whole.
    #[must_use]
    pub fn size(self, plan: &Plan) -> (usize, usize) {
        let (width, height) = plan.size();
        if Self::FULL.contains(&self) { (2 * width, 2 * height) } else { (width, height) }
    }
}
