//! Adapters: listing them, and choosing one.

use crate::error::{DeviceError, ExecutionError, Result};
use crate::process;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

/// An adapter, as `mrfgs devices` lists it.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct DeviceInfo {
    /// Position in the list, which `--device` accepts besides a part of the name.
    pub index: usize,
    /// Name given by its driver.
    pub name: String,
    /// Discrete GPU, integrated GPU, virtual GPU, software, or other.
    pub kind: &'static str,
    /// Vulkan, Metal or WebGPU.
    pub api: &'static str,
    /// Driver and its version, as far as the adapter reports them.
    pub driver: String,
    /// Largest buffer, in bytes.
    pub max_buffer: u64,
    /// Largest range of a buffer that a shader can see at once, in bytes.
    pub max_binding: u64,
    /// Whether it is a software driver, which `auto` does not choose.
    pub software: bool,
    /// Whether `auto` chooses this one.
    pub automatic: bool,
}

/// The process that has asked the drivers first; 0 before. Drivers have threads, locks and connections, which no process that is forked
/// takes along.
static ASKED_BY: AtomicU32 = AtomicU32::new(0);

/// Whether they have said that there is nothing for `auto`.
static NONE_AUTOMATIC: AtomicBool = AtomicBool::new(false);

async fn adapters() -> Result<Vec<wgpu::Adapter>> {
    let (id, asked) =
        (process::id(), ASKED_BY.compare_exchange(0, process::id(), Ordering::AcqRel, Ordering::Acquire));
    if asked.is_err_and(|first| first != id) {
        return Err(DeviceError::Forked.into());
    }
    let backends = wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::BROWSER_WEBGPU;
    let adapters = adapters_of(backends).await;
    let any = adapters.iter().any(|adapter| is_automatic(&adapter.get_info()));
    NONE_AUTOMATIC.store(!any, Ordering::Release);
    Ok(adapters)
}

pub(super) async fn adapters_of(backends: wgpu::Backends) -> Vec<wgpu::Adapter> {
    let mut descriptor = wgpu::InstanceDescriptor {
        backends,
        flags: wgpu::InstanceFlags::empty(),
        // Above this share of the memory that the driver reports, allocations are refused instead of evicting
        // others' buffers.
        memory_budget_thresholds: wgpu::MemoryBudgetThresholds {
            for_resource_creation: Some(95),
            for_device_loss: None,
        },
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    };
    descriptor.backend_options.noop.enable = backends.contains(wgpu::Backends::NOOP);
    let instance = wgpu::Instance::new(descriptor);
    if !cfg!(target_arch = "wasm32") {
        if !backends.contains(wgpu::Backends::NOOP) {
            keep_drivers(&instance);
        }
        return instance.enumerate_adapters(backends).await;
    }
    // A browser shows one of its adapters, the one that is asked for.
    let wanted = wgpu::RequestAdapterOptions {
        power_preference: wgpu::PowerPreference::HighPerformance,
        ..Default::default()
    };
    instance.request_adapter(&wanted).await.into_iter().collect()
}

/// Keeps the libraries of the drivers for as long as the process lives. With the last instance they would be unloaded, and threads that
/// have used them call them once more when they end: with NVIDIA's driver that is a segmentation fault.
fn keep_drivers(instance: &wgpu::Instance) {
    static KEPT: OnceLock<wgpu::Instance> = OnceLock::new();
    KEPT.get_or_init(|| instance.clone());
}

pub(super) fn api(backend: wgpu::Backend) -> &'static str {
    match backend {
        wgpu::Backend::Vulkan => "Vulkan",
        wgpu::Backend::Metal => "Metal",
        wgpu::Backend::BrowserWebGpu => "WebGPU",
        _ => "other",
    }
}

/// Driver and version, as far as the adapter reports them.
pub(super) fn driver(info: &wgpu::AdapterInfo) -> String {
    format!("{} {}", info.driver, info.driver_info).trim().to_owned()
}

/// The kinds of devices with their names, the preferred ones first.
const KINDS: [(wgpu::DeviceType, &str); 5] = [
    (wgpu::DeviceType::DiscreteGpu, "discrete GPU"),
    (wgpu::DeviceType::IntegratedGpu, "integrated GPU"),
    (wgpu::DeviceType::VirtualGpu, "virtual GPU"),
    (wgpu::DeviceType::Other, "other"),
    (wgpu::DeviceType::Cpu, "software"),
];

