//! Planes for filled pixels.

use crate::common::twin;
use crate::maps::on_maps;
use crate::median::any_method;
use crate::plane::slanted;
use mrfgs::low_level::backend::Stage;

#[test]
fn fill_plane() {
    for plane in [true, false] {
        let method = |random: &mut crate::common::random::Random, method: &mut mrfgs::options::Method| {
            any_method(random, method);
            method.refinement.plane = plane;
        };
        on_maps(Stage::FillPlane, 20, method, slanted, twin::fill_plane::fill_plane);
    }
}
