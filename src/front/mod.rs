//! The front end of the paper (section 2.4): what is done to the images before there are costs.

pub mod illumination;
pub mod zones;
