//! Options of the refinement of the disparity map.

use super::row::{Takes, odd, one_of, options, real, whole, words};

words! {
    /// Where the right view's map for the left-right check comes from.
    LeftRightCheck {
        /// No check.
        Off = "off",
        /// From the same beliefs: a right pixel takes the best of the labels that see it.
        RightView = "right-view",
        /// From a second matching with the views exchanged, as in the paper's predecessor.
        SecondMatch = "second-match",
    }
}

words! {
    /// What happens to pixels that the left-right check or the speckle filter made invalid.
    Fill {
        /// They stay invalid.
        None = "none",
        /// They take the farther of the nearest valid disparities to the left and to the right on the row.
        Row = "row",
        /// Valid pixels vote for their own disparities, above all along rows. A vote loses weight with
        /// distance and at edges. Disparities that would hide what the right view sees get votes against
        /// them. Valid pixels of little confidence may be outvoted. Then planes are fitted through wide
        /// surroundings of what is filled. At last, planes of measured pixels, however far away, extend to
        /// the filled pixels that they fit, and outvote valid ones of little confidence. This last step takes
        /// `plane`, and is left out at half the size.
        Votes = "votes",
    }
}

words! {
    /// Which disparities belong to nearer surfaces, counted as x in the left view minus x in the right one. Fill needs to know
    /// it, since what one view does not see belongs to the farther surface.
    Nearer {
        /// The larger ones: the right view was taken from the right of the left one.
        Larger = "larger",
        /// The smaller ones: it was taken from the left, as from an aircraft on its way back.
        Smaller = "smaller",
    }
}

words! {
    /// Which pixels the weighted median changes.
    Median {
        /// None.
        Off = "off",
        /// Filled pixels.
        Filled = "filled",
        /// All pixels.
        All = "all",
    }
}

options! {
    /// What is done with the disparity map after belief propagation.
    "refinement" RefinementOptions {
        /// Compare with the disparities of the right view: a pixel that differs by more than one pixel is occluded.
        left_right_check: LeftRightCheck = LeftRightCheck::RightView, takes one_of(LeftRightCheck::WORDS),
            source "section 2.5: off";
        /// Regions with fewer pixels than this become invalid, and so do pixels at which two labels tie; 0 keeps all of them.
        speckle_size: u32 = 100, takes whole(0..=u32::MAX), unit "pixels", source "open";
        /// Place the disparity between the labels, by the matching cost around the optimum.
        sub_pixel: bool = true, takes Takes::Switch, source "open";
        /// What happens to invalid pixels.
        fill: Fill = Fill::Votes, takes one_of(Fill::WORDS), source "row in the paper";
        /// Which disparities belong to nearer surfaces; the fill takes the farther ones.
        nearer: Nearer = Nearer::Larger, takes one_of(Nearer::WORDS), source "not in the paper";
        /// Which pixels the weighted median changes.
        median: Median = Median::All, takes one_of(Median::WORDS), source "section 2.5: all";
        /// Side of the median's window; it uses every second row of the window.
        median_window: u32 = 17, takes odd(3..=31), unit "pixels", source "open";
        /// Spatial parameter of the median's weights.
        median_sigma_space: f64 = 5.75, takes real(0.1..=100.0), unit "pixels", source "open";
        /// Range parameter of the median's weights, for intensities from 0 to 1.
        median_sigma_range: f64 = 0.1, takes real(1e-3..=10.0), unit "intensity", source "open";
        /// After a median, fit a plane around each pixel that it changes, and take its value there.
        plane: bool = true, takes Takes::Switch, source "not in the paper";
        /// Also make the disparity map of the right view, refined like that of the left one.
        right_map: bool = false, takes Takes::Switch, source "not in the paper";
        /// Pixels with less confidence than this get the validity flag for low confidence.
        confidence_floor: u32 = 24, takes whole(0..=255), unit "1/8 nat", source "not in the paper";
    }
}
