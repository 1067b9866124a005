//! The label windows.

use crate::common::twin;
use crate::{cells, on_all};
use mrfgs::image::Plane;
use mrfgs::low_level::backend::{Backend, Stage, Volume};
use mrfgs::low_level::front::Prepared;
use mrfgs::low_level::plan::Plan;
use mrfgs::options::Order;
use std::cell::Cell;

/// The windows of `level` after its stage, which must replace other windows below the coarsest level.
fn found(backend: &mut dyn Backend, plan: &Plan, level: usize) -> Plane<[u16; 2]> {
    if level + 1 < plan.levels.len() {
        let (runs, rows) = plan.levels[level].windows();
        let stride = plan.levels[level].stride as u16;
        backend.probe().set_windows(level, &Plane::filled(runs, rows, [stride - 16, 16])).unwrap();
    }
    backend.run(Stage::LabelWindow(level)).unwrap();
    backend.probe().windows(level).unwrap()
}

#[test]
fn label_window() {
    let (narrower, all) = (Cell::new(0), Cell::new(0));
    on_all(|case, backend, random| {
        let mut method = case.plan.method.clone();
        method.schedule.order = Order::CoarseFirst;
        let (width, height) = case.plan.size();
        let plan = Plan::new(width, height, case.plan.range, &method).unwrap();
        backend.prepare(&plan, Prepared::new(&case.pair)).unwrap();
        let last = plan.levels.len() - 1;
        if found(backend, &plan, last) != twin::label_window::label_window(&plan, last, None, None) {
            return Err("windows of the coarsest level".into());
        }
        for z in 0..last {
            let labels = plan.levels[z + 1].labels;
            // A surface, with some pixels far from it, and ties.
            let surface = random.within(0, labels as u32 - 1) as usize;
            let far = random.pick(&[2, 30, 1000]);
            let belief: Vec<u32> = (0..cells(&plan, z + 1))
                .map(|i| {
                    if i % labels == surface && !random.one_in(far) {
                        random.within(1, 4)
                    } else if random.one_in(500) {
                        // Just within or beyond the limit for candidates.
                        random.within(9, 13)
                    } else {
                        random.within(16, 25)
                    }
                })
                .collect();
            backend.probe().set_windows(z + 1, &full(&plan, z + 1)).unwrap();
            backend.probe().write(Volume::Belief(z + 1), &belief).unwrap();
            let expected = twin::label_window::label_window(&plan, z, Some(&belief), None);
            if found(backend, &plan, z) != expected {
                return Err(format!("windows of level {z}"));
            }
            // Controls: some windows are narrower than all labels, and some are not.
            narrower.set(narrower.get() + usize::from(expected != full(&plan, z)));
            all.set(all.get() + 1);
        }
        Ok(())
    });
    assert!(
        5 * narrower.get() > all.get() && narrower.get() < all.get(),
        "{} of {}",
        narrower.get(),
        all.get()
    );
}

fn full(plan: &Plan, level: usize) -> Plane<[u16; 2]> {
    let (runs, rows) = plan.levels[level].windows();
    Plane::filled(runs, rows, [0, plan.levels[level].stride as u16])
}

#[test]
fn windows_within_label_ranges() {
    let narrower = Cell::new(0);
    on_all(|case, backend, random| {
        let mut method = case.plan.method.clone();
        (method.front.zone_sigmas, method.schedule.order) = (1.0, Order::Together);
        let (width, height) = case.plan.size();
        let plan = Plan::new(width, height, case.plan.range, &method).unwrap();
        let ranges: Vec<Plane<[u16; 2]>> = plan
            .levels
            .iter()
            .map(|level| {
                let last = level.labels as u32 - 1;
                let most = random.pick(&[0, 3, last]).min(last);
                Plane::from_fn(level.width, level.height, |_, _| {
                    let first = random.within(last / 2, last / 2 + most.min(last - last / 2));
                    [first as u16, random.within(first, last.min(first + most)) as u16]
                })
            })
            .collect();
        let prepared = Prepared { label_ranges: ranges.clone(), ..Prepared::new(&case.pair) };
        backend.prepare(&plan, prepared).unwrap();
        for (z, ranges) in ranges.iter().enumerate() {
            let expected = twin::label_window::label_window(&plan, z, None, Some(ranges));
            if found(backend, &plan, z) != expected {
                return Err(format!("windows of level {z}"));
            }
            narrower.set(narrower.get() + usize::from(expected != full(&plan, z)));
        }
        Ok(())
    });
    assert!(narrower.get() > 100, "{}", narrower.get());
}
