//! A naive twin of every stage, one file per stage, written only from the definitions in `src/stage/NAME.rs`:
//! one cell at a time, wide integers, no padding, no tables, no tricks. Twins share data types and documented
//! constants with the library, but no function that computes.
//!
//! Volumes are `Vec<u32>` in the layout of [`mrfgs::low_level::backend::Volume`]:
//! \[y\]\[x\]\[slot\]\[label\].

pub mod census;

macro_rules! declare {
    (
        $( $group:ident { $( $stage:ident $name:ident; )* } )*
    ) => {
        $( $( pub mod $name; )* )*
    };
}

mrfgs::for_every_stage!(declare);

use mrfgs::image::Plane;
use mrfgs::low_level::backend::{Backend, Map};
use mrfgs::low_level::graph::LevelGraph;
use mrfgs::low_level::plan::{Plan, Truncation, TruncationRule, VolumeWidth};

/// The maps of the finest level: the plane of every [`Map`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finest {
    pub label: Plane<i32>,
    pub best: Plane<i32>,
    pub runner_up: Plane<i32>,
    pub right_label: Plane<i32>,
    pub right_best: Plane<i32>,
    pub raw: Plane<i32>,
    pub disparity: Plane<i32>,
    pub validity: Plane<i32>,
    pub confidence: Plane<i32>,
}

impl Finest {
    /// Zero everywhere.
    pub fn zero((width, height): (usize, usize)) -> Self {
        let zero = || Plane::filled(width, height, 0);
        Self {
            label: zero(),
            best: zero(),
            runner_up: zero(),
            right_label: zero(),
            right_best: zero(),
            raw: zero(),
            disparity: zero(),
            validity: zero(),
            confidence: zero(),
        }
    }

    /// Every map, with its plane.
    pub fn planes(&self) -> [(Map, &Plane<i32>); 9] {
        [
            (Map::Label, &self.label),
            (Map::Best, &self.best),
            (Map::RunnerUp, &self.runner_up),
            (Map::RightLabel, &self.right_label),
            (Map::RightBest, &self.right_best),
            (Map::Raw, &self.raw),
            (Map::Disparity, &self.disparity),
            (Map::Validity, &self.validity),
            (Map::Confidence, &self.confidence),
        ]
    }

    /// Writes all maps to `backend`.
    pub fn write(&self, backend: &mut dyn Backend) {
        for (map, plane) in self.planes() {
            backend.probe().write_map(map, plane).unwrap();
        }
    }
}

/// The binomial filter 1 4 6 4 1, at -2 ..= 2.
pub fn binomial(place: i64) -> i64 {
    match place.abs() {
        0 => 6,
        1 => 4,
        2 => 1,
        _ => 0,
    }
}

/// The largest value of messages and beliefs, at which their sums saturate; also the sum if no label agrees.
pub fn most(plan: &Plan) -> u32 {
    match plan.volume_width {
        VolumeWidth::Narrow => 255,
        VolumeWidth::Wide => 65_535,
    }
}

/// Marks values of labels that a pixel does not have.
pub const UNDEFINED: u32 = u32::MAX;

/// Truncates the sums `s` to a message; the minimum is over the labels that `counts` accepts.
pub fn cut(plan: &Plan, s: &[i64], counts: impl Fn(usize) -> bool, cut: Truncation) -> Vec<u32> {
    let (tau, infinite) = (i64::from(cut.tau), i64::from(most(plan)));
    let smallest = (0..s.len()).filter(|&d| counts(d)).map(|d| s[d]).min().unwrap_or(infinite);
    let low = smallest.min(infinite - tau);
    let message = |d: usize| match cut.rule {
        _ if !counts(d) => UNDEFINED,
        TruncationRule::Relative => u32::try_from(s[d].min(low + tau) - low).unwrap(),
        TruncationRule::Absolute => u32::try_from(s[d].min(tau)).unwrap(),
    };
    (0..s.len()).map(message).collect()
}

/// The message of a variable to a factor: its belief minus the factor's old message, infinite where the
/// belief is. For absolute truncation, also minus its minimum over the labels that `counts` accepts.
pub fn variable_message(
    plan: &Plan,
    belief: &[u32],
    old: &[u32],
    counts: impl Fn(usize) -> bool,
    cut: Truncation,
) -> Vec<i64> {
    let infinite = i64::from(most(plan));
    let finite = |d: usize| belief[d] != most(plan);
    let q: Vec<i64> = (0..belief.len())
        .map(|d| if finite(d) { i64::from(belief[d]) - i64::from(old[d]) } else { infinite })
        .collect();
    assert!(q.iter().all(|&q| q >= 0), "a belief below a message that is part of it");
    match cut.rule {
        TruncationRule::Relative => q,
        TruncationRule::Absolute => {
            let counted = (0..q.len()).filter(|&d| counts(d) && finite(d)).map(|d| q[d]);
            let smallest = counted.min().unwrap_or(infinite);
            let less = |d: usize| if finite(d) { (q[d] - smallest).max(0) } else { infinite };
            (0..q.len()).map(less).collect()
        }
    }
}

/// The pixel in each slot of `factor`, decoded from the graph's codes: a position in the 7 x 7 window in
/// raster order, 255 for none.
pub fn members(graph: &LevelGraph, factor: usize) -> Vec<Option<usize>> {
    let (width, neighbours) = (graph.width(), graph.slots() - 1);
    let mut members = vec![Some(factor)];
    for &code in &graph.codes()[factor * neighbours..(factor + 1) * neighbours] {
        members.push((code != 255).then(|| {
            let x = factor % width + usize::from(code % 7) - 3;
            let y = factor / width + usize::from(code / 7) - 3;
            assert!(x < width && y < graph.height());
            y * width + x
        }));
    }
    members
}
