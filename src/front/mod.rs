//! The front end of the paper (section 2.4): what is worked out from the images alone, before there are costs.

pub mod check;
pub mod illumination;
pub mod label_range;
pub mod matches;
pub mod zones;
