use super::UNDEFINED;
use mrfgs::image::Plane;
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::stage::LabelPrior;
use std::ops::Range;

/// The cost of label `k` by a prior of `level`.
pub fn cost(plan: &Plan, level: usize, prior: LabelPrior, k: usize) -> i64 {
    // The interval is cut a label outside the labels of the level.
    let end = |end: i32| i64::from(end).clamp(-32, 32 * plan.levels[level].labels as i64);
    let at = 32 * k as i64;
    let away = (end(prior.lo) - at).max(at - end(prior.hi)).clamp(0, 65535);
    (away * i64::from(prior.slope.min(4095)) / (32 * 16)).min(prior.cap.into())
}

/// The evidence of `level` with the prior added, for pixels with the labels `has`.
pub fn prior(
    plan: &Plan,
    level: usize,
    has: &[Range<usize>],
    prior: &Plane<LabelPrior>,
    evidence: &[u32],
) -> Vec<u32> {
    let l = &plan.levels[level];
    let mut out = Vec::new();
    for ((pixel, has), prior) in evidence.chunks(l.labels).zip(has).zip(prior.data()) {
        let sum = |k: usize| i64::from(pixel[k]) + cost(plan, level, *prior, k);
        let least = has.clone().map(sum).min().unwrap();
        for k in 0..l.labels {
            out.push(match (has.contains(&k), prior.cap) {
                (false, _) => UNDEFINED,
                (true, 0) => pixel[k],
                (true, _) => (sum(k) - least).min(l.evidence.cap.into()) as u32,
            });
        }
    }
    out
}
