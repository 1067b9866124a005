//! Every stage of every backend against its naive twin, bit for bit, on seeded random input of awkward sizes,
//! and whole runs of message passing against a second implementation of the schedule. Negative controls show
//! that the comparisons can fail.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on panics")]
#![allow(clippy::needless_range_loop, reason = "levels are counted, as in the schedule that is checked")]

#[path = "../common/mod.rs"]
mod common;
mod controls;
mod floods;
mod maps;
mod saturation;

macro_rules! declare {
    (
        $( $group:ident { $( $stage:ident $name:ident; )* } )*
    ) => {
        $( $( mod $name; )* )*
    };
}

mrfgs::for_every_stage!(declare);

use common::compare::compare;
use common::devices::backends;
use common::random::{self, Random, State};
use common::twin;
use mrfgs::image::{Pair, Plane};
use mrfgs::low_level::backend::{Backend, Volume};
use mrfgs::low_level::graph::LevelGraph;
use mrfgs::low_level::plan::{COST_MAX, Plan};
use mrfgs::options::{MatchingCost, Pyramid};
use std::collections::HashSet;
use std::ops::Range;

/// One pixel, one column, one row, odd sizes, other factors than two, and wider than any block.
const SIZES: &[(usize, usize)] =
    &[(1, 1), (1, 9), (13, 1), (2, 2), (5, 7), (8, 8), (17, 11), (33, 6), (9, 40), (31, 19), (67, 3)];
const LABELS: &[usize] = &[1, 2, 31, 32, 33, 64, 257];
const MINIMA: &[i32] = &[-20, 0, 5, 700, -900];
const NEIGHBOURS: &[usize] = &[0, 1, 2, 4, 8, 12, 25, 48];
/// Largest number of cells of the dependency messages of one case.
const CELLS: usize = 1_000_000;
/// Cases per size and number of labels, unless `MRFGS_ROUNDS` is set.
const ROUNDS: usize = 3;

struct Case {
    name: String,
    seed: u64,
    plan: Plan,
    pair: Pair,
    graphs: Vec<LevelGraph>,
    /// Label windows of every level.
    windows: Vec<Plane<[u16; 2]>>,
}

impl Case {
    /// The labels that every pixel has, by level.
    fn has(&self) -> Vec<Vec<Range<usize>>> {
        let levels = self.windows.iter().enumerate();
        levels.map(|(z, windows)| twin::label_window::ranges(&self.plan, z, windows)).collect()
    }

    /// A state during message passing within the windows.
    fn state(&self, random: &mut Random, loose: bool) -> State {
        random::state_within(random, &self.plan, &self.graphs, self.has(), loose)
    }

    /// Beliefs of level 0 up to `most`, infinite outside the windows.
    fn beliefs(&self, random: &mut Random, most: u32) -> Vec<u32> {
        let labels = self.plan.levels[0].labels;
        let has = twin::label_window::ranges(&self.plan, 0, &self.windows[0]);
        let value = |i: usize| {
            if has[i / labels].contains(&(i % labels)) {
                random.within(0, most)
            } else {
                twin::most(&self.plan)
            }
        };
        (0..cells(&self.plan, 0)).map(value).collect()
    }
}

/// The cases of all tests.
fn cases() -> Vec<Case> {
    let given =
        std::env::var("MRFGS_ROUNDS").ok().map(|rounds| rounds.parse().expect("MRFGS_ROUNDS is a number"));
    rounds(given.unwrap_or(ROUNDS))
}

/// `count` cases for every size and number of labels; everything else is random.
fn rounds(count: usize) -> Vec<Case> {
    let mut cases = Vec::new();
    for (&size, &labels) in SIZES.iter().flat_map(|size| LABELS.iter().map(move |labels| (size, labels))) {
        for _ in 0..count {
            let seed = cases.len() as u64;
            let mut random = Random::new(seed);
            let min = MINIMA[cases.len() % MINIMA.len()];
            let fits: Vec<usize> =
                NEIGHBOURS.iter().copied().filter(|n| size.0 * size.1 * labels * (n + 1) <= CELLS).collect();
            let neighbours = random.pick(&fits);
            let plan = random::plan(size, min, labels, &random::method(&mut random, neighbours));
            assert_eq!(plan.neighbours, neighbours);
            let pair = random::pair(&mut random, size.0, size.1);
            let graphs = if random.one_in(2) {
                common::graphs(pair.left(), &plan)
            } else {
                random::graphs(&mut random, &plan)
            };
            let name = format!("case {seed}: {size:?}, {labels} labels from {min}, {:?}", plan.method);
            let windows = (0..plan.levels.len()).map(|z| random::windows(&mut random, &plan, z)).collect();
            cases.push(Case { name, seed, plan, pair, graphs, windows });
        }
    }
    cases
}

