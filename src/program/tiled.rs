//! A match tile by tile: everything that looks at volumes for one tile after the other, then the stages of maps on the maps of the
//! whole image.

use super::tiles::Tiles;
use super::{Frame, Program, Step, View, right_view};
use crate::stage::Stage;

/// The match of `program`, which is in one piece, in `tiles`.
#[must_use]
pub fn cut(program: &Program, tiles: &Tiles) -> Program {
    let [whole, ..] = &program.frames[..] else { unreachable!("a frame to match") };
    let width = whole.plan.size().0;
    let mut cut = Program { frames: vec![whole.clone()], steps: vec![Step::Condition, Step::Mosaic(0)] };
    let reads_right_view = whole.plan.reads_right_view();
    let right_map = whole.plan.method.refinement.right_map;
    let matches = entered(program);
    let count = matches.len() * tiles.count();
    for (frame, steps) in matches {
        let mirrored = program.frames[frame].mirrored;
        for tile in tiles.list() {
            let [crop, core] = [&tile.crop, &tile.core]
                .map(|part| if mirrored { part.mirrored(width) } else { part.clone() });
            cut.steps.push(Step::Enter(cut.frames.len()));
            let place = Some((cut.frames.len(), count));
            cut.frames.push(Frame { plan: tile.plan.clone(), crop, core, mirrored, tile: place });
            cut.steps.extend_from_slice(steps);
            cut.steps.push(Step::Place(if mirrored { View::Mirrored } else { View::Left }));
            if !mirrored && right_map && reads_right_view {
                cut.steps.extend(right_view::STAGES.map(Step::of));
                cut.steps.push(Step::Place(View::Right));
            }
        }
    }
    cut.steps.push(Step::Gather);
    let first = program.steps.iter().position(is_of_maps).unwrap_or(program.steps.len());
    for step in &program.steps[first..] {
        match step.stage() {
            // The tiles have found the disparities of the right view.
            Some(Stage::SubPixel) => cut.steps.push(Step::PlaceRight),
            Some(Stage::Cost) => {}
            _ => cut.steps.push(step.clone()),
        }
    }
    cut
}

fn is_of_maps(step: &Step) -> bool {
    step.stage().is_some_and(Stage::is_of_maps)
}

/// Each frame that is entered, with the steps that look at its volumes.
fn entered(program: &Program) -> Vec<(usize, &[Step])> {
    let is_enter = |step: &Step| matches!(step, Step::Enter(_));
    let ends = |step: &Step| is_enter(step) || is_of_maps(step) || step.stage() == Some(Stage::MirrorLabels);
    let steps = program.steps.iter().enumerate();
    steps
        .filter_map(|(at, step)| {
            let Step::Enter(frame) = step else { return None };
            let rest = &program.steps[at + 1..];
            Some((*frame, &rest[..rest.iter().position(ends).unwrap_or(rest.len())]))
        })
        .collect()
}
