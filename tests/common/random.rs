//! Seeded random input: images, pairs, methods, graphs, and states of the volumes that respect the
//! invariants.

use super::twin::{self, Finest, UNDEFINED};
use mrfgs::image::{Image, Pair, Plane};
use mrfgs::low_level::backend::{Backend, NO_LABEL, Volume};
use mrfgs::low_level::graph::LevelGraph;
use mrfgs::low_level::plan::Plan;
use mrfgs::maps::flag;
use mrfgs::options::{
    Agreement, DisparityRange, Fill, FrontOptions, LeftRightCheck, MatchingCost, Median, Method, Nearer,
    Order, Potential, Pyramid,
};
use std::ops::Range;

/// Random label windows for a level of `plan`: all labels, one common window, or varying windows.
pub fn windows(random: &mut Random, plan: &Plan, level: usize) -> Plane<[u16; 2]> {
    let l = &plan.levels[level];
    let all = l.stride as u16;
    let style = random.within(0, 3);
    let any = |random: &mut Random| {
        let count = 16 * random.within(1, u32::from(all) / 16);
        let most = (u32::from(all) - count).min(l.labels as u32 - 1) / 4;
        [4 * random.within(0, most) as u16, count as u16]
    };
    let common = any(random);
    Plane::from_fn(l.width.div_ceil(8), l.height.div_ceil(2), |_, _| match style {
        0 => [0, all],
        1 => common,
        2 if random.one_in(2) => common,
        _ => any(random),
    })
}

/// The splitmix64 generator (Steele, Lea and Flood 2014).
pub struct Random(u64);

impl Random {
    /// The generator that starts at `seed`.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number in `low ..= high`.
    pub fn within(&mut self, low: u32, high: u32) -> u32 {
        low + (self.bits() % (u64::from(high - low) + 1)) as u32
    }

    /// True with probability 1 / `n`.
    pub fn one_in(&mut self, n: u32) -> bool {
        self.within(1, n) == 1
    }

    /// One of `choices`.
    pub fn pick<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.within(0, choices.len() as u32 - 1) as usize]
    }

    /// `low` times a random power, up to `high`.
    pub fn log_within(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(f64::from(self.within(0, 1000)) / 1000.0)
    }

    /// `choices` in random order.
    pub fn shuffled<T: Clone>(&mut self, choices: &[T]) -> Vec<T> {
        let mut out = choices.to_vec();
        for i in (1..out.len()).rev() {
            out.swap(i, self.within(0, i as u32) as usize);
        }
        out
    }
}

fn pixel(r: u16, g: u16, b: u16) -> [u16; 4] {
    [r, g, b, ((u32::from(r) + u32::from(g) + u32::from(b)) / 3) as u16]
}

/// An image of strong noise, faint noise, few values or one value, with some, none or all of it masked.
pub fn image(random: &mut Random, width: usize, height: usize) -> Image {
    let style = random.within(0, 3);
    let base = random.within(0, 60_000);
    let pixels = Plane::from_fn(width, height, |_, _| {
        let mut value = || match style {
            0 => random.within(0, 65_535) as u16,
            1 => (base + random.within(0, 5_000)) as u16,
            2 => (base / 4 * random.within(0, 4)) as u16,
            _ => base as u16,
        };
        pixel(value(), value(), value())
    });
    let masked = mask(random, width, height);
    Image { pixels, masked }
}

fn mask(random: &mut Random, width: usize, height: usize) -> Plane<bool> {
    let density = random.pick(&[0, 0, 0, 20, 5, 2, 1]);
    let block = random.pick(&[1, 3]);
    let seeds = Plane::from_fn(width.div_ceil(block), height.div_ceil(block), |_, _| {
        density > 0 && random.one_in(density)
    });
    Plane::from_fn(width, height, |x, y| seeds[(x / block, y / block)])
}

/// A pair of unrelated images, or one whose right image is the left one shifted and disturbed.
pub fn pair(random: &mut Random, width: usize, height: usize) -> Pair {
    let left = image(random, width, height);
    let mut right = image(random, width, height);
    if !random.one_in(3) {
        let step = random.within(0, 9) as usize;
        let noise = random.pick(&[0, 300, 8000]);
        right.pixels = Plane::from_fn(width, height, |x, y| {
            let source = left.pixels[((x + step).min(width - 1), y)];
            let [r, g, b, _] = source.map(|v| v.saturating_add(random.within(0, noise) as u16));
            pixel(r, g, b)
        });
    }
    Pair::new(left, right).unwrap()
}