/// Rank of a kind of device in [`KINDS`].
fn preference(device_type: wgpu::DeviceType) -> usize {
    KINDS.iter().take_while(|kind| kind.0 != device_type).count()
}

/// Position of the preferred adapter, the first one on a tie.
fn preferred(adapters: &[wgpu::Adapter]) -> Option<usize> {
    (0..adapters.len()).min_by_key(|&i| preference(adapters[i].get_info().device_type))
}

/// Whether `auto` would take this adapter. A browser does not say of what kind a GPU is.
fn is_automatic(info: &wgpu::AdapterInfo) -> bool {
    let in_browser = info.backend == wgpu::Backend::BrowserWebGpu;
    preference(info.device_type) <= if in_browser { 3 } else { 1 }
}

/// Every adapter of this machine, in the order of their indices. Empty where there is no driver.
#[cfg(not(target_arch = "wasm32"))]
#[must_use]
pub fn devices() -> Vec<DeviceInfo> {
    let adapters = pollster::block_on(adapters()).unwrap_or_default();
    let preferred = preferred(&adapters);
    adapters
        .iter()
        .enumerate()
        .map(|(index, adapter)| {
            let (info, limits) = (adapter.get_info(), adapter.limits());
            DeviceInfo {
                index,
                kind: KINDS[preference(info.device_type)].1,
                api: api(info.backend),
                driver: driver(&info),
                max_buffer: limits.max_buffer_size,
                max_binding: limits.max_storage_buffer_binding_size,
                software: info.device_type == wgpu::DeviceType::Cpu,
                automatic: preferred == Some(index) && is_automatic(&info),
                name: info.name,
            }
        })
        .collect()
}

/// The adapter that `wanted` names by its index or a part of its name, or the preferred one.
pub(super) async fn select(wanted: Option<&str>) -> Result<wgpu::Adapter> {
    let mut adapters = adapters().await?;
    if adapters.is_empty() {
        return Err(DeviceError::NoDriver.into());
    }
    let place = match wanted {
        None => preferred(&adapters),
        Some(wanted) => {
            let named = || {
                adapters.iter().position(|a| {
                    a.get_info().name.to_lowercase().contains(&wanted.to_lowercase()) && !wanted.is_empty()
                })
            };
            wanted.parse::<usize>().ok().filter(|&i| i < adapters.len()).or_else(named)
        }
    };
    if let Some(place) = place {
        return Ok(adapters.swap_remove(place));
    }
    let present = adapters.iter().enumerate().map(|(i, a)| format!("{i}: {}", a.get_info().name)).collect();
    Err(ExecutionError::NoSuchDevice { wanted: wanted.unwrap_or_default().into(), present }.into())
}

/// Whether there may be a GPU. On Linux every GPU driver has a node in `/dev`; elsewhere only the driver
/// knows.
#[must_use]
pub fn may_have_gpu() -> bool {
    // The kernel's graphics, NVIDIA, WSL, Arm, Qualcomm, Imagination.
    const NODES: [&str; 9] = ["dri", "nvidia", "nvhost", "nvgpu", "nvmap", "dxg", "mali", "kgsl", "pvr"];
    if !cfg!(target_os = "linux") {
        return true;
    }
    let Ok(entries) = std::fs::read_dir("/dev") else { return true };
    let mut names = entries.flatten().map(|entry| entry.file_name());
    names.any(|name| NODES.iter().any(|node| name.to_string_lossy().starts_with(node)))
}

/// Whether `auto` finds a suitable device. Where there is no GPU the driver is not asked, because a loader
/// that finds no display may print to standard error.
#[cfg(not(target_arch = "wasm32"))]
#[must_use]
pub fn has_automatic() -> bool {
    pollster::block_on(has_automatic_async())
}

/// As `has_automatic`, for a browser.
pub async fn has_automatic_async() -> bool {
    if !may_have_gpu() {
        return false;
    }
    // Where they cannot be asked once more, whoever opens the device is told why.
    let _ = adapters().await;
    !NONE_AUTOMATIC.load(Ordering::Acquire)
}
