//! The nearest of many points in the plane, in all directions.

/// The number of directions.
pub(super) const COUNT: usize = 8;
/// Neighbours are at most this many times as far away as the third nearest.
const FARTHEST: i32 = 4;
/// Smallest distance of the third nearest that counts, in px.
const LEAST: i32 = 4;

/// A neighbour: its squared distance in px, and its index.
pub(super) type Neighbour = (u32, u32);

/// Points sorted into square cells.
pub(super) struct Neighbours<'a> {
    points: &'a [(i32, i32)],
    cell: i32,
    columns: i32,
    rows: i32,
    /// The points of cell i are `order[starts[i]..starts[i + 1]]`.
    starts: Vec<u32>,
    order: Vec<u32>,
}

impl<'a> Neighbours<'a> {
    /// Sorts `points`, which lie inside a view of (width, height) pixels.
    pub(super) fn new(points: &'a [(i32, i32)], (width, height): (usize, usize)) -> Self {
        // About two points per cell.
        let cell = (2 * width * height / points.len().max(1)).isqrt().clamp(2, 1 << 12) as i32;
        let (columns, rows) = (width as i32 / cell + 1, height as i32 / cell + 1);
        let cell_of = |&(x, y): &(i32, i32)| (y / cell * columns + x / cell) as usize;
        let mut starts = vec![0; (columns * rows) as usize + 1];
        for point in points {
            starts[cell_of(point) + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut next = starts.clone();
        let mut order = vec![0; points.len()];
        for (i, point) in points.iter().enumerate() {
            let place = &mut next[cell_of(point)];
            order[*place as usize] = i as u32;
            *place += 1;
        }
        Self { points, cell, columns, rows, starts, order }
    }

    /// The points nearest to (x, y), one in each of eight sectors, because the rows of a lidar are much farther apart than their points.
    /// They are at most `reach` px away, and at most [`FARTHEST`] times as far as the third nearest; nearest first, those of lower
    /// index first on ties. The point `but` is left out.
    ///
    /// Cells are visited in squares around the place, until no cell can hold a nearer point.
    pub(super) fn nearest(
        &self,
        (x, y): (i32, i32),
        reach: i32,
        but: Option<u32>,
        found: &mut Vec<Neighbour>,
    ) {
        let mut sectors = [(u32::MAX, u32::MAX); COUNT];
        let (column, row) = (x.div_euclid(self.cell), y.div_euclid(self.cell));
        let mut most = squared(reach);
        for ring in 0..=reach / self.cell + 1 {
            // Points of this square and beyond are at least this far away.
            let least = squared((ring - 1).max(0) * self.cell);
            let farthest = sectors.iter().map(|near| near.0).max().unwrap_or(0);
            if least > most || farthest <= least {
                break;
            }
            for v in (row - ring).max(0)..=(row + ring).min(self.rows - 1) {
                let is_edge = (v - row).abs() == ring;
                let step = if is_edge { 1 } else { 2 * ring };
                for u in (column - ring..=column + ring).step_by(step as usize) {
                    if (0..self.columns).contains(&u) {
                        self.add_cell((v * self.columns + u) as usize, (x, y), but, &mut sectors);
                    }
                }
            }
            most = most.min(limit(&sectors));
        }
        found.clear();
        found.extend(sectors.iter().filter(|near| near.0 <= most));
        found.sort_unstable();
    }

    fn add_cell(&self, cell: usize, (x, y): (i32, i32), but: Option<u32>, sectors: &mut [Neighbour; COUNT]) {
        for &i in &self.order[self.starts[cell] as usize..self.starts[cell + 1] as usize] {
            let (px, py) = self.points[i as usize];
            let (dx, dy) = (px - x, py - y);
            if but != Some(i) {
                let nearest = &mut sectors[sector(dx, dy)];
                *nearest = (*nearest).min((squared(dx) + squared(dy), i));
            }
        }
    }
}

/// The sector of a direction.
fn sector(dx: i32, dy: i32) -> usize {
    4 * usize::from(dx >= 0) + 2 * usize::from(dy >= 0) + usize::from(dx.abs() > dy.abs())
}

/// The largest squared distance of a neighbour.
fn limit(sectors: &[Neighbour; COUNT]) -> u32 {
    let mut sorted = sectors.map(|near| near.0);
    sorted.sort_unstable();
    // Distances are below 2^14.
    squared(FARTHEST).saturating_mul(sorted[2].max(squared(LEAST)))
}

fn squared(distance: i32) -> u32 {
    distance.pow(2).cast_unsigned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_points_are_those_of_a_full_search() {
        let mut seed = 7_u32;
        let mut random = |most: i32| {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 8) as i32 % most
        };
        for (size, count) in [((90, 60), 40), ((300, 20), 700), ((50, 50), 3)] {
            let points: Vec<_> = (0..count).map(|_| (random(size.0), random(size.1))).collect();
            let sorted = Neighbours::new(&points, (size.0 as usize, size.1 as usize));
            for reach in [9, 40] {
                for _ in 0..200 {
                    let (x, y) = (random(size.0), random(size.1));
                    let mut sectors = [(u32::MAX, u32::MAX); COUNT];
                    for (i, &(px, py)) in (0..).zip(&points) {
                        let nearest = &mut sectors[sector(px - x, py - y)];
                        *nearest = (*nearest).min((squared(px - x) + squared(py - y), i));
                    }
                    let most = limit(&sectors).min(squared(reach));
                    let mut all: Vec<_> = sectors.into_iter().filter(|near| near.0 <= most).collect();
                    all.sort_unstable();
                    let mut found = Vec::new();
                    sorted.nearest((x, y), reach, None, &mut found);
                    assert_eq!(found, all);
                    // Control: without the nearest, another one takes its place.
                    if let Some(&(_, nearest)) = all.first() {
                        sorted.nearest((x, y), reach, Some(nearest), &mut found);
                        assert!(found != all && found.iter().all(|near| near.1 != nearest));
                    }
                }
            }
        }
    }
}
