//! `mrfgs devices` and `mrfgs --version`.

use std::fmt::Write;

use mrfgs::Result;
use mrfgs::low_level::backend::gpu;

use crate::console;
use crate::process::quiet_loader;
use crate::table::Table;
use crate::text::bytes;

pub(crate) fn run() -> Result<()> {
    quiet_loader();
    let devices = gpu::devices();
    let mut out = String::new();
    if !devices.is_empty() {
        let mut table = Table::new("r|l|l|l|l|r|r");
        table.row(["", "name", "kind", "API", "driver", "largest buffer", "largest binding"]);
        table.rule();
        for device in &devices {
            table.row([
                device.index.to_string(),
                device.name.clone(),
                device.kind.to_string(),
                device.api.to_string(),
                device.driver.clone(),
                bytes(device.max_buffer),
                bytes(device.max_binding),
            ]);
        }
        let _ = writeln!(out, "{table}");
    }
    let _ = match devices.iter().find(|d| d.automatic) {
        Some(device) => writeln!(out, "`auto` uses {}: {}", device.index, device.name),
        None if devices.is_empty() => {
            writeln!(out, "no Vulkan or Metal driver found: `auto` uses the CPU")
        }
        None => writeln!(out, "`auto` uses the CPU"),
    };
    console::print(&out)
}

/// The version of wgpu in Cargo.toml.
const WGPU: &str = "30";

/// Prints what a bug report should include: the versions of the program, wgpu and every driver.
pub(crate) fn print_versions() -> Result<()> {
    quiet_loader();
    let mut out = format!("mrfgs {}\nwgpu {WGPU}\n", env!("CARGO_PKG_VERSION"));
    for device in gpu::devices() {
        let driver = if device.driver.is_empty() { "unknown" } else { &device.driver };
        let _ = writeln!(out, "device {}: {}, {}, driver {driver}", device.index, device.name, device.api);
    }
    console::print(&out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_of_wgpu_is_that_of_the_manifest() {
        let manifest: toml::Table = include_str!("../../../Cargo.toml").parse().unwrap();
        assert_eq!(manifest["dependencies"]["wgpu"]["version"].as_str(), Some(WGPU));
    }
}
