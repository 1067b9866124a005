//! The graph of a level: see [`Stage::Graph`](crate::backend::Stage::Graph).

use crate::backend::cpu::units::Units;
use crate::backend::cpu::volumes::Volumes;
use crate::graph::of_level;

pub(super) fn run<U: Units>(volumes: &mut Volumes<U>, z: usize) {
    let (finer, rest) = volumes.levels.split_at_mut(z);
    let level = &mut rest[0];
    level.guide =
        finer.last().map(|finer| finer.guide.as_ref().unwrap_or_else(|| volumes.pair.left()).downsampled());
    level.graph = of_level(level.guide.as_ref().unwrap_or_else(|| volumes.pair.left()), &volumes.plan);
}
