//! Adapters: listing them, and choosing one.

use crate::error::{DeviceError, ExecutionError, Result};
use crate::process;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

/// An adapter as listed by `mrfgs devices`.
#[cfg(not(target_arch = "wasm32"))]
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct DeviceInfo {
    /// Position in the list, which `--device` accepts like a part of the name.
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
    /// Largest part of a buffer that a shader can bind, in bytes.
    pub max_binding: u64,
    /// Whether it is a software driver, which `auto` never chooses.
    pub software: bool,
    /// Whether `auto` chooses this one.
    pub automatic: bool,
}

/// The first process that listed adapters, or 0. Threads, locks and connections do not survive forks.
static ASKED_BY: AtomicU32 = AtomicU32::new(0);

/// Whether the last listing had no adapter for `auto`.
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
        // Above this share of the reported memory, allocations fail instead of evicting other buffers.
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
    // A browser offers only one adapter for each request.
    let wanted = wgpu::RequestAdapterOptions {
        power_preference: wgpu::PowerPreference::HighPerformance,
        ..Default::default()
    };
    instance.request_adapter(&wanted).await.into_iter().collect()
}

/// Keeps the driver libraries loaded for the life of the process. The last instance would unload them, but
/// threads that used them call into them when they end, which is a segmentation fault with NVIDIA's driver.
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

/// The kinds of devices with their names, preferred ones first.
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

/// Whether `auto` may choose this adapter. Browsers do not report the kind of a GPU.
fn is_automatic(info: &wgpu::AdapterInfo) -> bool {
    let in_browser = info.backend == wgpu::Backend::BrowserWebGpu;
    preference(info.device_type) <= if in_browser { 3 } else { 1 }
}

/// All adapters of this machine by index; empty without a driver.
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

/// The adapter that `wanted` names by index or part of its name; the preferred one if `None`.
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
    // Device nodes of kernel graphics, NVIDIA, WSL, Arm, Qualcomm and Imagination.
    const NODES: [&str; 9] = ["dri", "nvidia", "nvhost", "nvgpu", "nvmap", "dxg", "mali", "kgsl", "pvr"];
    if !cfg!(target_os = "linux") {
        return true;
    }
    let Ok(entries) = std::fs::read_dir("/dev") else { return true };
    let mut names = entries.flatten().map(|entry| entry.file_name());
    names.any(|name| NODES.iter().any(|node| name.to_string_lossy().starts_with(node)))
}

/// Whether `auto` finds a suitable device. Without a GPU the driver is not loaded, because a loader that
/// finds no display may print to standard error.
#[cfg(not(target_arch = "wasm32"))]
#[must_use]
pub fn has_automatic() -> bool {
    pollster::block_on(has_automatic_async())
}

/// Like `has_automatic`, for browsers.
pub(crate) async fn has_automatic_async() -> bool {
    if !may_have_gpu() {
        return false;
    }
    // If drivers cannot be used again, opening the device reports why.
    let _ = adapters().await;
    !NONE_AUTOMATIC.load(Ordering::Acquire)
}
