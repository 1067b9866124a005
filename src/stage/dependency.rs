//! Messages of the dependency factors of a level: a factor tells each member the labels that the other
//! members prefer, since all should lie on one surface.
//!
//! The stage reads beliefs and old messages from before it, and does not change beliefs. Both are costs;
//! infinity is inf = [`VolumeWidth::most`](crate::plan::VolumeWidth::most). Take the factor of pixel p with
//! the members p = p(0), p(1), ... of the level's [`graph`](super::graph), the belief b of a member, and the
//! factor's old message m to it:
//!
//! 1. From each member s to the factor, at label k:
//!
//!    ```text
//!    q(s, k) = b(p(s), k) - m(s, k)         inf where b(p(s), k) is
//!    ```
//!
//!    If the rule is [`Absolute`](crate::plan::TruncationRule::Absolute), the minimum of q(s) over the labels
//!    that p has is subtracted from each finite q(s, k), but not below 0.
//! 2. To each member t, the sum over the others, truncated by [`Plan::dependency`] with the cost of
//!    disagreement tau:
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
//! If [`Plan::label_step`] defines a cost for labels that differ by one, S(t, k) is replaced by
//!
//! ```text
//! min(S(t, k), S(t, k - 1) + step, S(t, k + 1) + step)
//! ```
//!
//! in m(t, k), where S is infinite at labels that p or p(t) does not have. (Slanted surfaces have several
//! labels within a factor. At coarse levels labels are far apart, and members would vote each other down.)
//!
//! At labels that p(t) has and p does not, S is infinite and the message is tau. Messages at labels that p(t)
//! does not have are undefined. A factor with one member, and an empty slot, keep their messages, which are 0
//! from the start.
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
    cell: 0.5,
    ..Descriptor::NONE
};
