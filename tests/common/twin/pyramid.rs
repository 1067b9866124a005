use super::binomial;
use mrfgs::low_level::plan::Plan;
use mrfgs::options::Pyramid;

/// Cost of `level` from the next finer one.
pub fn pyramid(plan: &Plan, level: usize, fine: &[u32]) -> Vec<u32> {
    let (f, c) = (&plan.levels[level - 1], &plan.levels[level]);
    let (width, height) = (f.width as i64, f.height as i64);
    let unit = if level == 1 { 256 } else { 1 };
    let fine_labels = i64::from(f.min)..=i64::from(f.min) + f.labels as i64 - 1;
    let mut out = Vec::new();
    for y in 0..c.height as i64 {
        for x in 0..c.width as i64 {
            // The mean over x and y of the fine label d.
            let mean = |d: i64| {
                let mut sum = 0;
                for j in -2..=2 {
                    for i in -2..=2 {
                        let fx = (2 * x + i).max(0).min(width - 1);
                        let fy = (2 * y + j).max(0).min(height - 1);
                        let index = (fy * width + fx) * f.labels as i64 + d - fine_labels.start();
                        sum += binomial(i) * binomial(j) * unit * i64::from(fine[index as usize]);
                    }
                }
                (sum + 128) >> 8
            };
            for z in (0..c.labels as i64).map(|label| i64::from(c.min) + label) {
                let cost = match plan.method.cost.pyramid {
                    Pyramid::LowPass => {
                        let at = |d: i64| mean(d.max(*fine_labels.start()).min(*fine_labels.end()));
                        let sum: i64 = (-2..=2).map(|k| binomial(k) * at(2 * z + k)).sum();
                        (sum + 8) >> 4
                    }
                    Pyramid::Minimum => (2 * z - 1..=2 * z + 1)
                        .filter(|d| fine_labels.contains(d))
                        .map(mean)
                        .min()
                        .expect("every coarse label is within one of a fine one"),
                };
                out.push(u32::try_from(cost).unwrap());
            }
        }
    }
    out
}
