//! The nearest of many points in the plane.

/// The number of neighbours that count.
pub(super) const COUNT: usize = 8;

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
        points.iter().for_each(|point| starts[cell_of(point) + 1] += 1);
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

    /// The up to [`COUNT`] points nearest to (x, y), at most `reach` px away, nearest first, those of lower index first on ties.
    /// Cells are visited in squares around the point, until no cell can hold a nearer one.
    pub(super) fn nearest(&self, (x, y): (i32, i32), reach: i32, found: &mut Vec<Neighbour>) {
        found.clear();
        let (column, row) = (x.div_euclid(self.cell), y.div_euclid(self.cell));
        let rings = reach / self.cell + 1;
        for ring in 0..=rings {
            // Points of this square and beyond are at least this far away.
            let least = (ring - 1).max(0) * self.cell;
            if found.len() == COUNT && found[COUNT - 1].0 <= (least * least).cast_unsigned() {
                break;
            }
            for v in row - ring..=row + ring {
                let is_edge = (v - row).abs() == ring;
                let step = if is_edge || ring == 0 { 1 } else { 2 * ring };
                for u in (column - ring..=column + ring).step_by(step as usize) {
                    if (0..self.columns).contains(&u) && (0..self.rows).contains(&v) {
                        self.add_cell((v * self.columns + u) as usize, (x, y), reach, found);
                    }
                }
            }
        }
    }

    fn add_cell(&self, cell: usize, (x, y): (i32, i32), reach: i32, found: &mut Vec<Neighbour>) {
        for &i in &self.order[self.starts[cell] as usize..self.starts[cell + 1] as usize] {
            let (px, py) = self.points[i as usize];
            let squared = ((px - x).pow(2) + (py - y).pow(2)).cast_unsigned();
            if squared > reach.pow(2).cast_unsigned() {
                continue;
            }
            let place = found.partition_point(|other| *other < (squared, i));
            if place < COUNT {
                found.truncate(COUNT - 1);
                found.insert(place, (squared, i));
            }
        }
    }
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
            for reach in [9_i32, 40] {
                for _ in 0..200 {
                    let (x, y) = (random(size.0), random(size.1));
                    let squared = |p: &(i32, i32)| ((p.0 - x).pow(2) + (p.1 - y).pow(2)).cast_unsigned();
                    let mut all: Vec<Neighbour> =
                        points.iter().zip(0..).map(|(p, i)| (squared(p), i)).collect();
                    all.retain(|near| near.0 <= reach.pow(2).cast_unsigned());
                    all.sort_unstable();
                    all.truncate(COUNT);
                    let mut found = Vec::new();
                    sorted.nearest((x, y), reach, &mut found);
                    assert_eq!(found, all);
                }
            }
        }
    }
}
