use super::{UNDEFINED, most};
use mrfgs::low_level::plan::Plan;
use std::ops::Range;

/// Evidence of `level` from its cost, for pixels with the labels `has`.
pub fn evidence(plan: &Plan, level: usize, has: &[Range<usize>], cost: &[u32]) -> Vec<u32> {
    let l = &plan.levels[level];
    let unit = if level == 0 { 256 } else { 1 };
    let scale = l.evidence;
    let mut out = Vec::new();
    for (pixel, has) in cost.chunks(l.labels).zip(has) {
        let smallest = pixel[has.clone()].iter().map(|&c| i64::from(c) * unit).min().unwrap();
        for (d, &c) in pixel.iter().enumerate() {
            if !has.contains(&d) {
                out.push(UNDEFINED);
                continue;
            }
            let difference = (i64::from(c) * unit - smallest).min(i64::from(scale.limit));
            let product = ((difference << scale.up) * i64::from(scale.multiplier)) >> 16;
            let e = (product + ((1 << scale.down) >> 1)) >> scale.down;
            out.push(u32::try_from(e.min(i64::from(scale.cap))).unwrap());
        }
    }
    out
}

/// The beliefs of `level` that equal this evidence.
pub fn beliefs(plan: &Plan, evidence: &[u32]) -> Vec<u32> {
    evidence.iter().map(|&e| if e == UNDEFINED { most(plan) } else { e }).collect()
}
