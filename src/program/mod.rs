//! A match as a list of steps, which everything else reads: the engine runs it, and work and progress are sums over it.
//!
//! [`schedule`] writes the plain list for a pair in one piece. Each other thing that a method, the memory or a backend asks for is a
//! pass from list to list, in a file of its own:
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

pub use list::{Frame, Part, Program, Run, Sent, Step, View};
