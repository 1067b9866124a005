//! Takes the guess off the lead of each pixel's label, so that no guess confirms itself.
//!
//! It changes pixels whose [`Prior`](Data::Prior) is a [guess](super::guess): 0 < cap <= `GUESS_CAP`. With p(k) the
//! [cost](super::prior) of label k by this prior, and b(k) the belief of label k, among the labels that the pixel
//! [has](super::label_window):
//!
//! ```text
//! RunnerUp = max(Best, p(Label) + min of b(k) - p(k) over |k - Label| > 1)       NO_RUNNER_UP if there is no such k
//! ```
//!
//! The label stays, also where another one would win without the guess: its lead is then 0. The guesses of other pixels still count,
//! because they arrive as messages.

use super::{Data, Descriptor, Map, Volume, maps, volumes};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| {
        let known = vec![Data::Windows(0), Data::Prior(0)];
        [volumes(&[Volume::Belief(0)]), known, maps(&[Map::Label, Map::Best])].concat()
    },
    writes: |_| maps(&[Map::RunnerUp]),
    reach: Some(0),
    pixel: 2.0,
    cell: 0.05,
    ..Descriptor::NONE
};
