//! Cost of a level from the next finer one: see [`crate::backend::Stage::Pyramid`].

use crate::plan::Plan;
use rayon::prelude::*;

const WEIGHTS: [u32; 5] = [1, 4, 6, 4, 1];

/// A stored cost in 1/256 cost units.
pub(super) trait StoredCost: Copy + Sync {
    fn fraction(self) -> u32;
}

impl StoredCost for u8 {
    fn fraction(self) -> u32 {
        u32::from(self) << crate::plan::COST_FRACTION_BITS
    }
}

impl StoredCost for u16 {
    fn fraction(self) -> u32 {
        u32::from(self)
    }
}

pub(super) fn run<C: StoredCost>(plan: &Plan, level: usize, fine: &[C], out: &mut [u16]) {
    let (fl, cl) = (&plan.levels[level - 1], &plan.levels[level]);
    let offset = plan.label_offset(level);
    let minimum = plan.minimum_over_d();
    let row_cells = fl.width * fl.stride;
    out.par_chunks_mut(cl.width * cl.stride).enumerate().for_each_init(
        // The five fine rows reduced over y, then one pixel reduced over x as well.
        || (vec![0u32; row_cells], vec![0u32; fl.stride]),
        |(column, smooth), (y, row)| {
            column.fill(0);
            for (j, wy) in WEIGHTS.iter().enumerate() {
                let fy = (2 * y + j).saturating_sub(2).min(fl.height - 1);
                for (sum, cost) in column.iter_mut().zip(&fine[fy * row_cells..][..row_cells]) {
                    *sum += wy * cost.fraction();
                }
            }
            for (x, costs) in row.chunks_exact_mut(cl.stride).enumerate() {
                smooth.fill(128);
                for (i, wx) in WEIGHTS.iter().enumerate() {
                    let fx = (2 * x + i).saturating_sub(2).min(fl.width - 1);
                    for (sum, v) in smooth.iter_mut().zip(&column[fx * fl.stride..]) {
                        *sum += wx * v;
                    }
                }
                for sum in smooth.iter_mut() {
                    *sum >>= 8;
                }
                reduce_labels(&smooth[..fl.labels], offset, minimum, &mut costs[..cl.labels]);
                costs[cl.labels..].fill(u16::MAX);
            }
        },
    );
}

/// The cost of each coarse label from the smoothed costs of the fine ones.
fn reduce_labels(fine: &[u32], offset: i32, minimum: bool, out: &mut [u16]) {
    let last = fine.len() as i32 - 1;
    for (z, out) in out.iter_mut().enumerate() {
        let centre = 2 * z as i32 + offset;
        let at = |i: i32| fine[i.clamp(0, last) as usize];
        *out = if minimum {
            // Clamping repeats a label of the three unless the centre is outside; then it is the one inside.
            at(centre).min(at(centre - 1)).min(at(centre + 1)) as u16
        } else {
            let sum: u32 = WEIGHTS.iter().enumerate().map(|(i, w)| w * at(centre + i as i32 - 2)).sum();
            ((sum + 8) >> 4) as u16
        };
    }
}
