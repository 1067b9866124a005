//! `mrfgs bench`.

mod args;
mod case;
mod findings;
mod synthetic;

use std::path::Path;

use mrfgs::low_level::backend::gpu::{self, Gpu};
use mrfgs::options::DeviceChoice;
use mrfgs::threads;

use crate::failure::Result;
use crate::outputs::files;
use crate::pairs::folder::{self, Folder};
use crate::process;

pub(crate) use args::Args;
use case::{Case, name};
use findings::Findings;

pub(crate) fn run(args: &Args) -> Result<()> {
    process::quiet_loader();
    args.threads.limit();
    let inputs = folder::inputs_of(&args.dirs).chain(args.method.files().map(Path::to_owned));
    files::check_json(args.json.as_deref(), inputs)?;
    // Report missing files before any match.
    args.dirs.iter().try_for_each(|dir| Folder::to_match(dir).map(drop))?;
    let bases: &[&'static str] =
        if args.method.name().is_some() { &["default"] } else { &["default", "paper"] };
    let called = |base: &str| args.method.name().unwrap_or_else(|| base.into());
    let methods =
        bases.iter().map(|base| Ok((called(base), args.method.on(base)?))).collect::<Result<_>>()?;
    let devices = devices(args);
    let dirs: Vec<Option<&Path>> = match args.dirs.as_slice() {
        [] => vec![None],
        dirs => dirs.iter().map(|dir| Some(dir.as_path())).collect(),
    };
    let alone = dirs.len() * bases.len() * devices.len() == 1;
    if !alone {
        // Report missing devices before any measurement.
        for device in devices.iter().filter(|device| **device != DeviceChoice::Cpu) {
            Gpu::new(name(device))?;
        }
    }
    let mut pairs = Vec::new();
    for dir in dirs {
        for base in bases {
            let mut rows = Vec::new();
            for device in &devices {
                let case = Case { args, dir, base, device };
                rows.push(if alone { case.measure()? } else { case.apart()? });
            }
            pairs.extend(rows.into_iter().reduce(|mut all, row| {
                all.devices.extend(row.devices);
                all
            }));
        }
    }
    let findings = Findings {
        version: env!("CARGO_PKG_VERSION").into(),
        threads: threads::count(),
        repeats: args.repeats,
        methods,
        pairs,
    };
    files::deliver(args.json.as_deref(), &findings, &findings.text(), |_| Ok(()))
}

/// The devices to measure, each once.
fn devices(args: &Args) -> Vec<DeviceChoice> {
    let mut devices = Vec::new();
    for device in &args.device {
        let device = match device {
            DeviceChoice::Auto if gpu::has_automatic() => DeviceChoice::Gpu,
            DeviceChoice::Auto => DeviceChoice::Cpu,
            device => device.clone(),
        };
        if !devices.contains(&device) {
            devices.push(device);
        }
    }
    devices
}
