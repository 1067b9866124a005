//! Saturating sums in 8 and 16 bits.

use crate::common::devices::backends;
use crate::common::prepare;
use crate::common::random::{self, Random, State};
use crate::common::twin;
use crate::common::twin::belief::belief_most;
use crate::floods::twin_flood;
use crate::{NEIGHBOURS, cells, resolve, same};
use mrfgs::low_level::backend::{Backend, Stage, Volume, volume_shape};
use mrfgs::low_level::graph::{self, LevelGraph};
use mrfgs::low_level::plan::{LevelPlan, Plan, Truncation, TruncationRule, VolumeWidth};
use mrfgs::options::{Agreement, Method};
use std::collections::HashSet;

/// Graphs in which all pixels of a window are neighbours: the largest possible number of factors per pixel.
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

/// The strongest evidence for label 0 at every pixel.
fn sure(plan: &Plan) -> Vec<Vec<u32>> {
    let evidence = |level: &LevelPlan| {
        let cap = u32::from(level.evidence.cap);
        (0..level.pixels() * level.labels).map(|i| if i % level.labels == 0 { 0 } else { cap }).collect()
    };
    plan.levels.iter().map(evidence).collect()
}

/// Message passing on full graphs from the strongest evidence, on the twins and all backends; returns the
/// largest belief.
fn flood_of_the_sure(plan: &Plan) -> u32 {
    let (width, height) = plan.size();
    let pair = random::pair(&mut Random::new(3), width, height);
    let graphs = full_graphs(plan);
    let mut state = State::fresh(plan, sure(plan));
    let start = state.clone();
    twin_flood(plan, &graphs, &mut state, None);
    for (name, mut backend) in backends() {
        prepare(backend.as_mut(), plan, &pair, &graphs);
        start.write(backend.as_mut());
        crate::common::flood(backend.as_mut(), plan).unwrap();
        for (volume, expected) in state.volumes() {
            if let Err(e) = same(plan, backend.as_mut(), volume, expected) {
                panic!("{name}: {e}\n{plan:?}");
            }
        }
    }
    state.belief.iter().flatten().copied().max().unwrap()
}

/// The largest in-degree, the strongest potential and the largest evidence fit in 16 bits.
#[test]
fn wide_beliefs_never_saturate() {
    for (resolution, levels) in [(Agreement::Strict, 3), (Agreement::Interpolating, 2)] {
        let mut method = Method::preset("paper").unwrap();
        (method.graph.percentile, method.messages.agreement, method.graph.levels) = (0.0, resolution, levels);
        (method.messages.temperature, method.messages.evidence_cap) = (0.5, 63.75);
        method.schedule.iterations = 6;
        let plan = random::plan((15, 13), 0, 5, &method);
        assert_eq!(plan.levels[0].evidence.cap, 255);
        let largest = flood_of_the_sure(&plan);
        assert!(largest < belief_most(&plan));
        // The worst case is reached: all 49 factors are at their cap.
        assert!(largest >= 255 + 49 * 1023, "{largest}");
    }
}

/// A plan of either width with such large truncations that beliefs saturate on full graphs.
fn saturating(neighbours: usize, width: VolumeWidth, rule: TruncationRule, resolution: Agreement) -> Plan {
    let mut method = Method::default();
    method.graph.percentile = 100.0 - neighbours as f64 * 100.0 / 48.0;
    method.messages.evidence_cap = 10.0;
    (method.graph.levels, method.schedule.iterations, method.schedule.final_iterations) = (2, 2, 2);
    method.messages.agreement = resolution;
    let mut plan = random::plan((15, 13), -3, 20, &method);
    let tau = match width {
        VolumeWidth::Narrow => 40,
        VolumeWidth::Wide => 5000,
    };
    (plan.dependency, plan.resolution, plan.volume_width) =
        (Truncation { tau, rule }, Truncation { tau, rule }, width);
    plan
}

#[test]
fn saturated_beliefs_equal_those_of_the_twins() {
    for width in [VolumeWidth::Narrow, VolumeWidth::Wide] {
        for rule in [TruncationRule::Relative, TruncationRule::Absolute] {
            for resolution in [Agreement::Strict, Agreement::Interpolating] {
                let plan = saturating(48, width, rule, resolution);
                assert_eq!(flood_of_the_sure(&plan), belief_most(&plan));
            }
        }
    }
}

