//! Graphs without cycles: beliefs are min-marginals.

use crate::common::devices::backends;
use crate::common::random::{self, Random};
use crate::{FORBIDDEN, Factor, LABELLINGS, Model, NEIGHBOURS, evidence, method, resolution_factors};
use mrfgs::low_level::graph::LevelGraph;
use mrfgs::low_level::plan::{HARD_CAP, Plan};
use mrfgs::options::{Agreement, Order, Potential};

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
