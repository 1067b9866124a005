//! Writes every step of a match as a picture or a small table.

use std::fmt::Write;
use std::path::PathBuf;

use mrfgs::Result;
use mrfgs::colour::{self, ColourMap};
use mrfgs::image::{Pair, Plane, write};
use mrfgs::low_level::backend::{Backend, Stage, Volume};
use mrfgs::low_level::engine::Inspection;
use mrfgs::low_level::front::Prepared;
use mrfgs::low_level::front::matches::SparseMatch;
use mrfgs::low_level::front::zones::Zones;
use mrfgs::low_level::graph::LevelGraph;
use mrfgs::low_level::plan::{Plan, UNITS_PER_NAT};
use mrfgs::options::Illumination;

use crate::outputs::StagedFolder;

/// Quarters of the label range at which costs are shown.
const SLICES: [usize; 3] = [1, 2, 3];

/// Collects files in a folder, which appears once it is complete.
pub(super) struct Steps {
    folder: StagedFolder,
    plan: Plan,
    changes: String,
    last: Option<Vec<usize>>,
}

impl Steps {
    pub(super) fn new(folder: StagedFolder, plan: Plan) -> Self {
        Self { folder, plan, changes: String::new(), last: None }
    }

    /// Writes the step that `inspection` shows.
    pub(super) fn look(&mut self, inspection: &mut Inspection) -> Result<()> {
        self.show(inspection).map_err(|e| self.folder.named(e))
    }

    fn show(&mut self, inspection: &mut Inspection) -> Result<()> {
        match inspection {
            Inspection::Prepared(prepared) => {
                // A match starts, perhaps again after the device failed.
                (self.changes, self.last) = ("iteration,rms_change_px\n".into(), None);
                self.prepared(prepared)
            }
            Inspection::Stage(backend, Stage::Graph(z)) => self.degree(*z, &backend.probe().graph(*z)?),
            Inspection::Stage(backend, Stage::Evidence(z)) => {
                if *z == 0 {
                    // Level 0 joins, in each look.
                    self.change(*backend, 0)?;
                }
                self.slices(*backend, *z)
            }
            Inspection::Stage(backend, Stage::WinnerTakesAll) => self.levels(*backend),
            Inspection::Stage(..) => Ok(()),
            Inspection::Iteration(backend, iteration) => self.change(*backend, *iteration),
        }
    }

