use super::{FRACTION, flag};
use crate::image::Plane;

/// Sets [`flag::SMALL_REGION`] on every pixel of each region of fewer than `size` valid pixels. Regions are
/// 4-connected; a step of at most one pixel of disparity connects.
pub fn region_filter(disparity: &Plane<i32>, flags: &mut Plane<u8>, size: usize) {
    if size < 2 {
        return;
    }
    let (width, height) = disparity.size();
    let d = disparity.data();
    let mut seen: Vec<bool> = flags.data().iter().map(|f| f & flag::INVALID != 0).collect();
    let mut region = Vec::new();
    for start in 0..d.len() {
        if seen[start] {
            continue;
        }
        seen[start] = true;
        region.clear();
        region.push(start);
        let mut next = 0;
        while let Some(&at) = region.get(next) {
            next += 1;
            let (x, y) = (at % width, at / width);
            let neighbours = [
                (x > 0).then(|| at - 1),
                (x + 1 < width).then(|| at + 1),
                (y > 0).then(|| at - width),
                (y + 1 < height).then(|| at + width),
            ];
            for to in neighbours.into_iter().flatten() {
                if !seen[to] && d[at].abs_diff(d[to]) <= FRACTION as u32 {
                    seen[to] = true;
                    region.push(to);
                }
            }
        }
        if region.len() < size {
            for &at in &region {
                flags.data_mut()[at] |= flag::SMALL_REGION;
            }
        }
    }
}
