//! Registers, spills and occupancy of all variants of all shaders on Radeons, from Mesa: see `scripts/isa`.
//!
//! Mesa's driver RADV can emulate any Radeon: it compiles for it but cannot run anything. wgpu runs something
//! at start-up, and does not expose statistics of shaders, so this program calls Vulkan directly.

#![allow(unsafe_code, reason = "the calls of Vulkan")]

mod variants;

use ash::{ext, khr, vk};
use mrfgs::low_level::backend::gpu::{Constant, Shader};
use naga::AddressSpace;
use naga::back::spv;
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};
use naga::valid::{Capabilities, ValidationFlags, Validator};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::CString;
use std::process::ExitCode;

/// The GPUs, by their names in RADV: RDNA 2, Vega and Polaris.
const GPUS: [&str; 3] = ["navi21", "vega10", "polaris10"];

/// Smallest occupancy of a kernel: waves per SIMD, in percent of those of an empty kernel.
const FLOOR: u64 = 60;

/// A kernel that may stay below [`FLOOR`], and why.
struct Exception {
    kernel: &'static str,
    floor: u64,
    /// Whether its arrays and registers may be in memory.
    scratch: bool,
    reason: &'static str,
}

impl Exception {
    fn of(kernel: &str) -> Option<&'static Self> {
        EXCEPTIONS.iter().find(|exception| exception.kernel == kernel)
    }
}

const MANY_MEMBERS: &str = "the sums of all members at once; the default has 3";
const EXCEPTIONS: &[Exception] = &[
    Exception {
        kernel: "cost/sad",
        floor: 20,
        scratch: false,
        reason: "the sums of eight pixels at once; the default takes another cost",
    },
    Exception { kernel: "dependency/13", floor: 10, scratch: false, reason: MANY_MEMBERS },
    Exception { kernel: "dependency/25", floor: 10, scratch: true, reason: MANY_MEMBERS },
    Exception { kernel: "dependency/37", floor: 10, scratch: true, reason: MANY_MEMBERS },
    Exception { kernel: "dependency/49", floor: 10, scratch: true, reason: MANY_MEMBERS },
];

/// Statistics of a kernel, or the worst of several kernels.
#[derive(Clone, Copy, Debug, Default)]
struct Figures {
    vgprs: u64,
    sgprs: u64,
    /// Registers that are spilled to memory.
    spills: u64,
    /// Bytes of memory per wave for spills and for arrays that are not in registers.
    scratch: u64,
    waves: u64,
    lds: u64,
    /// Estimated cycles between two waves; the compiler does not know the iterations of loops.
    cycles: u64,
}

impl Figures {
    fn worst(self, other: Self) -> Self {
        Self {
            vgprs: self.vgprs.max(other.vgprs),
            sgprs: self.sgprs.max(other.sgprs),
            spills: self.spills.max(other.spills),
            scratch: self.scratch.max(other.scratch),
            waves: self.waves.min(other.waves),
            lds: self.lds.max(other.lds),
            cycles: self.cycles.max(other.cycles),
        }
    }

    /// The faults of a kernel called `name`, if a SIMD can hold `most` waves.
    fn faults(self, name: &str, most: u64) -> Vec<String> {
        let exception = Exception::of(name);
        let floor = exception.map_or(FLOOR, |exception| exception.floor);
        let mut faults = Vec::new();
        if self.spills > 0 && !exception.is_some_and(|exception| exception.scratch) {
            faults.push(format!("spills {} registers", self.spills));
        } else if self.scratch > 0 && !exception.is_some_and(|exception| exception.scratch) {
            faults.push(format!("keeps arrays in memory, {} bytes a wave", self.scratch));
        }
        if 100 * self.waves < floor * most {
            faults.push(format!("lets a SIMD hold {} of {most} waves, fewer than {floor} %", self.waves));
        }
        faults
    }
}

fn main() -> ExitCode {
    let names: Vec<String> = std::env::args().skip(1).collect();
    match run(&names) {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("{why}");
            ExitCode::FAILURE
        }
    }
}

