//! Negative controls: errors are detected.

use crate::common::compare::compare;
use crate::common::devices::backends;
use crate::common::random::{self, Random};
use crate::common::{graphs, prepare};
use crate::floods::{twin_flood, whole_flood};
use crate::{same, twin_start};
use mrfgs::image::Pair;
use mrfgs::low_level::backend::Volume;
use mrfgs::low_level::graph::LevelGraph;
use mrfgs::low_level::plan::{Plan, TruncationRule};
use mrfgs::options::{Agreement, MatchingCost, Method, Order, Pyramid};

/// A change of a plan for a negative control.
type Change = fn(&mut Plan);

/// Negative control: a single wrong element of any volume is detected and located.
#[test]
fn control_one_wrong_element_is_found() {
    let mut random = Random::new(5);
    let plan = random::plan((7, 5), -20, 33, &{
        let mut method = random::method(&mut random, 4);
        method.graph.levels = 3;
        method
    });
    let pair = random::pair(&mut random, 7, 5);
    let graphs = random::graphs(&mut random, &plan);
    let state = random::state(&mut random, &plan, &graphs, false);
    for (_, mut backend) in backends() {
        prepare(backend.as_mut(), &plan, &pair, &graphs);
        for (volume, values) in state.volumes() {
            for _ in 0..20 {
                let mut wrong = values.to_vec();
                let at = random.within(0, values.len() as u32 - 1) as usize;
                wrong[at] = if wrong[at] == 0 { 1 } else { wrong[at] - 1 };
                backend.probe().write(volume, &wrong).unwrap();
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
                backend.probe().write(volume, values).unwrap();
                same(&plan, backend.as_mut(), volume, values).unwrap();
            }
            let error = compare(&plan, volume, &values[1..], values).unwrap_err();
            assert!(error.contains("values, the twin has"), "{error}");
        }
    }
}

/// The volumes of the twin for `plan`, for a case in which every parameter of every stage matters.
fn twin_of_the_control(plan: &Plan, pair: &Pair, graphs: &[LevelGraph]) -> Vec<(String, Vec<u32>)> {
    let (costs, mut state) = twin_start(plan, pair);
    twin_flood(plan, graphs, &mut state, Some(&costs));
    let mut all: Vec<(String, Vec<u32>)> =
        costs.into_iter().enumerate().map(|(z, cost)| (format!("{:?}", Volume::Cost(z)), cost)).collect();
    all.extend(state.volumes().into_iter().map(|(volume, v)| (format!("{volume:?}"), v.to_vec())));
    all
}

/// Negative control: a twin with a slightly different plan is detected.
#[test]
fn control_a_changed_parameter_is_found() {
    let mut method = Method::default();
    (method.graph.levels, method.schedule.iterations, method.schedule.final_iterations) = (3, 2, 2);
    (method.graph.percentile, method.messages.temperature) = (92.0, 0.1);
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
    let graphs = graphs(pair.left(), &plan);
    let base = twin_of_the_control(&plan, &pair, &graphs);
    let changes: &[(&str, &str, Change)] = &[
        ("outside cost", "Cost(0)", |p| p.outside_cost += 1),
        ("kind of cost", "Cost(0)", |p| p.method.cost.matching = MatchingCost::Sad),
        ("pyramid", "Cost(1)", |p| p.method.cost.pyramid = Pyramid::LowPass),
        ("evidence cap", "Evidence(2)", |p| p.levels[2].evidence.cap -= 1),
        ("evidence limit", "Evidence(1)", |p| p.levels[1].evidence.limit /= 2),
        ("evidence up", "Evidence(0)", |p| p.levels[0].evidence.up += 1),
        ("evidence down", "Evidence(1)", |p| p.levels[1].evidence.down += 1),
        ("evidence multiplier", "Evidence(2)", |p| p.levels[2].evidence.multiplier -= 1000),
        ("dependency tau", "Dependency(0)", |p| p.dependency.tau += 1),
        ("label step", "Dependency(1)", |p| p.method.messages.label_step = 0.5),
        ("dependency rule", "Dependency(0)", |p| p.dependency.rule = TruncationRule::Absolute),
        ("resolution tau", "Up(2)", |p| p.resolution.tau += 1),
        ("resolution rule", "Down(0)", |p| p.resolution.rule = TruncationRule::Absolute),
        ("resolution kind", "Down(1)", |p| p.method.messages.agreement = Agreement::Strict),
        ("iterations", "Belief(0)", |p| p.method.schedule.iterations += 1),
        ("final iterations", "Belief(0)", |p| p.method.schedule.final_iterations += 1),
        ("schedule", "Belief(1)", |p| p.method.schedule.order = Order::Together),
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
    // The unchanged plan passes on the backends.
    whole_flood(&plan, &pair);
}
