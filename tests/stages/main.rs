//! Every stage of every backend against its naive twin, bit for bit, on seeded random input at awkward sizes, and
//! whole floods against a schedule written here once more. Negative controls show that the comparison can fail.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on panics")]
#![allow(clippy::needless_range_loop, reason = "levels are counted, as in the schedule that is checked")]

#[path = "../common/mod.rs"]
mod common;
mod controls;
mod floods;
mod maps;
mod saturation;

use common::compare::{compare, compare_finest, compare_maps};
use common::devices::backends;
use common::random::{self, Random, State};
use common::twin;
use common::twin::belief::belief_most;
use mrfgs::backend::cpu::Cpu;
use mrfgs::backend::{Backend, Stage, Volume};
use mrfgs::graph::{self, LevelGraph};
use mrfgs::image::{Pair, Plane};
use mrfgs::options::{MatchingCost, Method};
use mrfgs::plan::{COST_MAX, Plan};
use std::cell::Cell;
use std::collections::HashSet;

/// One pixel, one column, one row, odd, divisible by no power of two, and wider than a block of anything.
const SIZES: &[(usize, usize)] =
    &[(1, 1), (1, 9), (13, 1), (2, 2), (5, 7), (8, 8), (17, 11), (33, 6), (9, 40), (31, 19), (67, 3)];
const LABELS: &[usize] = &[1, 2, 31, 32, 33, 64, 257];
const MINIMA: &[i32] = &[-20, 0, 5, 700, -900];
const NEIGHBOURS: &[usize] = &[0, 1, 2, 4, 8, 12, 25, 48];
/// Cells of the dependency messages of one case, at most.
const CELLS: usize = 1_000_000;
/// Cases of one size and number of labels.
const ROUNDS: usize = 3;

struct Case {
    name: String,
    seed: u64,
    plan: Plan,
    pair: Pair,
    graphs: Vec<LevelGraph>,
}

/// Every size with every number of labels; all else is drawn.
fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for (&size, &labels) in SIZES.iter().flat_map(|size| LABELS.iter().map(move |labels| (size, labels))) {
        for _ in 0..ROUNDS {
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
                graph::build(pair.left(), &plan)
            } else {
                random::graphs(&mut random, &plan)
            };
            let name = format!("case {seed}: {size:?}, {labels} labels from {min}, {:?}", plan.method);
            cases.push(Case { name, seed, plan, pair, graphs });
        }
    }
    cases
}

/// Runs `check` for every case on every backend, prepared, with a generator of the case's own.
fn on_all(check: impl Fn(&Case, &mut dyn Backend, &mut Random) -> Result<(), String>) {
    for case in cases() {
        for (name, mut backend) in backends() {
            let backend = backend.as_mut();
            backend.prepare(&case.plan, &case.pair, case.graphs.clone()).unwrap();
            if let Err(e) = check(&case, backend, &mut Random::new(case.seed ^ 0xbeef)) {
                panic!("{name}: {e}\n{}", case.name);
            }
        }
    }
}

/// Compares what `backend` holds with what the twin says.
fn same(plan: &Plan, backend: &mut dyn Backend, volume: Volume, expected: &[u32]) -> Result<(), String> {
    compare(plan, volume, &backend.read(volume).unwrap(), expected)
}

fn cells(plan: &Plan, z: usize) -> usize {
    plan.levels[z].pixels() * plan.levels[z].labels
}

/// Costs of a level as it stores them, far apart, close together, or all alike.
fn random_cost(random: &mut Random, plan: &Plan, z: usize) -> Vec<u32> {
    let most = u32::from(COST_MAX) * if z == 0 { 1 } else { 256 };
    let most = random.pick(&[most, most, most / 20, 1, 0]);
    (0..cells(plan, z)).map(|_| random.within(0, most)).collect()
}

