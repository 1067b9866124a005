//! Graphs with cycles: hard messages are those of the sum-product.

use crate::common;
use crate::common::devices::backends;
use crate::common::random::{self, Random};
use crate::common::twin;
use crate::{Factor, Model, NEIGHBOURS, evidence, method};
use mrfgs::low_level::backend::Volume;
use mrfgs::low_level::graph::LevelGraph;
use mrfgs::low_level::plan::HARD_CAP;
use mrfgs::options::{Agreement, Potential};

/// Equations (3) and (4), in f64, literally: every sum runs over all labels of all other members.
struct SumProduct<'a> {
    model: &'a Model,
    /// exp(-evidence) of each variable.
    prior: Vec<Vec<f64>>,
    /// Messages from each factor to each of its variables, in their order.
    messages: Vec<Vec<Vec<f64>>>,
}

impl<'a> SumProduct<'a> {
    fn new(model: &'a Model, evidence: &[Vec<u32>]) -> Self {
        let prior = (0..model.variables())
            .map(|v| model.row(evidence, v).iter().map(|&e| (-f64::from(e) / 4.0).exp()).collect())
            .collect();
        let ones = |f: &Factor| f.variables().iter().map(|&v| vec![1.0; model.labels(v)]).collect();
        Self { model, prior, messages: model.factors.iter().map(ones).collect() }
    }

    /// The product of all messages to `variable`, except the one from factor `without`.
    fn product(&self, variable: usize, without: Option<usize>) -> Vec<f64> {
        let mut out = self.prior[variable].clone();
        for (f, factor) in self.model.factors.iter().enumerate() {
            for (i, &v) in factor.variables().iter().enumerate() {
                if v == variable && Some(f) != without {
                    out.iter_mut().zip(&self.messages[f][i]).for_each(|(out, m)| *out *= m);
                }
            }
        }
        normalised(out)
    }

    /// One iteration: all messages from all old ones.
    fn step(&mut self) {
        let model = self.model;
        let new = model.factors.iter().enumerate().map(|(f, factor)| {
            let variables = factor.variables();
            // Equation (3).
            let incoming: Vec<Vec<f64>> = variables.iter().map(|&v| self.product(v, Some(f))).collect();
            // Equation (4).
            let to = |i: usize| {
                let mut out = vec![0.0; model.labels(variables[i])];
                let mut labels = vec![0; variables.len()];
                loop {
                    if model.agree(factor, &labels) {
                        let others = (0..labels.len()).filter(|&j| j != i);
                        out[labels[i]] += others.map(|j| incoming[j][labels[j]]).product::<f64>();
                    }
                    let next = (0..labels.len()).find(|&j| labels[j] + 1 < model.labels(variables[j]));
                    let Some(j) = next else { return normalised(out) };
                    labels[j] += 1;
                    labels[..j].fill(0);
                }
            };
            (0..variables.len()).map(to).collect()
        });
        self.messages = new.collect();
    }
}

/// The scale of a message has no meaning: the largest value becomes 1.
fn normalised(mut values: Vec<f64>) -> Vec<f64> {
    let most = values.iter().copied().fold(0.0, f64::max);
    assert!(most > 0.0);
    for v in &mut values {
        *v /= most;
    }
    values
}

/// Compares a probability vector with costs in units, minimum 0: exactly where it is not 0, and as far behind
/// where it is 0. Returns the largest cost that was compared exactly.
fn compare_costs(what: &str, costs: &[u32], probabilities: &[f64]) -> f64 {
    let least = *costs.iter().min().unwrap();
    let mut most = 0.0f64;
    for (d, (&cost, &p)) in costs.iter().zip(probabilities).enumerate() {
        let cost = cost - least;
        if p == 0.0 {
            assert!(
                cost >= u32::from(HARD_CAP) / 2,
                "{what}, label index {d}: {cost} where all is forbidden"
            );
            continue;
        }
        let exact = -4.0 * p.ln();
        assert!((exact - f64::from(cost)).abs() < 1e-6, "{what}, label index {d}: {cost}, by sums {exact}");
        most = most.max(exact);
    }
    most
}

