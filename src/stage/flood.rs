//! One iteration within a level: [`dependency`](super::dependency), and then
//! [`belief`](super::belief).
//!
//! (They are one stage so that a belief can be summed while its messages are at hand; the values
//! are those of the two stages in turn.)

use super::{Descriptor, belief, dependency};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |z| [(dependency::ROW.reads)(z), (belief::ROW.reads)(z)].concat(),
    writes: |z| [(dependency::ROW.writes)(z), (belief::ROW.writes)(z)].concat(),
    joins: true,
    cell: 0.9,
    ..Descriptor::NONE
};
