//! The sub-pixel disparity.

use crate::common::compare::compare_finest;
use crate::common::random::Random;
use crate::common::twin::Finest;
use crate::common::twin::belief::belief_most;
use crate::common::twin::sub_pixel::Fit;
use crate::common::{random, twin};
use crate::{cells, on_all, random_cost};
use mrfgs::image::Plane;
use mrfgs::low_level::backend::{Stage, Volume};
use mrfgs::low_level::plan::Plan;
use mrfgs::options::Method;

/// Labels like on a slanted surface, with differences up to `apart`.
fn slanted(random: &mut Random, plan: &Plan, apart: u32, maps: &mut Finest) {
    let labels = plan.levels[0].labels as u32;
    let first = random.within(0, labels - 1);
    let (width, height) = plan.size();
    maps.label =
        Plane::from_fn(width, height, |_, _| (first + random.within(0, apart)).min(labels - 1) as i32);
}

#[test]
fn sub_pixel() {
    on_all(|case, backend, random| {
        for most in [0, 2, belief_most(&case.plan)] {
            let belief: Vec<u32> = (0..cells(&case.plan, 0)).map(|_| random.within(0, most)).collect();
            let cost = random_cost(random, &case.plan, 0);
            let mut maps = random::finest(random, &case.plan, false);
            // Plausible labels of a match.
            twin::winner_takes_all::winner_takes_all(&case.plan, &belief, &mut maps);
            let winners = maps.clone();
            for apart in [None, Some(1), Some(4)] {
                maps = winners.clone();
                if let Some(apart) = apart {
                    slanted(random, &case.plan, apart, &mut maps);
                }
                backend.probe().write(Volume::Cost(0), &cost).unwrap();
                maps.write(backend);
                backend.run(Stage::SubPixel).unwrap();
                twin::sub_pixel::sub_pixel(&case.plan, &cost, &mut maps);
                compare_finest(backend, &maps)?;
            }
        }
        Ok(())
    });
}

/// Negative control: a change of any part of the fit is detected, and offsets span their whole range.
#[test]
fn control_a_changed_fit_is_found() {
    let mut random = Random::new(31);
    let plan = random::plan((40, 30), -3, 19, &Method::default());
    let cost = (0..cells(&plan, 0)).map(|_| random.within(0, 254)).collect::<Vec<_>>();
    let mut maps = random::finest(&mut random, &plan, false);
    let label = |random: &mut Random| 4 + random.within(0, 6) as i32;
    maps.label = Plane::from_fn(40, 30, |_, _| label(&mut random));
    let fitted = |fit: &Fit| {
        let mut maps = maps.clone();
        twin::sub_pixel::sub_pixel_by(fit, &plan, &cost, &mut maps);
        maps.raw
    };
    let base = fitted(&Fit::DEFINED);
    for (name, fit) in [
        ("columns", Fit { reach: (1, 1), ..Fit::DEFINED }),
        ("rows", Fit { reach: (2, 0), ..Fit::DEFINED }),
        ("labels", Fit { near: 1, ..Fit::DEFINED }),
        ("bound", Fit { most: 255.0, ..Fit::DEFINED }),
    ] {
        assert_ne!(base, fitted(&fit), "{name}");
    }
    let offset = |(raw, label): (&i32, &i32)| raw - 256 * (plan.range.min + label);
    let offsets: Vec<i32> = base.data().iter().zip(maps.label.data()).map(offset).collect();
    assert!(offsets.contains(&256) && offsets.contains(&-256) && offsets.contains(&0));
    assert!(offsets.iter().any(|offset| (129..256).contains(offset)));
}