fn run(names: &[String]) -> Result<(), String> {
    if let Some(name) = names.iter().find(|name| !GPUS.contains(&name.as_str())) {
        return Err(format!("there is no GPU `{name}`; the GPUs are {}", GPUS.join(", ")));
    }
    let gpus = GPUS.into_iter().filter(|gpu| names.is_empty() || names.iter().any(|name| name == gpu));
    // Open all before starting threads.
    let radeons = gpus.map(Radeon::open).collect::<Result<Vec<_>, _>>()?;
    let kernels: Vec<Shader> =
        variants::kernels(&variants::plans()).into_iter().map(|kernel| kernel.shader).collect();
    let known: BTreeSet<String> = kernels.iter().map(name).collect();
    if let Some(stale) = EXCEPTIONS.iter().find(|exception| !known.contains(exception.kernel)) {
        return Err(format!("EXCEPTIONS in shaders/isa.rs: there is no kernel `{}`", stale.kernel));
    }

    println!(
        "{:<10} {:<24} {:>8} {:>6} {:>6} {:>7} {:>8} {:>6} {:>6} {:>7}  floor",
        "GPU", "kernel", "variants", "VGPRs", "SGPRs", "spills", "scratch", "waves", "LDS", "cycles"
    );
    let mut faults = Vec::new();
    for radeon in &radeons {
        let most = radeon.compile(EMPTY, "main")?.waves;
        radeon.control(most)?;
        let figures: Vec<Figures> = kernels
            .par_iter()
            .map(|kernel| {
                radeon.compile(&kernel.source(), kernel.entry).map_err(|e| format!("{}: {e}", name(kernel)))
            })
            .collect::<Result<_, _>>()?;
        let mut rows: BTreeMap<String, (usize, Figures)> = BTreeMap::new();
        for (kernel, figures) in kernels.iter().zip(figures) {
            rows.entry(name(kernel))
                .and_modify(|(variants, worst)| (*variants, *worst) = (*variants + 1, worst.worst(figures)))
                .or_insert((1, figures));
        }
        for (name, (variants, f)) in rows {
            let found = f.faults(&name, most);
            faults.extend(
                (!found.is_empty()).then(|| format!("{}: {name} {}", radeon.name, found.join(" and "))),
            );
            let floor = Exception::of(&name).map_or(format!("{FLOOR} %"), |exception| {
                format!("{} %: {}", exception.floor, exception.reason)
            });
            println!(
                "{:<10} {name:<24} {variants:>8} {:>6} {:>6} {:>7} {:>8} {:>6} {:>6} {:>7}  {floor}",
                radeon.name,
                f.vgprs,
                f.sgprs,
                f.spills,
                f.scratch,
                format!("{}/{most}", f.waves),
                f.lds,
                f.cycles
            );
        }
    }
    if faults.is_empty() {
        println!("{} variants: none spills without an exception, and all reach their floors", kernels.len());
        return Ok(());
    }
    faults.push(
        "Let them use fewer registers, or add them to EXCEPTIONS in shaders/isa.rs with the reason.".into(),
    );
    Err(faults.join("\n"))
}

/// The name of a kernel, shared by variants with the same number of slots.
fn name(kernel: &Shader) -> String {
    let entry = match kernel.entry {
        "main" => String::new(),
        entry => format!("/{entry}"),
    };
    let slots = kernel.constants.iter().find_map(|constant| match constant {
        ("SLOTS", Constant::U32(slots)) => Some(format!("/{slots}")),
        _ => None,
    });
    format!("{}{entry}{}", kernel.stage, slots.unwrap_or_default())
}

/// A kernel with the largest occupancy.
const EMPTY: &str = "@compute @workgroup_size(64) fn main() {}";

