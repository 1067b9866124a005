//! The speckle filter: see [`crate::backend::Stage::SpeckleFilter`].

use crate::image::Pair;
use crate::maps::flag;
use crate::plan::Plan;
use crate::stage::MapSet;

pub(super) fn run(maps: &mut MapSet, plan: &Plan, _: &Pair) {
    let size = plan.method.refinement.speckle_size as usize;
    let MapSet { optima, validity, .. } = maps;
    let (width, height) = optima.size();
    let flags = validity.data_mut();
    // A border of pixels without a region gives every pixel four neighbours.
    let pitch = width + 2;
    let mut labels = vec![0; pitch * (height + 2)];
    let mut seen = vec![true; labels.len()];
    for y in 0..height {
        let inside = (y + 1) * pitch + 1..(y + 2) * pitch - 1;
        let pixels = optima.row(y).iter().zip(&mut flags[y * width..]);
        for ((label, seen), (optimum, flags)) in
            labels[inside.clone()].iter_mut().zip(&mut seen[inside]).zip(pixels)
        {
            if *flags == 0 && optimum.runner_up == optimum.best {
                *flags = flag::TIE;
            }
            (*label, *seen) = (optimum.label, *flags != 0);
        }
    }
    let mut region = Vec::new();
    for start in 0..labels.len() {
        if seen[start] {
            continue;
        }
        seen[start] = true;
        region.clear();
        region.push(start);
        let mut next = 0;
        while let Some(&at) = region.get(next) {
            next += 1;
            for to in [at - 1, at + 1, at - pitch, at + pitch] {
                if !seen[to] && labels[at].abs_diff(labels[to]) <= 1 {
                    seen[to] = true;
                    region.push(to);
                }
            }
        }
        if region.len() < size {
            for &at in &region {
                flags[(at / pitch - 1) * width + at % pitch - 1] |= flag::SPECKLE;
            }
        }
    }
}
