use mrfgs::low_level::plan::Plan;

/// Evidence of `level` from its cost.
pub fn evidence(plan: &Plan, level: usize, cost: &[u32]) -> Vec<u32> {
    let l = &plan.levels[level];
    let unit = if level == 0 { 256 } else { 1 };
    let scale = l.evidence;
    let mut out = Vec::new();
    for pixel in cost.chunks(l.labels) {
        let smallest = pixel.iter().map(|&c| i64::from(c) * unit).min().unwrap();
        for &c in pixel {
            let difference = (i64::from(c) * unit - smallest).min(i64::from(scale.limit));
            let product = ((difference << scale.up) * i64::from(scale.multiplier)) >> 16;
            let e = (product + ((1 << scale.down) >> 1)) >> scale.down;
            out.push(u32::try_from(e.min(i64::from(scale.cap))).unwrap());
        }
    }
    out
}
