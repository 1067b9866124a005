//! Sources of pairs.

pub(crate) mod folder;
pub(crate) mod input;
pub(crate) mod large;
pub mod list;
pub(crate) mod views;
