use super::Finest;
use mrfgs::image::Plane;
use mrfgs::low_level::plan::Plan;
use mrfgs::maps::flag;

/// Flags ties, where the runner-up equals the optimum, and small regions of the other pixels. Every pixel
/// starts as its own region; touching regions take the smaller number until nothing changes.
pub fn speckle_filter(plan: &Plan, maps: &mut Finest) {
    let (width, height) = plan.size();
    for y in 0..height {
        for x in 0..width {
            let at = (x, y);
            if maps.validity[at] == 0 && maps.runner_up[at] - maps.best[at] == 0 {
                maps.validity[at] = i32::from(flag::TIE);
            }
        }
    }
    let mut region = Plane::from_fn(width, height, |x, y| y * width + x);
    let connected = |a: (usize, usize), b: (usize, usize)| {
        maps.validity[a] == 0 && maps.validity[b] == 0 && (maps.label[a] - maps.label[b]).abs() <= 1
    };
    loop {
        let mut changed = false;
        for y in 0..height {
            for x in 0..width {
                for other in [(x + 1, y), (x, y + 1)] {
                    if other.0 >= width || other.1 >= height || !connected((x, y), other) {
                        continue;
                    }
                    let smaller = region[(x, y)].min(region[other]);
                    changed |= region[(x, y)] != region[other];
                    (region[(x, y)], region[other]) = (smaller, smaller);
                }
            }
        }
        if !changed {
            break;
        }
    }
    let mut members = vec![0; width * height];
    for &r in region.data() {
        members[r] += 1;
    }
    for (validity, &r) in maps.validity.data_mut().iter_mut().zip(region.data()) {
        if *validity == 0 && members[r] < plan.method.refinement.speckle_size {
            *validity |= i32::from(flag::SPECKLE);
        }
    }
}
