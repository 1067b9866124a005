//! The preset `paper` on whole pairs, beside sum-product messages in floating point.
//!
//! Its resolution factors let an odd label agree with both of its coarse neighbours, so a sum of equation (4) has
//! several terms there, and the stages take the largest one instead. The reference computes both: with the largest
//! term it must give the labels of the stages, and with the sum it shows how far these are from sum-product.

use crate::common;
use crate::common::twin;
use mrfgs::image::{Pair, Plane, calib::Calibration, read};
use mrfgs::low_level::backend::cpu::Cpu;
use mrfgs::low_level::backend::{Backend, Volume};
use mrfgs::low_level::engine::Inspection;
use mrfgs::low_level::graph::LevelGraph;
use mrfgs::low_level::plan::{HARD_CAP, Plan, UNITS_PER_NAT};
use mrfgs::options::{DisparityRange, Method};
use std::io::Write;
use std::ops::ControlFlow;
use std::path::Path;

/// How a message combines the labels of another variable that agree with one label.
#[derive(Clone, Copy, PartialEq)]
enum Terms {
    /// Sum-product, as the paper has it.
    All,
    /// Max-product, as the stages have it.
    Largest,
}

/// The largest cost in a message, in nats: that of the stages.
const CAP: f64 = HARD_CAP as f64 / UNITS_PER_NAT;

/// Loopy belief propagation as costs in nats. Infinite evidence marks labels that a pixel does not have.
struct Reference {
    plan: Plan,
    terms: Terms,
    graphs: Vec<LevelGraph>,
    evidence: Vec<Vec<f64>>,
    dependency: Vec<Vec<f64>>,
    down: Vec<Vec<f64>>,
    up: Vec<Vec<f64>>,
}

impl Reference {
    /// Starts from the evidence and the graphs that a backend has before the first iteration, with no messages.
    fn new(plan: &Plan, terms: Terms, graphs: Vec<LevelGraph>, evidence: Vec<Vec<f64>>) -> Self {
        let zero: Vec<Vec<f64>> = evidence.iter().map(|level| vec![0.0; level.len()]).collect();
        let dependency = evidence.iter().map(|level| vec![0.0; level.len() * plan.slots()]).collect();
        Self { plan: plan.clone(), terms, graphs, evidence, dependency, down: zero.clone(), up: zero }
    }

    /// The cost of several labels of which any may hold.
    fn any(&self, costs: &[f64]) -> f64 {
        let least = costs.iter().copied().fold(f64::INFINITY, f64::min);
        if self.terms == Terms::Largest || least == f64::INFINITY {
            return least;
        }
        least - costs.iter().map(|cost| (least - cost).exp()).sum::<f64>().ln()
    }

    fn beliefs(&self, z: usize) -> Vec<f64> {
        let labels = self.plan.levels[z].labels;
        let mut belief = self.evidence[z].clone();
        for (i, b) in belief.iter_mut().enumerate() {
            *b += self.down[z][i] + self.up[z][i];
        }
        for factor in 0..self.plan.levels[z].pixels() {
            for (slot, pixel) in twin::members(&self.graphs[z], factor).into_iter().enumerate() {
                let Some(pixel) = pixel else { continue };
                let at = (factor * self.plan.slots() + slot) * labels;
                for d in 0..labels {
                    belief[pixel * labels + d] += self.dependency[z][at + d];
                }
            }
        }
        belief
    }

    /// The labels of the finest level: those with the smallest cost, the first on ties.
    fn labels(&self) -> Vec<usize> {
        let belief = self.beliefs(0);
        let best = |row: &[f64]| (0..row.len()).min_by(|&a, &b| row[a].total_cmp(&row[b])).unwrap();
        belief.chunks(self.plan.levels[0].labels).map(best).collect()
    }

    /// One iteration: all messages from all old ones.
    fn step(&mut self) {
        let beliefs: Vec<Vec<f64>> = (0..self.plan.levels.len()).map(|z| self.beliefs(z)).collect();
        for (z, belief) in beliefs.iter().enumerate() {
            self.dependency[z] = self.dependency_messages(z, belief);
        }
        for z in 1..beliefs.len() {
            (self.down[z - 1], self.up[z]) = self.resolution_messages(z, &beliefs[z - 1], &beliefs[z]);
        }
    }

