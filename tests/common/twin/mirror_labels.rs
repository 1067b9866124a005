use super::Finest;

/// Copies the mirrored labels of the left view to the right view.
pub fn mirror_labels(maps: &mut Finest) {
    let (width, height) = maps.label.size();
    for y in 0..height {
        for x in 0..width {
            maps.right_label[(x, y)] = maps.label[(width - 1 - x, y)];
            maps.right_best[(x, y)] = maps.best[(width - 1 - x, y)];
        }
    }
}
