//! The options of a matcher.

use std::ffi::{CString, c_char};
use std::path::Path;
use std::ptr;
use std::sync::LazyLock;

use mrfgs::options::{Execution, Method, PRESETS};

use crate::argument;
use crate::status::{Failure, Status, call};

/// The method and the device of a matcher.
#[derive(Default)]
pub struct Options {
    pub(crate) method: Method,
    pub(crate) execution: Execution,
}

/// Changes `options`, or leaves them unchanged on failure.
///
/// # Safety
/// `options` is null, or from mrfgs_options_new() and not used elsewhere.
unsafe fn change(options: *mut Options, change: impl FnOnce(&mut Options) -> Result<(), Failure>) -> Status {
    call(|| {
        // SAFETY: guaranteed by the caller.
        let options = unsafe { options.as_mut() };
        change(options.ok_or_else(|| Failure::argument("options are null"))?)
    })
}

/// Options with the preset "default", on a GPU if there is one, else on the CPU, with the default number of threads.
#[unsafe(no_mangle)]
pub extern "C" fn mrfgs_options_new() -> *mut Options {
    Box::into_raw(Box::default())
}

/// Frees options; null is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_options_free(options: *mut Options) {
    // SAFETY: the caller guarantees that it is from `mrfgs_options_new` and is freed once.
    unsafe { argument::free(options) }
}

/// The name of the preset with this index, from 0; null past the last one. Always valid.
#[unsafe(no_mangle)]
pub extern "C" fn mrfgs_preset_name(index: u32) -> *const c_char {
    static NAMES: LazyLock<Vec<CString>> =
        LazyLock::new(|| PRESETS.iter().flat_map(|preset| CString::new(preset.name)).collect());
    NAMES.get(index as usize).map_or(ptr::null(), |name| name.as_ptr())
}

/// Sets all options of the preset with this name; mrfgs_preset_name() lists them.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_options_preset(options: *mut Options, name: *const c_char) -> Status {
    let set = |options: &mut Options| {
        // SAFETY: the caller guarantees a text.
        options.method = Method::preset(unsafe { argument::text("the name", name) }?)?;
        Ok(())
    };
    // SAFETY: guaranteed by the caller.
    unsafe { change(options, set) }
}

/// Sets an option: "fill" or "refinement.fill" to "none", "memory" (in MiB) to "2048". `mrfgs presets` lists all options and values.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_options_set(
    options: *mut Options,
    key: *const c_char,
    value: *const c_char,
) -> Status {
    let set = |options: &mut Options| {
        // SAFETY: the caller guarantees a text.
        let key = unsafe { argument::text("the key", key) }?;
        // SAFETY: the caller guarantees a text.
        let value = unsafe { argument::text("the value", value) }?;
        Ok(options.method.set(key, value)?)
    };
    // SAFETY: guaranteed by the caller.
    unsafe { change(options, set) }
}

/// Sets all options in a TOML file, like `mrfgs match --method FILE`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_options_load(options: *mut Options, path: *const c_char) -> Status {
    let load = |options: &mut Options| {
        // SAFETY: the caller guarantees a text.
        let path = unsafe { argument::text("the path", path) }?;
        Ok(options.method.load(Path::new(path))?)
    };
    // SAFETY: guaranteed by the caller.
    unsafe { change(options, load) }
}

/// Selects the device: "auto" uses a GPU if there is one, else the CPU; "cpu"; "gpu", which fails without one; or the index of a device,
/// such as "0", or part of its name, as listed by `mrfgs devices`. The maps are bit for bit the same.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_options_device(options: *mut Options, name: *const c_char) -> Status {
    let set = |options: &mut Options| {
        // SAFETY: the caller guarantees a text.
        options.execution.device = unsafe { argument::text("the name", name) }?.into();
        Ok(())
    };
    // SAFETY: guaranteed by the caller.
    unsafe { change(options, set) }
}

/// Sets the maximum number of CPU threads of a match, up to 1024; 0 means the processors available to the process (affinity, cgroups), or
/// the smallest of RAYON_NUM_THREADS, OMP_NUM_THREADS, SLURM_CPUS_PER_TASK and SLURM_CPUS_ON_NODE if lower.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_options_threads(options: *mut Options, threads: u32) -> Status {
    let set = |options: &mut Options| {
        if threads as usize > Execution::MOST_THREADS {
            let most = Execution::MOST_THREADS;
            return Err(Failure::argument(format!(
                "threads is {threads}: give 1 to {most}, or 0 for the default number"
            )));
        }
        options.execution.threads = (threads > 0).then_some(threads as usize);
        Ok(())
    };
    // SAFETY: guaranteed by the caller.
    unsafe { change(options, set) }
}
