//! The exchange of the views.

use crate::common::compare::compare_finest;
use crate::common::{random, twin};
use crate::{on_all, same};
use mrfgs::low_level::backend::{Stage, Volume};

#[test]
fn swap_views() {
    on_all(|case, backend, random| {
        let mut maps = random::finest(random, &case.plan, false);
        maps.write(backend);
        backend.run(Stage::SwapViews).unwrap();
        twin::swap_views::swap_views(&mut maps);
        compare_finest(backend, &maps)?;
        // Stages on images see the views exchanged.
        backend.run(Stage::Cost).unwrap();
        same(&case.plan, backend, Volume::Cost(0), &twin::cost::cost(&case.plan, &case.pair.mirrored()))?;
        // A second exchange restores everything except the runners-up.
        backend.run(Stage::SwapViews).unwrap();
        twin::swap_views::swap_views(&mut maps);
        compare_finest(backend, &maps)
    });
}

/// Control: labels that stay, or that are mirrored without an exchange, are detected.
#[test]
fn control_a_missing_swap_is_found() {
    let (noticed, all) = (std::cell::Cell::new(0), std::cell::Cell::new(0));
    on_all(|case, backend, random| {
        let maps = random::finest(random, &case.plan, false);
        maps.write(backend);
        backend.run(Stage::SwapViews).unwrap();
        let mut mirrored = maps.clone();
        (mirrored.label, mirrored.right_label) = (maps.label.mirrored(), maps.right_label.mirrored());
        let both = [maps, mirrored].map(|wrong| compare_finest(backend, &wrong).is_err());
        noticed.set(noticed.get() + usize::from(both == [true, true]));
        all.set(all.get() + 1);
        Ok(())
    });
    assert!(2 * noticed.get() > all.get(), "{} of {}", noticed.get(), all.get());
}