/// A random graph with many cycles, two or three levels, and the hard potential.
fn loopy(seed: u64) -> (Model, Vec<Vec<u32>>) {
    let mut random = Random::new(seed);
    let levels = random.within(1, 3);
    let size = random.pick(&[(4, 3), (5, 2), (1, 8), (3, 3)]);
    let labels = random.within(2, 5) as usize;
    let min = random.pick(&[-3, -1, 0]);
    let mut method = method(Potential::Hard, Agreement::Strict, levels);
    method.schedule.iterations = 1;
    let plan = random::plan(size, min, labels, &method);
    let graphs = plan
        .levels
        .iter()
        .map(|level| {
            let mut codes = Vec::new();
            for y in 0..level.height as i32 {
                for x in 0..level.width as i32 {
                    let near = random.shuffled(&[(1, 0), (0, 1), (-1, 0), (1, 1), (0, -2), (3, 0)]);
                    let inside = near.into_iter().filter(|(dx, dy)| {
                        (0..level.width as i32).contains(&(x + dx))
                            && (0..level.height as i32).contains(&(y + dy))
                    });
                    let mut own: Vec<u8> =
                        inside.take(2).map(|(dx, dy)| ((dy + 3) * 7 + dx + 3) as u8).collect();
                    own.resize(NEIGHBOURS, 255);
                    codes.extend(random.shuffled(&own));
                }
            }
            LevelGraph::new(level.width, level.height, NEIGHBOURS, codes)
        })
        .collect();
    let evidence = evidence(&mut random, &plan, 2);
    (Model::new(plan, graphs), evidence)
}

/// Under the hard potential, and with strict agreement between levels, one label of the receiver leaves the
/// others a single choice: its own label for a dependency factor, twice or half of it for a resolution
/// factor. So every sum of equation (4) has at most one term that is not 0. Sum-product and max-product are
/// then the same, products are sums of costs, and integers represent them exactly as long as nothing is
/// truncated. (Interpolating agreement leaves several choices; there the two differ.)
#[test]
fn hard_messages_are_those_of_the_sum_product() {
    let (mut compared, mut cycles) = (0, 0);
    for seed in 0..60 {
        let (model, evidence) = loopy(seed);
        if (0..model.variables()).all(|v| model.labels(v) == 1) || infeasible(&model) {
            continue;
        }
        let joins: usize = model.factors.iter().map(|f| f.variables().len() - 1).sum();
        cycles += usize::from(joins >= model.variables());
        for (name, mut backend) in backends() {
            let backend = backend.as_mut();
            model.backend_with(backend, &evidence);
            let mut sums = SumProduct::new(&model, &evidence);
            for iteration in 1..=8 {
                common::flood(backend, &model.plan).unwrap();
                sums.step();
                let levels = model.plan.levels.len();
                let mut read = |f: &dyn Fn(usize) -> Volume, levels: std::ops::Range<usize>| {
                    let mut out = vec![Vec::new(); model.plan.levels.len()];
                    for z in levels {
                        out[z] = backend.probe().read(f(z)).unwrap();
                    }
                    out
                };
                let dependency = read(&Volume::Dependency, 0..levels);
                let down = read(&Volume::Down, 0..levels - 1);
                let up = read(&Volume::Up, 1..levels);
                let belief = read(&Volume::Belief, 0..levels);
                let mut most = 0.0f64;
                let mut check = |what: String, costs: &[u32], probabilities: &[f64]| {
                    let what = format!("{name}, graph {seed}, iteration {iteration}, {what}");
                    most = most.max(compare_costs(&what, costs, probabilities));
                };
                for (factor, messages) in model.factors.iter().zip(&sums.messages) {
                    let v = factor.variables();
                    for (i, message) in messages.iter().enumerate() {
                        let costs = match factor {
                            Factor::Resolution(_) if i == 0 => model.row(&up, v[0]),
                            Factor::Resolution(_) => model.row(&down, v[i]),
                            Factor::Dependency(_) => {
                                // A factor belongs to its first member; the others are in some slots of it.
                                let z = model.level[v[0]];
                                let centre = v[0] - model.starts[z];
                                let slot = twin::members(&model.graphs[z], centre)
                                    .iter()
                                    .position(|&m| m == Some(v[i] - model.starts[z]))
                                    .unwrap();
                                let labels = model.labels(v[0]);
                                let at = (centre * (NEIGHBOURS + 1) + slot) * labels;
                                &dependency[z][at..at + labels]
                            }
                        };
                        check(format!("{factor:?} to member {i}"), costs, message);
                    }
                }
                for v in 0..model.variables() {
                    check(format!("belief of {v}"), model.row(&belief, v), &sums.product(v, None));
                }
                compared += 1;
                // Hard messages grow without bound: the comparison ends long before truncation sets in.
                if most > 60.0 {
                    assert!(iteration > 1, "graph {seed} says nothing: {most}");
                    break;
                }
            }
        }
    }
    assert!(compared > 100 && cycles > 20, "{compared} iterations, {cycles} graphs with cycles");
}