/// Front-end options without corrections, so that stages get unchanged images.
pub fn as_it_is() -> FrontOptions {
    let mut front = FrontOptions::default();
    (front.level_rows, front.equal_sharpness, front.denoise) = (false, false, false);
    front
}

/// A method with random values for all parameters that the stages read, and `neighbours` neighbours per
/// factor.
pub fn method(random: &mut Random, neighbours: usize) -> Method {
    let mut m = Method::default();
    m.front = as_it_is();
    m.cost.matching = random.pick(&[MatchingCost::ALL, &[MatchingCost::AdCensus]].concat());
    m.cost.colour_contrast = random.pick(&[0.0, 0.3, 5.0, 40.0, 128.0]);
    m.cost.sad_window = random.pick(&[1, 3, 5, 7, 9]);
    m.cost.sad_steps = random.pick(&[1, 1, 3, 16]);
    let most = m.cost.most();
    m.cost.outside_cost = f64::from(random.within(0, (1000.0 * most) as u32)) / 1000.0;
    m.messages.temperature = random.log_within(0.001 * most, 6.0 * most);
    m.messages.evidence_cap = random.pick(&[0.25, 3.0, 8.0, 63.75]);
    m.messages.evidence_gain = random.pick(&[1.0, 1.7, 3.0, 4.0]);
    m.cost.pyramid = random.pick(&[Pyramid::LowPass, Pyramid::Minimum]);
    m.graph.levels = random.within(1, 5);
    m.graph.percentile = 100.0 - neighbours as f64 * 100.0 / 48.0;
    m.graph.sigma_space = random.log_within(0.5, 30.0);
    m.graph.sigma_range = random.log_within(0.01, 3.0);
    m.messages.potential = random.pick(&[Potential::Soft, Potential::Exact, Potential::Hard]);
    m.messages.dependency_truncation = random.pick(&[0.25, 2.0, 10.0, 63.75, 64.0, 255.75]);
    m.messages.label_step = random.pick(&[0.25, 0.75, 1.75, 9.0]);
    m.messages.agreement = random.pick(&[Agreement::Strict, Agreement::Interpolating]);
    m.messages.resolution_truncation = random.pick(&[0.25, 8.0, 63.75, 255.75]);
    m.schedule.order = random.pick(&[Order::Together, Order::CoarseFirst]);
    m.schedule.iterations = random.within(1, 3);
    m.schedule.final_iterations = random.within(0, 3);
    m.refinement.left_right_check = random.pick(&[
        LeftRightCheck::Off,
        LeftRightCheck::RightView,
        LeftRightCheck::RightView,
        LeftRightCheck::SecondMatch,
    ]);
    m.refinement.speckle_size = random.pick(&[0, 3, 20]);
    m.refinement.sub_pixel = random.pick(&[false, true]);
    m.refinement.fill = random.pick(&[Fill::None, Fill::Row, Fill::Votes, Fill::Votes]);
    m.refinement.nearer = random.pick(&[Nearer::Larger, Nearer::Smaller]);
    m.refinement.median = random.pick(&[Median::Off, Median::Filled, Median::All]);
    m.refinement.median_window = random.pick(&[3, 5, 15]);
    m.refinement.median_sigma_space = random.log_within(0.3, 30.0);
    m.refinement.median_sigma_range = random.log_within(0.01, 3.0);
    m.refinement.plane = random.pick(&[false, true]);
    m.refinement.confidence_floor = random.pick(&[0, 16, 255]);
    m.refinement.right_map = random.one_in(3);
    m
}

/// The plan of `method` for `labels` labels from `min` on.
pub fn plan((width, height): (usize, usize), min: i32, labels: usize, method: &Method) -> Plan {
    let range = DisparityRange::new(min, min + labels as i32 - 1).unwrap();
    Plan::new(width, height, range, method).unwrap()
}

