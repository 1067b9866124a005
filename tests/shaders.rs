//! Every shader, in every variant that a plan can ask for, without a device: it validates with no capability asked,
//! its layouts are those of the Rust structs, it stays within the limits that every device has, and it translates to
//! what the drivers of all platforms take.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

use mrfgs::backend::gpu::{Kernel, LevelParams, MAX_LOOP_ITERATIONS, Params, Variant};
use mrfgs::options::{DisparityRange, Method};
use mrfgs::plan::Plan;
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{AddressSpace, Module, ShaderStage, TypeInner};
use std::collections::HashSet;
use std::mem::offset_of;

/// Methods that between them ask for every constant of the shaders.
fn methods() -> Vec<Method> {
    let paper = Method::preset("paper").unwrap();
    let mut all = vec![Method::default(), paper];
    for (key, value) in [
        ("potential", "exact"),
        ("potential", "hard"),
        ("agreement", "strict"),
        ("pyramid", "low-pass"),
        ("percentile", "100"),
        ("percentile", "0"),
        ("percentile", "84"),
    ] {
        let mut method = Method::default();
        method.set(key, value).unwrap();
        all.push(method);
    }
    all
}

fn plans() -> Vec<Plan> {
    let range = DisparityRange::new(-20, 43).unwrap();
    methods().iter().map(|m| Plan::new(101, 67, range, m).unwrap()).collect()
}

fn sources() -> Vec<(String, Kernel, String)> {
    let mut seen = HashSet::new();
    let mut all = Vec::new();
    for plan in plans() {
        for level in 0..plan.levels.len() {
            for kernel in Kernel::ALL {
                let variant = Variant::new(kernel, &plan, level);
                if seen.insert((kernel, variant)) {
                    all.push((format!("{} {variant:?}", kernel.name()), kernel, kernel.source(variant)));
                }
            }
        }
    }
    all
}

fn validated(source: &str) -> Result<(Module, ModuleInfo), String> {
    let module = naga::front::wgsl::parse_str(source).map_err(|e| e.emit_to_string(source))?;
    let info = Validator::new(ValidationFlags::all(), Capabilities::empty())
        .validate(&module)
        .map_err(|e| e.emit_to_string(source))?;
    Ok((module, info))
}

/// Runs `check` on every shader and reports all failures at once.
fn for_every_shader(check: impl Fn(Kernel, &Module, &ModuleInfo) -> Result<(), String>) {
    let sources = sources();
    assert!(sources.len() > Kernel::ALL.len(), "only {} shaders", sources.len());
    let failures: Vec<String> = sources
        .iter()
        .filter_map(|(name, kernel, source)| {
            let result = validated(source).and_then(|(module, info)| check(*kernel, &module, &info));
            result.err().map(|e| format!("{name}: {e}"))
        })
        .collect();
    assert!(
        failures.is_empty(),
        "{} of {} shaders fail:\n{}",
        failures.len(),
        sources.len(),
        failures.join("\n")
    );
}

#[test]
fn every_file_is_a_kernel_and_every_kernel_has_a_file() {
    let files: HashSet<String> = std::fs::read_dir("shaders")
        .unwrap()
        .filter_map(|e| e.unwrap().path().file_name()?.to_str()?.strip_suffix(".wgsl").map(str::to_owned))
        .collect();
    let kernels: HashSet<String> = Kernel::ALL.iter().map(|k| k.name().to_owned()).collect();
    assert_eq!(files, kernels);
}

#[test]
fn every_shader_validates_and_no_capability_is_asked() {
    for_every_shader(|_, _, _| Ok(()));
}

#[test]
fn validation_can_fail() {
    let source = Kernel::Belief.source(Variant::new(Kernel::Belief, &plans()[0], 0));
    assert!(validated(&source).is_ok());
    assert!(validated(&source.replace("pack_narrow(values)", "values")).is_err());
    // 64-bit integers are a capability that was not asked for.
    assert!(
        validated(&source.replace("let blocks = quads / QUADS;", "let blocks = u32(u64(quads)) / QUADS;"))
            .is_err()
    );
}

