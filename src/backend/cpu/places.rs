//! Places in the windows of adjacent pixels, for median and planes.

/// Number of adjacent pixels that are processed together, in vectors of bytes.
pub(super) const LANES: usize = 32;

/// A place of the windows: its index in the input for the first lane, its steps from the centre in x and y,
/// and its weights for all lanes, which are 0 without a disparity.
#[derive(Clone, Copy, Default)]
pub(super) struct Weighed {
    pub(super) at: usize,
    pub(super) step: [i16; 2],
    pub(super) weights: [u8; LANES],
}

/// The disparities at a place of the windows, for all lanes, relative to a base per lane.
#[repr(align(64))]
#[derive(Clone, Copy, Default)]
pub(super) struct Values(pub(super) [i16; LANES]);
