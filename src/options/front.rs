//! Options of the front end.

use super::row::{one_of, options, real, whole, words};

words! {
    /// Correction of the illumination.
    Illumination {
        /// No correction.
        None = "none",
        /// A homomorphic filter of 21 x 21 pixels: it takes the logarithm, subtracts a low-pass, and takes the exponential.
        Homomorphic = "homomorphic",
    }
}

options! {
    /// What is done before any cost is computed: illumination, texture zones, label ranges.
    "front" FrontOptions {
        /// Correction of the illumination of both images.
        illumination: Illumination = Illumination::None, takes one_of(Illumination::WORDS),
            source "sections 2.4 and 3.1: homomorphic";
        /// Number of texture zones of the reference image, found by K-means of Gabor responses. Used where zone-sigmas is
        /// above 0.
        zones: u32 = 15, takes whole(1..=64), unit "zones", source "section 3.1: 15";
        /// Limits the labels of a pixel to the mean disparity of its zone's sparse matches and this many standard
        /// deviations on either side; 0 keeps all labels.
        zone_sigmas: f64 = 0.0, takes real(0.0..=100.0), unit "standard deviations", source "section 2.4: 1";
    }
}
