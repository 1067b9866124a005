//! Corners of a view (Shi and Tomasi 1994), spread evenly over the image and over its zones.

use super::view::View;
use crate::image::Plane;
use crate::threads::prelude::*;
use std::collections::BTreeMap;

/// Smallest number of pixels per corner: dense enough for the statistics of a small zone.
pub(super) const SPACING: usize = 64;
/// Side of the cells over which corners are spread evenly, in pixels, at a spacing of [`SPACING`].
const CELL: usize = 32;
/// A corner is the maximum of 5 x 5 pixels.
const PEAK_RADIUS: usize = 2;

/// Side of a cell in pixels, such that a cell holds about the same number of corners at any spacing.
pub(super) fn cell(spacing: usize) -> usize {
    CELL * (spacing / SPACING).isqrt().max(1)
}

/// Corners of `view` in raster order, each with the smaller eigenvalue of its structure tensor: the best of each zone in each cell of the
/// image, one per `spacing` pixels.
pub(super) fn corners(
    view: &View,
    zones: Option<(&Plane<u32>, usize)>,
    spacing: usize,
) -> Vec<(usize, usize, f64)> {
    let (width, height) = view.grey.size();
    if let Some((map, _)) = zones {
        assert_eq!(map.size(), (width, height), "the map of zones has the size of the images");
    }
    let values = view.eigenvalues();
    // On a tie, the earlier one in raster order wins.
    let is_peak = |x: usize, y: usize| {
        let value = values[(x, y)];
        // Most pixels are below one beside them.
        value > 0.0
            && [(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)].iter().all(|beside| values[*beside] <= value)
            && (y - PEAK_RADIUS..=y + PEAK_RADIUS).all(|v| {
                (x - PEAK_RADIUS..=x + PEAK_RADIUS)
                    .all(|u| value.total_cmp(&values[(u, v)]).then((v, u).cmp(&(y, x))).is_ge())
            })
    };
    let side = cell(spacing);
    let cells: Vec<(usize, usize)> =
        (0..height).step_by(side).flat_map(|y| (0..width).step_by(side).map(move |x| (x, y))).collect();
    let mut out: Vec<_> = cells
        .into_par_iter()
        .flat_map_iter(|(left, top)| {
            let mut of_zone = BTreeMap::<u32, (usize, Vec<(usize, usize)>)>::new();
            let (rows, columns) = (top..(top + side).min(height), left..(left + side).min(width));
            let pixels = rows.len() * columns.len();
            let cell = rows.flat_map(|y| columns.clone().map(move |x| (x, y)));
            if let Some((map, count)) = zones {
                for (x, y) in cell.filter(|at| (map[*at] as usize) < count) {
                    let (pixels, optima) = of_zone.entry(map[(x, y)]).or_default();
                    *pixels += 1;
                    optima.extend(is_peak(x, y).then_some((x, y)));
                }
            } else {
                of_zone.insert(0, (pixels, cell.filter(|(x, y)| is_peak(*x, *y)).collect()));
            }
            of_zone.into_values().flat_map(|(pixels, mut optima)| {
                optima.sort_by(|a, b| values[*b].total_cmp(&values[*a]));
                optima.truncate(pixels.div_ceil(spacing));
                optima.into_iter().map(|(x, y)| (x, y, values[(x, y)]))
            })
        })
        .collect();
    out.sort_by_key(|&(x, y, _)| (y, x));
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;

    #[test]
    fn every_zone_gives_its_own_best_corners() {
        // Noise in bands of 16 rows, every other one with an eighth of the contrast.
        let faint = |y: usize| y / 16 % 2 == 1;
        let image = Image::from_rgb8(&Plane::from_fn(192, 128, |x, y| {
            let seed = (x as u32).wrapping_mul(0x9e37_79b9) ^ (y as u32).wrapping_mul(0x85eb_ca6b);
            let noise = ((seed ^ seed >> 15).wrapping_mul(0xc2b2_ae35) >> 24) as u8;
            [if faint(y) { 112 + noise / 8 } else { noise }; 3]
        }));
        let view = View::new(&image);
        let zones = Plane::from_fn(192, 128, |_, y| u32::from(faint(y)));
        let found = |zones| {
            let all = corners(&view, zones, 256);
            assert!(all.len() <= 192 * 128 / 256);
            all.iter().filter(|(_, y, _)| faint(*y)).count()
        };
        let (with, without) = (found(Some((&zones, 2))), found(None));
        assert!(with >= 40 && without <= 10, "{with} with zones, {without} without");

        // The maximum is among them, and no corner is next to a better one.
        let all = corners(&view, None, 256);
        let values = view.eigenvalues();
        for &(x, y, _) in &all {
            let around = (y - 2..=y + 2).flat_map(|v| (x - 2..=x + 2).map(move |u| (u, v)));
            assert!(around.into_iter().all(|at| values[at] <= values[(x, y)]));
        }
    }

    #[test]
    fn a_corner_has_two_large_eigenvalues() {
        // A square on black: the corners are found, the sides are not.
        let image = Image::from_rgb8(&Plane::from_fn(40, 40, |x, y| {
            [if (10..30).contains(&x) && (10..30).contains(&y) { 200 } else { 0 }; 3]
        }));
        let view = View::new(&image);
        let values = view.eigenvalues();
        let row = values.row(20);
        assert!(row.iter().all(|&value| value == 0.0), "{row:?}");
        let found = corners(&view, None, 64);
        assert_eq!(found.len(), 4, "{found:?}");
        for (x, y, _) in found {
            assert!([x, y].iter().all(|c| c.abs_diff(10).min(c.abs_diff(29)) <= 1), "{x}, {y}");
        }
        let at = |x: usize, y: usize| f64::from(view.grey[(x, y)]);
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for (x, y) in (8..13).flat_map(|y| (8..13).map(move |x| (x, y))) {
            let (dx, dy) = (at(x + 1, y) - at(x - 1, y), at(x, y + 1) - at(x, y - 1));
            xx += dx * dx;
            xy += dx * dy;
            yy += dy * dy;
        }
        let value = values[(10, 10)];
        // For [[xx, xy], [xy, yy]]: the determinant of the tensor minus the value on its diagonal is 0.
        let determinant = (xx - value) * (yy - value) - xy * xy;
        assert!(value > 0.0 && determinant.abs() < 1e-9 * xx * yy && 2.0 * value <= xx + yy);
    }
}
