use super::{cut, most, variable_message};
use mrfgs::low_level::plan::Plan;
use mrfgs::options::Agreement;
use std::ops::Range;

/// New messages (down, up) of the resolution factors between `level` and the next finer one.
pub fn resolution(
    plan: &Plan,
    level: usize,
    [fine_has, coarse_has]: [&[Range<usize>]; 2],
    fine_belief: &[u32],
    coarse_belief: &[u32],
    old_down: &[u32],
    old_up: &[u32],
) -> (Vec<u32>, Vec<u32>) {
    let infinite = i64::from(most(plan));
    let (f, c) = (&plan.levels[level - 1], &plan.levels[level]);
    let agree = |d: usize, z: usize| {
        let (d, z) = (i64::from(f.min) + d as i64, i64::from(c.min) + z as i64);
        match plan.method.messages.agreement {
            Agreement::Strict => d == 2 * z,
            Agreement::Interpolating => (d - 2 * z).abs() <= 1,
        }
    };
    let smallest = |values: &mut dyn Iterator<Item = i64>| values.min().unwrap_or(infinite);
    let message = |s: Vec<i64>, has: &Range<usize>| cut(plan, &s, |d| has.contains(&d), plan.resolution);
    let from = |belief: &[u32], old: &[u32]| variable_message(plan, belief, old, |_| true, plan.resolution);
    let (mut down, mut up) = (old_down.to_vec(), old_up.to_vec());
    for y in 0..c.height {
        for x in 0..c.width {
            let at = (y * c.width + x) * c.labels;
            let parent = at..at + c.labels;
            let q = from(&coarse_belief[parent.clone()], &old_up[parent.clone()]);
            let mut children = Vec::new();
            for (fx, fy) in [(2 * x, 2 * y), (2 * x + 1, 2 * y), (2 * x, 2 * y + 1), (2 * x + 1, 2 * y + 1)] {
                if fx < f.width && fy < f.height {
                    let at = (fy * f.width + fx) * f.labels;
                    children.push(at..at + f.labels);
                }
            }
            // The minima U of each child.
            let mut u = Vec::new();
            for child in &children {
                let q = from(&fine_belief[child.clone()], &old_down[child.clone()]);
                let best = |z| smallest(&mut (0..f.labels).filter(|&d| agree(d, z)).map(|d| q[d]));
                u.push((0..c.labels).map(best).collect::<Vec<i64>>());
            }
            let to_parent =
                (0..c.labels).map(|z| u.iter().map(|u| u[z]).sum::<i64>().min(infinite)).collect();
            up[parent].copy_from_slice(&message(to_parent, &coarse_has[y * c.width + x]));
            for (i, child) in children.iter().enumerate() {
                let others =
                    |z: usize| u.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, u)| u[z]).sum::<i64>();
                let t: Vec<i64> = (0..c.labels).map(|z| (q[z] + others(z)).min(infinite)).collect();
                let to_child = (0..f.labels)
                    .map(|d| smallest(&mut (0..c.labels).filter(|&z| agree(d, z)).map(|z| t[z])))
                    .collect();
                down[child.clone()].copy_from_slice(&message(to_child, &fine_has[child.start / f.labels]));
            }
        }
    }
    (down, up)
}
