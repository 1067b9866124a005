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
pub mod double_size;
pub mod joined;
mod list;
pub mod right_view;
#[cfg(test)]
mod samples;
pub mod schedule;
pub mod second_match;
pub mod sharing;
pub mod tiled;
pub mod tiles;
pub mod together;

pub use list::{Frame, Program, RowBand, Run, Sent, SentMessages, Step, View};