/// A kernel with `count` live values, each in its own register.
fn with_live_values(count: usize) -> String {
    let each = |line: fn(usize, usize) -> String| (0..count).map(|i| line(i, count)).collect::<String>();
    format!(
        "@group(0) @binding(0) var<storage, read_write> data: array<u32>;
        @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
            {}
            storageBarrier();
            {}
        }}",
        each(|i, count| format!("let v{i} = data[id.x * {count}u + {i}u];\n")),
        each(|i, count| format!("data[id.x * {count}u + {i}u] = v{};\n", count - 1 - i)),
    )
}

/// RADV emulating this GPU. Nothing is freed before the program ends.
struct Radeon {
    name: &'static str,
    device: ash::Device,
    executables: khr::pipeline_executable_properties::Device,
    /// Keeps the loader loaded.
    _entry: ash::Entry,
}

impl Radeon {
    /// Sets an environment variable, so no other threads may run.
    fn open(name: &'static str) -> Result<Self, String> {
        // SAFETY: no other thread reads the environment.
        unsafe { std::env::set_var("RADV_FORCE_FAMILY", name) };
        // SAFETY: the arguments are valid and live as long as the calls.
        unsafe { Self::create(name) }.map_err(|e| format!("{name}: {e}"))
    }

    unsafe fn create(name: &'static str) -> Result<Self, String> {
        let failed = |what: &'static str| move |e: vk::Result| format!("{what}: {e}");
        let entry = unsafe { ash::Entry::load() }.map_err(|e| format!("no Vulkan loader: {e}"))?;
        let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
        let info = vk::InstanceCreateInfo::default().application_info(&application);
        let instance = unsafe { entry.create_instance(&info, None) }.map_err(failed("no Vulkan driver"))?;
        let found = unsafe { instance.enumerate_physical_devices() }.map_err(failed("no device"))?;
        let is_radv = |device: &vk::PhysicalDevice| {
            let mut driver = vk::PhysicalDeviceDriverProperties::default();
            let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut driver);
            unsafe { instance.get_physical_device_properties2(*device, &mut properties) };
            driver.driver_id == vk::DriverId::MESA_RADV
        };
        let physical = found.into_iter().find(is_radv).ok_or("no RADV; run scripts/isa, which finds it")?;