/// Runs `check` for every case on every backend, prepared with the case's label windows, with a separate
/// random generator for each case.
fn on_all(check: impl Fn(&Case, &mut dyn Backend, &mut Random) -> Result<(), String>) {
    for case in cases() {
        for (name, mut backend) in backends() {
            let backend = backend.as_mut();
            common::prepare(backend, &case.plan, &case.pair, &case.graphs);
            for (z, windows) in case.windows.iter().enumerate() {
                backend.probe().set_windows(z, windows).unwrap();
            }
            if let Err(e) = check(&case, backend, &mut Random::new(case.seed ^ 0xbeef)) {
                panic!("{name}: {e}\n{}", case.name);
            }
        }
    }
}

/// Compares a volume of `backend` with the twin's.
fn same(plan: &Plan, backend: &mut dyn Backend, volume: Volume, expected: &[u32]) -> Result<(), String> {
    compare(plan, volume, &backend.probe().read(volume).unwrap(), expected)
}

fn cells(plan: &Plan, z: usize) -> usize {
    plan.levels[z].pixels() * plan.levels[z].labels
}

/// Stored costs of a level: far apart, close together, or all equal.
fn random_cost(random: &mut Random, plan: &Plan, z: usize) -> Vec<u32> {
    let most = u32::from(COST_MAX) * if z == 0 { 1 } else { 256 };
    let most = random.pick(&[most, most, most / 20, 1, 0]);
    (0..cells(plan, z)).map(|_| random.within(0, most)).collect()
}

#[test]
fn the_cases_cover_all_kinds_of_plans() {
    let cases = rounds(ROUNDS);
    let seen = |f: &dyn Fn(&Plan) -> String| cases.iter().map(|c| f(&c.plan)).collect::<HashSet<_>>();
    assert_eq!(
        seen(&|p| format!("{:?} {:?}", p.method.messages.potential, p.method.messages.agreement)).len(),
        6
    );
    assert_eq!(seen(&|p| format!("{:?} {:?}", p.volume_width, p.dependency.rule)).len(), 4);
    assert_eq!(
        seen(&|p| format!("{:?} {:?}", p.method.cost.matching, p.method.cost.pyramid)).len(),
        MatchingCost::ALL.len() * Pyramid::ALL.len()
    );
    assert_eq!(seen(&|p| p.neighbours.to_string()).len(), NEIGHBOURS.len());
    assert_eq!(seen(&|p| p.levels.len().to_string()).len(), 5);
    assert_eq!(
        seen(&|p| format!("{} {}", p.range.min, p.levels[0].labels)).len(),
        MINIMA.len() * LABELS.len()
    );
    // Windows with all labels, equal narrower windows, and differing windows.
    let narrower =
        |case: &&Case| case.windows[0].data().iter().any(|w| usize::from(w[1]) < case.plan.levels[0].stride);
    let differ = |case: &&Case| case.windows[0].data().iter().any(|w| w != &case.windows[0].data()[0]);
    let (narrower, differ) = (cases.iter().filter(narrower).count(), cases.iter().filter(differ).count());
    assert!(narrower > 50 && differ > 30 && narrower + 20 < cases.len(), "{narrower}, {differ}");
    // Both alignments of the labels of two levels.
    assert_eq!(
        seen(&|p| (1..p.levels.len()).map(|z| p.label_offset(z)).min().unwrap_or(1).to_string()).len(),
        3
    );
}

/// The twins' costs of all levels, and their state before any level has joined.
fn twin_start(plan: &Plan, pair: &Pair) -> (Vec<Vec<u32>>, State) {
    let mut costs = vec![twin::cost::cost(plan, pair)];
    for z in 1..plan.levels.len() {
        costs.push(twin::pyramid::pyramid(plan, z, &costs[z - 1]));
    }
    let none = (0..plan.levels.len()).map(|z| vec![0; cells(plan, z)]).collect();
    let state = State::fresh(plan, none);
    (costs, state)
}

/// Writes the twin's resolution messages of one level to the state.
fn resolve(plan: &Plan, state: &mut State, z: usize) {
    let (down, up) = twin::resolution::resolution(
        plan,
        z,
        [&state.has[z - 1], &state.has[z]],
        &state.belief[z - 1],
        &state.belief[z],
        &state.down[z - 1],
        &state.up[z],
    );
    (state.down[z - 1], state.up[z]) = (down, up);
}
