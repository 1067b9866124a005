//! What a matcher is to do, and where.

use std::ffi::{CString, c_char};
use std::path::Path;
use std::ptr;
use std::sync::LazyLock;

use mrfgs::options::{Execution, Method, PRESETS};

use crate::argument;
use crate::status::{Failure, Status, call};

/// What a matcher is to do, and where.
#[derive(Default)]
pub struct Options {
    pub(crate) method: Method,
    pub(crate) execution: Execution,
}

/// Changes `options`, or leaves them as they are.
///
/// # Safety
/// `options` is null, or of mrfgs_options_new() and used by nobody else.
unsafe fn change(options: *mut Options, change: impl FnOnce(&mut Options) -> Result<(), Failure>) -> Status {
    call(|| {
        // SAFETY: the caller promises it.
        let options = unsafe { options.as_mut() };
        change(options.ok_or_else(|| Failure::argument("options are null"))?)
    })
}

/// The preset "default", on a GPU where there is one and else on the CPU, with the usual number of threads.
#[unsafe(no_mangle)]
pub extern "C" fn mrfgs_options_new() -> *mut Options {
    Box::into_raw(Box::default())
}

/// Frees options; they may be null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_options_free(options: *mut Options) {
    // SAFETY: the caller promises that it is of `mrfgs_options_new`, and freed once.
    unsafe { argument::free(options) }
}

/// The name of the preset with this index, from 0 on; null past the last one. It stays as it is.
#[unsafe(no_mangle)]
pub extern "C" fn mrfgs_preset_name(index: u32) -> *const c_char {
    static NAMES: LazyLock<Vec<CString>> =
        LazyLock::new(|| PRESETS.iter().flat_map(|preset| CString::new(preset.name)).collect());
    NAMES.get(index as usize).map_or(ptr::null(), |name| name.as_ptr())
}

/// Takes all options of the preset with this name; mrfgs_preset_name() lists them.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_options_preset(options: *mut Options, name: *const c_char) -> Status {
    let set = |options: &mut Options| {
        // SAFETY: the caller promises that it is a text.
        options.method = Method::preset(unsafe { argument::text("the name", name) }?)?;
        Ok(())
    };
    // SAFETY: the caller promises that the pointer is good.
    unsafe { change(options, set) }
}

/// Sets an option: "fill" or "refinement.fill" to "none", "memory" (in MiB) to "2048". `mrfgs presets` lists all, with their values.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_options_set(
    options: *mut Options,
    key: *const c_char,
    value: *const c_char,
) -> Status {
    let set = |options: &mut Options| {
        // SAFETY: the caller promises that it is a text.
        let key = unsafe { argument::text("the key", key) }?;
        // SAFETY: the caller promises that it is a text.
        let value = unsafe { argument::text("the value", value) }?;
        Ok(options.method.set(key, value)?)
    };
    // SAFETY: the caller promises that the pointer is good.
    unsafe { change(options, set) }
}

/// Sets every option that a TOML file holds, as `mrfgs match --method FILE` does.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_options_load(options: *mut Options, path: *const c_char) -> Status {
    let load = |options: &mut Options| {
        // SAFETY: the caller promises that it is a text.
        let path = unsafe { argument::text("the path", path) }?;
        Ok(options.method.load(Path::new(path))?)
    };
    // SAFETY: the caller promises that the pointer is good.
    unsafe { change(options, load) }
}

/// What runs a match: "auto" takes a GPU where there is one, else the CPU; "cpu"; "gpu" fails where there is none; anything else is the
/// index of a device, such as "0", or a part of its name, as `mrfgs devices` lists them. The maps are the same, bit for bit.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_options_device(options: *mut Options, name: *const c_char) -> Status {
    let set = |options: &mut Options| {
        // SAFETY: the caller promises that it is a text.
        options.execution.device = unsafe { argument::text("the name", name) }?.into();
        Ok(())
    };
    // SAFETY: the caller promises that the pointer is good.
    unsafe { change(options, set) }
}

/// The threads of a match on the CPU at most, up to 1024; 0 takes as many as processors that the process may use, by affinity and cgroups, or
/// fewer where RAYON_NUM_THREADS, OMP_NUM_THREADS, SLURM_CPUS_PER_TASK or SLURM_CPUS_ON_NODE is a smaller number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_options_threads(options: *mut Options, threads: u32) -> Status {
    let set = |options: &mut Options| {
        if threads as usize > Execution::MOST_THREADS {
            let most = Execution::MOST_THREADS;
            return Err(Failure::argument(format!(
                "threads are {threads}: give 1 to {most}, or 0 for the usual number"
            )));
        }
        options.execution.threads = (threads > 0).then_some(threads as usize);
        Ok(())
    };
    // SAFETY: the caller promises that the pointer is good.
    unsafe { change(options, set) }
}
