//! Every stage of every backend against its naive twin, bit for bit, on seeded random input at awkward sizes, and
//! whole floods against a schedule written here once more. Negative controls show that the comparison can fail.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on panics")]
#![allow(clippy::needless_range_loop, reason = "levels are counted, as in the schedule that is checked")]

mod common;

use common::compare::{compare, compare_finest, compare_maps};
use common::devices::backends;
use common::random::{self, Random, State};
use common::twin::{self, belief::belief_most};
use mrfgs::backend::cpu::Cpu;
use mrfgs::backend::{Backend, Stage, Volume, volume_shape};
use mrfgs::graph::{self, LevelGraph};
use mrfgs::image::{Pair, Plane};
use mrfgs::options::{Cost, Method, PRESETS, Potential, Pyramid, Resolution, Schedule};
use mrfgs::plan::{COST_MAX, Cut, CutRule, LevelPlan, Plan, VolumeWidth};
use mrfgs::solver;
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

/// A change of a plan, as a negative control makes it.
type Change = fn(&mut Plan);

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
    assert_eq!(seen(&|p| format!("{:?} {:?}", p.method.potential, p.method.resolution)).len(), 6);
    assert_eq!(seen(&|p| format!("{:?} {:?}", p.volume_width, p.dependency.rule)).len(), 4);
    assert_eq!(seen(&|p| format!("{:?} {:?}", p.method.cost, p.method.pyramid)).len(), 6);
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
        for cost in [Cost::Sad, Cost::Census, Cost::AdCensus] {
            let mut plan = case.plan.clone();
            plan.method.cost = cost;
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
    (method.cost, method.sad_window, method.outside_cost) = (Cost::Sad, 31, 20.0);
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
fn restrict() {
    on_all(|case, backend, random| {
        let mut method = case.plan.method.clone();
        method.support = 1.0;
        let (width, height) = case.plan.size();
        let plan = Plan::new(width, height, case.plan.range, &method).unwrap();
        backend.prepare(&plan, &case.pair, case.graphs.clone()).unwrap();
        let supports: Vec<Plane<[u16; 2]>> = plan
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
        backend.restrict(&supports).unwrap();
        for (z, support) in supports.iter().enumerate() {
            let cost = random_cost(random, &plan, z);
            backend.write(Volume::Cost(z), &cost).unwrap();
            backend.run(Stage::Restrict(z)).unwrap();
            let expected = twin::restrict::restrict(&plan, z, support, &cost);
            same(&plan, backend, Volume::Cost(z), &expected)?;
            // Control: the support does matter.
            if expected != cost {
                let mut other = support.clone();
                other.data_mut().fill([0, plan.levels[z].labels as u16 - 1]);
                assert!(
                    same(&plan, backend, Volume::Cost(z), &twin::restrict::restrict(&plan, z, &other, &cost))
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

/// What was written must carry a flood on, whatever a backend stores beside the labels.
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
fn a_flood_goes_on_from_a_written_state() {
    on_all(|case, backend, random| {
        for loose in [false, true] {
            let mut state = random::state(random, &case.plan, &case.graphs, loose);
            state.write(backend);
            for _ in 0..2 {
                for (z, graph) in case.graphs.iter().enumerate() {
                    backend.run(Stage::Dependency(z)).unwrap();
                    state.dependency[z] = twin::dependency::dependency(
                        &case.plan,
                        z,
                        graph,
                        &state.belief[z],
                        &state.dependency[z],
                    );
                }
                for z in 1..case.plan.levels.len() {
                    backend.run(Stage::Resolution(z)).unwrap();
                    resolve(&case.plan, &mut state, z);
                }
                for z in 0..case.plan.levels.len() {
                    backend.run(Stage::Belief(z)).unwrap();
                }
                state.believe(&case.plan, &case.graphs);
                for (volume, expected) in state.volumes() {
                    same(&case.plan, backend, volume, expected)?;
                }
            }
        }
        Ok(())
    });
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
            for stage in [Stage::Estimate, Stage::RightView, Stage::SubPixel] {
                backend.run(stage).unwrap();
            }
            twin_estimate(&plan, &cost, &belief, &mut maps);
            compare_finest(backend, &maps)?;
            // Control: with all columns it is another right view.
            let mut all = maps.clone();
            twin::estimate::right_view(&case.plan, &belief, &mut all);
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
    twin::estimate::estimate(plan, belief, maps);
    twin::estimate::right_view(plan, belief, maps);
    twin::sub_pixel::sub_pixel(plan, cost, maps);
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

/// The schedule once more, on the twins: coarse levels first or all together, and a new level and the
/// one above hear of each other before the new one's own messages start.
fn twin_flood(plan: &Plan, graphs: &[LevelGraph], state: &mut State) -> u32 {
    let last = plan.levels.len() - 1;
    let method = &plan.method;
    let additions: Vec<(usize, u32)> = match method.schedule {
        Schedule::Together => vec![(0, method.iterations)],
        Schedule::CoarseFirst => (0..=last)
            .rev()
            .map(|z| (z, if z == 0 { method.final_iterations } else { method.iterations }))
            .collect(),
    };
    let mut total = 0;
    let mut map = vec![0; plan.levels[0].pixels()];
    for (finest, iterations) in additions {
        if method.schedule == Schedule::CoarseFirst && finest < last {
            resolve(plan, state, finest + 1);
            state.believe_at(plan, graphs, finest);
            state.believe_at(plan, graphs, finest + 1);
        }
        let watched = finest == 0 && method.tolerance > 0.0;
        if watched {
            twin::change::change(&state.belief[0], plan.levels[0].labels, &mut map);
        }
        for _ in 0..iterations {
            total += 1;
            for z in finest..=last {
                state.dependency[z] =
                    twin::dependency::dependency(plan, z, &graphs[z], &state.belief[z], &state.dependency[z]);
            }
            for z in finest + 1..=last {
                resolve(plan, state, z);
            }
            for z in finest..=last {
                state.believe_at(plan, graphs, z);
            }
            if watched {
                let sum = twin::change::change(&state.belief[0], plan.levels[0].labels, &mut map);
                if (sum as f64 / map.len() as f64).sqrt() <= method.tolerance {
                    break;
                }
            }
        }
    }
    total
}

/// From the pair to the estimate, on every backend and on the twins; the number of iterations.
fn whole_flood(plan: &Plan, pair: &Pair) -> u32 {
    let graphs = graph::build(pair.left(), plan);
    let mut costs = vec![twin::cost::cost(plan, pair)];
    for z in 1..plan.levels.len() {
        costs.push(twin::pyramid::pyramid(plan, z, &costs[z - 1]));
    }
    let evidence =
        costs.iter().enumerate().map(|(z, cost)| twin::evidence::evidence(plan, z, cost)).collect();
    let mut state = State::fresh(plan, evidence);
    let iterations = twin_flood(plan, &graphs, &mut state);
    let mut maps = twin::Finest::zero(plan.size());
    twin_estimate(plan, &costs[0], &state.belief[0], &mut maps);
    for (name, mut backend) in backends() {
        let backend = backend.as_mut();
        backend.prepare(plan, pair, graphs.clone()).unwrap();
        backend.run(Stage::Cost).unwrap();
        for z in 1..plan.levels.len() {
            backend.run(Stage::Pyramid(z)).unwrap();
        }
        for z in 0..plan.levels.len() {
            backend.run(Stage::Evidence(z)).unwrap();
        }
        let check = |backend: &mut dyn Backend| -> Result<(), String> {
            let actual = solver::flood(backend, plan).unwrap();
            if actual != iterations {
                return Err(format!("{actual} iterations but the twin did {iterations}"));
            }
            for (z, cost) in costs.iter().enumerate() {
                same(plan, backend, Volume::Cost(z), cost)?;
            }
            for (volume, expected) in state.volumes() {
                same(plan, backend, volume, expected)?;
            }
            twin::Finest::zero(plan.size()).write(backend);
            for stage in [Stage::Estimate, Stage::RightView, Stage::SubPixel] {
                backend.run(stage).unwrap();
            }
            compare_finest(backend, &maps)
        };
        if let Err(e) = check(backend) {
            panic!("{name}: {e}\n{:?}", plan.method);
        }
    }
    iterations
}

#[test]
fn floods_of_the_presets() {
    for (i, (preset, _)) in PRESETS.iter().enumerate() {
        let mut random = Random::new(i as u64);
        let mut method = Method::preset(preset).unwrap();
        method.iterations = method.iterations.min(8);
        method.tolerance = 0.0;
        let pair = random::pair(&mut random, 45, 27);
        whole_flood(&random::plan((45, 27), -3, 19, &method), &pair);
    }
}

#[test]
fn floods_of_every_kind() {
    let mut seed = 100;
    for schedule in [Schedule::Together, Schedule::CoarseFirst] {
        for potential in [Potential::Soft, Potential::Exact, Potential::Hard] {
            for resolution in [Resolution::Strict, Resolution::Interpolating] {
                for levels in [1, 3, 5] {
                    seed += 1;
                    let mut random = Random::new(seed);
                    let mut method = random::method(&mut random, [2, 4, 8][seed as usize % 3]);
                    (method.schedule, method.potential) = (schedule, potential);
                    (method.resolution, method.levels) = (resolution, levels);
                    let size = random.pick(&[(23, 14), (1, 30), (30, 1), (16, 16), (9, 21)]);
                    let labels = random.pick(&[1, 2, 15, 16, 17, 33]);
                    let pair = random::pair(&mut random, size.0, size.1);
                    whole_flood(&random::plan(size, random.pick(MINIMA), labels, &method), &pair);
                }
            }
        }
    }
}

#[test]
fn floods_that_stop_by_themselves() {
    let mut counts = HashSet::new();
    for (i, tolerance) in [0.05, 0.3, 0.6, 1.0, 3.0, 1e6, 1e-9].into_iter().enumerate() {
        for schedule in [Schedule::Together, Schedule::CoarseFirst] {
            let mut random = Random::new(i as u64 + 7);
            let mut method = random::method(&mut random, 4);
            (method.cost, method.outside_cost, method.temperature) = (Cost::AdCensus, 0.8, 0.8);
            (method.potential, method.dependency_cut, method.schedule) = (Potential::Soft, 2.0, schedule);
            (method.levels, method.iterations, method.final_iterations) = (3, 5, 5);
            method.tolerance = tolerance;
            let pair = random::pair(&mut random, 24, 17);
            let plan = random::plan((24, 17), 0, 12, &method);
            let before: u32 =
                plan.phases.iter().filter(|phase| phase.finest > 0).map(|phase| phase.iterations).sum();
            counts.insert(whole_flood(&plan, &pair) - before);
        }
    }
    // Some stop at once, some later, some never.
    assert!(counts.contains(&1) && counts.contains(&5) && counts.len() > 2, "{counts:?}");
}

/// Graphs in which everyone is everyone's neighbour in every window: as many factors a pixel as there can be.
fn full_graphs(plan: &Plan) -> Vec<LevelGraph> {
    assert_eq!(plan.neighbours, 48);
    let graph = |level: &LevelPlan| {
        let mut codes = Vec::new();
        for y in 0..level.height as i32 {
            for x in 0..level.width as i32 {
                codes.extend((0..49).filter(|&code| code != 24).map(|code| {
                    let (nx, ny) = (x + code % 7 - 3, y + code / 7 - 3);
                    let inside = nx >= 0 && ny >= 0 && nx < level.width as i32 && ny < level.height as i32;
                    if inside { code as u8 } else { 255 }
                }));
            }
        }
        LevelGraph::new(level.width, level.height, 48, codes)
    };
    plan.levels.iter().map(graph).collect()
}

/// Evidence of everyone for label 0, as strong as it gets.
fn sure(plan: &Plan) -> Vec<Vec<u32>> {
    let evidence = |level: &LevelPlan| {
        let cap = u32::from(level.evidence.cap);
        (0..level.pixels() * level.labels).map(|i| if i % level.labels == 0 { 0 } else { cap }).collect()
    };
    plan.levels.iter().map(evidence).collect()
}

/// A flood on full graphs from sure evidence, on the twins and on every backend; the largest belief.
fn flood_of_the_sure(plan: &Plan) -> u32 {
    let (width, height) = plan.size();
    let pair = random::pair(&mut Random::new(3), width, height);
    let graphs = full_graphs(plan);
    let mut state = State::fresh(plan, sure(plan));
    let start = state.clone();
    twin_flood(plan, &graphs, &mut state);
    for (name, mut backend) in backends() {
        backend.prepare(plan, &pair, graphs.clone()).unwrap();
        start.write(backend.as_mut());
        solver::flood(backend.as_mut(), plan).unwrap();
        for (volume, expected) in state.volumes() {
            if let Err(e) = same(plan, backend.as_mut(), volume, expected) {
                panic!("{name}: {e}\n{plan:?}");
            }
        }
    }
    state.belief.iter().flatten().copied().max().unwrap()
}

/// The largest in-degree there is, the strongest potential, the largest evidence: 16 bits hold it.
#[test]
fn wide_beliefs_stay_below_their_largest() {
    for (resolution, levels) in [(Resolution::Strict, 3), (Resolution::Interpolating, 2)] {
        let mut method = Method::preset("paper").unwrap();
        (method.percentile, method.resolution, method.levels) = (0.0, resolution, levels);
        method.iterations = 6;
        let plan = random::plan((15, 13), 0, 5, &method);
        assert_eq!(plan.levels[0].evidence.cap, 255);
        let largest = flood_of_the_sure(&plan);
        assert!(largest < belief_most(&plan));
        // The case is as bad as it gets: all 49 factors are at their cap.
        assert!(largest >= 255 + 49 * 1023, "{largest}");
    }
}

/// A plan of either width whose cuts are larger than a plan's own: beliefs exceed what it stores on full graphs.
fn saturating(neighbours: usize, width: VolumeWidth, rule: CutRule, resolution: Resolution) -> Plan {
    let mut method = Method::default();
    method.percentile = 100.0 - neighbours as f64 * 100.0 / 48.0;
    method.evidence_cap = 10.0;
    (method.levels, method.iterations, method.final_iterations) = (2, 2, 2);
    method.resolution = resolution;
    let mut plan = random::plan((15, 13), -3, 20, &method);
    let tau = match width {
        VolumeWidth::Narrow => 40,
        VolumeWidth::Wide => 5000,
    };
    (plan.dependency, plan.resolution, plan.volume_width) = (Cut { tau, rule }, Cut { tau, rule }, width);
    plan
}

#[test]
fn beliefs_that_saturate() {
    for width in [VolumeWidth::Narrow, VolumeWidth::Wide] {
        for rule in [CutRule::Relative, CutRule::Absolute] {
            for resolution in [Resolution::Strict, Resolution::Interpolating] {
                let plan = saturating(48, width, rule, resolution);
                assert_eq!(flood_of_the_sure(&plan), belief_most(&plan));
            }
        }
    }
}

/// Negative control: where every label's sum saturates, a message says nothing, and a belief as little; one that did not
/// saturate would.
#[test]
fn control_saturated_sums_say_nothing() {
    for width in [VolumeWidth::Narrow, VolumeWidth::Wide] {
        for resolution in [Resolution::Strict, Resolution::Interpolating] {
            let plan = saturating(48, width, CutRule::Relative, resolution);
            let pair = random::pair(&mut Random::new(3), 15, 13);
            let graphs = full_graphs(&plan);
            let tau = u32::from(plan.dependency.tau);
            // Label 0 is a little better everywhere, in beliefs and in messages that are not at their minimum.
            let better = |plan: &Plan, volume: Volume, most: u32| {
                let (rows, labels, _) = volume_shape(plan, volume);
                (0..rows * labels).map(|i| if i % labels == 0 { most - 5 } else { most }).collect::<Vec<_>>()
            };
            let zero = |plan: &Plan, volume: Volume| {
                let (rows, labels, _) = volume_shape(plan, volume);
                vec![0; rows * labels]
            };
            for (name, mut backend) in backends() {
                let backend = backend.as_mut();
                backend.prepare(&plan, &pair, graphs.clone()).unwrap();
                for z in 0..2 {
                    let belief = better(&plan, Volume::Belief(z), belief_most(&plan));
                    backend.write(Volume::Belief(z), &belief).unwrap();
                }
                backend.run(Stage::Dependency(0)).unwrap();
                let silent = zero(&plan, Volume::Dependency(0));
                same(&plan, backend, Volume::Dependency(0), &silent)
                    .unwrap_or_else(|e| panic!("{name}: {e}"));
                backend.run(Stage::Resolution(1)).unwrap();
                // The coarse pixel at the far corner has a single child, whose belief is no sum.
                let up = backend.read(Volume::Up(1)).unwrap();
                let silent: Vec<bool> =
                    up.chunks(plan.levels[1].labels).map(|m| m.iter().all(|&m| m == 0)).collect();
                let (corner, others) = silent.split_last().unwrap();
                assert!(!corner && others.iter().all(|&silent| silent), "{name}: {silent:?}");

                for volume in [Volume::Dependency(0), Volume::Down(0)] {
                    backend.write(volume, &better(&plan, volume, tau)).unwrap();
                }
                backend.write(Volume::Evidence(0), &zero(&plan, Volume::Evidence(0))).unwrap();
                backend.run(Stage::Belief(0)).unwrap();
                // Away from the border every pixel is in 49 factors.
                let belief = backend.read(Volume::Belief(0)).unwrap();
                let labels = plan.levels[0].labels;
                let inner = &belief[(6 * 15 + 7) * labels..][..labels];
                assert!(inner.iter().all(|&b| b == belief_most(&plan)), "{name}: {inner:?}");
            }
        }
    }
}

/// Negative control: what belongs to no label must not look better than labels that are all as bad as can be, even when its
/// message is taken off it.
#[test]
fn control_padding_stays_behind_beliefs_that_saturate() {
    for width in [VolumeWidth::Narrow, VolumeWidth::Wide] {
        let plan = saturating(1, width, CutRule::Relative, Resolution::Interpolating);
        let level = &plan.levels[0];
        assert!(level.labels < level.stride);
        let graphs: Vec<LevelGraph> = plan
            .levels
            .iter()
            .map(|l| {
                let codes = (0..l.pixels()).map(|i| if i % l.width == 0 { 255 } else { graph::code(-1, 0) });
                LevelGraph::new(l.width, l.height, 1, codes.collect())
            })
            .collect();
        let pair = random::pair(&mut Random::new(3), 15, 13);
        let flat = |value| vec![value; cells(&plan, 0)];
        let silent = vec![0; cells(&plan, 0) * plan.slots()];
        for (name, mut backend) in backends() {
            let backend = backend.as_mut();
            backend.prepare(&plan, &pair, graphs.clone()).unwrap();
            backend.write(Volume::Evidence(0), &flat(0)).unwrap();
            backend.write(Volume::Belief(0), &flat(0)).unwrap();
            for _ in 0..2 {
                backend.run(Stage::Dependency(0)).unwrap();
                same(&plan, backend, Volume::Dependency(0), &silent)
                    .unwrap_or_else(|e| panic!("{name}: {e}"));
                backend.write(Volume::Down(0), &flat(belief_most(&plan))).unwrap();
                backend.run(Stage::Belief(0)).unwrap();
                same(&plan, backend, Volume::Belief(0), &flat(belief_most(&plan))).unwrap();
            }
        }
    }
}

/// Where nothing saturates even if a pixel is in more factors than usual, and where it may not.
#[test]
fn every_plan_leaves_room_for_its_beliefs() {
    let mut random = Random::new(11);
    let mut widths = HashSet::new();
    for _ in 0..2000 {
        let neighbours = random.pick(NEIGHBOURS);
        let plan = random::plan((9, 9), 0, 9, &random::method(&mut random, neighbours));
        let (dependency, resolution) = (u32::from(plan.dependency.tau), u32::from(plan.resolution.tau));
        // As many as a factor has members in 8 bits, as many as there can be in 16.
        let factors = match plan.volume_width {
            VolumeWidth::Narrow => plan.neighbours as u32 + 1,
            VolumeWidth::Wide => 49,
        };
        let cap = u32::from(plan.levels[0].evidence.cap);
        assert!(plan.levels.iter().all(|l| u32::from(l.evidence.cap) == cap));
        let usual = cap + factors * dependency + 2 * resolution;
        assert!(usual <= belief_most(&plan), "{:?}", plan.method);
        assert_eq!(belief_most(&plan), u32::from(plan.belief_most()));
        widths.insert(format!("{:?}", plan.volume_width));
    }
    assert_eq!(widths.len(), 2);
}

/// Negative control: whatever single element of whatever volume is wrong, the comparison says so and says where.
#[test]
fn control_one_wrong_element_is_found() {
    let mut random = Random::new(5);
    let plan = random::plan((7, 5), -20, 33, &{
        let mut method = random::method(&mut random, 4);
        method.levels = 3;
        method
    });
    let pair = random::pair(&mut random, 7, 5);
    let graphs = random::graphs(&mut random, &plan);
    let state = random::state(&mut random, &plan, &graphs, false);
    for (_, mut backend) in backends() {
        backend.prepare(&plan, &pair, graphs.clone()).unwrap();
        for (volume, values) in state.volumes() {
            for _ in 0..20 {
                let mut wrong = values.to_vec();
                let at = random.within(0, values.len() as u32 - 1) as usize;
                wrong[at] = if wrong[at] == 0 { 1 } else { wrong[at] - 1 };
                backend.write(volume, &wrong).unwrap();
                let error = same(&plan, backend.as_mut(), volume, values).unwrap_err();
                assert!(error.contains(&format!("1 of {} values differ", values.len())), "{error}");
                let z = (0..3).find(|z| format!("{volume:?}").contains(&z.to_string())).unwrap();
                let (labels, width) = (plan.levels[z].labels, plan.levels[z].width);
                let slots = if matches!(volume, Volume::Dependency(_)) { plan.slots() } else { 1 };
                let place = format!(
                    "x {}, y {}, slot {}, label index {}: {} but the twin says {}",
                    at / labels / slots % width,
                    at / labels / slots / width,
                    at / labels % slots,
                    at % labels,
                    wrong[at],
                    values[at]
                );
                assert!(error.ends_with(&place), "{error} / {place}");
                backend.write(volume, values).unwrap();
                same(&plan, backend.as_mut(), volume, values).unwrap();
            }
            let error = compare(&plan, volume, &values[1..], values).unwrap_err();
            assert!(error.contains("values, the twin has"), "{error}");
        }
    }
}

/// A case in which every parameter of every stage matters, and the volumes of a twin that follows `plan`.
fn twin_of_the_control(plan: &Plan, pair: &Pair, graphs: &[LevelGraph]) -> Vec<(String, Vec<u32>)> {
    let mut costs = vec![twin::cost::cost(plan, pair)];
    for z in 1..plan.levels.len() {
        costs.push(twin::pyramid::pyramid(plan, z, &costs[z - 1]));
    }
    let evidence =
        costs.iter().enumerate().map(|(z, cost)| twin::evidence::evidence(plan, z, cost)).collect();
    let mut state = State::fresh(plan, evidence);
    twin_flood(plan, graphs, &mut state);
    let mut all: Vec<(String, Vec<u32>)> =
        costs.into_iter().enumerate().map(|(z, cost)| (format!("{:?}", Volume::Cost(z)), cost)).collect();
    all.extend(state.volumes().into_iter().map(|(volume, v)| (format!("{volume:?}"), v.to_vec())));
    all
}

/// Negative control: a twin that follows a slightly different plan is found out.
#[test]
fn control_a_changed_parameter_is_found() {
    let mut method = Method::default();
    (method.levels, method.iterations, method.final_iterations) = (3, 2, 2);
    (method.percentile, method.temperature) = (92.0, 0.1);
    let plan = random::plan((24, 15), -3, 19, &method);
    let mut random = Random::new(77);
    let pair = loop {
        let pair = random::pair(&mut random, 24, 15);
        let masked = |image: &mrfgs::image::Image| image.masked.data().iter().filter(|&&m| m).count();
        let noisy = pair.left().pixels[(3, 3)] != pair.left().pixels[(4, 3)];
        if noisy && masked(pair.left()) == 0 && masked(pair.right()) == 0 {
            break pair;
        }
    };
    let graphs = graph::build(pair.left(), &plan);
    let base = twin_of_the_control(&plan, &pair, &graphs);
    let changes: &[(&str, &str, Change)] = &[
        ("outside cost", "Cost(0)", |p| p.outside_cost += 1),
        ("kind of cost", "Cost(0)", |p| p.method.cost = Cost::Sad),
        ("pyramid", "Cost(1)", |p| p.method.pyramid = Pyramid::LowPass),
        ("evidence cap", "Evidence(2)", |p| p.levels[2].evidence.cap -= 1),
        ("evidence limit", "Evidence(1)", |p| p.levels[1].evidence.limit /= 2),
        ("evidence up", "Evidence(0)", |p| p.levels[0].evidence.up += 1),
        ("evidence down", "Evidence(1)", |p| p.levels[1].evidence.down += 1),
        ("evidence multiplier", "Evidence(2)", |p| p.levels[2].evidence.multiplier -= 1000),
        ("dependency tau", "Dependency(0)", |p| p.dependency.tau += 1),
        ("dependency rule", "Dependency(0)", |p| p.dependency.rule = CutRule::Absolute),
        ("resolution tau", "Up(2)", |p| p.resolution.tau += 1),
        ("resolution rule", "Down(0)", |p| p.resolution.rule = CutRule::Absolute),
        ("resolution kind", "Down(1)", |p| p.method.resolution = Resolution::Strict),
        ("iterations", "Belief(0)", |p| p.method.iterations += 1),
        ("final iterations", "Belief(0)", |p| p.method.final_iterations += 1),
        ("schedule", "Belief(1)", |p| p.method.schedule = Schedule::Together),
        ("smallest labels", "Cost(0)", |p| {
            for (z, level) in p.levels.iter_mut().enumerate() {
                level.min += 4 >> z;
            }
        }),
    ];
    for (name, volume, change) in changes {
        let mut changed = plan.clone();
        change(&mut changed);
        let other = twin_of_the_control(&changed, &pair, &graphs);
        let differs = base.iter().zip(&other).any(|(a, b)| a.0 == *volume && a.1 != b.1);
        assert!(differs, "{name}: {volume} is the same");
    }
    // And the unchanged plan passes, against the backends.
    whole_flood(&plan, &pair);
}

/// Negative control: twins that saturate later than a narrow plan does give other volumes.
#[test]
fn control_saturation_in_8_bits_is_found() {
    let plan = saturating(48, VolumeWidth::Narrow, CutRule::Relative, Resolution::Interpolating);
    let mut wider = plan.clone();
    wider.volume_width = VolumeWidth::Wide;
    let graphs = full_graphs(&plan);
    let mut random = Random::new(12);
    let state = random::state(&mut random, &plan, &graphs, true);
    let mut believed = state.clone();
    believed.believe(&plan, &graphs);
    let mut differ = believed.clone();
    differ.believe(&wider, &graphs);
    assert_ne!(believed.belief[0], differ.belief[0]);
    let messages =
        |plan| twin::dependency::dependency(plan, 0, &graphs[0], &state.belief[0], &state.dependency[0]);
    assert_ne!(messages(&plan), messages(&wider));
    let resolved = |plan| {
        let mut state = state.clone();
        resolve(plan, &mut state, 1);
        (state.down, state.up)
    };
    let (narrow, wide) = (resolved(&plan), resolved(&wider));
    assert!(narrow.0 != wide.0 && narrow.1 != wide.1);
}

/// Negative control for the graph: a range a little wider moves a neighbour somewhere.
#[test]
fn control_a_changed_sigma_is_found() {
    let mut random = Random::new(8);
    let method = random::method(&mut random, 8);
    let mut plan = random::plan((31, 19), 0, 4, &method);
    let image = loop {
        let image = random::image(&mut random, 31, 19);
        if image.pixels[(0, 0)] != image.pixels[(1, 0)] && !image.masked.data().contains(&true) {
            break image;
        }
    };
    let built = graph::build(&image, &plan);
    assert_eq!(built[0].codes(), twin::graph::graphs(&image, &plan)[0]);
    plan.method.sigma_range *= 1.05;
    assert_ne!(built[0].codes(), twin::graph::graphs(&image, &plan)[0]);
}
