//! Every backend that this machine can run, for tests that hold each of them to the twins.

use mrfgs::backend::Backend;
use mrfgs::backend::cpu::Cpu;

/// Name and a fresh instance of every backend.
///
/// The twins are no backend and never in this list: a backend that were compared with itself would always pass.
pub fn backends() -> Vec<(String, Box<dyn Backend>)> {
    let all: Vec<(String, Box<dyn Backend>)> = vec![("cpu".into(), Box::new(Cpu::default()))];
    // GPU: push one entry for each usable adapter here, and print the ones that are left out, with the reason.
    assert!(!all.is_empty());
    all
}
