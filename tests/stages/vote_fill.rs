//! The votes on filled pixels.

use crate::common::devices::backends;
use crate::common::random::{self, Random};
use crate::common::twin::{self, Finest};
use crate::maps::on_maps;
use mrfgs::image::{Image, Pair, Plane};
use mrfgs::low_level::backend::{Map, Stage};
use mrfgs::low_level::front::Prepared;
use mrfgs::low_level::plan::Plan;
use mrfgs::maps::flag;
use mrfgs::options::{Fill, Method, Nearer};

/// Maps after the fill: pixels that are neither valid nor masked are filled.
fn filled(random: &mut Random, plan: &Plan) -> Finest {
    let mut maps = random::finest(random, plan, false);
    for validity in maps.validity.data_mut() {
        if twin::fill::invalid(*validity) && *validity & i32::from(flag::MASKED) == 0 {
            *validity |= i32::from(flag::FILLED);
        }
    }
    maps
}

#[test]
fn vote_fill() {
    let method = |random: &mut Random, method: &mut Method| {
        method.refinement.fill = Fill::Votes;
        method.refinement.nearer = random.pick(&[Nearer::Larger, Nearer::Smaller]);
    };
    on_maps(Stage::VoteFill, 20, method, filled, twin::vote_fill::vote_fill);
}

/// A wrong patch in a flat surface is outvoted if its pixels are not confident, unless it has another colour.
#[test]
fn doubtful_pixels_are_outvoted() {
    let size = (60, 24);
    let inside = |x: usize, y: usize| (24..34).contains(&x) && (8..16).contains(&y);
    let plan = random::plan(size, 0, 20, &Method::default());
    let image = |patch: u8| {
        let level = |x: usize, y: usize| if inside(x, y) { patch } else { 90 };
        Image::from_rgb8(&Plane::from_fn(size.0, size.1, |x, y| [level(x, y); 3]))
    };
    for (name, mut backend) in backends() {
        let mut outvoted = |confidence: i32, patch: u8| {
            let mut maps = Finest::zero(size);
            let label = |x: usize, y: usize| if inside(x, y) { 12 } else { 3 };
            maps.label = Plane::from_fn(size.0, size.1, label);
            maps.disparity = maps.label.map(|label| 256 * label);
            let confident = |x: usize, y: usize| if inside(x, y) { confidence } else { 100 };
            maps.confidence = Plane::from_fn(size.0, size.1, confident);
            let pair = Pair::new(image(patch), image(patch)).unwrap();
            let backend = backend.as_mut();
            backend.prepare(&plan, Prepared::new(&pair)).unwrap();
            maps.write(backend);
            backend.run(Stage::VoteFill).unwrap();
            let [disparity, validity, confidence] = [Map::Disparity, Map::Validity, Map::Confidence]
                .map(|map| pollster::block_on(backend.map(map)).unwrap());
            let given_up = i32::from(flag::OUTVOTED | flag::FILLED);
            for (x, y) in (0..size.1).flat_map(|y| (0..size.0).map(move |x| (x, y))) {
                let at = (x, y);
                if validity[at] == given_up {
                    assert!(inside(x, y) && confidence[at] == 0, "{name}, {at:?}");
                    assert!((disparity[at] - 768).abs() < 256, "{name}, {at:?}: {}", disparity[at]);
                } else {
                    assert_eq!((disparity[at], validity[at]), (256 * label(x, y), 0), "{name}, {at:?}");
                    assert_eq!(confidence[at], confident(x, y), "{name}, {at:?}");
                }
            }
            validity.data().iter().filter(|&&validity| validity == given_up).count()
        };
        assert_eq!([outvoted(31, 90), outvoted(32, 90), outvoted(31, 250)], [80, 0, 0], "{name}");
    }
}
