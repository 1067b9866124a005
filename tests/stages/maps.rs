//! Shared code for tests of map stages, and tests of several of them.

use super::common::compare::compare_finest;
use super::common::devices::backends;
use super::common::random::{self, Random, texture};
use super::common::twin::{self, Finest};
use mrfgs::image::{Image, Pair, Plane};
use mrfgs::low_level::backend::Stage;
use mrfgs::low_level::front::Prepared;
use mrfgs::low_level::plan::Plan;
use mrfgs::maps::flag;
use mrfgs::options::{Median, Method, Nearer};

const SIZES: &[(usize, usize)] = &[(1, 1), (1, 9), (13, 1), (2, 2), (17, 11), (24, 31), (150, 4)];

/// A twin of a map stage.
pub(crate) type Twin = fn(&Plan, &Pair, &mut Finest);

/// A plan with one level and no neighbours, for a random method.
pub(crate) fn small_plan(random: &mut Random, size: (usize, usize), change: impl Fn(&mut Method)) -> Plan {
    let mut method = random::method(random, 0);
    method.graph.levels = 1;
    change(&mut method);
    let labels = random.pick(&[1, 2, 3, 9, 40]);
    random::plan(size, random.pick(&[-20, -1, 0, 5]), labels, &method)
}

/// Runs `stage` on maps from `input`, for every size and many seeds, and compares all maps with the twin's.
pub(crate) fn on_maps(
    stage: Stage,
    rounds: u64,
    change: impl Fn(&mut Random, &mut Method),
    input: impl Fn(&mut Random, &Plan) -> Finest,
    twin: Twin,
) {
    let mut backends = backends();
    for &size in SIZES {
        for seed in 0..rounds {
            let mut random = Random::new(seed);
            let mut draw = Random::new(seed + 1000);
            let draw = std::cell::RefCell::new(&mut draw);
            let plan = small_plan(&mut random, size, |method| change(&mut draw.borrow_mut(), method));
            let pair = random::pair(&mut random, size.0, size.1);
            let maps = input(&mut random, &plan);
            let mut expected = maps.clone();
            twin(&plan, &pair, &mut expected);
            for (name, backend) in &mut backends {
                let backend = backend.as_mut();
                backend.prepare(&plan, Prepared::new(&pair)).unwrap();
                maps.write(backend);
                backend.run(stage).unwrap();
                if let Err(e) = compare_finest(backend, &expected) {
                    panic!("{name}, {size:?}, seed {seed}: {e}\n{:?}", plan.method);
                }
            }
        }
    }
}

/// Maps without usable pixels: all masked, or all rejected.
#[test]
fn maps_without_valid_pixels() {
    for &size in SIZES {
        let mut random = Random::new(1);
        let plan = small_plan(&mut random, size, |m| {
            (m.refinement.median, m.refinement.speckle_size) = (Median::All, 100);
        });
        let pair = random::pair(&mut random, size.0, size.1);
        let outside = flag::OUTSIDE | flag::LOW_CONFIDENCE;
        for all in [flag::MASKED, flag::OCCLUDED, outside, flag::SPECKLE, flag::TIE, flag::OUTVOTED] {
            let mut maps = random::finest(&mut random, &plan, false);
            maps.validity = Plane::filled(size.0, size.1, all.into());
            let mut expected = maps.clone();
            expected.confidence = Plane::filled(size.0, size.1, 0);
            for (name, mut backend) in backends() {
                backend.prepare(&plan, Prepared::new(&pair)).unwrap();
                maps.write(backend.as_mut());
                for stage in [
                    Stage::SpeckleFilter,
                    Stage::Fill,
                    Stage::VoteFill,
                    Stage::FillPlane,
                    Stage::Median,
                    Stage::Plane,
                    Stage::Confidence,
                    Stage::Support,
                    Stage::FarPlane,
                ] {
                    backend.run(stage).unwrap();
                }
                if let Err(e) = compare_finest(backend.as_mut(), &expected) {
                    panic!("{name}, {size:?}, all {all}: {e}");
                }
            }
        }
    }
}

