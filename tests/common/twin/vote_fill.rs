use super::Finest;
use super::fill::invalid;
use super::median::filled;
use mrfgs::image::Pair;
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::plan::votes::{
    HIDING_LABELS, VOTE_AWAY, VOTE_BITS, VOTE_FRACTION_BITS, VOTE_HIDING, VOTE_MOST, VOTE_OUTVOTES,
    VOTE_REACH, VOTE_SHIFT, VOTE_SURE,
};
use mrfgs::maps::flag;
use mrfgs::options::{Fill, Nearer};

/// A half-size pixel: column and row.
type Half = (usize, usize);

/// The votes of half-size pixels on the maps from before the stage.
struct Votes<'a> {
    plan: &'a Plan,
    pair: &'a Pair,
    maps: &'a Finest,
    /// The label that the right view sees, by row and column.
    shown: Vec<Vec<Option<usize>>>,
}

/// Whether a pixel is valid and confident.
fn sure(maps: &Finest, at: (usize, usize)) -> bool {
    !invalid(maps.validity[at]) && maps.confidence[at] >= VOTE_SURE as i32
}

/// Filled pixels take the vote of the most similar half-size pixel, and outvoted ones that of their own.
pub fn vote_fill(plan: &Plan, pair: &Pair, maps: &mut Finest) {
    if plan.method.refinement.fill != Fill::Votes {
        return;
    }
    let before = maps.clone();
    let (width, height) = maps.disparity.size();
    let mut votes = Votes { plan, pair, maps: &before, shown: Vec::new() };
    votes.shown = (0..height).map(|y| votes.shown(y)).collect();
    let rows: Vec<Vec<Vec<u64>>> = (0..height.div_ceil(2)).map(|y| votes.along_row(y)).collect();
    let elected: Vec<Vec<Option<i64>>> =
        (0..rows.len()).map(|y| (0..rows[y].len()).map(|x| votes.vote(&rows, (x, y))).collect()).collect();
    for y in 0..height {
        for x in 0..width {
            let at = (x, y);
            if !filled(before.validity[at]) {
                let vote =
                    elected[y / 2][x / 2].filter(|_| !invalid(before.validity[at]) && !sure(&before, at));
                if let Some(vote) =
                    vote.filter(|vote| (vote - i64::from(before.disparity[at])).abs() > VOTE_OUTVOTES.into())
                {
                    maps.disparity[at] = vote as i32;
                    maps.validity[at] = i32::from(flag::OUTVOTED | flag::FILLED);
                    maps.confidence[at] = 0;
                }
                continue;
            }
            let own = votes.colour(x, y);
            let mut best: Option<(i64, i64)> = None;
            for (j, row) in (y / 2..).take(3).enumerate() {
                for (i, column) in (x / 2..).take(3).enumerate() {
                    // Rows and columns start one above and one to the left.
                    let (Some(row), Some(column)) = (row.checked_sub(1), column.checked_sub(1)) else {
                        continue;
                    };
                    let Some(Some(vote)) = elected.get(row).and_then(|r| r.get(column)) else { continue };
                    let away = i64::from(VOTE_AWAY) * (i.abs_diff(1) + j.abs_diff(1)) as i64;
                    let unlike = difference(own, votes.half((column, row))) + away;
                    if best.is_none_or(|(least, _)| unlike < least) {
                        best = Some((unlike, *vote));
                    }
                }
            }
            if let Some((_, vote)) = best {
                maps.disparity[(x, y)] = vote as i32;
            }
        }
    }
}

fn difference(a: [i64; 3], b: [i64; 3]) -> i64 {
    (0..3).map(|c| (a[c] - b[c]).abs()).sum()
}