/// Negative control: if the sums of all labels saturate, messages and beliefs carry no information; without
/// saturation they would.
#[test]
fn control_saturated_sums_carry_no_information() {
    for width in [VolumeWidth::Narrow, VolumeWidth::Wide] {
        for resolution in [Agreement::Strict, Agreement::Interpolating] {
            let plan = saturating(48, width, TruncationRule::Relative, resolution);
            let pair = random::pair(&mut Random::new(3), 15, 13);
            let graphs = full_graphs(&plan);
            let tau = u32::from(plan.dependency.tau);
            // Label 0 is slightly better everywhere, in beliefs and in messages above their minimum.
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
                prepare(backend, &plan, &pair, &graphs);
                for z in 0..2 {
                    let belief = better(&plan, Volume::Belief(z), belief_most(&plan));
                    backend.probe().write(Volume::Belief(z), &belief).unwrap();
                }
                backend.run(Stage::Dependency(0)).unwrap();
                let silent = |backend: &mut dyn Backend, volume: Volume| -> Vec<bool> {
                    let labels = plan.levels[volume.level()].labels;
                    let messages = backend.probe().read(volume).unwrap();
                    messages.chunks(labels).map(|m| m.iter().all(|&other| other == m[0])).collect()
                };
                assert!(silent(backend, Volume::Dependency(0)).iter().all(|&silent| silent), "{name}");
                backend.run(Stage::Resolution(1)).unwrap();
                // The coarse pixel at the far corner has a single child, whose belief is no sum.
                let silent = silent(backend, Volume::Up(1));
                let (corner, others) = silent.split_last().unwrap();
                assert!(!corner && others.iter().all(|&silent| silent), "{name}: {silent:?}");

                for volume in [Volume::Dependency(0), Volume::Down(0)] {
                    backend.probe().write(volume, &better(&plan, volume, tau)).unwrap();
                }
                backend.probe().write(Volume::Evidence(0), &zero(&plan, Volume::Evidence(0))).unwrap();
                backend.run(Stage::Belief(0)).unwrap();
                // Away from the border every pixel is in 49 factors.
                let belief = backend.probe().read(Volume::Belief(0)).unwrap();
                let labels = plan.levels[0].labels;
                let inner = &belief[(6 * 15 + 7) * labels..][..labels];
                assert!(inner.iter().all(|&b| b == belief_most(&plan)), "{name}: {inner:?}");
            }
        }
    }
}

/// Negative control: padding must not be better than labels that all have the largest cost, even after its
/// message is subtracted.
#[test]
fn control_padding_stays_above_saturated_beliefs() {
    for width in [VolumeWidth::Narrow, VolumeWidth::Wide] {
        let plan = saturating(1, width, TruncationRule::Relative, Agreement::Interpolating);
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
            prepare(backend, &plan, &pair, &graphs);
            backend.probe().write(Volume::Evidence(0), &flat(0)).unwrap();
            backend.probe().write(Volume::Belief(0), &flat(0)).unwrap();
            for _ in 0..2 {
                backend.run(Stage::Dependency(0)).unwrap();
                same(&plan, backend, Volume::Dependency(0), &silent)
                    .unwrap_or_else(|e| panic!("{name}: {e}"));
                backend.probe().write(Volume::Down(0), &flat(belief_most(&plan))).unwrap();
                backend.run(Stage::Belief(0)).unwrap();
                same(&plan, backend, Volume::Belief(0), &flat(belief_most(&plan))).unwrap();
            }
        }
    }
}

/// The usual number of factors never saturates in narrow plans, nor the largest number in wide ones.
#[test]
fn usual_beliefs_fit_the_width_of_every_plan() {
    let mut random = Random::new(11);
    let mut widths = HashSet::new();
    for _ in 0..2000 {
        let neighbours = random.pick(NEIGHBOURS);
        let plan = random::plan((9, 9), 0, 9, &random::method(&mut random, neighbours));
        let (dependency, resolution) = (u32::from(plan.dependency.tau), u32::from(plan.resolution.tau));
        // The number of members of a factor in 8 bits, the largest possible number in 16.
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

/// Negative control: twins that saturate later than a narrow plan give different volumes.
#[test]
fn control_saturation_in_8_bits_is_found() {
    let plan = saturating(48, VolumeWidth::Narrow, TruncationRule::Relative, Agreement::Interpolating);
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
    let messages = |plan| {
        let (has, belief) = (&state.has[0], &state.belief[0]);
        twin::dependency::dependency(plan, 0, &graphs[0], has, belief, &state.dependency[0])
    };
    assert_ne!(messages(&plan), messages(&wider));
    let resolved = |plan| {
        let mut state = state.clone();
        resolve(plan, &mut state, 1);
        (state.down, state.up)
    };
    let (narrow, wide) = (resolved(&plan), resolved(&wider));
    assert!(narrow.0 != wide.0 && narrow.1 != wide.1);
}
