//! The labels of the right view, from the beliefs of the left view: a right pixel takes the best of all
//! labels that project to it.
//!
//! With low the smallest disparity, label k matches right pixel (x, y) to left pixel (x + low + k, y), whose
//! belief for it is the cost b(k). Among the k whose left pixel is in the columns
//! [`core`](crate::plan::Plan::core), is not masked, and [has](super::label_window) that label:
//!
//! ```text
//! RightLabel(x, y) = the k of smallest b(k), the lowest on ties         NO_LABEL without any
//! RightBest(x, y)  = its b(k)                                           65535 without any
//! ```
//!
//! A masked pixel would take the right pixels of its neighbours, as all labels cost it nothing.
//! These are the maps [`RightLabel`](crate::backend::Map::RightLabel) and
//! [`RightBest`](crate::backend::Map::RightBest).

use super::{Data, Descriptor, Map, Volume, maps, volumes};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |_| [volumes(&[Volume::Belief(0)]), vec![Data::LEFT]].concat(),
    writes: |_| maps(&[Map::RightLabel, Map::RightBest]),
    reach: Some(0),
    cell: 0.1,
    ..Descriptor::NONE
};
