//! The matching cost of level 0: the dissimilarity of the left pixel (x, y) and the right pixel (x - d, y)
//! for the disparity d of each label, 0 ..= [`COST_MAX`](crate::plan::COST_MAX).
//!
//! Where x - d is outside the image or either pixel is masked, the cost is
//! [`outside_cost`](crate::plan::Plan::outside_cost). Elsewhere
//! [`MatchingCost`](crate::options::MatchingCost) defines it.

use super::{Data, Descriptor, Volume, volumes};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| vec![Data::LEFT, Data::Right],
    writes: |_| volumes(&[Volume::Cost(0)]),
    needs: |_| vec![Data::LeftCensus, Data::RightCensus, Data::Contrast],
    cell: 2.3,
    ..Descriptor::NONE
};
