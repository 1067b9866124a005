//! Where pairs come from.

pub(crate) mod folder;
pub(crate) mod input;
pub mod list;