    /// The messages of the dependency factors: one label of the receiver leaves the others a single choice.
    fn dependency_messages(&self, z: usize, belief: &[f64]) -> Vec<f64> {
        let (labels, slots) = (self.plan.levels[z].labels, self.plan.slots());
        let mut out = self.dependency[z].clone();
        for factor in 0..self.plan.levels[z].pixels() {
            let members = twin::members(&self.graphs[z], factor);
            if members.iter().flatten().count() < 2 {
                continue;
            }
            let at = |slot: usize| (factor * slots + slot) * labels;
            for to in 0..slots {
                let Some(pixel) = members[to] else { continue };
                let cost = |d: usize| -> f64 {
                    let others = members.iter().enumerate().filter(|(from, _)| *from != to);
                    others
                        .filter_map(|(from, member)| {
                            Some(belief[(*member)? * labels + d] - self.dependency[z][at(from) + d])
                        })
                        .sum()
                };
                let costs: Vec<f64> = (0..labels).map(cost).collect();
                let has = &self.evidence[z][pixel * labels..][..labels];
                out[at(to)..at(to) + labels].copy_from_slice(&message(&costs, has));
            }
        }
        out
    }

    /// The messages (down, up) of the resolution factors between level `z` and the next finer one.
    fn resolution_messages(&self, z: usize, fine: &[f64], coarse: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (f, c) = (&self.plan.levels[z - 1], &self.plan.levels[z]);
        let offset = self.plan.label_offset(z);
        // The fine labels that agree with a coarse one, and the coarse labels that agree with a fine one.
        let finer = |k: usize| {
            let centre = 2 * k as i32 + offset;
            (centre - 1..=centre + 1).filter(|d| (0..f.labels as i32).contains(d)).map(|d| d as usize)
        };
        let coarser =
            |d: usize| (0..c.labels).filter(move |&k| (d as i32 - 2 * k as i32 - offset).abs() <= 1);
        let coarser: Vec<Vec<usize>> = (0..f.labels).map(|d| coarser(d).collect()).collect();
        let (mut down, mut up) = (self.down[z - 1].clone(), self.up[z].clone());
        for y in 0..c.height {
            for x in 0..c.width {
                let parent = (y * c.width + x) * c.labels;
                let own: Vec<f64> =
                    (0..c.labels).map(|k| coarse[parent + k] - self.up[z][parent + k]).collect();
                let children: Vec<usize> = [(0, 0), (1, 0), (0, 1), (1, 1)]
                    .into_iter()
                    .map(|(i, j)| (2 * x + i, 2 * y + j))
                    .filter(|&(x, y)| x < f.width && y < f.height)
                    .map(|(x, y)| (y * f.width + x) * f.labels)
                    .collect();
                let of_child = |child: usize, k: usize| {
                    let costs: Vec<f64> =
                        finer(k).map(|d| fine[child + d] - self.down[z - 1][child + d]).collect();
                    self.any(&costs)
                };
                let costs: Vec<Vec<f64>> = children
                    .iter()
                    .map(|&child| (0..c.labels).map(|k| of_child(child, k)).collect())
                    .collect();
                let sum: Vec<f64> = (0..c.labels).map(|k| costs.iter().map(|cost| cost[k]).sum()).collect();
                let has = &self.evidence[z][parent..parent + c.labels];
                up[parent..parent + c.labels].copy_from_slice(&message(&sum, has));
                for (i, &child) in children.iter().enumerate() {
                    let with_others = |k: usize| {
                        let others = costs.iter().enumerate().filter(|(j, _)| *j != i);
                        own[k] + others.map(|(_, cost)| cost[k]).sum::<f64>()
                    };
                    let by_coarse: Vec<f64> = (0..c.labels).map(with_others).collect();
                    let to_child: Vec<f64> = coarser
                        .iter()
                        .map(|agreeing| self.any(&agreeing.iter().map(|&k| by_coarse[k]).collect::<Vec<_>>()))
                        .collect();
                    let has = &self.evidence[z - 1][child..child + f.labels];
                    down[child..child + f.labels].copy_from_slice(&message(&to_child, has));
                }
            }
        }
        (down, up)
    }
}

/// The message with these costs to a pixel with this evidence: its least is 0, and its most is [`CAP`].
fn message(costs: &[f64], has: &[f64]) -> Vec<f64> {
    let least = costs.iter().zip(has).filter(|(_, e)| e.is_finite()).map(|(cost, _)| *cost);
    let least = least.fold(f64::INFINITY, f64::min);
    if least == f64::INFINITY {
        return vec![0.0; costs.len()];
    }
    costs.iter().map(|cost| cost.min(least + CAP) - least).collect()
}

/// What a comparison found.
struct Compared {
    iterations: u32,
    /// Pixels of the finest level.
    pixels: usize,
    /// Pixels whose label differs from that of the stages, with the largest term and with all terms.
    differing: [usize; 2],
    /// Average error of the raw map in pixels, and share of pixels wrong by more than 2 px in percent: of the stages
    /// and of sum-product.
    errors: [(f64, f64); 2],
}

