//! Connected regions of clusters.

use crate::image::Plane;

/// The zone of masked pixels, which does not count.
pub const MASKED: u32 = u32::MAX;

/// A segmentation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Zones {
    /// Zone of each pixel, 0 .. `count` in the order of their first pixels, or [`MASKED`].
    pub map: Plane<u32>,
    /// Number of zones.
    pub count: usize,
}

/// The connected regions of `clusters`: two pixels are in one region if a path of neighbours (above, below,
/// left, right) of the same cluster joins them. [`MASKED`] pixels stay masked.
#[must_use]
pub fn connected(clusters: &Plane<u32>) -> Zones {
    let (width, height) = clusters.size();
    let mut map = Plane::filled(width, height, MASKED);
    let mut count = 0;
    let mut edge = Vec::new();
    // A pixel that has no region yet starts the next one.
    for first in 0..width * height {
        let cluster = clusters.data()[first];
        if cluster == MASKED || map.data()[first] != MASKED {
            continue;
        }
        edge.push(first);
        map.data_mut()[first] = count;
        while let Some(i) = edge.pop() {
            let (x, y) = (i % width, i / width);
            let neighbours = [
                (y > 0).then(|| i - width),
                (x > 0).then(|| i - 1),
                (x + 1 < width).then_some(i + 1),
                (y + 1 < height).then_some(i + width),
            ];
            for i in neighbours.into_iter().flatten() {
                if clusters.data()[i] == cluster && map.data()[i] == MASKED {
                    map.data_mut()[i] = count;
                    edge.push(i);
                }
            }
        }
        count += 1;
    }
    Zones { map, count: count as usize }
}
