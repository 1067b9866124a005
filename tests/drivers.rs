//! Drivers stay loaded after the last device is dropped, because threads that used one call it again when they exit.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

mod common;

use mrfgs::low_level::backend::gpu::FaultInjection;
use std::collections::BTreeSet;

/// The shared libraries that this process has loaded.
fn libraries() -> BTreeSet<String> {
    let maps = std::fs::read_to_string("/proc/self/maps").unwrap();
    let files = maps.lines().filter_map(|line| line.split_whitespace().nth(5));
    files.filter(|file| file.contains(".so")).map(str::to_owned).collect()
}

// This must be the only test in this process, so that no other test holds a device.
#[test]
fn drivers_outlive_their_devices() {
    let before = libraries();
    let Some(gpu) = common::devices::open(FaultInjection::default()) else { return };
    let with: BTreeSet<_> = libraries().difference(&before).cloned().collect();
    assert!(with.iter().any(|file| file.contains("libvulkan.so")), "control: {with:?}");
    std::thread::spawn(move || drop(gpu)).join().unwrap();
    let gone: Vec<_> = with.difference(&libraries()).cloned().collect();
    assert!(gone.is_empty(), "unloaded: {gone:?}");
}
