//! Where pairs come from.

pub(crate) mod cameras;
pub(crate) mod folder;
pub(crate) mod input;
pub mod list;
pub(crate) mod raw;
