//! `mrfgs devices`.

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
            super::bytes(device.max_buffer),
            super::bytes(device.max_binding)
        );
    }
    let _ = match devices.iter().find(|d| d.automatic) {
        Some(device) => writeln!(out, "`auto` takes {}: {}", device.index, device.name),
        None if devices.is_empty() => {
            writeln!(out, "no Vulkan or Metal driver found: `auto` takes the CPU path")
        }
        None => writeln!(out, "`auto` takes the CPU path"),
    };
    super::print(&out)
}
