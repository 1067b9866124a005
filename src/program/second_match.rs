//! The right view by a second match: the mirrored pair is matched first, and its labels become those of the right view.

use super::{Frame, Program, Step};
use crate::stage::Stage;

/// The match of `program`, which is in one piece, after one of the mirrored pair.
#[must_use]
pub fn first(program: Program) -> Program {
    let Program { mut frames, steps } = program;
    let enter = steps.iter().position(|step| matches!(step, Step::Enter(_))).expect("a frame to match");
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
