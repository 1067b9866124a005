//! Beliefs of a level: for each pixel, the total cost of each label.
//!
//! ```text
//! b(p, k) = min(e(p, k)                                       the evidence
//!               + sum of m(t, k) over the factors and slots t that hold p
//!               + down(p, k)                                  from the factor with its parent
//!               + up(p, k),                                   from the factor with its children
//!               belief_most)
//! ```
//!
//! at the labels k that p [has](super::label_window), and infinite at all others. m are the messages of the
//! [`dependency`](super::dependency) factors; down and up are the messages of the
//! [`resolution`](super::resolution) factors. Messages that have not been sent, or do not exist at the
//! coarsest and the finest level, count as 0.
//!
//! ([`belief_most`](crate::plan::Plan::belief_most) is one message below infinity: labels that a pixel has
//! stay below those that it does not have, even after a message is subtracted.)

use super::{Data, Descriptor, Volume, volumes};
use crate::plan::GRAPH_WINDOW;

pub(super) const ROW: Descriptor = Descriptor {
    reads: |z| {
        let messages = [Volume::Evidence(z), Volume::Dependency(z), Volume::Down(z), Volume::Up(z)];
        [volumes(&messages), vec![Data::Members(z), Data::Incoming(z), Data::Windows(z)]].concat()
    },
    writes: |z| volumes(&[Volume::Belief(z)]),
    reach: Some(GRAPH_WINDOW / 2),
    joins: true,
    cell: 0.4,
    ..Descriptor::NONE
};
