//! The results of message passing: on trees the min-marginals of the joint distribution of equation (1),
//! checked by enumeration; on graphs with cycles the sum-product of equations (3) and (4), checked in
//! floating point.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on panics")]

#[path = "../common/mod.rs"]
mod common;
mod interpolating;
mod sum_product;
mod trees;

use common::random::{self, Random, State};
use common::twin;
use mrfgs::image::{Image, Pair, Plane};
use mrfgs::low_level::backend::{Backend, Volume};
use mrfgs::low_level::graph::LevelGraph;
use mrfgs::low_level::plan::Plan;
use mrfgs::options::{Agreement, Method, Order, Potential};

/// Neighbours of a dependency factor in these graphs; most of the slots stay empty.
const NEIGHBOURS: usize = 4;
/// The cost of forbidden labellings under a hard potential, in the enumeration.
const FORBIDDEN: u64 = 1 << 40;
/// Largest number of joint labellings in one enumeration.
const LABELLINGS: usize = 150_000;

/// The structure of a factor graph: variables are pixels of all levels, finest level first.
struct Model {
    plan: Plan,
    graphs: Vec<LevelGraph>,
    /// First variable of each level, and the number of variables.
    starts: Vec<usize>,
    /// Level of each variable.
    level: Vec<usize>,
    factors: Vec<Factor>,
}

/// The variables that a factor connects.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Factor {
    /// Equal labels agree.
    Dependency(Vec<usize>),
    /// The parent comes first; its children agree with it where the fine label fits the coarse one.
    Resolution(Vec<usize>),
}

impl Factor {
    fn variables(&self) -> &[usize] {
        match self {
            Factor::Dependency(v) | Factor::Resolution(v) => v,
        }
    }
}

impl Model {
    fn new(plan: Plan, graphs: Vec<LevelGraph>) -> Self {
        let mut starts = vec![0];
        let mut level = Vec::new();
        for (z, l) in plan.levels.iter().enumerate() {
            level.extend(vec![z; l.pixels()]);
            starts.push(level.len());
        }
        let mut model = Self { plan, graphs, starts, level, factors: Vec::new() };
        for (z, graph) in model.graphs.iter().enumerate() {
            for factor in 0..model.plan.levels[z].pixels() {
                let members: Vec<usize> =
                    twin::members(graph, factor).into_iter().flatten().map(|i| model.starts[z] + i).collect();
                if members.len() > 1 {
                    model.factors.push(Factor::Dependency(members));
                }
            }
        }
        model.factors.extend(resolution_factors(&model.plan, &model.starts));
        model
    }

    fn variables(&self) -> usize {
        self.level.len()
    }

    fn labels(&self, variable: usize) -> usize {
        self.plan.levels[self.level[variable]].labels
    }

    /// The disparity of label index `label` of `variable`, at its own level.
    fn disparity(&self, variable: usize, label: usize) -> i64 {
        i64::from(self.plan.levels[self.level[variable]].min) + label as i64
    }

    /// Whether the members of `factor` agree, given the label index of each.
    fn agree(&self, factor: &Factor, labels: &[usize]) -> bool {
        match factor {
            Factor::Dependency(_) => labels.iter().all(|&d| d == labels[0]),
            Factor::Resolution(v) => {
                let z = self.disparity(v[0], labels[0]);
                let reach = i64::from(self.plan.method.messages.agreement == Agreement::Interpolating);
                (1..v.len()).all(|i| (self.disparity(v[i], labels[i]) - 2 * z).abs() <= reach)
            }
        }
    }

    /// Cost of disagreement in `factor`.
    fn penalty(&self, factor: &Factor) -> u64 {
        match (self.plan.method.messages.potential, factor) {
            (Potential::Hard, _) => FORBIDDEN,
            (_, Factor::Dependency(_)) => self.plan.dependency.tau.into(),
            (_, Factor::Resolution(_)) => self.plan.resolution.tau.into(),
        }
    }