#[test]
fn the_cases_cover_what_they_should() {
    let cases = cases();
    let seen = |f: &dyn Fn(&Plan) -> String| cases.iter().map(|c| f(&c.plan)).collect::<HashSet<_>>();
    assert_eq!(
        seen(&|p| format!("{:?} {:?}", p.method.messages.potential, p.method.messages.agreement)).len(),
        6
    );
    assert_eq!(seen(&|p| format!("{:?} {:?}", p.volume_width, p.dependency.rule)).len(), 4);
    assert_eq!(seen(&|p| format!("{:?} {:?}", p.method.cost.matching, p.method.cost.pyramid)).len(), 6);
    assert_eq!(seen(&|p| p.neighbours.to_string()).len(), NEIGHBOURS.len());
    assert_eq!(seen(&|p| p.levels.len().to_string()).len(), 5);
    assert_eq!(
        seen(&|p| format!("{} {}", p.range.min, p.levels[0].labels)).len(),
        MINIMA.len() * LABELS.len()
    );
    // Both alignments of the labels of two levels.
    assert_eq!(
        seen(&|p| (1..p.levels.len()).map(|z| p.label_offset(z)).min().unwrap_or(1).to_string()).len(),
        3
    );
}

#[test]
fn graph() {
    for case in cases() {
        let built = graph::build(case.pair.left(), &case.plan);
        let expected = twin::graph::graphs(case.pair.left(), &case.plan);
        for (z, (graph, codes)) in built.iter().zip(expected).enumerate() {
            assert!(graph.codes() == codes, "level {z} of {}", case.name);
        }
        for graph in case.graphs.iter().chain(&built) {
            let mut incoming = vec![Vec::new(); graph.width() * graph.height()];
            for factor in 0..incoming.len() {
                for (slot, member) in twin::members(graph, factor).into_iter().enumerate() {
                    assert_eq!(graph.member(factor, slot), member);
                    if let Some(pixel) = member {
                        incoming[pixel].push((factor * graph.slots() + slot) as u32);
                    }
                }
            }
            for (pixel, slots) in incoming.iter().enumerate() {
                assert_eq!(graph.incoming_of(pixel), slots, "pixel {pixel} of {}", case.name);
            }
        }
    }
}

#[test]
fn downsample() {
    for case in cases() {
        let (actual, expected) =
            (graph::downsample(case.pair.left()), twin::graph::downsample(case.pair.left()));
        compare_maps("pixels", &actual.pixels, &expected.pixels).unwrap();
        compare_maps("mask", &actual.masked, &expected.masked).unwrap();
    }
}

