//! Whole runs of message passing, against twins with a separate schedule.

use crate::common::compare::compare_finest;
use crate::common::devices::backends;
use crate::common::random::{self, Random, State};
use crate::common::twin;
use crate::{MINIMA, on_all, resolve, same, twin_start};
use mrfgs::image::{Image, Pair};
use mrfgs::low_level::backend::{Backend, Stage, Volume};
use mrfgs::low_level::front::Prepared;
use mrfgs::low_level::graph::LevelGraph;
use mrfgs::low_level::plan::Plan;
use mrfgs::options::{Agreement, MatchingCost, Order, PRESETS, Potential};
use pollster::block_on;
use std::collections::HashSet;

/// Message passing continues correctly from written volumes, whatever a backend stores in the padding.
#[test]
fn message_passing_continues_from_a_written_state() {
    on_all(|case, backend, random| {
        for loose in [false, true] {
            let mut state = case.state(random, loose);
            state.write(backend);
            for _ in 0..2 {
                for (z, graph) in case.graphs.iter().enumerate() {
                    backend.run(Stage::Dependency(z)).unwrap();
                    state.dependency[z] = twin::dependency::dependency(
                        &case.plan,
                        z,
                        graph,
                        &state.has[z],
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

/// An independent implementation of the schedule on the twins: all levels together, or coarse levels first. A
/// level that joins exchanges resolution messages with the next coarser one before its own dependency
/// messages start, so its first iteration needs no exchange. At level 0 the coarser levels send messages only
/// in every other iteration, and levels whose messages can no longer reach level 0 send none.
///
/// A level that joins gets its windows and evidence from `costs`; without them, it keeps those in `state`.
pub(super) fn twin_flood(
    plan: &Plan,
    graphs: &[LevelGraph],
    state: &mut State,
    costs: Option<&[Vec<u32>]>,
) -> u32 {
    let last = plan.levels.len() - 1;
    let method = &plan.method;
    let additions: Vec<(usize, u32)> = match method.schedule.order {
        Order::Together => vec![(0, method.schedule.iterations)],
        Order::CoarseFirst => (0..=last)
            .rev()
            .map(|z| (z, if z == 0 { method.schedule.final_iterations } else { method.schedule.iterations }))
            .collect(),
    };
    let mut total = 0;
    let mut map = vec![0; plan.levels[0].pixels()];
    let mut joined = last + 1;
    for (finest, iterations) in additions {
        for z in (finest..joined).rev() {
            if let Some(costs) = costs {
                let coarse = state.belief.get(z + 1).map(Vec::as_slice);
                let windows = twin::label_window::label_window(plan, z, coarse, None);
                state.has[z] = twin::label_window::ranges(plan, z, &windows);
                state.evidence[z] = twin::evidence::evidence(plan, z, &state.has[z], &costs[z]);
                state.belief[z] = twin::evidence::beliefs(plan, &state.evidence[z]);
            }
        }
        joined = finest;
        if method.schedule.order == Order::CoarseFirst && finest < last {
            resolve(plan, state, finest + 1);
            state.believe_at(plan, graphs, finest);
            state.believe_at(plan, graphs, finest + 1);
        }
        let watched = finest == 0 && method.schedule.tolerance > 0.0;
        if watched {
            twin::change::change(&state.belief[0], plan.levels[0].labels, &mut map);
        }
        for i in 0..iterations {
            total += 1;
            // Levels that send dependency messages, and levels that exchange messages with the next finer
            // one.
            let mut speak: Vec<usize> = (finest..=last).collect();
            let mut hear: Vec<usize> = (finest + 1..=last).collect();
            if method.schedule.order == Order::CoarseFirst {
                if finest == 0 {
                    // Messages between levels advance by one level at a time, in every second iteration.
                    let exchanges = (i..iterations).filter(|j| j % 2 == 1).count();
                    speak.retain(|&z| z == 0 || (i % 2 == 0 && z <= exchanges));
                    hear.retain(|&z| i % 2 == 1 && z <= exchanges);
                } else if i == 0 {
                    hear.clear();
                }
            }
            for &z in &speak {
                state.dependency[z] = twin::dependency::dependency(
                    plan,
                    z,
                    &graphs[z],
                    &state.has[z],
                    &state.belief[z],
                    &state.dependency[z],
                );
            }
            for &z in &hear {
                resolve(plan, state, z);
            }
            for &z in &speak {
                state.believe_at(plan, graphs, z);
            }
            if watched {
                let sum = twin::change::change(&state.belief[0], plan.levels[0].labels, &mut map);
                if (sum as f64 / map.len() as f64).sqrt() <= method.schedule.tolerance {
                    break;
                }
            }
        }
    }
    total
}

/// The stages after message passing that read volumes.
fn twin_read_out(plan: &Plan, left: &Image, cost: &[u32], belief: &[u32], maps: &mut twin::Finest) {
    twin::winner_takes_all::winner_takes_all(plan, belief, maps);
    twin::right_view::right_view(plan, left, belief, maps);
    twin::sub_pixel::sub_pixel(plan, cost, maps);
}

/// From the pair to the estimate, on all backends and the twins; returns the number of iterations.
pub(super) fn whole_flood(plan: &Plan, pair: &Pair) -> u32 {
    let codes = twin::graph::graphs(pair.left(), plan);
    let graphs: Vec<LevelGraph> = codes
        .into_iter()
        .zip(&plan.levels)
        .map(|(codes, l)| LevelGraph::new(l.width, l.height, plan.neighbours, codes))
        .collect();
    let (costs, mut state) = twin_start(plan, pair);
    let iterations = twin_flood(plan, &graphs, &mut state, Some(&costs));
    let mut maps = twin::Finest::zero(plan.size());
    twin_read_out(plan, pair.left(), &costs[0], &state.belief[0], &mut maps);
    for (name, mut backend) in backends() {
        let backend = backend.as_mut();
        backend.prepare(plan, Prepared::new(pair)).unwrap();
        backend.run(Stage::Cost).unwrap();
        for z in 0..plan.levels.len() {
            backend.run(Stage::Graph(z)).unwrap();
            if z > 0 {
                backend.run(Stage::Pyramid(z)).unwrap();
            }
        }
        let check = |backend: &mut dyn Backend| -> Result<(), String> {
            let all = crate::common::flood_on_costs(backend, plan).unwrap();
            let actual = all - block_on(backend.idle_iterations()).unwrap();
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
            for stage in [Stage::WinnerTakesAll, Stage::RightView, Stage::SubPixel] {
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
    for (i, preset) in PRESETS.iter().enumerate() {
        let mut random = Random::new(i as u64);
        let mut method = preset.method();
        method.schedule.iterations = method.schedule.iterations.min(8);
        method.schedule.tolerance = 0.0;
        let pair = random::pair(&mut random, 45, 27);
        let plan = random::plan((45, 27), -3, 19, &method);
        whole_flood(&plan, &if plan.full.is_some() { pair.halved() } else { pair });
    }
}

#[test]
fn floods_with_all_combinations_of_options() {
    let mut seed = 100;
    for schedule in [Order::Together, Order::CoarseFirst] {
        for potential in [Potential::Soft, Potential::Exact, Potential::Hard] {
            for resolution in [Agreement::Strict, Agreement::Interpolating] {
                for levels in [1, 3, 5] {
                    seed += 1;
                    let mut random = Random::new(seed);
                    let mut method = random::method(&mut random, [2, 4, 8][seed as usize % 3]);
                    (method.schedule.order, method.messages.potential) = (schedule, potential);
                    (method.messages.agreement, method.graph.levels) = (resolution, levels);
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
fn floods_that_stop_early() {
    let mut counts = HashSet::new();
    for (i, tolerance) in [0.05, 0.3, 0.6, 1.0, 3.0, 1e6, 1e-9].into_iter().enumerate() {
        for schedule in [Order::Together, Order::CoarseFirst] {
            let mut random = Random::new(i as u64 + 7);
            let mut method = random::method(&mut random, 4);
            (method.cost.matching, method.cost.outside_cost, method.messages.temperature) =
                (MatchingCost::AdCensus, 0.8, 0.8);
            (method.messages.potential, method.messages.dependency_truncation, method.schedule.order) =
                (Potential::Soft, 2.0, schedule);
            (method.graph.levels, method.schedule.iterations, method.schedule.final_iterations) = (3, 5, 5);
            method.schedule.tolerance = tolerance;
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
