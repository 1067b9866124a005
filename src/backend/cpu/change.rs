//! The change of the label map: see [`crate::backend::Stage::Change`].

use super::units::{Units, argmin};
use super::volumes::Volumes;
use rayon::prelude::*;

pub(super) fn run<U: Units>(v: &mut Volumes<U>) {
    let (level, belief, labels) = (&v.plan.levels[0], &v.levels[0].belief, &mut v.labels);
    v.change = labels
        .par_chunks_mut(level.width)
        .zip(belief.par_chunks(level.width * level.stride))
        .map(|(labels, row)| {
            let mut sum = 0;
            for (label, belief) in labels.iter_mut().zip(row.chunks_exact(level.stride)) {
                let new = argmin(&belief[..level.labels]).0 as u16;
                sum += u64::from(new.abs_diff(*label)).pow(2);
                *label = new;
            }
            sum
        })
        .sum();
}
