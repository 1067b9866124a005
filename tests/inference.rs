//! What message passing computes: on trees the min-marginals of the joint distribution of equation (1),
//! checked by enumeration; on graphs with cycles the sum-product of equations (3) and (4), checked in
//! floating point.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on panics")]

mod common;

use common::devices::backends;
use common::random::{self, Random, State};
use common::twin;
use mrfgs::image::{Image, Pair, Plane};
use mrfgs::low_level::backend::{Backend, Volume};
use mrfgs::low_level::graph::LevelGraph;
use mrfgs::low_level::plan::{HARD_CAP, Plan};
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

fn root(parents: &[usize], mut v: usize) -> usize {
    while parents[v] != v {
        v = parents[v];
    }
    v
}

/// A random graph without cycles on the levels of `plan`. Resolution factors connect their fixed pixels, and
/// each dependency factor takes up to `most` neighbours that are not connected to it yet.
fn tree(random: &mut Random, plan: Plan, most: u32) -> Model {
    let mut starts = vec![0];
    for level in &plan.levels {
        starts.push(starts[starts.len() - 1] + level.pixels());
    }
    let mut parents: Vec<usize> = (0..starts[plan.levels.len()]).collect();
    for factor in resolution_factors(&plan, &starts) {
        for &v in &factor.variables()[1..] {
            let (a, b) = (root(&parents, v), root(&parents, factor.variables()[0]));
            assert_ne!(a, b, "resolution factors alone have no cycle");
            parents[a] = b;
        }
    }
    let window: Vec<i32> = (0..49).filter(|&code| code != 24).collect();
    let mut graphs = Vec::new();
    for (z, level) in plan.levels.iter().enumerate() {
        let (width, height) = (level.width as i32, level.height as i32);
        let mut codes = vec![255; level.pixels() * NEIGHBOURS];
        let pixels: Vec<usize> = (0..level.pixels()).collect();
        for pixel in random.shuffled(&pixels) {
            let count = random.within(0, most) as usize;
            let mut slots = random.shuffled(&[0, 1, 2, 3]);
            for code in random.shuffled(&window) {
                let x = pixel as i32 % width + code % 7 - 3;
                let y = pixel as i32 / width + code / 7 - 3;
                if slots.len() + count == NEIGHBOURS || x < 0 || y < 0 || x >= width || y >= height {
                    continue;
                }
                let other = root(&parents, starts[z] + (y * width + x) as usize);
                let own = root(&parents, starts[z] + pixel);
                if own != other {
                    parents[other] = own;
                    codes[pixel * NEIGHBOURS + slots.pop().unwrap()] = code as u8;
                }
            }
        }
        graphs.push(LevelGraph::new(level.width, level.height, NEIGHBOURS, codes));
    }
    Model::new(plan, graphs)
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

/// Where beliefs, up to a constant per pixel, differ from the min-marginals. Labels forbidden by a hard
/// potential must be far behind instead of infinitely far.
fn wrong_beliefs(beliefs: &[Vec<u32>], marginals: &[Vec<u64>]) -> Option<String> {
    for (v, (b, m)) in beliefs.iter().zip(marginals).enumerate() {
        let (least_b, least_m) = (*b.iter().min().unwrap(), *m.iter().min().unwrap());
        assert!(least_m < FORBIDDEN, "no labelling is allowed");
        for (d, (&b, &m)) in b.iter().zip(m).enumerate() {
            let (b, m) = (u64::from(b - least_b), m - least_m);
            if if m < FORBIDDEN / 2 { b != m } else { b < u64::from(HARD_CAP) / 2 } {
                return Some(format!(
                    "variable {v}, label index {d}: {b} above the best, the min-marginal is {m} above"
                ));
            }
        }
    }
    None
}

/// Evidence 0 ..= `most` with minimum 0 for every pixel.
fn evidence(random: &mut Random, plan: &Plan, most: u8) -> Vec<Vec<u32>> {
    let mut plan = plan.clone();
    plan.levels.iter_mut().for_each(|level| level.evidence.cap = most);
    random::evidence(random, &plan)
}

/// (size, smallest label, labels, levels) of the trees: one level, which has no resolution factors, two and three.
const SHAPES: &[((usize, usize), i32, usize, u32)] = &[
    ((6, 1), 0, 5, 1),
    ((1, 7), -2, 4, 1),
    ((3, 3), 5, 3, 1),
    ((4, 2), -1, 4, 1),
    ((1, 1), 0, 6, 1),
    ((1, 4), 0, 6, 2),
    ((5, 1), -3, 4, 2),
    ((2, 2), -2, 6, 2),
    ((3, 2), 0, 5, 2),
    ((4, 2), 0, 3, 2),
    ((1, 4), -3, 6, 3),
    ((3, 1), 0, 9, 3),
    ((3, 2), -2, 4, 3),
];

/// Trees of every shape, with evidence for each: dense, sparse, and with resolution factors only.
fn trees(potential: Potential, resolution: Agreement, schedule: Order) -> Vec<(Model, Vec<Vec<u32>>)> {
    let mut out = Vec::new();
    for &(size, min, labels, levels) in SHAPES {
        for most in [NEIGHBOURS as u32; 4].into_iter().chain([1, 1, 0]) {
            let mut random = Random::new(out.len() as u64 + 1000);
            let mut method = method(potential, resolution, levels);
            method.schedule.order = schedule;
            method.messages.dependency_truncation = random.pick(&[0.25, 1.0, 2.0, 4.5]);
            method.messages.resolution_truncation = random.pick(&[0.5, 1.5, 8.0]);
            let plan = random::plan(size, min, labels, &method);
            assert_eq!(plan.levels.len(), levels as usize);
            let tree = tree(&mut random, plan, most);
            assert!(tree.labellings() <= LABELLINGS, "{} labellings of {size:?}", tree.labellings());
            assert_eq!(levels == 1, !tree.factors.iter().any(|f| matches!(f, Factor::Resolution(_))));
            // Under a hard potential the evidence of all pixels together stays below its cap.
            let most = if potential == Potential::Hard { 30 } else { random.pick(&[3, 10, 40]) };
            let evidence = evidence(&mut random, &tree.plan, most);
            out.push((tree, evidence));
        }
    }
    out
}

#[test]
fn beliefs_on_trees_are_min_marginals() {
    for potential in [Potential::Hard, Potential::Exact] {
        for resolution in [Agreement::Strict, Agreement::Interpolating] {
            for schedule in [Order::Together, Order::CoarseFirst] {
                for (tree, evidence) in trees(potential, resolution, schedule) {
                    let marginals = tree.min_marginals(&evidence);
                    for (name, mut backend) in backends() {
                        let beliefs = tree.beliefs(backend.as_mut(), &evidence);
                        if let Some(e) = wrong_beliefs(&beliefs, &marginals) {
                            panic!("{name}: {e}\n{:?}\n{:?}", tree.plan, tree.factors);
                        }
                    }
                }
            }
        }
    }
}

/// The trees are a meaningful test: connected across levels, with factors of three and more members, and with
/// truncation in effect somewhere.
#[test]
fn the_trees_cover_what_they_should() {
    let trees = trees(Potential::Exact, Agreement::Interpolating, Order::Together);
    let factors: Vec<&Factor> = trees.iter().flat_map(|(tree, _)| &tree.factors).collect();
    let count = |wanted: &dyn Fn(&Factor) -> bool| factors.iter().filter(|f| wanted(f)).count();
    for members in 2..=5 {
        assert!(
            count(&|f| matches!(f, Factor::Dependency(v) if v.len() == members)) > 2,
            "{members} members"
        );
        assert!(count(&|f| matches!(f, Factor::Resolution(v) if v.len() == members)) > 2 || members == 4);
    }
    // A dependency factor that connects two coarse pixels also connects their children.
    let coarse = trees.iter().any(|(tree, _)| {
        tree.factors.iter().any(|f| matches!(f, Factor::Dependency(v) if v[0] >= tree.starts[1]))
    });
    assert!(coarse);
}

/// Negative control: the default potential truncates after it normalises, which is a different model: a
/// factor still sends messages when its members disagree.
#[test]
fn control_the_normalised_cut_is_another_model() {
    let mut different = 0;
    for (tree, evidence) in trees(Potential::Soft, Agreement::Interpolating, Order::Together) {
        let marginals = tree.min_marginals(&evidence);
        for (_, mut backend) in backends() {
            let beliefs = tree.beliefs(backend.as_mut(), &evidence);
            different += usize::from(wrong_beliefs(&beliefs, &marginals).is_some());
        }
    }
    assert!(different > 5, "{different} trees differ");
}

/// Negative control: one unit of evidence more, one factor less, or the other kind of agreement is detected.
#[test]
fn control_a_changed_model_is_found() {
    let (mut checked, mut noticed) = ([0; 3], [0; 3]);
    for (mut tree, evidence) in trees(Potential::Exact, Agreement::Strict, Order::Together) {
        let (_, mut backend) = backends().swap_remove(0);
        let beliefs = tree.beliefs(backend.as_mut(), &evidence);
        let mut check = |i: usize, tree: &Model, evidence: &[Vec<u32>]| {
            checked[i] += 1;
            noticed[i] += usize::from(wrong_beliefs(&beliefs, &tree.min_marginals(evidence)).is_some());
        };
        let mut changed = evidence.clone();
        let best = changed[0][..tree.plan.levels[0].labels].iter().position(|&e| e == 0).unwrap();
        changed[0][best] += 1;
        check(0, &tree, &changed);
        if let Some(factor) = tree.factors.pop() {
            check(1, &tree, &evidence);
            tree.factors.push(factor);
        }
        tree.plan.method.messages.agreement = Agreement::Interpolating;
        check(2, &tree, &evidence);
    }
    // A constant per pixel does not count, a factor may have no effect, and a single level has no resolution
    // factor.
    for i in 0..3 {
        assert!(noticed[i] * 3 > checked[i], "change {i}: {} of {} noticed", noticed[i], checked[i]);
    }
}

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