        // Features that wgpu enables and that change the code.
        let core = vk::PhysicalDeviceFeatures::default().robust_buffer_access(true);
        let mut robust = vk::PhysicalDeviceRobustness2FeaturesEXT::default().robust_buffer_access2(true);
        let mut zeros =
            vk::PhysicalDeviceVulkan13Features::default().shader_zero_initialize_workgroup_memory(true);
        let mut asked = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default()
            .pipeline_executable_info(true);
        let extensions =
            [khr::pipeline_executable_properties::NAME, ext::robustness2::NAME].map(std::ffi::CStr::as_ptr);
        let queues = [vk::DeviceQueueCreateInfo::default().queue_priorities(&[1.0])];
        let info = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&extensions)
            .enabled_features(&core)
            .push_next(&mut robust)
            .push_next(&mut zeros)
            .push_next(&mut asked);
        let device =
            unsafe { instance.create_device(physical, &info, None) }.map_err(failed("the driver"))?;
        let executables = khr::pipeline_executable_properties::Device::new(&instance, &device);
        Ok(Self { name, device, executables, _entry: entry })
    }

    /// Statistics of the entry point `entry` of the shader `source`.
    fn compile(&self, source: &str, entry: &str) -> Result<Figures, String> {
        let (module, words) = spirv(source)?;
        let bindings: Vec<_> = module
            .global_variables
            .iter()
            .filter_map(|(_, variable)| {
                let kind = match variable.space {
                    AddressSpace::Uniform => vk::DescriptorType::UNIFORM_BUFFER,
                    _ => vk::DescriptorType::STORAGE_BUFFER,
                };
                let binding =
                    vk::DescriptorSetLayoutBinding::default().descriptor_type(kind).descriptor_count(1);
                let place = variable.binding?.binding;
                Some(binding.binding(place).stage_flags(vk::ShaderStageFlags::COMPUTE))
            })
            .collect();
        let entry = CString::new(entry).map_err(|e| e.to_string())?;
        // SAFETY: naga emits valid SPIR-V, `bindings` has all its bindings, and all arguments outlive the calls.
        let statistics = unsafe { self.statistics(&bindings, &words, &entry) }.map_err(|e| e.to_string())?;
        let figure = |name: &str| {
            let found = statistics.get(name).copied();
            found.ok_or_else(|| format!("this version of Mesa does not say `{name}`"))
        };
        Ok(Figures {
            vgprs: figure("VGPRs")?,
            sgprs: figure("SGPRs")?,
            spills: figure("Spilled VGPRs")? + figure("Spilled SGPRs")?,
            scratch: figure("Scratch size")?,
            waves: figure("Subgroups per SIMD")?,
            lds: figure("LDS size")?,
            cycles: figure("Inverse Throughput")?,
        })
    }

    unsafe fn statistics(
        &self,
        bindings: &[vk::DescriptorSetLayoutBinding],
        words: &[u32],
        entry: &CString,
    ) -> Result<BTreeMap<String, u64>, vk::Result> {
        let device = &self.device;
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(bindings);
        let sets = [unsafe { device.create_descriptor_set_layout(&info, None) }?];
        let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets);
        let layout = unsafe { device.create_pipeline_layout(&info, None) }?;
        let info = vk::ShaderModuleCreateInfo::default().code(words);
        let module = unsafe { device.create_shader_module(&info, None) }?;
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(module)
            .name(entry);
        let info = vk::ComputePipelineCreateInfo::default()
            .stage(stage)
            .layout(layout)
            .flags(vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR);
        let pipelines = unsafe { device.create_compute_pipelines(vk::PipelineCache::null(), &[info], None) };
        let pipeline = pipelines.map_err(|(_, e)| e)?[0];
        let info = vk::PipelineExecutableInfoKHR::default().pipeline(pipeline);
        let statistics = unsafe { self.executables.get_pipeline_executable_statistics(&info) }?;
        let named = statistics.iter().filter_map(|statistic| {
            let name = statistic.name_as_c_str().ok()?.to_str().ok()?;
            // SAFETY: the format says which member of the union is set.
            let is_whole = statistic.format == vk::PipelineExecutableStatisticFormatKHR::UINT64;
            is_whole.then(|| (name.to_owned(), unsafe { statistic.value.u64 }))
        });
        Ok(named.collect())
    }

    /// Control: a kernel that needs more registers than exist is reported.
    fn control(&self, most: u64) -> Result<(), String> {
        let (small, large) =
            (self.compile(&with_live_values(8), "main")?, self.compile(&with_live_values(300), "main")?);
        if !small.faults("control", most).is_empty() || large.faults("control", most).len() < 2 {
            return Err(format!("{}: the control fails: 8 values give {small:?}, 300 {large:?}", self.name));
        }
        Ok(())
    }
}

/// Translates a shader to SPIR-V like wgpu for this driver.
fn spirv(source: &str) -> Result<(naga::Module, Vec<u32>), String> {
    let module = naga::front::wgsl::parse_str(source).map_err(|e| e.emit_to_string(source))?;
    let info = Validator::new(ValidationFlags::all(), Capabilities::empty())
        .validate(&module)
        .map_err(|e| e.emit_to_string(source))?;
    let options = spv::Options {
        lang_version: (1, 6),
        flags: spv::WriterFlags::empty(),
        // The driver checks the bounds of buffers.
        bounds_check_policies: BoundsCheckPolicies {
            index: BoundsCheckPolicy::Restrict,
            ..Default::default()
        },
        zero_initialize_workgroup_memory: spv::ZeroInitializeWorkgroupMemoryMode::Native,
        ..Default::default()
    };
    let words = spv::write_vec(&module, &info, &options, None).map_err(|e| e.to_string())?;
    Ok((module, words))
}
