use mrfgs::image::Plane;
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::stage::LabelPrior;
use mrfgs::maps::flag;

/// An end of an interval, cut a label outside the labels of `level`.
fn cut(plan: &Plan, level: usize, end: i32) -> i32 {
    end.max(-32).min(32 * plan.levels[level].labels as i32)
}

/// The prior of level 0 after a look with these maps, if `known` was known before, if anything was.
pub fn take(
    plan: &Plan,
    disparity: &Plane<i32>,
    validity: &Plane<i32>,
    known: Option<&Plane<LabelPrior>>,
) -> Plane<LabelPrior> {
    let (width, height) = plan.size();
    Plane::from_fn(width, height, |x, y| {
        if let Some(known) = known.map(|known| known[(x, y)]).filter(|known| known.cap > 5) {
            return LabelPrior {
                lo: cut(plan, 0, known.lo),
                hi: cut(plan, 0, known.hi),
                slope: known.slope.min(4095),
                cap: known.cap,
            };
        }
        let flags = validity[(x, y)] as u8;
        if flags & flag::INVALID == 0 || flags & flag::FILLED == 0 {
            return LabelPrior::default();
        }
        let label = f64::from(disparity[(x, y)]) / 256.0 - f64::from(plan.range.min);
        let at = cut(plan, 0, (32.0 * label).floor() as i32);
        LabelPrior { lo: at, hi: at, slope: 64, cap: 5 }
    })
}

/// The prior of `level` from that of the next `finer` one.
pub fn pool(plan: &Plan, level: usize, finer: &Plane<LabelPrior>) -> Plane<LabelPrior> {
    let l = &plan.levels[level];
    let offset = 2 * l.min - plan.levels[level - 1].min;
    Plane::from_fn(l.width, l.height, |x, y| {
        let places = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| (2 * x + i, 2 * y + j));
        let inside = places.into_iter().filter(|&(u, v)| u < finer.width() && v < finer.height());
        let children: Vec<_> = inside.map(|at| finer[at]).filter(|child| child.cap > 0).collect();
        let Some(lo) = children.iter().map(|child| child.lo).min() else { return LabelPrior::default() };
        let hi = children.iter().map(|child| child.hi).max().unwrap();
        let count = children.len() as u32;
        // Caps up to 5 are guesses, which fade.
        let counted = |cap: u8| u32::from(if cap <= 5 { cap.max(2) - 2 } else { cap });
        let half = |end: i32, f: fn(f64) -> f64| f(f64::from(end - 32 * offset) / 2.0) as i32;
        LabelPrior {
            lo: cut(plan, level, half(lo - 32, f64::floor)),
            hi: cut(plan, level, half(hi + 32, f64::ceil)),
            slope: (2 * children.iter().map(|child| child.slope).sum::<u32>() / count).min(4095),
            cap: (children.iter().map(|child| counted(child.cap)).sum::<u32>() / count) as u8,
        }
    })
}