    /// Moves the folder to its place.
    pub(super) fn finish(self) -> Result<()> {
        let saved = write::save(&self.path("change-per-iteration.csv"), self.changes.as_bytes());
        saved.map_err(|e| self.folder.named(e))?;
        self.folder.publish()
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a map in colours.
    fn map(&self, name: &str, map: &Plane<f32>, min: f32, max: f32) -> Result<()> {
        let picture = colour::preview(map, min, max, ColourMap::default());
        write::picture(&self.path(&format!("{name}.png")), &picture)
    }

    fn prepared(&self, prepared: &Prepared) -> Result<()> {
        let Prepared { pair, label_ranges, zones, .. } = prepared;
        if self.plan.method.front.illumination != Illumination::None {
            self.corrected(pair)?;
        }
        if let Some((zones, matches)) = zones {
            self.zones(pair, zones, matches)?;
        }
        if let Some(ranges) = label_ranges.first() {
            let widths = ranges.map(|&[first, last]| f32::from(last - first) + 1.0);
            self.map("label-range-width", &widths, 1.0, self.plan.levels[0].labels as f32)?;
        }
        Ok(())
    }

    fn corrected(&self, pair: &Pair) -> Result<()> {
        write::picture(&self.path("corrected-left.png"), &pair.left().to_rgb8())?;
        write::picture(&self.path("corrected-right.png"), &pair.right().to_rgb8())
    }

    fn zones(&self, pair: &Pair, zones: &Zones, matches: &[SparseMatch]) -> Result<()> {
        let (width, height) = pair.size();
        write::picture(&self.path("zones.png"), &zones.map.map(|&zone| colour::zone(zone)))?;
        // Both views side by side; matching points have the same colour.
        let (left, right) = (pair.left().to_rgb8(), pair.right().to_rgb8());
        let mut both = Plane::from_fn(2 * width, height, |x, y| {
            let [r, g, b] = if x < width { left[(x, y)] } else { right[(x - width, y)] };
            [r / 2 + 64, g / 2 + 64, b / 2 + 64]
        });
        let mut table = String::from("x,y,disparity_px,score\n");
        for m in matches {
            let disparity = f64::from(m.disparity) / 256.0;
            let _ = writeln!(table, "{},{},{disparity},{}", m.x, m.y, m.score);
            let seen = (m.x as f64 - disparity).round().clamp(0.0, width as f64 - 1.0) as usize;
            let shade = colour::zone(zones.map[(m.x, m.y)]);
            for at in [m.x, width + seen] {
                for (x, y) in (at.saturating_sub(1)..=at + 1).flat_map(|x| [(x, m.y), (x, m.y + 1)]) {
                    if x < 2 * width && y < height {
                        both[(x, y)] = shade;
                    }
                }
            }
        }
        write::picture(&self.path("matches.png"), &both)?;
        write::save(&self.path("matches.csv"), table.as_bytes())
    }

    /// Writes the number of dependency factors of each pixel.
    fn degree(&self, z: usize, graph: &LevelGraph) -> Result<()> {
        let degrees = Plane::from_fn(graph.width(), graph.height(), |x, y| {
            graph.incoming_of(y * graph.width() + x).len() as f32
        });
        self.map(&format!("graph-degree-level-{z}"), &degrees, 0.0, 4.0 * graph.slots() as f32)
    }

    /// Writes the costs of single labels.
    fn slices(&self, backend: &mut dyn Backend, z: usize) -> Result<()> {
        let level = &self.plan.levels[z];
        let cost = backend.probe().read(Volume::Cost(z))?;
        let unit = if z == 0 { 1.0 } else { 256.0 };
        for quarter in SLICES {
            let label = (level.labels - 1) * quarter / 4;
            let slice = Plane::from_fn(level.width, level.height, |x, y| {
                cost[(y * level.width + x) * level.labels + label] as f32 / unit
            });
            let name = format!("cost-level-{z}-disparity-{}", level.min + label as i32);
            self.map(&name, &slice, 0.0, f32::from(mrfgs::low_level::plan::COST_MAX))?;
        }
        Ok(())
    }

    /// Writes the map of every level, as a picture and in pixels of the level, and the entropy of the finest beliefs.
    fn levels(&self, backend: &mut dyn Backend) -> Result<()> {
        for (z, level) in self.plan.levels.iter().enumerate() {
            let belief = backend.probe().read(Volume::Belief(z))?;
            let optima: Vec<usize> = belief.chunks_exact(level.labels).map(optimum).collect();
            let map = Plane::from_fn(level.width, level.height, |x, y| {
                (level.min + optima[y * level.width + x] as i32) as f32
            });
            self.map(&format!("map-level-{z}"), &map, level.min as f32, level.max() as f32)?;
            map.save(self.path(&format!("map-level-{z}.pfm")))?;
            if z == 0 {
                let entropies: Vec<f32> = belief.chunks_exact(level.labels).map(entropy).collect();
                let picture = Plane::new(level.width, level.height, entropies);
                self.map("belief-entropy-nats", &picture, 0.0, (level.labels as f32).ln().max(1.0))?;
            }
        }
        Ok(())
    }

    fn change(&mut self, backend: &mut dyn Backend, iteration: u32) -> Result<()> {
        let belief = backend.probe().read(Volume::Belief(0))?;
        let map: Vec<usize> = belief.chunks_exact(self.plan.levels[0].labels).map(optimum).collect();
        if iteration > 0
            && let Some(last) = &self.last
        {
            let squares: f64 = map.iter().zip(last).map(|(&a, &b)| (a.abs_diff(b) as f64).powi(2)).sum();
            let rms = (squares / map.len() as f64).sqrt();
            let _ = writeln!(self.changes, "{iteration},{rms:.6}");
        }
        self.last = Some(map);
        Ok(())
    }
}

/// Index of the smallest belief, the lowest on ties.
fn optimum(belief: &[u32]) -> usize {
    (0..belief.len()).min_by_key(|&i| belief[i]).unwrap_or(0)
}

/// Entropy of the label distribution that a belief represents, in nats.
fn entropy(belief: &[u32]) -> f32 {
    let least = belief.iter().min().copied().unwrap_or(0);
    let weights: Vec<f64> = belief.iter().map(|&b| (-f64::from(b - least) / UNITS_PER_NAT).exp()).collect();
    let sum: f64 = weights.iter().sum();
    weights.iter().filter(|&&w| w > 0.0).map(|w| -(w / sum) * (w / sum).ln()).sum::<f64>() as f32
}
