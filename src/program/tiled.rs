//! A match in tiles: the stages on volumes for each tile, then the map stages on the maps of the whole image.

use super::tiles::Tiles;
use super::{Frame, Program, Step, View, right_view};
use crate::stage::Stage;

/// The match of `program`, which is in one piece, cut into `tiles`.
#[must_use]
pub(crate) fn cut(program: &Program, tiles: &Tiles) -> Program {
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
                cut.steps.extend(right_view::stages(&whole.plan));
                cut.steps.push(Step::Place(View::Right));
            }
        }
    }
    cut.steps.push(Step::Gather);
    let first = program.steps.iter().position(is_of_maps).unwrap_or(program.steps.len());
    for step in &program.steps[first..] {
        match step.stage() {
            // The tiles already have the disparities of the right view.
            Some(Stage::SubPixel | Stage::Refine) => cut.steps.push(Step::PlaceRight),
            Some(Stage::Cost) => {}
            _ => cut.steps.push(step.clone()),
        }
    }
    cut
}

fn is_of_maps(step: &Step) -> bool {
    step.stage().is_some_and(Stage::is_of_maps)
}

/// Each entered frame, with the steps on its volumes.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::LeftRightCheck;
    use crate::program::{samples, schedule, second_match};

    /// Each tile of each view is entered, estimated and placed once; then only map stages follow.
    #[test]
    fn tiles_are_estimated_one_by_one_and_finished_together() {
        for check in [LeftRightCheck::RightView, LeftRightCheck::SecondMatch] {
            let plan = samples::plan(check);
            let tiles = Tiles::new(&plan).unwrap();
            let mut whole = samples::plain(&plan);
            let twice = check == LeftRightCheck::SecondMatch;
            if twice {
                whole = second_match::first(whole);
            }
            whole.steps = right_view::follow(&plan, whole.steps);
            let program = cut(&whole, &tiles);
            let count = tiles.count() * if twice { 2 } else { 1 };
            assert!(tiles.count() > 1 && program.frames.len() == 1 + count);

            let mut steps = program.steps[2..].iter();
            let estimate = schedule::estimate(&plan);
            for (at, frame) in program.frames.iter().enumerate().skip(1) {
                assert_eq!(steps.next(), Some(&Step::Enter(at)));
                assert_eq!(frame.tile, Some((at, count)));
                assert!(estimate.iter().all(|step| steps.next() == Some(step)));
                let view = if frame.mirrored { View::Mirrored } else { View::Left };
                assert_eq!(steps.next(), Some(&Step::Place(view)));
                if !twice {
                    assert!(right_view::stages(&plan).iter().all(|step| steps.next() == Some(step)));
                    assert_eq!(steps.next(), Some(&Step::Place(View::Right)));
                }
            }
            let post = schedule::post_processing(&plan);
            let mut expected = vec![Step::Gather];
            expected.extend_from_slice(&post);
            expected.extend([Step::Ask(View::Left), Step::of(Stage::SwapViews), Step::PlaceRight]);
            expected.extend(post);
            expected.extend([Step::Ask(View::Right), Step::Collect]);
            assert_eq!(steps.cloned().collect::<Vec<_>>(), expected);
        }
    }
}
