//! The evidence of a level: what its costs say against each label, compared with the pixel's best
//! one.
//!
//! 1. With C(k) the pixel's cost of label k in 1/256 cost units (256 times what is stored at level
//!    0), and `limit`, `up`, `multiplier`, `down` and `cap` the level's
//!    [`EvidenceScale`](crate::plan::EvidenceScale), for the labels that the pixel
//!    [has](super::label_window):
//!
//!    ```text
//!    D(k) = min(C(k) - min of C over these labels, limit)
//!    e(k) = min((((D(k) << up) multiplier >> 16) + (1 << down >> 1)) >> down, cap)
//!    ```
//!
//! 2. The beliefs of these labels become the evidence, those of all others infinite.
//!
//! Evidence at labels that the pixel does not have is not defined.

use super::{Data, Descriptor, Volume, volumes};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |z| vec![Data::Volume(Volume::Cost(z)), Data::Windows(z)],
    writes: |z| volumes(&[Volume::Evidence(z), Volume::Belief(z)]),
    reach: Some(0),
    cell: 0.6,
    ..Descriptor::NONE
};
