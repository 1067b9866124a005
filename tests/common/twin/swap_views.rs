use super::Finest;

/// Exchanges and mirrors the labels of the two views.
pub fn swap_views(maps: &mut Finest) {
    let old = maps.clone();
    let (width, height) = old.label.size();
    for y in 0..height {
        for x in 0..width {
            let from = (width - 1 - x, y);
            maps.label[(x, y)] = old.right_label[from];
            maps.best[(x, y)] = old.right_best[from];
            maps.runner_up[(x, y)] = 65_535;
            maps.right_label[(x, y)] = old.label[from];
            maps.right_best[(x, y)] = old.best[from];
        }
    }
}
