use super::fill::invalid;
use mrfgs::image::Plane;
use mrfgs::refine::flag;

/// Flags small regions. Every pixel starts as its own region; regions that touch take the smaller number until
/// nothing changes.
pub fn region_filter(disparity: &Plane<i32>, flags: &mut Plane<u8>, size: usize) {
    let (width, height) = disparity.size();
    let mut region = Plane::from_fn(width, height, |x, y| y * width + x);
    let connected = |flags: &Plane<u8>, a: (usize, usize), b: (usize, usize)| {
        let step = i64::from(disparity[a]) - i64::from(disparity[b]);
        !invalid(flags[a]) && !invalid(flags[b]) && step.abs() <= 256
    };
    loop {
        let mut changed = false;
        for y in 0..height {
            for x in 0..width {
                for other in [(x + 1, y), (x, y + 1)] {
                    if other.0 >= width || other.1 >= height || !connected(flags, (x, y), other) {
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
    for (flags, &r) in flags.data_mut().iter_mut().zip(region.data()) {
        if !invalid(*flags) && members[r] < size {
            *flags |= flag::SMALL_REGION;
        }
    }
}
