//! The labels of the mirrored pair.

use crate::common::compare::compare_finest;
use crate::common::{random, twin};
use crate::on_all;
use mrfgs::low_level::backend::{Map, Stage};
use mrfgs::low_level::front::Prepared;
use pollster::block_on;

#[test]
fn mirror_labels() {
    on_all(|case, backend, random| {
        let mut maps = random::finest(random, &case.plan, false);
        maps.write(backend);
        let unmirrored = maps.clone();
        backend.run(Stage::MirrorLabels).unwrap();
        twin::mirror_labels::mirror_labels(&mut maps);
        compare_finest(backend, &maps)?;
        // Control: labels that are not mirrored are detected.
        assert_eq!(compare_finest(backend, &unmirrored).is_ok(), unmirrored == maps);
        // They stay when the pair itself is prepared.
        backend.prepare(&case.plan, Prepared::new(&case.pair.mirrored())).unwrap();
        let labels = block_on(backend.map(Map::RightLabel)).unwrap();
        if labels != maps.right_label {
            return Err("the labels do not stay".into());
        }
        Ok(())
    });
}