impl Votes<'_> {
    fn colour(&self, x: usize, y: usize) -> [i64; 3] {
        let pixel = self.pair.left().pixels[(x, y)];
        [0, 1, 2].map(|c| i64::from(pixel[c]) / 256)
    }

    fn half(&self, (x, y): Half) -> [i64; 3] {
        let (width, height) = self.pair.size();
        let pixels = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| (2 * x + i, 2 * y + j));
        let inside = pixels.into_iter().filter(|&(x, y)| x < width && y < height);
        let colours: Vec<_> =
            inside.filter(|&at| !self.pair.left().masked[at]).map(|(x, y)| self.colour(x, y)).collect();
        let count = colours.len() as i64;
        let mean = |c: usize| (2 * colours.iter().map(|colour| colour[c]).sum::<i64>() + count) / (2 * count);
        if count == 0 { [0; 3] } else { [0, 1, 2].map(mean) }
    }

    fn labels(&self) -> usize {
        self.plan.levels[0].labels
    }

    /// Whether label `k` of a pixel is nearer than `j`, by at least `by` labels.
    fn nearer(&self, k: usize, j: usize, by: usize) -> bool {
        match self.plan.method.refinement.nearer {
            Nearer::Larger => k >= j + by,
            Nearer::Smaller => k + by <= j,
        }
    }

    /// Column of the right view to which label `k` of column `x` projects.
    fn column(&self, k: usize, x: usize) -> Option<usize> {
        let column = usize::try_from(x as i64 - i64::from(self.plan.range.min) - k as i64);
        column.ok().filter(|&column| column < self.pair.size().0)
    }

    /// The nearest label that confident pixels of row `y` show in each column of the right view.
    fn shown(&self, y: usize) -> Vec<Option<usize>> {
        let mut shown: Vec<Option<usize>> = vec![None; self.pair.size().0];
        for x in (0..shown.len()).filter(|&x| sure(self.maps, (x, y))) {
            let label = self.maps.label[(x, y)] as usize;
            let Some(column) = self.column(label, x) else { continue };
            if shown[column].is_none_or(|other| self.nearer(label, other, 0)) {
                shown[column] = Some(label);
            }
        }
        shown
    }

    /// Whether label `k` at (x, y) would hide a label in the right view.
    fn hides(&self, k: usize, x: usize, y: usize) -> bool {
        let seen = self.column(k, x).and_then(|column| self.shown[y][column]);
        seen.is_some_and(|label| self.nearer(k, label, HIDING_LABELS as usize))
    }

    /// Votes of one half-size pixel, by label.
    fn own(&self, (x, y): Half) -> Vec<u64> {
        let (width, height) = self.pair.size();
        let of = |k: usize| {
            let mut sum = 0;
            for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let (x, y) = (2 * x + i, 2 * y + j);
                if x >= width || y >= height {
                    continue;
                }
                let validity = self.maps.validity[(x, y)];
                if !invalid(validity) {
                    let label = 256 * (i64::from(self.plan.range.min) + k as i64);
                    let away = (i64::from(self.maps.disparity[(x, y)]) - label).abs();
                    sum += (away.min(VOTE_MOST.into()) >> VOTE_BITS) as u64;
                } else if validity & i32::from(flag::MASKED) == 0 && self.hides(k, x, y) {
                    sum += u64::from(VOTE_HIDING);
                }
            }
            sum << VOTE_FRACTION_BITS
        };
        (0..self.labels()).step_by(2).map(of).collect()
    }

    /// Weight of the step between two half-size pixels, in 1/65536; `step` is the weight for equal colours.
    fn weight(&self, step: f64, a: Half, b: Half) -> u64 {
        let difference = difference(self.half(a), self.half(b)) as f64;
        (65536.0 * step * (-0.0345 * difference).exp()).round() as u64
    }

    /// Sums along row `y`, \[x\]\[label\].
    fn along_row(&self, y: usize) -> Vec<Vec<u64>> {
        let width = self.pair.size().0.div_ceil(2);
        let own: Vec<_> = (0..width).map(|x| self.own((x, y))).collect();
        let weight = |x: usize| self.weight(0.9895, (x - 1, y), (x, y));
        let (mut f, mut b) = (own.clone(), vec![vec![0; own[0].len()]; width]);
        for k in 0..own[0].len() {
            for x in 1..width {
                f[x][k] = own[x][k] + weight(x) * f[x - 1][k] / 65536;
            }
            for x in (1..width).rev() {
                b[x - 1][k] = weight(x) * (own[x][k] + b[x][k]) / 65536;
            }
        }
        let both = f.into_iter().zip(b);
        both.map(|(f, b)| f.into_iter().zip(b).map(|(f, b)| (f + b) >> VOTE_SHIFT).collect()).collect()
    }

    /// The vote of a half-size pixel, in 1/256 px.
    fn vote(&self, rows: &[Vec<Vec<u64>>], (x, y): Half) -> Option<i64> {
        let mut sums = rows[y][x].clone();
        for (k, sum) in sums.iter_mut().enumerate() {
            let mut from_above = 0;
            for row in y.saturating_sub(VOTE_REACH)..y {
                from_above =
                    self.weight(0.81, (x, row), (x, row + 1)) * (rows[row][x][k] + from_above) / 65536;
            }
            let mut from_below = 0;
            for row in (y + 1..rows.len().min(y + VOTE_REACH + 1)).rev() {
                from_below =
                    self.weight(0.81, (x, row), (x, row - 1)) * (rows[row][x][k] + from_below) / 65536;
            }
            *sum += from_above + from_below;
            assert!(u32::try_from(*sum).is_ok(), "sums fit in 32 bits");
        }
        let least = *sums.iter().min()?;
        if sums.iter().all(|&sum| sum == least) {
            return None;
        }
        let k = sums.iter().position(|&sum| sum == least)?;
        let mut offset = 0;
        if k > 0 && k + 1 < sums.len() {
            let (p, q) = (sums[k - 1] - least, sums[k + 1] - least);
            let halvings = (0..32).find(|bits| p.max(q) >> bits < 65536)?;
            let (p, q) = ((p >> halvings) as i64, (q >> halvings) as i64);
            let t = p.max(q);
            offset = if t == 0 { 0 } else { (512 * (p - q) + t).div_euclid(2 * t) };
        }
        Some(256 * (i64::from(self.plan.range.min) + 2 * k as i64) + offset)
    }
}
