//! Groups of flags that several commands share.

pub(crate) mod execution;
pub(crate) mod method;
pub(crate) mod reading;
pub(crate) mod rectification;
pub(crate) mod search;
pub(crate) mod sign;
pub(crate) mod sizes;