/// Whether strict agreement leaves some pixel without any label; equation (1) is then 0 everywhere.
fn infeasible(model: &Model) -> bool {
    let mut allowed: Vec<Vec<bool>> = (0..model.variables()).map(|v| vec![true; model.labels(v)]).collect();
    for _ in 0..model.variables() {
        for factor in &model.factors {
            let variables = factor.variables();
            for (i, &v) in variables.iter().enumerate() {
                for d in 0..model.labels(v) {
                    let disparity = model.disparity(v, d);
                    let agrees = variables.iter().enumerate().all(|(j, &other)| {
                        let wanted = match factor {
                            Factor::Resolution(_) if i == 0 && j > 0 => 2 * disparity,
                            Factor::Resolution(_) if i > 0 && j == 0 => {
                                if disparity % 2 != 0 {
                                    return false;
                                }
                                disparity / 2
                            }
                            _ => disparity,
                        };
                        (0..model.labels(other))
                            .any(|d| model.disparity(other, d) == wanted && allowed[other][d])
                    });
                    if !agrees {
                        allowed[v][d] = false;
                    }
                }
            }
        }
    }
    allowed.iter().any(|labels| !labels.contains(&true))
}

/// Negative control: the sum-product with one unit of evidence more differs from what the backend computes.
#[test]
fn control_other_evidence_is_found_by_the_sum_product() {
    let (model, evidence) =
        (0..60).map(loopy).find(|(m, _)| !infeasible(m) && m.plan.levels.len() == 2).unwrap();
    let (_, mut backend) = backends().swap_remove(0);
    model.backend_with(backend.as_mut(), &evidence);
    common::flood(backend.as_mut(), &model.plan).unwrap();
    let beliefs: Vec<Vec<u32>> = (0..2).map(|z| backend.probe().read(Volume::Belief(z)).unwrap()).collect();
    let differs = |evidence: &[Vec<u32>]| {
        let mut sums = SumProduct::new(&model, evidence);
        sums.step();
        (0..model.variables()).any(|v| {
            let costs = model.row(&beliefs, v);
            let least = costs.iter().min().unwrap();
            sums.product(v, None)
                .iter()
                .zip(costs)
                .any(|(&p, cost)| p > 0.0 && (-4.0 * p.ln() - f64::from(cost - least)).abs() > 0.5)
        })
    };
    assert!(!differs(&evidence));
    for label in 0..model.labels(0) {
        let mut changed = evidence.clone();
        changed[0][label] += 1;
        if model.disparity(0, label) % 2 == 0 {
            assert!(differs(&changed), "label index {label}");
        }
    }
}
