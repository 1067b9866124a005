//! Sources of pairs.

pub(crate) mod folder;
pub(crate) mod input;
pub mod list;
