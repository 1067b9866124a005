//! Every stage of every backend against its naive twin, bit for bit, on seeded random input at awkward sizes, and
//! whole floods against a schedule written here once more. Negative controls show that the comparison can fail.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on panics")]
#![allow(clippy::needless_range_loop, reason = "levels are counted, as in the schedule that is checked")]

mod common;

use common::compare::{compare, compare_finest, compare_maps};
use common::devices::backends;
use common::random::{self, Random, State};
use common::twin;
use mrfgs::backend::{Backend, Stage, Volume};
use mrfgs::graph::{self, LevelGraph};
use mrfgs::image::{Pair, Plane};
use mrfgs::options::{Cost, Method, PRESETS, Potential, Pyramid, Resolution, Schedule};
use mrfgs::plan::{COST_MAX, CutRule, MessageWidth, Plan};
use mrfgs::solver;
use std::cell::Cell;
use std::collections::HashSet;

/// One pixel, one column, one row, odd, divisible by no power of two, and wider than a block of anything.
const SIZES: &[(usize, usize)] =
    &[(1, 1), (1, 9), (13, 1), (2, 2), (5, 7), (8, 8), (17, 11), (33, 6), (9, 40), (31, 19), (67, 3)];
const LABELS: &[usize] = &[1, 2, 31, 32, 33, 64, 257];
const MINIMA: &[i32] = &[-20, 0, 5];
const NEIGHBOURS: &[usize] = &[0, 1, 2, 4, 8, 12, 25, 48];
/// Cells of the dependency messages of one case, at most.
const CELLS: usize = 1_000_000;
/// Cases of one size and number of labels.
const ROUNDS: usize = 3;

/// What 16 bits hold.
const MOST: u32 = 65_535;

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
    assert_eq!(seen(&|p| format!("{:?} {:?}", p.message_width, p.dependency.rule)).len(), 4);
    assert_eq!(seen(&|p| format!("{:?} {:?}", p.method.cost, p.method.pyramid)).len(), 6);
    assert_eq!(seen(&|p| p.neighbours.to_string()).len(), NEIGHBOURS.len());
    assert_eq!(seen(&|p| p.levels.len().to_string()).len(), 5);
    assert_eq!(seen(&|p| format!("{} {}", p.range.min, p.levels[0].labels)).len(), 21);
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
            backend.write(Volume::Belief(z), &vec![50_000; cells(&case.plan, z)]).unwrap();
            backend.run(Stage::Belief(z)).unwrap();
            same(&case.plan, backend, Volume::Belief(z), &state.belief[z])?;
        }
        Ok(())
    });
}

/// What was written must carry a flood on, whatever a backend stores beside the labels.
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
            let most = random.pick(&[0, 2, 50_000]);
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
        for most in [0, 2, 50_000] {
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

/// The largest in-degree there is, the strongest potential, the largest evidence: nothing saturates or wraps.
#[test]
fn beliefs_stay_within_the_bound() {
    for (resolution, levels) in [(Resolution::Strict, 3), (Resolution::Interpolating, 2)] {
        let mut method = Method::preset("paper").unwrap();
        (method.percentile, method.resolution, method.levels) = (0.0, resolution, levels);
        method.iterations = 6;
        let plan = random::plan((15, 13), 0, 5, &method);
        assert_eq!((plan.neighbours, plan.levels[0].evidence.cap), (48, 255));
        let pair = random::pair(&mut Random::new(3), 15, 13);
        // In every window, everyone is everyone's neighbour.
        let all: Vec<LevelGraph> = plan
            .levels
            .iter()
            .map(|level| {
                let mut codes = Vec::new();
                for y in 0..level.height as i32 {
                    for x in 0..level.width as i32 {
                        codes.extend((0..49).filter(|&code| code != 24).map(|code| {
                            let (nx, ny) = (x + code % 7 - 3, y + code / 7 - 3);
                            let inside =
                                nx >= 0 && ny >= 0 && nx < level.width as i32 && ny < level.height as i32;
                            if inside { code as u8 } else { 255 }
                        }));
                    }
                }
                LevelGraph::new(level.width, level.height, 48, codes)
            })
            .collect();
        // Everyone is sure of label 0.
        let sure = plan
            .levels
            .iter()
            .map(|level| {
                (0..level.pixels() * level.labels)
                    .map(|i| if i % level.labels == 0 { 0 } else { 255 })
                    .collect()
            })
            .collect();
        let mut state = State::fresh(&plan, sure);
        let start = state.clone();
        twin_flood(&plan, &all, &mut state);
        let largest = state.belief.iter().flatten().copied().max().unwrap();
        assert!(largest <= random::belief_bound(&plan) && largest <= MOST);
        // The case is as bad as it gets: all 49 factors are at their cap.
        assert!(largest >= 255 + 49 * 1023, "{largest}");
        for (name, mut backend) in backends() {
            backend.prepare(&plan, &pair, all.clone()).unwrap();
            start.write(backend.as_mut());
            solver::flood(backend.as_mut(), &plan).unwrap();
            for (volume, expected) in state.volumes() {
                if let Err(e) = same(&plan, backend.as_mut(), volume, expected) {
                    panic!("{name}: {e}");
                }
            }
        }
    }
}

#[test]
fn every_plan_bounds_its_beliefs() {
    let mut random = Random::new(11);
    let mut widths = HashSet::new();
    for _ in 0..2000 {
        let neighbours = random.pick(NEIGHBOURS);
        let plan = random::plan((9, 9), 0, 9, &random::method(&mut random, neighbours));
        let bound = random::belief_bound(&plan);
        assert!(plan.levels.iter().all(|l| l.evidence.cap == plan.levels[0].evidence.cap));
        assert!(bound <= MOST, "{:?}", plan.method);
        widths.insert(format!("{:?}", plan.message_width));
        if plan.message_width == MessageWidth::Narrow {
            assert!(plan.dependency.tau <= 255 && plan.resolution.tau <= 255, "{:?}", plan.method);
            assert!(
                (plan.neighbours as u32 + 1) * (bound - plan.levels[0].evidence.cap + 255) <= MOST,
                "{:?}",
                plan.method
            );
        }
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
        ("evidence multiplier", "Evidence(2)", |p| p.levels[2].evidence.multiplier += 20_000),
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

/// Negative control for the graph: one more sixteenth of a level moves a neighbour somewhere.
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
