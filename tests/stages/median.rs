//! The weighted median, and its weights.

use crate::common::random::{self, Random};
use crate::common::twin::{self, Finest};
use crate::maps::on_maps;
use mrfgs::low_level::backend::Stage;
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::weights::MedianWeights;
use mrfgs::options::{Median, Method};

/// Random parameters of the median.
pub(crate) fn any_method(random: &mut Random, method: &mut Method) {
    method.refinement.median = random.pick(&[Median::Off, Median::Filled, Median::All, Median::All]);
    method.refinement.median_sigma_space = random.log_within(0.1, 100.0);
    method.refinement.median_sigma_range = random.log_within(0.001, 10.0);
    method.refinement.median_window = random.pick(&[3, 5, 15, 31]);
}

/// Random maps, sometimes with disparities that are extremely far apart.
pub(crate) fn any_maps(random: &mut Random, plan: &Plan) -> Finest {
    let mut maps = random::finest(random, plan, true);
    if random.one_in(4) {
        for d in maps.disparity.data_mut() {
            *d = random.within(0, 1 << 29) as i32 - (1 << 28);
        }
    }
    maps
}

#[test]
fn median() {
    on_maps(Stage::Median, 30, any_method, any_maps, twin::median::median);
}

#[test]
fn median_weights() {
    let mut random = Random::new(4);
    for _ in 0..300 {
        let (space, range) = (random.log_within(0.1, 100.0), random.log_within(0.001, 10.0));
        let weights = MedianWeights::new(31, space, range);
        let words = weights.words();
        for dy in 0..16 {
            for dx in 0..16 {
                let taken = twin::median::space(dx, dy, space);
                assert_eq!(i64::from(words[(16 * dy + dx) as usize]), taken, "({dx}, {dy}); sigma {space}");
                let row = weights.space_row(dy as usize);
                assert!(row[(15 + dx) as usize] == row[(15 - dx) as usize]);
                assert_eq!(i64::from(row[(15 + dx) as usize]), taken);
            }
        }
        for _ in 0..200 {
            let spread = random.pick(&[300, 5000, 65_535]);
            let [a, b] = [0; 2].map(|_: i32| [0; 4].map(|_: i32| random.within(0, spread) as u16));
            let guide = |channel: u16| (u32::from(channel) * weights.scale) >> 16;
            let apart: u32 = (0..3).map(|c| guide(a[c]).abs_diff(guide(b[c]))).sum();
            let taken = twin::median::colour(a, b, range);
            assert_eq!(i64::from(apart << weights.doublings), taken, "{a:?}, {b:?}; sigma {range}");
            // By definition, all weight is lost at a difference of 1270 sigmas in 8-bit levels.
            let levels: f64 = (0..3).map(|c| f64::from(a[c].abs_diff(b[c])) / 256.0).sum();
            let exact = 127.0 * levels / (1270.0 * range);
            let step = f64::from(1 << weights.doublings);
            let in_range = range > 0.001 && range < 20.0;
            let error = 3.0 * step + exact * 0.5 / f64::from(weights.scale);
            assert!(!in_range || (taken as f64 - exact).abs() <= error, "{taken} against {exact}");
        }
    }
}
