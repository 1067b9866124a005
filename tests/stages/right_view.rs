//! The label map of the right view.

use crate::common::compare::compare_finest;
use crate::common::twin::belief::belief_most;
use crate::common::{random, twin};
use crate::on_all;
use mrfgs::image::Image;
use mrfgs::low_level::backend::{Stage, Volume};
use mrfgs::low_level::front::Prepared;
use std::cell::Cell;

#[test]
fn right_view() {
    let (narrower, masked) = (Cell::new(0), Cell::new(0));
    on_all(|case, backend, random| {
        let mut plan = case.plan.clone();
        let width = plan.levels[0].width;
        for most in [0, 2, belief_most(&plan)] {
            let belief = case.beliefs(random, most);
            backend.probe().write(Volume::Belief(0), &belief).unwrap();
            let mut maps = random::finest(random, &plan, false);
            maps.write(backend);
            backend.run(Stage::RightView).unwrap();
            twin::right_view::right_view(&plan, case.pair.left(), &belief, &mut maps);
            compare_finest(backend, &maps)?;
            // Control: all columns give a different right view.
            let mut all = maps.clone();
            twin::right_view::right_view(&case.plan, case.pair.left(), &belief, &mut all);
            narrower.set(narrower.get() + usize::from(all != maps));
            // Control: so do masked pixels.
            let seen = Image { masked: case.pair.left().masked.map(|_| false), ..case.pair.left().clone() };
            twin::right_view::right_view(&plan, &seen, &belief, &mut all);
            masked.set(masked.get() + usize::from(all != maps));
            // Then prepare a tile with another core in the same buffers.
            let start = random.within(0, width as u32 - 1) as usize;
            plan.core = start..random.within(start as u32 + 1, width as u32) as usize;
            backend.prepare(&plan, Prepared::new(&case.pair)).unwrap();
            backend.probe().set_windows(0, &case.windows[0]).unwrap();
        }
        Ok(())
    });
    assert!(narrower.get() > 50, "{}", narrower.get());
    assert!(masked.get() > 50, "{}", masked.get());
}