/// (stage, whether its input only has flags of the left-right check, twin, change that makes it differ).
pub(crate) type Control = (Stage, bool, Twin, fn(&mut Plan));

/// Negative control: a wrong parameter of any stage is detected.
#[test]
fn control_changes_are_found() {
    let region: Twin = |plan, _, maps| twin::speckle_filter::speckle_filter(plan, maps);
    let support: Twin = |plan, _, maps| twin::support::support(plan, maps);
    let fill: Twin = |plan, _, maps| twin::fill::fill(plan, maps);
    control(&[
        (Stage::LeftRightCheck, false, twin::left_right_check::left_right_check, |p| p.range.min += 1),
        (Stage::SpeckleFilter, true, region, |p| p.method.refinement.speckle_size += 1),
        (Stage::Fill, false, fill, |p| p.method.refinement.nearer = Nearer::Smaller),
        (Stage::Support, false, support, |p| p.method.refinement.confidence_floor += 4),
        (Stage::VoteFill, false, twin::vote_fill::vote_fill, |p| {
            p.method.refinement.nearer = Nearer::Smaller;
        }),
        (Stage::VoteFill, false, twin::vote_fill::vote_fill, |p| p.range.min += 1),
        (Stage::FillPlane, false, twin::fill_plane::fill_plane, |p| {
            p.method.refinement.median_sigma_range = 0.02;
        }),
        (Stage::FillPlane, false, twin::fill_plane::fill_plane, |p| p.method.refinement.plane = false),
        (Stage::FillPlane, false, twin::plane::plane, |p| p.method.refinement.median = Median::Filled),
        (Stage::Median, false, twin::median::median, |p| p.method.refinement.median_window = 7),
        (Stage::Median, false, twin::median::median, |p| p.method.refinement.median_sigma_space = 1.0),
        (Stage::Median, false, twin::median::median, |p| p.method.refinement.median_sigma_range = 0.02),
        (Stage::Plane, false, twin::median::median, |_| ()),
        (Stage::Plane, false, twin::plane::plane, |p| p.method.refinement.median = Median::Filled),
        (Stage::Plane, false, twin::plane::plane, |p| p.method.refinement.median_window = 7),
        (Stage::Plane, false, twin::plane::plane, |p| p.method.refinement.median_sigma_range = 0.02),
        (Stage::Plane, false, twin::plane::plane, |p| p.range.max -= 1),
    ]);
}

/// Runs negative controls on every backend.
pub(crate) fn control(changes: &[Control]) {
    let mut random = Random::new(21);
    let mut method = Method::default();
    (method.graph.levels, method.graph.percentile, method.refinement.median_window) = (1, 100.0, 5);
    let plan = random::plan((24, 31), 0, 9, &method);
    // Faint enough that neighbours have weight in the median.
    let faint = Plane::from_fn(24, 31, |_, _| [0; 3].map(|_: i32| random.within(100, 130) as u8));
    let pair = Pair::new(Image::from_rgb8(&faint), texture(&mut random, 24, 31)).unwrap();
    let maps = loop {
        let mut maps = random::finest(&mut random, &plan, true);
        maps.runner_up = maps.best.map(|best| best + best % 20);
        let valid = maps.validity.data().iter().filter(|&&f| f & i32::from(flag::INVALID) == 0).count();
        if valid > 300 && valid < 600 {
            break maps;
        }
    };
    let mut unflagged = maps.clone();
    unflagged.validity = unflagged.validity.map(|v| v & i32::from(flag::OCCLUDED));
    let mut plan = plan;
    plan.method.refinement.speckle_size = 3;
    for (name, mut backend) in backends() {
        for (stage, bare, twin, change) in changes {
            let input = if *bare { &unflagged } else { &maps };
            backend.prepare(&plan, Prepared::new(&pair)).unwrap();
            input.write(backend.as_mut());
            backend.run(*stage).unwrap();
            let mut other = plan.clone();
            change(&mut other);
            let mut expected = input.clone();
            twin(&other, &pair, &mut expected);
            assert!(compare_finest(backend.as_mut(), &expected).is_err(), "{name}: {stage:?}");
        }
    }
}
