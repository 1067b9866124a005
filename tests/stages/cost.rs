//! The matching cost.

use crate::common::devices::backends;
use crate::common::random::{self, Random, texture};
use crate::common::twin;
use crate::{cells, on_all, same};
use mrfgs::image::{Image, Pair, Plane};
use mrfgs::low_level::backend::{Stage, Volume};
use mrfgs::low_level::front::Prepared;
use mrfgs::options::{MatchingCost, Method};

#[test]
fn cost() {
    on_all(|case, backend, random| {
        for &cost in MatchingCost::ALL {
            let mut plan = case.plan.clone();
            plan.method.cost.matching = cost;
            backend.prepare(&plan, Prepared::new(&case.pair)).unwrap();
            let poison: Vec<u32> = (0..cells(&plan, 0)).map(|_| random.within(0, 255)).collect();
            backend.probe().write(Volume::Cost(0), &poison).unwrap();
            backend.run(Stage::Cost).unwrap();
            same(&plan, backend, Volume::Cost(0), &twin::cost::cost(&plan, &case.pair))?;
        }
        Ok(())
    });
}

#[test]
fn cost_with_the_largest_window() {
    let mut random = Random::new(31);
    let mut method = random::method(&mut random, 0);
    (method.cost.matching, method.cost.sad_window, method.cost.sad_steps) = (MatchingCost::Sad, 31, 16);
    method.cost.outside_cost = 10.0;
    let plan = random::plan((37, 33), -3, 9, &method);
    let pair = random::pair(&mut random, 37, 33);
    for (name, mut backend) in backends() {
        backend.prepare(&plan, Prepared::new(&pair)).unwrap();
        backend.run(Stage::Cost).unwrap();
        if let Err(e) = same(&plan, backend.as_mut(), Volume::Cost(0), &twin::cost::cost(&plan, &pair)) {
            panic!("{name}: {e}");
        }
    }
}

/// Images in whole 8-bit levels, which are uploaded in fewer bytes, and some that are nearly so.
#[test]
fn cost_of_8_bit_images() {
    let mut random = Random::new(32);
    let (width, height) = (37, 23);
    let masked = |random: &mut Random| {
        let mut image = texture(random, width, height);
        image.masked = Plane::from_fn(width, height, |_, _| random.one_in(9));
        image
    };
    let pair = [masked(&mut random), masked(&mut random)];
    let changes: &[fn(&mut [Image; 2])] = &[
        |_| (),
        |[left, _]| left.pixels[(36, 22)][0] += 1,
        |[_, right]| right.pixels[(0, 5)][2] += 255,
        |[left, _]| left.pixels[(3, 5)][3] ^= 256,
        |[_, right]| right.pixels[(9, 9)][3] = right.pixels[(9, 9)][3].wrapping_sub(1),
    ];
    for (name, mut backend) in backends() {
        let mut bytes = Vec::new();
        for change in changes {
            let mut images = pair.clone();
            change(&mut images);
            let [left, right] = images;
            let pair = Pair::new(left, right).unwrap();
            let plan = random::plan((width, height), -3, 9, &Method::default());
            // Data of an earlier pair of this size must not affect the result.
            backend.prepare(&plan, Prepared::new(&pair)).unwrap();
            backend.probe().poison(0xa5).unwrap();
            backend.prepare(&plan, Prepared::new(&pair)).unwrap();
            bytes.push(backend.traffic().bytes_up);
            backend.run(Stage::Cost).unwrap();
            if let Err(e) = same(&plan, backend.as_mut(), Volume::Cost(0), &twin::cost::cost(&plan, &pair)) {
                panic!("{name}: {e}");
            }
        }
        assert!(bytes[1..].iter().all(|&wide| wide == 0 || wide > 3 * bytes[0]), "{name}: {bytes:?}");
    }
}
