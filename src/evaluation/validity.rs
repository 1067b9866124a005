//! The quality of the validity map: whether it detects the pixels that one view does not see.

use serde::Serialize;

use super::dataset::{GroundTruth, same_size};
use super::metrics::{VISIBLE, average, percent};
use crate::error::Result;
use crate::image::Plane;
use crate::maps::flag;

/// The flags of pixels without a match of their own.
const FLAGGED: u8 = flag::INVALID & !flag::MASKED;

/// How well the flags of pixels without a match of their own detect the pixels that one view does not see.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Detection {
    /// Share of the flagged pixels that one view does not see, in percent; `None` when none is flagged.
    pub precision: Option<f64>,
    /// Share of the pixels that one view does not see that are flagged, in percent; `None` when both views see all.
    pub recall: Option<f64>,
}

impl Detection {
    /// The average of each field over several pairs, every pair with the same weight, as in
    /// [`mean`](super::mean); `None` for no pairs.
    #[must_use]
    pub fn mean(all: &[&Self]) -> Option<Self> {
        (!all.is_empty()).then(|| Self {
            precision: average(all.iter().map(|d| d.precision)),
            recall: average(all.iter().map(|d| d.recall)),
        })
    }
}

impl GroundTruth {
    /// How well the flags of `validity` (bits of [`flag`]) detect the pixels that one view does not see, over the pixels whose
    /// truth is known; `None` without a mask.
    ///
    /// # Errors
    /// [`Error::Mismatch`](crate::Error::Mismatch) when the sizes differ.
    pub fn detect(&self, validity: &Plane<u8>) -> Result<Option<Detection>> {
        let Some(mask) = &self.mask else { return Ok(None) };
        same_size("validity map", validity.size(), self.truth.size())?;
        let (mut flagged, mut unseen, mut both) = (0_u32, 0_u32, 0_u32);
        for ((&bits, &t), &m) in validity.data().iter().zip(self.truth.data()).zip(mask.data()) {
            if t.is_finite() {
                let (is_flagged, is_unseen) = (bits & FLAGGED != 0, m != VISIBLE);
                flagged += u32::from(is_flagged);
                unseen += u32::from(is_unseen);
                both += u32::from(is_flagged && is_unseen);
            }
        }
        let share = |whole: u32| percent(f64::from(both), f64::from(whole));
        Ok(Some(Detection { precision: share(flagged), recall: share(unseen) }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_case_computed_by_hand() {
        let flags = [
            flag::OUTSIDE,
            flag::OCCLUDED | flag::FILLED,
            flag::SPECKLE | flag::LOW_CONFIDENCE,
            flag::LOW_CONFIDENCE | flag::FILLED,
            flag::MASKED,
            0,
            0,
            flag::OUTSIDE,
            flag::TIE,
            flag::OUTVOTED | flag::FILLED,
        ];
        let mut truth = Plane::filled(10, 1, 3.0);
        truth[(7, 0)] = f32::INFINITY;
        let mask = Plane::new(10, 1, vec![128, 0, 255, 128, 255, 255, 128, 128, 255, 128]);
        // Flagged: 0, 1, 2, 8, 9. Not seen by one view: 0, 1, 3, 6, 9.
        let (flags, nothing) = (Plane::new(10, 1, flags.to_vec()), Plane::filled(10, 1, 0));
        let (hidden, seen) = (Plane::filled(10, 1, flag::OCCLUDED), Plane::filled(10, 1, 255));
        for (flags, mask, precision, recall) in [
            (&flags, &mask, Some(60.0), Some(60.0)),
            (&nothing, &mask, None, Some(0.0)),
            (&hidden, &seen, Some(0.0), None),
        ] {
            let ground = GroundTruth::new(truth.clone(), Some(mask.clone())).unwrap();
            assert_eq!(ground.detect(flags).unwrap(), Some(Detection { precision, recall }));
            let error = ground.detect(&Plane::filled(7, 1, 0)).unwrap_err().to_string();
            assert!(error.contains("validity map is 7 x 1"), "{error}");
        }
        assert_eq!(GroundTruth::new(truth, None).unwrap().detect(&flags).unwrap(), None);
    }

    #[test]
    fn means_are_over_all_pairs_or_none() {
        let one = Detection { precision: Some(20.0), recall: Some(50.0) };
        let two = Detection { precision: Some(40.0), recall: None };
        assert_eq!(Detection::mean(&[&one, &two]), Some(Detection { precision: Some(30.0), recall: None }));
        assert_eq!(Detection::mean(&[]), None);
    }
}
