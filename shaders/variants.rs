//! Every variant of every shader, by trying all options: for tests of shaders, `scripts/isa` and
//! `scripts/check-wgsl`.

use mrfgs::low_level::backend::Stage;
use mrfgs::low_level::backend::gpu;
use mrfgs::low_level::plan::Plan;
use mrfgs::options::{DisparityRange, GROUPS, Key, Method, PRESETS, Takes};
use std::collections::HashSet;

/// Values of an option: all words, the ends of whole numbers, and five values of real numbers.
fn values(key: &Key) -> Vec<String> {
    match key.takes {
        Takes::Switch => vec!["false".into(), "true".into()],
        Takes::Words(words) => words.iter().map(|word| word.word.into()).collect(),
        Takes::Whole { low, high, .. } => vec![low.to_string(), high.to_string()],
        Takes::Real { low, high } => {
            (0..=4).map(|i| (low + f64::from(i) * (high - low) / 4.0).to_string()).collect()
        }
    }
}

/// A plan for every preset, the default first, with and without a prior, and for every change of one or two of its options. The
/// constants of a kernel depend on few options each, so this covers all variants.
pub(crate) fn plans() -> Vec<Plan> {
    let keys = GROUPS.iter().flat_map(|group| group.keys);
    let changes: Vec<(String, String)> =
        keys.flat_map(|key| values(key).into_iter().map(|value| (key.name(), value))).collect();
    let range = DisparityRange::new(-20, 43).expect("a range");
    let mut plans = Vec::new();
    for preset in PRESETS {
        let preset = preset.method();
        let plan = |method: &Method| Plan::new(101, 67, range, method).expect("a valid method");
        // A prior adds stages.
        plans.extend([plan(&preset), plan(&preset).with_prior(true)]);
        for (i, (key, value)) in changes.iter().enumerate() {
            for (other, other_value) in &changes[i..] {
                let mut method = preset.clone();
                // Some values cannot be combined.
                if method.set_all([(&**key, &**value), (&**other, &**other_value)]).is_ok() {
                    plans.push(plan(&method));
                }
            }
        }
    }
    plans
}

/// The kernels of `plans`, each shader once.
pub(crate) fn kernels(plans: &[Plan]) -> Vec<gpu::Kernel> {
    let mut seen = HashSet::new();
    let kernels = plans.iter().flat_map(|plan| {
        let of_stages = Stage::all(plan).into_iter().flat_map(|stage| gpu::kernels(stage, plan));
        of_stages.chain(gpu::other_kernels(plan))
    });
    kernels.filter(|kernel| seen.insert(kernel.shader.clone())).collect()
}
