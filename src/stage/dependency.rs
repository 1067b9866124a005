//! Messages of the dependency factors of a level: a factor tells each member which labels the other
//! members believe in, since all of them should show one surface.
//!
//! All messages are from the beliefs and the old messages before the stage; beliefs stay. Beliefs
//! and messages are costs, and infinite is inf =
//! [`VolumeWidth::most`](crate::plan::VolumeWidth::most). For the factor of pixel p whose members
//! are the pixels p = p(0), p(1), ... of the level's [`graph`](super::graph), with b the belief of
//! a member and m the factor's old message to it:
//!
//! 1. From each member s to the factor, at label k:
//!
//!    ```text
//!    q(s, k) = b(p(s), k) - m(s, k)         inf where b(p(s), k) is
//!    ```
//!
//!    Where the rule is [`Absolute`](crate::plan::TruncationRule::Absolute), each finite q(s, k) is
//!    lowered by the minimum of q(s) over the labels that p has, but not below 0.
//! 2. To each member t, the sum over the others, truncated by [`Plan::dependency`], whose cost of
//!    disagreement is tau:
//!
//!    ```text
//!    S(t, k) = min(sum of q(s, k) over s != t, inf)
//!    m(t, k) = min(S(t, k), high) - low     at the labels k that p(t) has
//!
//!    relative   low = min(least, inf - tau), high = low + tau
//!               with least = the smallest S(t, k) of the labels that both p and p(t) have, or inf
//!    absolute   low = 0, high = tau
//!    ```
//!
//! Where [`Plan::label_step`] gives a cost for labels that differ by one, S(t, k) is replaced by
//!
//! ```text
//! min(S(t, k), S(t, k - 1) + step, S(t, k + 1) + step)
//! ```
//!
//! in m(t, k), where S is infinite at labels that not both p and p(t) have. (Surfaces that slant have several labels within a factor. At
//! coarse levels labels are wide apart, and the members would vote each other down.)
//!
//! At labels that p(t) has and p has not, S is infinite and the message is tau. Messages at labels
//! that p(t) does not have are not defined. A factor of one member, and a slot without one, keep
//! the message they have: 0, from the start.
//!
//! [`Plan::dependency`]: crate::plan::Plan::dependency
//! [`Plan::label_step`]: crate::plan::Plan::label_step

use super::{Data, Descriptor, Volume, volumes};
use crate::plan::GRAPH_WINDOW;

pub(super) const ROW: Descriptor = Descriptor {
    reads: |z| {
        let volumes = volumes(&[Volume::Belief(z), Volume::Dependency(z)]);
        [volumes, vec![Data::Members(z), Data::Windows(z)]].concat()
    },
    writes: |z| volumes(&[Volume::Dependency(z)]),
    reach: Some(GRAPH_WINDOW / 2),
    joins: true,
    cell: 0.45,
    ..Descriptor::NONE
};