    /// The values of `variable` in volumes with one row per pixel.
    fn row<'a>(&self, volumes: &'a [Vec<u32>], variable: usize) -> &'a [u32] {
        let (z, labels) = (self.level[variable], self.labels(variable));
        let at = (variable - self.starts[z]) * labels;
        &volumes[z][at..at + labels]
    }

    /// Equation (1) by enumeration, as costs: the smallest cost of all labellings in which a variable has a label,
    /// for every variable and label.
    fn min_marginals(&self, evidence: &[Vec<u32>]) -> Vec<Vec<u64>> {
        let mut out: Vec<Vec<u64>> = (0..self.variables()).map(|v| vec![u64::MAX; self.labels(v)]).collect();
        let mut labels = vec![0; self.variables()];
        let mut own = Vec::new();
        loop {
            let mut cost: u64 =
                labels.iter().enumerate().map(|(v, &d)| u64::from(self.row(evidence, v)[d])).sum();
            for factor in &self.factors {
                own.clear();
                own.extend(factor.variables().iter().map(|&v| labels[v]));
                if !self.agree(factor, &own) {
                    cost += self.penalty(factor);
                }
            }
            for (out, &d) in out.iter_mut().zip(&labels) {
                out[d] = out[d].min(cost);
            }
            // The next labelling; the first variable changes fastest.
            let Some(v) = (0..labels.len()).find(|&v| labels[v] + 1 < self.labels(v)) else { return out };
            labels[v] += 1;
            labels[..v].fill(0);
        }
    }

    fn labellings(&self) -> usize {
        (0..self.variables()).map(|v| self.labels(v)).fold(1, usize::saturating_mul)
    }

    fn backend_with(&self, backend: &mut dyn Backend, evidence: &[Vec<u32>]) {
        let (width, height) = self.plan.size();
        common::prepare(backend, &self.plan, &blank(width, height), &self.graphs);
        State::fresh(&self.plan, evidence.to_vec()).write(backend);
    }

    /// Beliefs of all variables after the message passing of the plan.
    fn beliefs(&self, backend: &mut dyn Backend, evidence: &[Vec<u32>]) -> Vec<Vec<u32>> {
        self.backend_with(backend, evidence);
        common::flood(backend, &self.plan).unwrap();
        let volumes: Vec<Vec<u32>> =
            (0..self.plan.levels.len()).map(|z| backend.probe().read(Volume::Belief(z)).unwrap()).collect();
        (0..self.variables()).map(|v| self.row(&volumes, v).to_vec()).collect()
    }
}

fn blank(width: usize, height: usize) -> Pair {
    let image =
        Image { pixels: Plane::filled(width, height, [0; 4]), masked: Plane::filled(width, height, false) };
    Pair::new(image.clone(), image).unwrap()
}

/// One factor for each pixel of level 1 and coarser, with its children.
fn resolution_factors(plan: &Plan, starts: &[usize]) -> Vec<Factor> {
    let mut out = Vec::new();
    for z in 1..plan.levels.len() {
        let (fine, coarse) = (&plan.levels[z - 1], &plan.levels[z]);
        for y in 0..coarse.height {
            for x in 0..coarse.width {
                let mut variables = vec![starts[z] + y * coarse.width + x];
                for (fx, fy) in
                    [(2 * x, 2 * y), (2 * x + 1, 2 * y), (2 * x, 2 * y + 1), (2 * x + 1, 2 * y + 1)]
                {
                    if fx < fine.width && fy < fine.height {
                        variables.push(starts[z - 1] + fy * fine.width + fx);
                    }
                }
                out.push(Factor::Resolution(variables));
            }
        }
    }
    out
}

fn method(potential: Potential, resolution: Agreement, levels: u32) -> Method {
    let mut method = Method::default();
    (method.messages.potential, method.messages.agreement, method.graph.levels) =
        (potential, resolution, levels);
    method.graph.percentile = 100.0 - NEIGHBOURS as f64 * 100.0 / 48.0;
    method.schedule.order = Order::Together;
    // Longer than the longest path in any of the trees.
    (method.schedule.iterations, method.schedule.final_iterations) = (30, 30);
    method.schedule.tolerance = 0.0;
    method
}

/// Evidence 0 ..= `most` with minimum 0 for every pixel.
fn evidence(random: &mut Random, plan: &Plan, most: u8) -> Vec<Vec<u32>> {
    let mut plan = plan.clone();
    plan.levels.iter_mut().for_each(|level| level.evidence.cap = most);
    random::evidence(random, &plan)
}
