//! Pairs that do not fit in the memory of their method, not even in tiles: their blocks are matched one by one.

use super::{Matched, Matcher, Request, fits};
use crate::error::Result;
use crate::image::Pair;
use crate::maps::Maps;
use crate::plan::Plan;
use crate::prior::PriorUse;
use crate::region::Blocks;
use crate::watch::{Observer, Progress};
use std::sync::Arc;

impl Matcher {
    /// Matches each block of `pair`, with the same corrections in all.
    pub(super) async fn solve_in_blocks(
        &mut self,
        pair: &Pair,
        request: Request<'_>,
        observer: Observer<'_>,
    ) -> Result<Matched> {
        let Request { range, method, prior, .. } = request;
        if let Some(prior) = prior {
            fits(prior, pair)?;
        }
        let blocks = Blocks::new(pair.size(), range, method)?;
        let known = if let Some(known) = request.known {
            known
        } else {
            let measured = async || blocks.conditioning(|part| Ok(pair.crop(part)));
            self.threads.run(pair.size().0 * pair.size().1, measured).await??
        };
        let count = blocks.list().len();
        let mut all: Option<Matched> = None;
        for (done, block) in blocks.list().iter().enumerate() {
            let observer = &mut |progress: Progress| {
                let done = (done as f64 + progress.done) / count as f64;
                observer(Progress { done, ..progress })
            };
            let prior = prior.map(|prior| Arc::new(prior.crop(block.window())));
            let request = Request { known: Some(known), prior: prior.as_ref(), ..request };
            let matched = self.solve_at_once(&block.window_of(pair), request, observer, None).await?;
            let maps = block.maps_of(&matched.maps);
            let whole = if let Some(whole) = &mut all {
                whole.add(matched);
                whole
            } else {
                let (width, height) = pair.size();
                let plan = Plan::new(width, height, range, method)?.with_prior(prior.is_some());
                let maps = Maps::blank(pair.size(), maps.right.is_some());
                all.insert(Matched { maps, plan, blocks: count, ..matched })
            };
            whole.maps.paste(&maps, block.part());
        }
        Ok(all.expect("a pair has a block"))
    }
}

impl Matched {
    /// Counts the match of another block.
    fn add(&mut self, other: Self) {
        self.iterations = self.iterations.max(other.iterations);
        self.traffic += other.traffic;
        self.cells.resize(self.cells.len().max(other.cells.len()), 0);
        self.cells.iter_mut().zip(&other.cells).for_each(|(all, of_block)| *all += of_block);
        if self.tiles.count() < other.tiles.count() {
            self.tiles = other.tiles;
        }
        for timing in other.timings {
            match self.timings.iter_mut().find(|t| (t.stage, t.level) == (timing.stage, timing.level)) {
                Some(sum) => (sum.runs, sum.time) = (sum.runs + timing.runs, sum.time + timing.time),
                None => self.timings.push(timing),
            }
        }
        self.prior = PriorUse::sum(self.prior, other.prior);
        // The device may have failed meanwhile.
        if other.note.is_some() {
            (self.note, self.ran_on, self.driver) = (other.note, other.ran_on, other.driver);
        }
    }
}
