//! Options of the factor graph.

use super::row::{options, real, whole};

options! {
    /// The factor graph: its levels, and the members of dependency factors.
    "graph" GraphOptions {
        /// Number of resolution levels; images too small for them have fewer.
        levels: u32 = 6, takes whole(1..=16), unit "levels", source "open";
        /// A pixel of the 7 x 7 window is a neighbour of the centre if its bilateral coefficient is at or above this
        /// percentile of the window's 48.
        percentile: f64 = 97.0, takes real(0.0..=100.0), unit "percent", source "section 3.1: 97";
        /// Domain parameter of the bilateral coefficients.
        sigma_space: f64 = 3.0, takes real(0.1..=100.0), unit "pixels", source "section 3.1: 3";
        /// Range parameter of the bilateral coefficients, for intensities from 0 to 1.
        sigma_range: f64 = 0.1, takes real(1e-3..=10.0), unit "intensity", source "section 3.1: 0.1";
    }
}