/// Matches the pair in `folder` by the preset `paper`, and follows it with both references.
fn compared(folder: &Path) -> Compared {
    let (left, right) = (folder.join("im0.png"), folder.join("im1.png"));
    let ndisp = Calibration::beside(&left).unwrap().unwrap().ndisp.unwrap();
    let range = DisparityRange::new(0, ndisp as i32 - 1).unwrap();
    let pair = Pair::open(&left, &right).unwrap();
    let (width, height) = pair.size();
    let plan = Plan::new(width, height, range, &Method::paper()).unwrap();
    let labels = plan.levels[0].labels;

    let mut references: Vec<Reference> = Vec::new();
    let (mut found, mut iterations) = (Vec::new(), 0);
    let mut look = |inspection: &mut Inspection| {
        let Inspection::Iteration(backend, iteration) = inspection else { return Ok(()) };
        if references.is_empty() {
            let (graphs, evidence): (Vec<_>, Vec<_>) =
                (0..plan.levels.len()).map(|z| start(*backend, &plan, z)).unzip();
            references = [Terms::Largest, Terms::All]
                .map(|terms| Reference::new(&plan, terms, graphs.clone(), evidence.clone()))
                .into();
        }
        references.iter_mut().for_each(Reference::step);
        iterations = *iteration;
        found = backend.probe().read(Volume::Belief(0))?;
        Ok(())
    };
    common::inspect(&mut Cpu::default(), &plan, &pair, &mut |_| ControlFlow::Continue(()), Some(&mut look))
        .unwrap();

    let least = |row: &[u32]| (0..row.len()).min_by_key(|&d| row[d]).unwrap();
    let ours: Vec<usize> = found.chunks(labels).map(least).collect();
    let [largest, all] = [0, 1].map(|i| references[i].labels());
    let differing = [&largest, &all].map(|other| ours.iter().zip(other).filter(|(a, b)| a != b).count());
    let truth = read::read_disparity(&folder.join("disp0GT.pfm")).unwrap();
    let errors = [&ours, &all].map(|map| error(map, &plan, &truth));
    Compared { iterations, pixels: width * height, differing, errors }
}

/// The graph of a level, and its evidence in nats, infinite for labels that a pixel does not have.
fn start(backend: &mut dyn Backend, plan: &Plan, z: usize) -> (LevelGraph, Vec<f64>) {
    let level = &plan.levels[z];
    let windows = backend.probe().windows(z).unwrap();
    let evidence = backend.probe().read(Volume::Evidence(z)).unwrap();
    let nats = |(i, e): (usize, u32)| {
        let (pixel, label) = (i / level.labels, i % level.labels);
        let [first, count] = windows[(pixel % level.width / 8, pixel / level.width / 2)].map(usize::from);
        if (first..first + count).contains(&label) { f64::from(e) / UNITS_PER_NAT } else { f64::INFINITY }
    };
    (backend.probe().graph(z).unwrap(), evidence.into_iter().enumerate().map(nats).collect())
}

/// Average error in pixels, and share of pixels wrong by more than 2 px in percent.
fn error(labels: &[usize], plan: &Plan, truth: &Plane<f32>) -> (f64, f64) {
    let disparities = labels.iter().map(|&label| (plan.levels[0].min + label as i32) as f32);
    let known = disparities.zip(truth.data()).filter(|(_, truth)| truth.is_finite());
    let errors: Vec<f64> = known.map(|(d, truth)| f64::from((d - truth).abs())).collect();
    let count = errors.len() as f64;
    let bad = errors.iter().filter(|&&error| error > 2.0).count() as f64;
    (errors.iter().sum::<f64>() / count, 100.0 * bad / count)
}

/// Max-product in floating point gives the labels of the stages, and sum-product gives others in few pixels.
#[test]
fn the_paper_takes_the_largest_terms_of_the_sums() {
    let mut folders = vec![Path::new("testdata/slanted").to_owned(), Path::new("testdata/thin").to_owned()];
    match std::env::var_os("MRFGS_MIDDLEBURY") {
        Some(pairs) => folders.push(Path::new(&pairs).join("Teddy")),
        None => {
            let _ = writeln!(std::io::stderr(), "SKIPPED on a real pair: MRFGS_MIDDLEBURY names no folder");
        }
    }
    for folder in folders {
        let Compared { iterations, pixels, differing: [largest, all], errors: [ours, sums] } =
            compared(&folder);
        println!(
            "{}: after {iterations} iterations {all} of {pixels} labels are others by sum-product; raw error {:.3} \
             px, bad2.0 {:.2} %, and {:.3} px, {:.2} % by sum-product",
            folder.display(),
            ours.0,
            ours.1,
            sums.0,
            sums.1
        );
        assert_eq!(largest, 0, "{}: the largest terms", folder.display());
        // Control: sums are something else.
        assert!(all > 0, "{}: sums and largest terms give the same map", folder.display());
        assert!(all * 10 < pixels, "{}: {all} of {pixels} labels differ", folder.display());
    }
}
