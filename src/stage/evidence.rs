//! The evidence of a level: the cost of each label relative to the best one of the pixel.
//!
//! 1. With C(k) the cost of label k in 1/256 cost units (256 times the stored value at level 0), and `limit`,
//!    `up`, `multiplier`, `down` and `cap` from the level's [`EvidenceScale`](crate::plan::EvidenceScale),
//!    for the labels that the pixel [has](super::label_window):
//!
//!    ```text
//!    D(k) = min(C(k) - min of C over these labels, limit)
//!    e(k) = min((((D(k) << up) multiplier >> 16) + (1 << down >> 1)) >> down, cap)
//!    ```
//!
//! 2. The beliefs of these labels become the evidence; the beliefs of all others become infinite.
//!
//! Evidence at labels that the pixel does not have is undefined.

use super::{Data, Descriptor, Volume, volumes};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |z| vec![Data::Volume(Volume::Cost(z)), Data::Windows(z)],
    writes: |z| volumes(&[Volume::Evidence(z), Volume::Belief(z)]),
    reach: Some(0),
    cell: 0.6,
    ..Descriptor::NONE
};
