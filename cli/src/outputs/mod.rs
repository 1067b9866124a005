//! Outputs: all checked before any computing, and all written or none left behind.

pub(crate) mod also;
pub(crate) mod claim;
pub(crate) mod cloud;
pub(crate) mod files;
pub(crate) mod film;
pub(crate) mod maps;
pub(crate) mod record;
pub(crate) mod staged;
