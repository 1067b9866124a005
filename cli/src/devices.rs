//! `mrfgs devices` and `mrfgs --version`.

use std::fmt::Write;

use mrfgs::Result;
use mrfgs::backend::gpu;

pub(super) fn run() -> Result<()> {
    let devices = gpu::devices();
    let mut out = String::new();
    for device in &devices {
        let _ = writeln!(
            out,
            "{:>2}  {} ({}, {}{})",
            device.index,
            device.name,
            device.kind,
            device.api,
            if device.software { ", software: `auto` does not take it" } else { "" }
        );
        if !device.driver.is_empty() {
            let _ = writeln!(out, "    driver: {}", device.driver);
        }
        let _ = writeln!(
            out,
            "    largest buffer {}, largest binding {}",
            crate::bytes(device.max_buffer),
            crate::bytes(device.max_binding)
        );
    }
    let _ = match devices.iter().find(|d| d.automatic) {
        Some(device) => writeln!(out, "`auto` takes {}: {}", device.index, device.name),
        None if devices.is_empty() => {
            writeln!(out, "no Vulkan or Metal driver found: `auto` takes the CPU path")
        }
        None => writeln!(out, "`auto` takes the CPU path"),
    };
    crate::print(&out)
}

/// The version of wgpu that Cargo.toml asks for.
const WGPU: &str = "30";

/// What a report of a bug should begin with: the versions of the program, of wgpu and of every driver.
pub(super) fn print_versions() -> Result<()> {
    let mut out = format!("mrfgs {}\nwgpu {WGPU}\n", env!("CARGO_PKG_VERSION"));
    for device in gpu::devices() {
        let driver = if device.driver.is_empty() { "unknown" } else { &device.driver };
        let _ = writeln!(out, "device {}: {}, {}, driver {driver}", device.index, device.name, device.api);
    }
    crate::print(&out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_of_wgpu_is_that_of_the_manifest() {
        let manifest: toml::Table = include_str!("../../Cargo.toml").parse().unwrap();
        assert_eq!(manifest["dependencies"]["wgpu"]["version"].as_str(), Some(WGPU));
    }
}
