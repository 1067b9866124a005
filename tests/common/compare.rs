//! Comparison of volumes and maps that reports where they first differ.

use super::twin::{Finest, UNDEFINED};
use mrfgs::image::Plane;
use mrfgs::low_level::backend::{Backend, Volume, volume_shape};
use mrfgs::low_level::plan::Plan;
use pollster::block_on;
use std::fmt::Debug;

/// The first difference between `actual` and `expected`, both \[y\]\[x\]\[slot\]\[label\] of `volume`, and
/// the number of differences. An expected [`UNDEFINED`] matches any value.
pub fn compare(plan: &Plan, volume: Volume, actual: &[u32], expected: &[u32]) -> Result<(), String> {
    let (rows, labels, _) = volume_shape(plan, volume);
    let (level, slots) = match volume {
        Volume::Dependency(z) => (z, plan.slots()),
        Volume::Cost(z) | Volume::Evidence(z) | Volume::Down(z) | Volume::Up(z) | Volume::Belief(z) => (z, 1),
    };
    let width = plan.levels[level].width;
    if actual.len() != rows * labels || expected.len() != rows * labels {
        let (a, e) = (actual.len(), expected.len());
        return Err(format!("{volume:?}: {a} values, the twin has {e}, the plan says {}", rows * labels));
    }
    let differ: Vec<usize> =
        (0..actual.len()).filter(|&i| expected[i] != UNDEFINED && actual[i] != expected[i]).collect();
    let Some(&first) = differ.first() else { return Ok(()) };
    let (label, slot, pixel) = (first % labels, first / labels % slots, first / labels / slots);
    Err(format!(
        "{volume:?}: {} of {} values differ, first at x {}, y {}, slot {slot}, label index {label}: {} but the \
         twin says {}",
        differ.len(),
        actual.len(),
        pixel % width,
        pixel / width,
        actual[first],
        expected[first]
    ))
}

/// The first map of a backend that differs from the twin's.
pub fn compare_finest(backend: &mut dyn Backend, expected: &Finest) -> Result<(), String> {
    for (map, plane) in expected.planes() {
        compare_maps(&format!("{map:?}"), &block_on(backend.map(map)).unwrap(), plane)?;
    }
    Ok(())
}

/// The first difference between two maps, and the number of differences.
pub fn compare_maps<T: PartialEq + Debug>(
    name: &str,
    actual: &Plane<T>,
    expected: &Plane<T>,
) -> Result<(), String> {
    if actual.size() != expected.size() {
        return Err(format!("{name}: {:?} but the twin's is {:?}", actual.size(), expected.size()));
    }
    let (a, e) = (actual.data(), expected.data());
    let differ: Vec<usize> = (0..a.len()).filter(|&i| a[i] != e[i]).collect();
    let Some(&first) = differ.first() else { return Ok(()) };
    Err(format!(
        "{name}: {} of {} pixels differ, first at x {}, y {}: {:?} but the twin says {:?}",
        differ.len(),
        a.len(),
        first % actual.width(),
        first / actual.width(),
        a[first],
        e[first]
    ))
}