/// Random graphs for every level of `plan`: each factor has random neighbours in random slots.
pub fn graphs(random: &mut Random, plan: &Plan) -> Vec<LevelGraph> {
    let window: Vec<u8> = (0..49).filter(|&code| code != 24).collect();
    plan.levels
        .iter()
        .map(|level| {
            let mut codes = Vec::new();
            for y in 0..level.height {
                for x in 0..level.width {
                    let present = random.pick(&[1, 1, 2, 5]);
                    let order = random.shuffled(&window);
                    codes.extend(order.into_iter().take(plan.neighbours).map(|code| {
                        let nx = x as i32 + i32::from(code) % 7 - 3;
                        let ny = y as i32 + i32::from(code) / 7 - 3;
                        let inside =
                            nx >= 0 && ny >= 0 && nx < level.width as i32 && ny < level.height as i32;
                        if inside && random.one_in(present) { code } else { 255 }
                    }));
                }
            }
            LevelGraph::new(level.width, level.height, plan.neighbours, codes)
        })
        .collect()
}

/// All volumes of message passing, one vector per level; empty where a level has none.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct State {
    /// Evidence.
    pub evidence: Vec<Vec<u32>>,
    /// Dependency messages.
    pub dependency: Vec<Vec<u32>>,
    /// Messages from the next coarser level.
    pub down: Vec<Vec<u32>>,
    /// Messages from the next finer level.
    pub up: Vec<Vec<u32>>,
    /// Beliefs.
    pub belief: Vec<Vec<u32>>,
    /// The labels that every pixel has.
    pub has: Vec<Vec<Range<usize>>>,
}

impl State {
    /// This evidence, messages 0, beliefs equal to the evidence, and all labels for every pixel.
    pub fn fresh(plan: &Plan, evidence: Vec<Vec<u32>>) -> Self {
        let last = plan.levels.len() - 1;
        let cells = |z: usize| plan.levels[z].pixels() * plan.levels[z].labels;
        Self {
            dependency: (0..=last).map(|z| vec![0; cells(z) * plan.slots()]).collect(),
            down: (0..=last).map(|z| vec![0; if z == last { 0 } else { cells(z) }]).collect(),
            up: (0..=last).map(|z| vec![0; if z == 0 { 0 } else { cells(z) }]).collect(),
            belief: evidence.clone(),
            has: (0..=last).map(|z| twin::label_window::all(plan, z)).collect(),
            evidence,
        }
    }

    /// All volumes, with their values.
    pub fn volumes(&self) -> Vec<(Volume, &[u32])> {
        let mut all: Vec<(Volume, &[u32])> = Vec::new();
        for z in 0..self.evidence.len() {
            all.push((Volume::Evidence(z), &self.evidence[z]));
            all.push((Volume::Dependency(z), &self.dependency[z]));
            if !self.down[z].is_empty() {
                all.push((Volume::Down(z), &self.down[z]));
            }
            if !self.up[z].is_empty() {
                all.push((Volume::Up(z), &self.up[z]));
            }
            all.push((Volume::Belief(z), &self.belief[z]));
        }
        all
    }

    /// Writes all volumes to `backend`, with an arbitrary value for undefined cells.
    pub fn write(&self, backend: &mut dyn Backend) {
        for (volume, values) in self.volumes() {
            let values: Vec<u32> = values.iter().map(|&v| if v == UNDEFINED { 77 } else { v }).collect();
            backend.probe().write(volume, &values).unwrap();
        }
    }

    /// The same state with the labels of pixels limited to `has`.
    pub fn within(mut self, plan: &Plan, graphs: &[LevelGraph], has: Vec<Vec<Range<usize>>>) -> Self {
        for z in 0..has.len() {
            let labels = plan.levels[z].labels;
            let of_level = [&mut self.evidence[z], &mut self.down[z], &mut self.up[z]];
            for volume in of_level.into_iter().chain([&mut self.belief[z]]) {
                for (i, value) in volume.iter_mut().enumerate() {
                    if !has[z][i / labels].contains(&(i % labels)) {
                        *value = UNDEFINED;
                    }
                }
            }
            let slots = plan.slots();
            for (i, row) in self.dependency[z].chunks_mut(labels).enumerate() {
                let factor = i / slots;
                if twin::members(&graphs[z], factor).iter().flatten().count() > 1 {
                    for d in (0..labels).filter(|d| !has[z][factor].contains(d)) {
                        row[d] = plan.dependency.tau.into();
                    }
                }
            }
            twin::dependency::undefine(plan, z, &graphs[z], &has[z], &mut self.dependency[z]);
            self.belief[z] = twin::evidence::beliefs(plan, &self.belief[z]);
        }
        self.has = has;
        self
    }

