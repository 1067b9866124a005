//! The limits of costs by label ranges.

use crate::common::twin;
use crate::{on_all, random_cost, same};
use mrfgs::image::Plane;
use mrfgs::low_level::backend::{Stage, Volume};
use mrfgs::low_level::front::Prepared;
use mrfgs::low_level::plan::Plan;

#[test]
fn label_range() {
    on_all(|case, backend, random| {
        let mut method = case.plan.method.clone();
        method.front.zone_sigmas = 1.0;
        let (width, height) = case.plan.size();
        let plan = Plan::new(width, height, case.plan.range, &method).unwrap();
        let label_ranges: Vec<Plane<[u16; 2]>> = plan
            .levels
            .iter()
            .map(|level| {
                Plane::from_fn(level.width, level.height, |_, _| {
                    let last = level.labels as u32 - 1;
                    let (a, b) = (random.within(0, last), random.within(0, last));
                    if random.one_in(4) { [0, last as u16] } else { [a.min(b) as u16, a.max(b) as u16] }
                })
            })
            .collect();
        let prepared = Prepared { label_ranges: label_ranges.clone(), ..Prepared::new(&case.pair) };
        backend.prepare(&plan, prepared).unwrap();
        for (z, label_range) in label_ranges.iter().enumerate() {
            let cost = random_cost(random, &plan, z);
            backend.probe().write(Volume::Cost(z), &cost).unwrap();
            backend.run(Stage::LabelRange(z)).unwrap();
            let expected = twin::label_range::label_range(&plan, z, label_range, &cost);
            same(&plan, backend, Volume::Cost(z), &expected)?;
            // Control: the label range affects the result.
            if expected != cost {
                let mut other = label_range.clone();
                other.data_mut().fill([0, plan.levels[z].labels as u16 - 1]);
                assert!(
                    same(
                        &plan,
                        backend,
                        Volume::Cost(z),
                        &twin::label_range::label_range(&plan, z, &other, &cost)
                    )
                    .is_err()
                );
            }
        }
        Ok(())
    });
}
