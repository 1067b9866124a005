//! A match at twice the size after the one at the pair's own size; their maps are merged.

use super::{Program, Step};

/// The steps of `own`, then those of `double` on the doubled pair, then the merge.
#[must_use]
pub(crate) fn follow(own: Program, double: Program) -> Program {
    let Program { mut frames, mut steps } = own;
    let first = frames.len();
    frames.extend(double.frames);
    steps.push(Step::Double);
    // The pair is already conditioned.
    steps.extend(double.steps.into_iter().filter(|step| *step != Step::Condition).map(|step| match step {
        Step::Enter(frame) => Step::Enter(first + frame),
        Step::Mosaic(frame) => Step::Mosaic(first + frame),
        other => other,
    }));
    steps.push(Step::Join);
    Program { frames, steps }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::LeftRightCheck;
    use crate::program::samples;

    #[test]
    fn the_doubled_pair_follows_in_separate_frames() {
        let plan = samples::plan(LeftRightCheck::RightView);
        let own = samples::plain(&plan);
        let program = follow(own.clone(), own.clone());
        assert_eq!(program.frames.len(), 2);
        let (first, second) = program.steps.split_at(own.steps.len());
        assert_eq!(first, own.steps);
        assert_eq!(second[..2], [Step::Double, Step::Enter(1)]);
        assert_eq!(second[2..second.len() - 1], own.steps[2..]);
        assert_eq!(second.last(), Some(&Step::Join));
        assert!(own.waits_once() && !program.waits_once());
        assert!((program.work() - 2.0 * own.work()).abs() < 1.0);
    }
}