    /// Updates the beliefs of every level by the twin.
    pub fn believe(&mut self, plan: &Plan, graphs: &[LevelGraph]) {
        for z in 0..plan.levels.len() {
            self.believe_at(plan, graphs, z);
        }
    }

    /// Updates the beliefs of one level by the twin.
    pub fn believe_at(&mut self, plan: &Plan, graphs: &[LevelGraph], z: usize) {
        self.belief[z] = twin::belief::belief(
            plan,
            z,
            &graphs[z],
            &self.has[z],
            &self.evidence[z],
            &self.dependency[z],
            [&self.down[z], &self.up[z]],
        );
    }
}

/// A message: minimum 0, at most `tau`.
fn message(random: &mut Random, labels: usize, tau: u32) -> Vec<u32> {
    let style = random.within(0, 3);
    let most = random.within(0, tau);
    let mut out: Vec<u32> = (0..labels)
        .map(|_| match style {
            0 => 0,
            1 => tau * random.within(0, 1),
            2 => random.within(0, tau),
            _ => random.within(0, most),
        })
        .collect();
    out[random.within(0, labels as u32 - 1) as usize] = 0;
    out
}

/// Random evidence for every level.
pub fn evidence(random: &mut Random, plan: &Plan) -> Vec<Vec<u32>> {
    plan.levels
        .iter()
        .map(|level| {
            (0..level.pixels())
                .flat_map(|_| message(random, level.labels, level.evidence.cap.into()))
                .collect()
        })
        .collect()
}

/// A state during message passing. Messages have minimum 0 and are at most their truncation, and are 0 for
/// slots without a member and factors with a single one. Beliefs are the sums of their terms or, if `loose`,
/// any values up to the largest belief that are not below any message in them.
pub fn state(random: &mut Random, plan: &Plan, graphs: &[LevelGraph], loose: bool) -> State {
    let has = (0..plan.levels.len()).map(|z| twin::label_window::all(plan, z)).collect();
    state_within(random, plan, graphs, has, loose)
}

/// Like [`state`], with the labels of pixels limited to `has`.
pub fn state_within(
    random: &mut Random,
    plan: &Plan,
    graphs: &[LevelGraph],
    has: Vec<Vec<Range<usize>>>,
    loose: bool,
) -> State {
    let mut state = State::fresh(plan, evidence(random, plan));
    for (z, level) in plan.levels.iter().enumerate() {
        let labels = level.labels;
        let tau = u32::from(plan.dependency.tau);
        for factor in 0..level.pixels() {
            let members = twin::members(&graphs[z], factor);
            if members.iter().flatten().count() < 2 {
                continue;
            }
            for (slot, _) in members.iter().enumerate().filter(|(_, m)| m.is_some()) {
                let at = (factor * plan.slots() + slot) * labels;
                state.dependency[z][at..at + labels].copy_from_slice(&message(random, labels, tau));
            }
        }
        let tau = u32::from(plan.resolution.tau);
        for volume in [&mut state.down[z], &mut state.up[z]] {
            for row in volume.chunks_mut(labels) {
                row.copy_from_slice(&message(random, labels, tau));
            }
        }
    }
    state = state.within(plan, graphs, has);
    state.believe(plan, graphs);
    if loose {
        let bound = twin::belief::belief_most(plan);
        for z in 0..plan.levels.len() {
            let labels = plan.levels[z].labels;
            let mut least = vec![0; state.belief[z].len()];
            for volume in [&state.down[z], &state.up[z]] {
                for (least, &m) in least.iter_mut().zip(volume) {
                    *least = if m == UNDEFINED { *least } else { m.max(*least) };
                }
            }
            for factor in 0..plan.levels[z].pixels() {
                for (slot, member) in twin::members(&graphs[z], factor).into_iter().enumerate() {
                    if let Some(pixel) = member {
                        let at = (factor * plan.slots() + slot) * labels;
                        for d in state.has[z][pixel].clone() {
                            let least = &mut least[pixel * labels + d];
                            *least = state.dependency[z][at + d].max(*least);
                        }
                    }
                }
            }
            for row in 0..plan.levels[z].pixels() {
                let style = random.within(0, 3);
                let has = state.has[z][row].clone();
                for i in row * labels + has.start..row * labels + has.end {
                    state.belief[z][i] = match style {
                        0 => random.within(least[i], bound),
                        1 => least[i] + random.within(0, (bound - least[i]).min(9)),
                        2 => random.within(least[i].max(bound.saturating_sub(9)), bound),
                        _ => least[i],
                    };
                }
            }
        }
    }
    state
}

