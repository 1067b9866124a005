use super::most;
use mrfgs::image::Plane;
use mrfgs::low_level::plan::Plan;
use mrfgs::options::Order;
use std::ops::Range;

/// The label windows of `level`, (first, count) of each run in each row of windows, from the beliefs of the
/// next coarser level or from the label ranges.
pub fn label_window(
    plan: &Plan,
    level: usize,
    coarse_belief: Option<&[u32]>,
    ranges: Option<&Plane<[u16; 2]>>,
) -> Plane<[u16; 2]> {
    let l = &plan.levels[level];
    let joins = plan.method.schedule.order == Order::CoarseFirst && level + 1 < plan.levels.len();
    Plane::from_fn(l.width.div_ceil(8), l.height.div_ceil(2), |run, row| {
        let mut needed = Vec::new();
        if joins {
            let (belief, c) = (coarse_belief.unwrap(), &plan.levels[level + 1]);
            for y in 0..c.height as i64 {
                for x in 0..c.width as i64 {
                    let (run, row) = (run as i64, row as i64);
                    if (y - row).abs() <= 2 && x >= 4 * run - 2 && x <= 4 * run + 5 {
                        let pixel = &belief[(y as usize * c.width + x as usize) * c.labels..][..c.labels];
                        let smallest = *pixel.iter().min().unwrap();
                        for (z, &b) in pixel.iter().enumerate() {
                            if b <= smallest + 8 && b < most(plan) {
                                let label = 2 * (i64::from(c.min) + z as i64) - i64::from(l.min);
                                needed.extend([label - 2, label + 2]);
                            }
                        }
                    }
                }
            }
        } else if let Some(ranges) = ranges {
            for y in [2 * row, 2 * row + 1].into_iter().filter(|&y| y < l.height) {
                for x in (8 * run..8 * run + 8).filter(|&x| x < l.width) {
                    needed.extend(ranges[(x, y)].map(i64::from));
                }
            }
        } else {
            needed = vec![0, l.labels as i64 - 1];
        }
        let inside = |label: i64| label.max(0).min(l.labels as i64 - 1);
        let least = inside(*needed.iter().min().unwrap());
        let most = inside(*needed.iter().max().unwrap());
        let padded = (l.labels as i64 + 15) / 16 * 16;
        let mut first = least - least % 4;
        let count = (most - first + 16) / 16 * 16;
        while first + count > padded {
            first -= 1;
        }
        [u16::try_from(first).unwrap(), u16::try_from(count).unwrap()]
    })
}

/// The labels that every pixel of `level` has.
pub fn ranges(plan: &Plan, level: usize, windows: &Plane<[u16; 2]>) -> Vec<Range<usize>> {
    let l = &plan.levels[level];
    let of = |i: usize| {
        let [first, count] = windows[(i % l.width / 8, i / l.width / 2)].map(usize::from);
        first..(first + count).min(l.labels)
    };
    (0..l.pixels()).map(of).collect()
}

/// All labels for every pixel of `level`.
pub fn all(plan: &Plan, level: usize) -> Vec<Range<usize>> {
    vec![0..plan.levels[level].labels; plan.levels[level].pixels()]
}
