//! A match in tiles: each look takes the stages on volumes for each tile, then the map stages on the maps of the whole image.

use super::tiles::Tiles;
use super::{Frame, Program, Step, View, right_view, schedule};
use crate::stage::Stage;

/// The match of `program`, which is in one piece, cut into `tiles`.
#[must_use]
pub(crate) fn cut(program: &Program, tiles: &Tiles) -> Program {
    let [whole, ..] = &program.frames[..] else { unreachable!("a frame to match") };
    let plan = &whole.plan;
    let mut cut = Program { frames: vec![whole.clone()], steps: vec![Step::Condition, Step::Mosaic(0)] };
    let matches = entered(program);
    let last = plan.looks() as usize - 1;
    let count = (matches.len() + last) * tiles.count();
    for look in 0..=last {
        if look > 0 {
            cut.steps.extend(schedule::between_looks(plan));
            cut.steps.push(Step::LookAgain);
        }
        let again = schedule::look(plan, look as u32);
        let matches = if look == 0 { &matches[..] } else { &[(0, &again[..])][..] };
        for &(frame, steps) in matches {
            let mirrored = program.frames[frame].mirrored;
            for tile in tiles.list() {
                let [crop, core] = [&tile.crop, &tile.core]
                    .map(|part| if mirrored { part.mirrored(plan.size().0) } else { part.clone() });
                cut.steps.push(Step::Enter(cut.frames.len()));
                let place = Some((cut.frames.len(), count));
                cut.frames.push(Frame { plan: tile.plan.clone(), crop, core, mirrored, tile: place });
                cut.steps.extend_from_slice(steps);
                cut.steps.push(Step::Place(if mirrored { View::Mirrored } else { View::Left }));
                let right_map = plan.method.refinement.right_map && plan.reads_right_view();
                if !mirrored && right_map && look == last {
                    cut.steps.extend(right_view::stages(plan));
                    cut.steps.push(Step::Place(View::Right));
                }
            }
        }
        cut.steps.push(Step::Gather);
    }
    for step in &program.steps[schedule::after_looks(&program.steps)..] {
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
    use crate::program::{samples, second_match};

    /// In each look, each tile of each view is entered, estimated and placed once; then only map stages follow.
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
            let looks = plan.looks();
            let count = tiles.count() * (looks as usize + usize::from(twice));
            assert!(looks > 1 && tiles.count() > 1 && program.frames.len() == 1 + count);

            let mut expected = program.steps[..2].to_vec();
            let mut frames = program.frames.iter().enumerate().skip(1);
            for look in 0..looks {
                if look > 0 {
                    expected.extend(schedule::between_looks(&plan));
                    expected.push(Step::LookAgain);
                }
                let of_look = tiles.count() * if twice && look == 0 { 2 } else { 1 };
                for (at, frame) in frames.by_ref().take(of_look) {
                    assert_eq!(frame.tile, Some((at, count)));
                    assert!(look == 0 || !frame.mirrored, "the mirrored pair is matched once");
                    expected.push(Step::Enter(at));
                    expected.extend(schedule::look(&plan, look));
                    expected.push(Step::Place(if frame.mirrored { View::Mirrored } else { View::Left }));
                    if !twice && look + 1 == looks {
                        expected.extend(right_view::stages(&plan));
                        expected.push(Step::Place(View::Right));
                    }
                }
                expected.push(Step::Gather);
            }
            let post = schedule::post_processing(&plan);
            expected.extend_from_slice(&post);
            expected.extend([Step::Ask(View::Left), Step::of(Stage::SwapViews), Step::PlaceRight]);
            expected.extend(post);
            expected.extend([Step::Ask(View::Right), Step::Collect]);
            assert_eq!(program.steps, expected);
        }
    }
}