/// Plausible maps after the estimate; if `filled`, with a plausible validity after the fill.
pub fn finest(random: &mut Random, plan: &Plan, filled: bool) -> Finest {
    let (width, height) = plan.size();
    let labels = plan.levels[0].labels as u32;
    let mut maps = Finest::zero((width, height));
    let spread = random.pick(&[1, 20, 5000]);
    let patch = random.pick(&[1, 2, 7]);
    let patches = Plane::from_fn(width.div_ceil(patch), height.div_ceil(patch), |_, _| {
        let few = random.within(0, 3).min(labels - 1);
        let any = random.within(0, labels - 1);
        random.pick(&[few, few, any])
    });
    for y in 0..height {
        for x in 0..width {
            let at = (x, y);
            maps.label[at] = patches[(x / patch, y / patch)] as i32;
            maps.best[at] = random.within(0, 50_000) as i32;
            maps.runner_up[at] = match (labels, maps.label[at]) {
                (1 | 2, _) | (3, 1) => 65_535,
                _ => maps.best[at] + random.within(0, spread) as i32,
            };
            maps.right_label[at] =
                if random.one_in(5) { NO_LABEL.into() } else { random.within(0, labels - 1) as i32 };
            maps.right_best[at] = random.within(0, 65_535) as i32;
            maps.confidence[at] = random.within(0, 255) as i32;
        }
    }
    maps.raw = disparity(random, width, height);
    maps.disparity = disparity(random, width, height);
    maps.validity = flags(random, width, height, filled);
    maps
}

/// Plausible flags before the fill or, if `filled`, after it.
fn flags(random: &mut Random, width: usize, height: usize, filled: bool) -> Plane<i32> {
    let density = random.pick(&[1, 2, 3, 10, 1000]);
    Plane::from_fn(width, height, |x, y| {
        let validity = if !random.one_in(density) {
            if filled {
                // FILLED alone marks what a prior decided.
                random.pick(&[0, 0, flag::LOW_CONFIDENCE, flag::FILLED])
            } else {
                random.pick(&[0, 0, flag::LOW_CONFIDENCE])
            }
        } else if random.one_in(6) {
            flag::MASKED
        } else {
            let reason = random.pick(&[flag::OUTSIDE, flag::OCCLUDED, flag::SPECKLE]);
            let filled = filled && !random.one_in(4);
            let reason = match (reason, (x + y) % 3) {
                (flag::SPECKLE, 1) => flag::TIE,
                // The vote fill also fills the pixels that it outvotes.
                (flag::SPECKLE, 2) if filled => flag::OUTVOTED,
                _ => reason,
            };
            if filled { reason | flag::FILLED } else { reason }
        };
        validity.into()
    })
}

/// A disparity map in 1/256 px with patches, steps of about a pixel, and noise.
fn disparity(random: &mut Random, width: usize, height: usize) -> Plane<i32> {
    let patch = random.pick(&[1, 2, 5]);
    let step = random.pick(&[1, 128, 255, 256, 257, 3000]);
    let patches =
        Plane::from_fn(width.div_ceil(patch), height.div_ceil(patch), |_, _| random.within(0, 3) as i32);
    Plane::from_fn(width, height, |x, y| {
        step * patches[(x / patch, y / patch)] - 2000 + random.pick(&[0, 0, 0, 1, -1, 256])
    })
}

/// Noise in every pixel.
pub fn texture(random: &mut Random, width: usize, height: usize) -> Image {
    Image::from_rgb8(&Plane::from_fn(width, height, |_, _| [0; 3].map(|_: i32| random.within(0, 255) as u8)))
}
