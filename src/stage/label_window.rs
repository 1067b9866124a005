//! The label windows of a level: the labels that each pixel has. Messages need not carry labels that have
//! lost at a coarser level.
//!
//! The pixels of columns 8 i to 8 i + 7 ([`WINDOW_RUN`](crate::plan::WINDOW_RUN)) in rows 2 r and
//! 2 r + 1 share window (i, r).
//!
//! 1. The labels that it must hold, from `least` to `most`, by the first rule that applies (label k of a
//!    level has the disparity low + k):
//!    - If [the windows follow beliefs](crate::plan::Plan::windows_follow_beliefs), that is, levels join one
//!      after another and this is not the coarsest: with c the disparity of each candidate of each pixel
//!      (X, Y) of the next coarser level inside the image and at most [`WINDOW_REACH`](crate::plan::WINDOW_REACH)
//!      rows and columns from those of the run,
//!
//!      ```text
//!      X = 4 i - 2 ..= 4 i + 5                 least = the label of the smallest 2 c - 2
//!      Y = r - 2 ..= r + 2                     most  = the label of the largest 2 c + 2
//!      ```
//!
//!      The candidates of a pixel are its labels whose belief is at most
//!      [`WINDOW_SLACK`](crate::plan::WINDOW_SLACK) above the smallest (beliefs are costs).
//!    - If zones [limit the labels](crate::plan::Plan::limits_labels): the smallest first and the largest
//!      last label of the [label ranges](crate::front::Prepared::label_ranges) of the run's pixels.
//!    - Otherwise: all labels.
//! 2. `least` and `most` are clamped to the labels of the level, 0 ..= labels - 1.
//! 3. The window holds `count` labels from `first` on:
//!
//!    ```text
//!    first = 4 floor(least / 4)                           4 is WINDOW_STEP
//!    count = 16 ceil((most + 1 - first) / 16)             16 is LABEL_BLOCK
//!    first = min(first, 16 ceil(labels / 16) - count)     not past the level's last block
//!    ```
//!
//! A pixel has the labels k of its window that exist at the level: first <= k < min(first + count, labels).
//! For every stage, the belief of any other label is infinite:
//! [`VolumeWidth::most`](crate::plan::VolumeWidth::most).

use super::{Data, Descriptor, Volume};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |z| vec![Data::Volume(Volume::Belief(z + 1)), Data::Windows(z + 1), Data::LabelRange(z)],
    writes: |z| vec![Data::Windows(z)],
    needs: |z| vec![Data::Candidates(z + 1)],
    pixel: 2.0,
    ..Descriptor::NONE
};
