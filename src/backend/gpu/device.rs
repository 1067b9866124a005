//! Adapters: which there are, which one to take, and a device on it that reports its failures.

use crate::error::{Error, Result};
use std::sync::{Arc, Mutex};

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

fn adapters() -> Vec<wgpu::Adapter> {
    let descriptor = wgpu::InstanceDescriptor {
        backends: wgpu::Backends::VULKAN | wgpu::Backends::METAL,
        flags: wgpu::InstanceFlags::empty(),
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    };
    let backends = descriptor.backends;
    pollster::block_on(wgpu::Instance::new(descriptor).enumerate_adapters(backends))
}

fn kind(device_type: wgpu::DeviceType) -> &'static str {
    match device_type {
        wgpu::DeviceType::DiscreteGpu => "discrete GPU",
        wgpu::DeviceType::IntegratedGpu => "integrated GPU",
        wgpu::DeviceType::VirtualGpu => "virtual GPU",
        wgpu::DeviceType::Cpu => "software",
        wgpu::DeviceType::Other => "other",
    }
}

fn api(backend: wgpu::Backend) -> &'static str {
    match backend {
        wgpu::Backend::Vulkan => "Vulkan",
        wgpu::Backend::Metal => "Metal",
        _ => "other",
    }
}

/// How much a kind of device is preferred, the least first.
fn preference(device_type: wgpu::DeviceType) -> u8 {
    match device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

/// Place of the preferred adapter; the first of equals.
fn preferred(adapters: &[wgpu::Adapter]) -> Option<usize> {
    (0..adapters.len()).min_by_key(|&i| preference(adapters[i].get_info().device_type))
}

/// Whether `auto` would take a device of this kind.
fn is_automatic(device_type: wgpu::DeviceType) -> bool {
    preference(device_type) <= 1
}

/// Every adapter of this machine, in the order of their indices. None where there is no driver.
#[must_use]
pub fn devices() -> Vec<DeviceInfo> {
    let adapters = adapters();
    let preferred = preferred(&adapters);
    adapters
        .iter()
        .enumerate()
        .map(|(index, adapter)| {
            let (info, limits) = (adapter.get_info(), adapter.limits());
            DeviceInfo {
                index,
                kind: kind(info.device_type),
                api: api(info.backend),
                driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
                max_buffer: limits.max_buffer_size,
                max_binding: limits.max_storage_buffer_binding_size,
                software: info.device_type == wgpu::DeviceType::Cpu,
                automatic: preferred == Some(index) && is_automatic(info.device_type),
                name: info.name,
            }
        })
        .collect()
}

/// The adapter that `wanted` names by index or part of the name, or the preferred one.
fn select(wanted: Option<&str>) -> Result<wgpu::Adapter> {
    let mut adapters = adapters();
    if adapters.is_empty() {
        return Err(Error::Device(
            "no Vulkan or Metal driver found: install the driver of the GPU, or a software one (Mesa's lavapipe), or \
             use --backend cpu"
                .into(),
        ));
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
    let names: Vec<_> =
        adapters.iter().enumerate().map(|(i, a)| format!("{i}: {}", a.get_info().name)).collect();
    Err(Error::option(
        "--device",
        format!(
            "no device is called `{}`; `mrfgs devices` lists {}",
            wanted.unwrap_or_default(),
            names.join(", ")
        ),
    ))
}

/// Whether `auto` finds a device to its taste.
#[must_use]
pub fn has_automatic() -> bool {
    adapters().iter().any(|a| is_automatic(a.get_info().device_type))
}

/// Limits that are kept below what a device offers: tests run the engine as if on a lesser device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ceiling {
    /// Largest binding in bytes.
    pub max_binding: Option<u64>,
}

/// An open device with its queue and the first failure it reported.
pub(super) struct Device {
    pub(super) inner: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) name: String,
    /// Whether its memory is the machine's own.
    pub(super) software: bool,
    pub(super) max_binding: u64,
    pub(super) max_buffer: u64,
    failure: Arc<Mutex<Option<String>>>,
}

impl Device {
    pub(super) fn open(wanted: Option<&str>, ceiling: Ceiling) -> Result<Self> {
        let adapter = select(wanted)?;
        let info = adapter.get_info();
        let offered = adapter.limits();
        let max_binding =
            offered.max_storage_buffer_binding_size.min(ceiling.max_binding.unwrap_or(u64::MAX));
        let required_limits = wgpu::Limits {
            max_buffer_size: offered.max_buffer_size,
            max_storage_buffer_binding_size: max_binding,
            ..wgpu::Limits::default()
        };
        let request = adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("mrfgs"),
            required_limits,
            ..Default::default()
        });
        let (device, queue) = pollster::block_on(request).map_err(|e| {
            Error::Device(format!(
                "{} cannot be opened: {e}; use another --device or --backend cpu",
                info.name
            ))
        })?;
        let failure = Arc::new(Mutex::new(None));
        let note = |failure: &Arc<Mutex<Option<String>>>| {
            let failure = Arc::clone(failure);
            move |reason: String| {
                if let Ok(mut failure) = failure.lock() {
                    failure.get_or_insert(reason);
                }
            }
        };
        let uncaptured = note(&failure);
        device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| uncaptured(e.to_string())));
        let lost = note(&failure);
        device.set_device_lost_callback(move |reason, message| {
            // Dropping the device says so too, when nobody listens any more.
            lost(format!("the device was lost ({reason:?}) {message}"));
        });
        Ok(Self {
            name: format!("{} ({})", info.name, api(info.backend)),
            software: info.device_type == wgpu::DeviceType::Cpu,
            max_binding: device.limits().max_storage_buffer_binding_size.min(max_binding),
            max_buffer: device.limits().max_buffer_size,
            inner: device,
            queue,
            failure,
        })
    }

    /// The first failure since the device was opened, if any.
    pub(super) fn check(&self) -> Result<()> {
        let failure = self.failure.lock().ok().and_then(|f| f.clone());
        match failure {
            None => Ok(()),
            Some(reason) => {
                let reason = reason.split_whitespace().collect::<Vec<_>>().join(" ");
                Err(Error::Device(format!("{}: {reason}; use another --device or --backend cpu", self.name)))
            }
        }
    }

    /// Waits for everything submitted so far.
    pub(super) fn wait(&self) -> Result<()> {
        let polled = self.inner.poll(wgpu::PollType::wait_indefinitely());
        self.check()?;
        polled.map(|_| ()).map_err(|e| Error::Device(format!("{}: {e}", self.name)))
    }
}
