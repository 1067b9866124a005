//! A match as a list of steps: the engine runs it, and work and progress are sums over it.
//!
//! [`schedule`] writes the basic list for a pair in one piece. Each other requirement of the method, the
//! memory or the backend is a pass from list to list, in its own file:
//!
//! ```text
//! schedule ──> second_match ──> right_view ──> tiled ──> double_size        what is computed
//!          ──> together, joined, sharing                                   how a backend computes it
//! ```

mod compile;
pub(crate) mod double_size;
pub(crate) mod joined;
mod list;
pub(crate) mod right_view;
#[cfg(test)]
mod samples;
pub(crate) mod schedule;
pub(crate) mod second_match;
pub(crate) mod sharing;
pub(crate) mod tiled;
pub(crate) mod tiles;
pub(crate) mod together;

pub(crate) use list::{Frame, RowBand, Sent, View};
pub use list::{Program, Run, SentMessages, Step};