#[test]
fn uniforms_are_laid_out_as_the_rust_structs() {
    macro_rules! fields {
        ($type:ty: $($field:ident),*) => { vec![$( (stringify!($field), offset_of!($type, $field)), )*] };
    }
    let level = fields!(LevelParams: width, height, low, labels, quads, pitch, dependency_pitch, member_pitch,
        pixel_pitch, starts_pitch);
    let params = fields!(Params: level, fine, first_row, rows, row_groups, grid, outside_cost, colour_weight,
        colour_variance, sad_radius, label_offset, evidence_multiplier, evidence_limit, evidence_up, evidence_down, evidence_cap, tau, sub_pixel,
        left_right_check, median_all, speckle_size, confidence_floor, halo, span, first_column, columns, source_first_row,
        source_rows, median_radius, median_step_bits, median_scale, median_doublings, median_row_bits, belief_most);
    for_every_shader(|_, module, _| {
        let expected =
            [("Level", &level, size_of::<LevelParams>()), ("Params", &params, size_of::<Params>())];
        for (name, fields, bytes) in expected {
            let (members, span) = module
                .types
                .iter()
                .find_map(|(_, t)| match &t.inner {
                    TypeInner::Struct { members, span } if t.name.as_deref() == Some(name) => {
                        Some((members, *span))
                    }
                    _ => None,
                })
                .ok_or(format!("no struct {name}"))?;
            let found: Vec<(&str, usize)> =
                members.iter().map(|m| (m.name.as_deref().unwrap_or(""), m.offset as usize)).collect();
            if found != **fields {
                return Err(format!("{name} is {found:?} and in Rust {fields:?}"));
            }
            if span as usize != bytes {
                return Err(format!("{name} takes {span} bytes and in Rust {bytes}"));
            }
        }
        Ok(())
    });
}

#[test]
fn every_shader_stays_within_the_limits_of_all_devices() {
    for_every_shader(|_, module, _| {
        let mut layouter = naga::proc::Layouter::default();
        layouter.update(module.to_ctx()).map_err(|e| e.to_string())?;
        let (mut storage, mut workgroup) = (0, 0);
        for (_, variable) in module.global_variables.iter() {
            match variable.space {
                AddressSpace::Storage { .. } => storage += 1,
                AddressSpace::WorkGroup => workgroup += layouter[variable.ty].size,
                _ => {}
            }
        }
        let invocations: u32 = module.entry_points[0].workgroup_size.iter().product();
        if storage > 8 || workgroup > 16_384 || invocations > 256 {
            return Err(format!(
                "{storage} storage buffers, {workgroup} bytes of workgroup memory, {invocations} invocations"
            ));
        }
        Ok(())
    });
}

#[test]
fn loops_stay_below_what_drivers_run() {
    let count = |plan: &Plan| {
        let levels = 0..plan.levels.len();
        levels.flat_map(|z| Kernel::ALL.map(|k| k.loop_iterations(plan, z))).max().unwrap()
    };
    for plan in plans() {
        assert!(count(&plan) <= MAX_LOOP_ITERATIONS, "{} iterations", count(&plan));
    }
    // And the count knows when it is too much.
    let mut method = Method::default();
    method.set("percentile", "0").unwrap();
    let plan = Plan::new(64, 64, DisparityRange::new(0, 9_999).unwrap(), &method).unwrap();
    assert!(count(&plan) > MAX_LOOP_ITERATIONS);
}

#[test]
fn every_shader_translates_to_spirv_msl_and_hlsl() {
    for_every_shader(|_, module, info| {
        let entry = (ShaderStage::Compute, "main".to_owned());
        let spirv = naga::back::spv::PipelineOptions { shader_stage: entry.0, entry_point: entry.1.clone() };
        let words =
            naga::back::spv::write_vec(module, info, &naga::back::spv::Options::default(), Some(&spirv))
                .map_err(|e| format!("SPIR-V: {e}"))?;
        let msl_options = naga::back::msl::Options { lang_version: (2, 4), ..Default::default() };
        let msl = naga::back::msl::PipelineOptions { entry_point: Some(entry.clone()), ..Default::default() };
        let (metal, _) = naga::back::msl::write_string(module, info, &msl_options, &msl)
            .map_err(|e| format!("MSL: {e}"))?;
        let mut hlsl = String::new();
        let options = naga::back::hlsl::Options::default();
        let pipeline = naga::back::hlsl::PipelineOptions { entry_point: Some(entry) };
        naga::back::hlsl::Writer::new(&mut hlsl, &options, &pipeline)
            .write(module, info, None)
            .map_err(|e| format!("HLSL: {e}"))?;
        if words.len() < 100 || !metal.contains("kernel void") || !hlsl.contains("numthreads") {
            return Err("a translation is empty".into());
        }
        Ok(())
    });
}
