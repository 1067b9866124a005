//! Regions too small to be trusted: see [`crate::backend::Stage::RegionFilter`].

use super::Finest;
use crate::maps::flag;

pub(super) fn run(size: usize, maps: &mut Finest) {
    let Finest { peaks, validity, .. } = maps;
    let (width, height) = peaks.size();
    let labels = peaks.data();
    let flags = validity.data_mut();
    let mut seen: Vec<bool> = flags.iter().map(|&f| f != 0).collect();
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
            let (x, y) = (at % width, at / width);
            let neighbours = [
                (x > 0).then(|| at - 1),
                (x + 1 < width).then(|| at + 1),
                (y > 0).then(|| at - width),
                (y + 1 < height).then(|| at + width),
            ];
            for to in neighbours.into_iter().flatten() {
                if !seen[to] && labels[at].label.abs_diff(labels[to].label) <= 1 {
                    seen[to] = true;
                    region.push(to);
                }
            }
        }
        if region.len() < size {
            for &at in &region {
                flags[at] |= flag::SMALL_REGION;
            }
        }
    }
}