#[test]
fn cost() {
    on_all(|case, backend, random| {
        for cost in [MatchingCost::Sad, MatchingCost::Census, MatchingCost::AdCensus] {
            let mut plan = case.plan.clone();
            plan.method.cost.matching = cost;
            backend.prepare(&plan, &case.pair, case.graphs.clone()).unwrap();
            let poison: Vec<u32> = (0..cells(&plan, 0)).map(|_| random.within(0, 255)).collect();
            backend.write(Volume::Cost(0), &poison).unwrap();
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
    (method.cost.matching, method.cost.sad_window, method.cost.outside_cost) = (MatchingCost::Sad, 31, 20.0);
    let plan = random::plan((37, 33), -3, 9, &method);
    let pair = random::pair(&mut random, 37, 33);
    for (name, mut backend) in backends() {
        backend.prepare(&plan, &pair, graph::build(pair.left(), &plan)).unwrap();
        backend.run(Stage::Cost).unwrap();
        if let Err(e) = same(&plan, backend.as_mut(), Volume::Cost(0), &twin::cost::cost(&plan, &pair)) {
            panic!("{name}: {e}");
        }
    }
}

#[test]
fn pyramid() {
    on_all(|case, backend, random| {
        for z in 1..case.plan.levels.len() {
            let fine = random_cost(random, &case.plan, z - 1);
            let poison = random_cost(random, &case.plan, z);
            backend.write(Volume::Cost(z - 1), &fine).unwrap();
            backend.write(Volume::Cost(z), &poison).unwrap();
            backend.run(Stage::Pyramid(z)).unwrap();
            same(&case.plan, backend, Volume::Cost(z), &twin::pyramid::pyramid(&case.plan, z, &fine))?;
            same(&case.plan, backend, Volume::Cost(z - 1), &fine)?;
        }
        Ok(())
    });
}

#[test]
fn label_range() {
    on_all(|case, backend, random| {
        let mut method = case.plan.method.clone();
        method.front.zone_sigmas = 1.0;
        let (width, height) = case.plan.size();
        let plan = Plan::new(width, height, case.plan.range, &method).unwrap();
        backend.prepare(&plan, &case.pair, case.graphs.clone()).unwrap();
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
        backend.label_range(&label_ranges).unwrap();
        for (z, label_range) in label_ranges.iter().enumerate() {
            let cost = random_cost(random, &plan, z);
            backend.write(Volume::Cost(z), &cost).unwrap();
            backend.run(Stage::LabelRange(z)).unwrap();
            let expected = twin::label_range::label_range(&plan, z, label_range, &cost);
            same(&plan, backend, Volume::Cost(z), &expected)?;
            // Control: the label range does matter.
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

#[test]
fn evidence() {
    on_all(|case, backend, random| {
        for z in 0..case.plan.levels.len() {
            let cost = random_cost(random, &case.plan, z);
            let poison = vec![231; cost.len()];
            backend.write(Volume::Cost(z), &cost).unwrap();
            backend.write(Volume::Evidence(z), &poison).unwrap();
            backend.write(Volume::Belief(z), &poison).unwrap();
            backend.run(Stage::Evidence(z)).unwrap();
            let expected = twin::evidence::evidence(&case.plan, z, &cost);
            same(&case.plan, backend, Volume::Evidence(z), &expected)?;
            same(&case.plan, backend, Volume::Belief(z), &expected)?;
        }
        Ok(())
    });
}

#[test]
fn dependency() {
    on_all(|case, backend, random| {
        for loose in [false, true] {
            let state = random::state(random, &case.plan, &case.graphs, loose);
            state.write(backend);
            for (z, graph) in case.graphs.iter().enumerate() {
                backend.run(Stage::Dependency(z)).unwrap();
                let expected = twin::dependency::dependency(
                    &case.plan,
                    z,
                    graph,
                    &state.belief[z],
                    &state.dependency[z],
                );
                same(&case.plan, backend, Volume::Dependency(z), &expected)?;
                same(&case.plan, backend, Volume::Belief(z), &state.belief[z])?;
            }
        }
        Ok(())
    });
}

#[test]
fn resolution() {
    on_all(|case, backend, random| {
        for loose in [false, true] {
            let mut state = random::state(random, &case.plan, &case.graphs, loose);
            state.write(backend);
            for z in 1..case.plan.levels.len() {
                backend.run(Stage::Resolution(z)).unwrap();
                resolve(&case.plan, &mut state, z);
                same(&case.plan, backend, Volume::Down(z - 1), &state.down[z - 1])?;
                same(&case.plan, backend, Volume::Up(z), &state.up[z])?;
            }
        }
        Ok(())
    });
}

#[test]
fn belief() {
    on_all(|case, backend, random| {
        let state = random::state(random, &case.plan, &case.graphs, false);
        state.write(backend);
        for z in 0..case.plan.levels.len() {
            let poison = vec![twin::most(&case.plan); cells(&case.plan, z)];
            backend.write(Volume::Belief(z), &poison).unwrap();
            backend.run(Stage::Belief(z)).unwrap();
            same(&case.plan, backend, Volume::Belief(z), &state.belief[z])?;
        }
        Ok(())
    });
}

/// The sweep, and what it is made of.
#[test]
fn a_sweep_is_messages_and_then_beliefs() {
    on_all(|case, backend, random| {
        let state = random::state(random, &case.plan, &case.graphs, true);
        for z in 0..case.graphs.len() {
            let after = |backend: &mut dyn Backend, stages: &[Stage]| {
                state.write(backend);
                for &stage in stages {
                    backend.run(stage).unwrap();
                }
                [Volume::Dependency(z), Volume::Belief(z)].map(|volume| backend.read(volume).unwrap())
            };
            let [messages, beliefs] = after(backend, &[Stage::Dependency(z), Stage::Belief(z)]);
            after(backend, &[Stage::Flood(z)]);
            same(&case.plan, backend, Volume::Dependency(z), &messages)?;
            same(&case.plan, backend, Volume::Belief(z), &beliefs)?;
        }
        Ok(())
    });
}

/// On the CPU path every thread sweeps bands of its own: what is around their borders must not be early or late.
#[test]
fn a_sweep_in_bands_is_a_sweep() {
    let mut random = Random::new(11);
    for preset in ["default", "paper"] {
        // Not a whole number of rows a band.
        let plan = random::plan((9, 133), -2, 21, &Method::preset(preset).unwrap());
        let pair = random::pair(&mut random, 9, 133);
        let graphs = graph::build(pair.left(), &plan);
        let state = random::state(&mut random, &plan, &graphs, true);
        let run = |threads: usize, stages: &[Stage]| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut cpu = Cpu::default();
                cpu.prepare(&plan, &pair, graphs.clone()).unwrap();
                state.write(&mut cpu);
                for &stage in stages {
                    cpu.run(stage).unwrap();
                }
                [Volume::Dependency(0), Volume::Belief(0)].map(|volume| cpu.read(volume).unwrap())
            })
        };
        let expected = run(1, &[Stage::Dependency(0), Stage::Belief(0)]);
        for threads in [1, 2, 3] {
            assert!(run(threads, &[Stage::Flood(0)]) == expected, "{preset}, {threads} threads");
        }
        // Control: beliefs before the messages are others.
        assert!(run(2, &[Stage::Belief(0), Stage::Dependency(0)]) != expected, "{preset}");
    }
}

#[test]
fn change() {
    on_all(|case, backend, random| {
        let labels = case.plan.levels[0].labels;
        let mut map = vec![0; case.plan.levels[0].pixels()];
        for _ in 0..4 {
            let most = random.pick(&[0, 2, belief_most(&case.plan)]);
            let belief: Vec<u32> = (0..cells(&case.plan, 0)).map(|_| random.within(0, most)).collect();
            backend.write(Volume::Belief(0), &belief).unwrap();
            let (actual, expected) =
                (backend.change().unwrap(), twin::change::change(&belief, labels, &mut map));
            if actual != expected {
                return Err(format!("a change of {actual} but the twin says {expected}"));
            }
        }
        Ok(())
    });
}

#[test]
fn estimate() {
    let narrower = Cell::new(0);
    on_all(|case, backend, random| {
        let mut plan = case.plan.clone();
        let width = plan.levels[0].width;
        for most in [0, 2, belief_most(&plan)] {
            let belief: Vec<u32> = (0..cells(&plan, 0)).map(|_| random.within(0, most)).collect();
            backend.write(Volume::Belief(0), &belief).unwrap();
            let cost = random_cost(random, &plan, 0);
            backend.write(Volume::Cost(0), &cost).unwrap();
            let mut maps = random::finest(random, &plan, false);
            maps.write(backend);
            for stage in [Stage::WinnerTakesAll, Stage::RightView, Stage::SubPixel] {
                backend.run(stage).unwrap();
            }
            twin_estimate(&plan, &cost, &belief, &mut maps);
            compare_finest(backend, &maps)?;
            // Control: with all columns it is another right view.
            let mut all = maps.clone();
            twin::winner_takes_all::right_view(&case.plan, &belief, &mut all);
            narrower.set(narrower.get() + usize::from(all != maps));
            // Then a tile with a core of its own, in the same buffers.
            let start = random.within(0, width as u32 - 1) as usize;
            plan.core = start..random.within(start as u32 + 1, width as u32) as usize;
            backend.prepare(&plan, &case.pair, case.graphs.clone()).unwrap();
        }
        Ok(())
    });
    assert!(narrower.get() > 50, "{}", narrower.get());
}

fn twin_estimate(plan: &Plan, cost: &[u32], belief: &[u32], maps: &mut twin::Finest) {
    twin::winner_takes_all::winner_takes_all(plan, belief, maps);
    twin::winner_takes_all::right_view(plan, belief, maps);
    twin::sub_pixel::sub_pixel(plan, cost, maps);
}

/// The twins' costs of all levels, and their state before anyone has spoken.
fn twin_start(plan: &Plan, pair: &Pair) -> (Vec<Vec<u32>>, State) {
    let mut costs = vec![twin::cost::cost(plan, pair)];
    for z in 1..plan.levels.len() {
        costs.push(twin::pyramid::pyramid(plan, z, &costs[z - 1]));
    }
    let evidence =
        costs.iter().enumerate().map(|(z, cost)| twin::evidence::evidence(plan, z, cost)).collect();
    let state = State::fresh(plan, evidence);
    (costs, state)
}

/// The twin's resolution messages of one level, into the state.
fn resolve(plan: &Plan, state: &mut State, z: usize) {
    let (down, up) = twin::resolution::resolution(
        plan,
        z,
        &state.belief[z - 1],
        &state.belief[z],
        &state.down[z - 1],
        &state.up[z],
    );
    (state.down[z - 1], state.up[z]) = (down, up);
}
