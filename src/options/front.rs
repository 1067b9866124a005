//! Options of the front end.

use super::row::{Takes, options, whole};
#[cfg(feature = "paper")]
use super::row::{one_of, real, words};

#[cfg(feature = "paper")]
words! {
    /// Correction of the illumination.
    Illumination {
        /// No correction.
        None = "none",
        /// A homomorphic filter of 21 x 21 pixels: it takes the logarithm, subtracts a low-pass, and takes
        /// the exponential. The matching cost and the graph take corrected images. Texture zones and sparse
        /// matches take the images as they are.
        Homomorphic = "homomorphic",
        /// The same filter before everything else: texture zones and sparse matches take corrected images,
        /// too.
        HomomorphicFirst = "homomorphic-first",
    }
}

#[cfg(feature = "paper")]
words! {
    /// What a texture zone is.
    ZoneExtent {
        /// A connected region of a cluster.
        Region = "region",
        /// A whole cluster, wherever its pixels are.
        Cluster = "cluster",
    }
}

options! {
    /// What is done before any cost is computed: illumination, texture zones, label ranges.
    "front" FrontOptions {
        /// Correction of the illumination of both images.
        #[cfg(feature = "paper")]
        illumination: Illumination = Illumination::None, takes one_of(Illumination::WORDS),
            source "sections 2.4 and 3.1: homomorphic", for reproduction;
        /// Moves the right view up or down by the median vertical offset of sparse matches, from a sixteenth
        /// of a row on.
        level_rows: bool = true, takes Takes::Switch, source "not in the paper";
        /// Smooths the sharper view until both are equally sharp, if one has markedly less detail.
        equal_sharpness: bool = true, takes Takes::Switch, source "not in the paper";
        /// Smooths both views if they share little of their finest detail, a sign of noise, or if JPEG has
        /// left steps between its blocks of 8 x 8 pixels.
        denoise: bool = true, takes Takes::Switch, source "not in the paper";
        /// Frames of a video from one measurement of these faults to the next. The frames between are corrected like the measured one.
        /// A frame of another size or range is measured too. 1 measures every frame, for pairs of different cameras.
        measure_every: u32 = 30, takes whole(1..=10_000), unit "frames", source "not in the paper";
        /// Number of clusters into which K-means sorts the Gabor responses of the reference image, for
        /// texture zones. Used if zone-sigmas is above 0.
        #[cfg(feature = "paper")]
        clusters: u32 = 15, takes whole(1..=64), unit "clusters", source "section 3.1: 15", for reproduction;
        /// What a texture zone is.
        #[cfg(feature = "paper")]
        zone_extent: ZoneExtent = ZoneExtent::Region, takes one_of(ZoneExtent::WORDS), source "section 2.4: region", for reproduction;
        /// Limits the labels of a pixel to this many standard deviations around the mean disparity of its
        /// zone's sparse matches; 0 keeps all labels, and so does a zone of fewer than 10 matches.
        #[cfg(feature = "paper")]
        zone_sigmas: f64 = 0.0, takes real(0.0..=100.0), unit "standard deviations", source "section 2.4: 1", for reproduction;
    }
}

#[cfg(feature = "paper")]
impl FrontOptions {
    /// Whether the illumination of the images is corrected.
    pub(crate) fn corrects_illumination(&self) -> bool {
        self.illumination != Illumination::None
    }

    /// Whether texture zones limit the labels of their pixels.
    pub(crate) fn limits_labels(&self) -> bool {
        self.zone_sigmas > 0.0
    }
}

#[cfg(not(feature = "paper"))]
#[allow(clippy::unused_self, reason = "with the feature they look at its options")]
impl FrontOptions {
    /// No illumination is corrected.
    pub(crate) fn corrects_illumination(&self) -> bool {
        false
    }

    /// No labels are limited.
    pub(crate) fn limits_labels(&self) -> bool {
        false
    }
}
