//! A match at twice the size of the pair, which follows that at its own size; both give one map.

use super::{Program, Step};

/// The steps of `own`, then those of `double` on the doubled pair, and one map of both.
#[must_use]
pub fn follow(own: Program, double: Program) -> Program {
    let Program { mut frames, mut steps } = own;
    let first = frames.len();
    frames.extend(double.frames);
    steps.push(Step::Double);
    // The pair has been conditioned.
    steps.extend(double.steps.into_iter().filter(|step| *step != Step::Condition).map(|step| match step {
        Step::Enter(frame) => Step::Enter(first + frame),
        Step::Mosaic(frame) => Step::Mosaic(first + frame),
        other => other,
    }));
    steps.push(Step::Join);
    Program { frames, steps }
}
