//! What the places of the windows of adjacent pixels hold, for median and planes.

/// Number of pixels whose windows are weighed together, in vectors of bytes.
pub(super) const LANES: usize = 32;

/// Where a place of the first lane's window lies in the input, how many steps in x and y from the centre, and the weights of all
/// lanes: 0 without disparity.
#[derive(Clone, Copy, Default)]
pub(super) struct Weighed {
    pub(super) at: usize,
    pub(super) step: [i16; 2],
    pub(super) weights: [u8; LANES],
}

/// The disparities at a place of the window, for all lanes, relative to a base of each lane.
#[repr(align(64))]
#[derive(Clone, Copy, Default)]
pub(super) struct Values(pub(super) [i16; LANES]);
