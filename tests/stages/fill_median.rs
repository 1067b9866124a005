//! The median of the filled pixels.

use crate::common::twin;
use crate::maps::on_maps;
use crate::median::{any_maps, any_method};
use mrfgs::low_level::backend::Stage;

#[test]
fn fill_median() {
    on_maps(Stage::FillMedian, 30, any_method, any_maps, twin::fill_median::fill_median);
}
