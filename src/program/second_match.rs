//! The right view by a second match: the mirrored pair is matched first, and its labels become the right labels.

use super::{Frame, Program, Step};
use crate::stage::Stage;

/// A match of the mirrored pair, then that of `program`, which is in one piece.
#[must_use]
pub(crate) fn first(program: Program) -> Program {
    let Program { mut frames, steps } = program;
    let enter = steps.iter().position(|step| matches!(step, Step::Enter(_))).unwrap_or(steps.len());
    let is_of_maps = |step: &Step| step.stage().is_some_and(Stage::is_of_maps);
    let end = steps.iter().position(is_of_maps).unwrap_or(steps.len());
    let mirrored = frames.len();
    frames.push(Frame { mirrored: true, ..frames[0].clone() });
    let mut all = steps[..enter].to_vec();
    all.push(Step::Enter(mirrored));
    all.extend_from_slice(&steps[enter + 1..end]);
    all.push(Step::of(Stage::MirrorLabels));
    all.extend_from_slice(&steps[enter..]);
    Program { frames, steps: all }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::LeftRightCheck;
    use crate::program::{View, samples, schedule};

    #[test]
    fn the_mirrored_pair_is_matched_first_and_in_the_same_way() {
        let plan = samples::plan(LeftRightCheck::SecondMatch);
        let plain = samples::plain(&plan);
        let both = first(plain.clone());
        let estimate = schedule::estimate(&plan);
        let mut expected = vec![Step::Condition, Step::Enter(1)];
        expected.extend_from_slice(&estimate);
        expected.push(Step::of(Stage::MirrorLabels));
        expected.extend_from_slice(&plain.steps[1..]);
        assert_eq!(both.steps, expected);
        assert_eq!(both.frames.iter().map(|frame| frame.mirrored).collect::<Vec<_>>(), [false, true]);
        assert_eq!(expected[expected.len() - 2..], [Step::Ask(View::Left), Step::Collect]);
    }
}
