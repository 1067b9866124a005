//! Every shader in every variant, without a device: it validates without optional capabilities, its layouts
//! match the Rust structs, it stays within the limits of all devices, and it translates to the shading
//! languages of all platforms.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

#[path = "../shaders/variants.rs"]
mod variants;

use mrfgs::low_level::backend::Stage;
use mrfgs::low_level::backend::gpu::{
    Bound, Kernel, MAX_LOOP_ITERATIONS, UniformLayout, binding_number, kernels,
};
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::program::tiles::Tiles;
use mrfgs::low_level::program::{Program, SentMessages, Step};
use mrfgs::low_level::stage::{Data, Map, Start};
use mrfgs::options::{DisparityRange, LeftRightCheck, Method};
use naga::valid::{Capabilities, GlobalUse, ModuleInfo, ValidationFlags, Validator};
use naga::{AddressSpace, Module, ShaderStage, TypeInner};
use std::collections::{BTreeMap, HashSet};
use std::sync::LazyLock;

static PLANS: LazyLock<Vec<Plan>> = LazyLock::new(variants::plans);
static KERNELS: LazyLock<Vec<Kernel>> = LazyLock::new(|| variants::kernels(&PLANS));

/// The names of all arrays of these plans.
static NAMES: LazyLock<HashSet<&str>> = LazyLock::new(|| {
    let names =
        |plan: &Plan| Data::all(plan).into_iter().map(|data| data.array(plan).name).collect::<Vec<_>>();
    PLANS.iter().step_by(50).flat_map(names).collect()
});

fn validated(source: &str) -> Result<(Module, ModuleInfo), String> {
    let module = naga::front::wgsl::parse_str(source).map_err(|e| e.emit_to_string(source))?;
    let info = Validator::new(ValidationFlags::all(), Capabilities::empty())
        .validate(&module)
        .map_err(|e| e.emit_to_string(source))?;
    Ok((module, info))
}

/// Runs `check` on every kernel, and reports all failures at once.
fn for_every_kernel(check: impl Fn(&Kernel, &Module, &ModuleInfo) -> Result<(), String>) {
    let entries: HashSet<_> =
        KERNELS.iter().map(|kernel| (kernel.shader.stage, kernel.shader.entry)).collect();
    assert!(entries.len() > 20 && KERNELS.len() > entries.len(), "only {} kernels", KERNELS.len());
    let failures: Vec<String> = KERNELS
        .iter()
        .filter_map(|kernel| {
            let source = kernel.shader.source();
            let result = validated(&source).and_then(|(module, info)| check(kernel, &module, &info));
            result.err().map(|e| format!("{:?}: {e}", kernel.shader))
        })
        .collect();
    assert!(
        failures.is_empty(),
        "{} of {} kernels fail:\n{}",
        failures.len(),
        KERNELS.len(),
        failures.join("\n")
    );
}

#[test]
fn every_stage_has_a_shader_and_every_shader_a_stage() {
    let files: HashSet<String> = std::fs::read_dir("shaders")
        .unwrap()
        .filter_map(|e| e.unwrap().path().file_name()?.to_str()?.strip_suffix(".wgsl").map(str::to_owned))
        .collect();
    let kernels: HashSet<String> = KERNELS.iter().map(|kernel| kernel.shader.stage.to_owned()).collect();
    assert_eq!(files, kernels);
    let mut stages: HashSet<&str> = PLANS.iter().flat_map(Stage::all).map(Stage::name).collect();
    // `flood` and `fill_plane` run shaders of other stages; `upload` and `pack` are not stages.
    assert!(stages.remove("flood") && stages.remove("fill_plane"));
    assert!(stages.insert("upload") && stages.insert("pack"));
    assert_eq!(kernels, stages.into_iter().map(str::to_owned).collect());
}

/// Every entry point of a shader file is used.
#[test]
fn every_entry_point_is_a_kernel() {
    let used: HashSet<(&str, &str)> =
        KERNELS.iter().map(|kernel| (kernel.shader.stage, kernel.shader.entry)).collect();
    for_every_kernel(|kernel, module, _| {
        let unused = module.entry_points.iter().find(|e| !used.contains(&(kernel.shader.stage, &e.name)));
        unused.map_or(Ok(()), |e| Err(format!("nothing runs `{}`", e.name)))
    });
}

#[test]
fn every_shader_validates_without_capabilities() {
    for_every_kernel(|_, _, _| Ok(()));
}

#[test]
fn validation_can_fail() {
    let source = kernels(Stage::Belief(0), &PLANS[0])[0].shader.source();
    assert!(validated(&source).is_ok());
    assert!(validated(&source.replace("pack_narrow(values)", "values")).is_err());
    // 64-bit integers are a capability that was not requested.
    assert!(
        validated(&source.replace("let blocks = quads / QUADS;", "let blocks = u32(u64(quads)) / QUADS;"))
            .is_err()
    );
}

/// The fields of the struct `name` with their offsets, and its size in bytes.
fn layout_of(module: &Module, name: &str) -> Result<(Vec<(String, usize)>, usize), String> {
    let found = module.types.iter().find_map(|(_, t)| match &t.inner {
        TypeInner::Struct { members, span } if t.name.as_deref() == Some(name) => {
            let fields = members.iter().map(|m| (m.name.clone().unwrap_or_default(), m.offset as usize));
            Some((fields.collect(), *span as usize))
        }
        _ => None,
    });
    found.ok_or(format!("no struct {name}"))
}

#[test]
fn uniforms_are_laid_out_as_the_rust_structs() {
    for_every_kernel(|kernel, module, _| {
        let inner = UniformLayout::inner();
        for (name, layout) in inner.iter().chain([&("Params", kernel.uniform.clone())]) {
            let (fields, bytes) = layout_of(module, name)?;
            let expected: Vec<_> = layout.fields.iter().map(|(name, at)| ((*name).to_owned(), *at)).collect();
            if fields != expected {
                return Err(format!("{name} is {fields:?} and in Rust {expected:?}"));
            }
            if bytes.next_multiple_of(16) != layout.bytes.next_multiple_of(16) {
                return Err(format!("{name} takes {bytes} bytes and in Rust {}", layout.bytes));
            }
        }
        Ok(())
    });
}

/// Control: an exchanged field is detected.
#[test]
fn control_a_different_uniform_layout_is_found() {
    let kernel = &kernels(Stage::Evidence(0), &PLANS[0])[0];
    let source = kernel.shader.source();
    let fields = |source: &str| layout_of(&validated(source).unwrap().0, "Params").unwrap().0;
    let expected = |fields: &[(String, usize)]| {
        fields.iter().map(|(name, at)| (name.as_str(), *at)).collect::<Vec<_>>() == kernel.uniform.fields
    };
    assert!(expected(&fields(&source)));
    assert!(!expected(&fields(
        &source.replace("    limit: u32,\n    up: u32,", "    up: u32,\n    limit: u32,")
    )));
}

/// The index of the kernel's entry point.
fn entry_point(kernel: &Kernel, module: &Module) -> usize {
    module.entry_points.iter().position(|e| e.name == kernel.shader.entry).expect("it compiles")
}

/// Checks that `kernel` binds exactly the variables that its entry point uses in `source`.
fn check_bindings(kernel: &Kernel, source: &str) -> Result<(), String> {
    let (module, info) = validated(source)?;
    let info = info.get_entry_point(entry_point(kernel, &module));
    let used = module.global_variables.iter().filter(|(handle, _)| !info[*handle].is_empty());
    let mut used: BTreeMap<Option<u32>, &str> = used
        .filter_map(|(_, variable)| Some((Some(variable.binding?.binding), variable.name.as_deref()?)))
        .collect();
    let uniform = used.remove(&Some(0));
    let bound = kernel.bound.iter().map(|b| (binding_number(source, b.name), b.name)).collect();
    if uniform.is_some() && used == bound {
        return Ok(());
    }
    Err(format!("uses {uniform:?} and {used:?}, and binds {bound:?}"))
}

#[test]
fn every_kernel_binds_what_its_entry_point_uses() {
    for_every_kernel(|kernel, _, _| check_bindings(kernel, &kernel.shader.source()));
}

/// Control: bindings that the shader lacks, that the entry point does not use, or that are missing, are
/// detected.
#[test]
fn control_wrong_bindings_are_found() {
    let kernel = &kernels(Stage::Evidence(0), &PLANS[0])[0];
    let source = kernel.shader.source();
    let names = |kernel: &Kernel| kernel.bound.iter().map(|bound| bound.name).collect::<Vec<_>>();
    assert_eq!(names(kernel), ["cost", "evidence", "belief", "windows"]);
    check_bindings(kernel, &source).unwrap();
    check_bindings(kernel, &source.replace("@binding(3)", "@binding(9)")).unwrap();
    assert!(check_bindings(kernel, &source.replace("evidence", "proof")).is_err());
    let unused = "@group(0) @binding(9) var<storage, read> unused: array<u32>;\n";
    let more = unused.to_owned() + &source;
    for names in [&["cost", "evidence", "belief"][..], &["cost", "evidence", "belief", "windows", "unused"]] {
        let mut changed = kernel.clone();
        changed.bound = names.iter().map(|name| Bound { name, data: name, around: 0 }).collect();
        assert!(check_bindings(&changed, &more).is_err(), "{names:?}");
    }
}

#[test]
fn every_shader_stays_within_the_limits_of_all_devices() {
    for_every_kernel(|kernel, module, info| {
        let mut layouter = naga::proc::Layouter::default();
        layouter.update(module.to_ctx()).map_err(|e| e.to_string())?;
        let (mut storage, mut workgroup) = (0, 0);
        let entry = entry_point(kernel, module);
        for (handle, variable) in module.global_variables.iter() {
            if info.get_entry_point(entry)[handle].is_empty() {
                continue;
            }
            match variable.space {
                AddressSpace::Storage { .. } => storage += 1,
                AddressSpace::WorkGroup => workgroup += layouter[variable.ty].size,
                _ => {}
            }
        }
        let invocations: u32 = module.entry_points[entry].workgroup_size.iter().product();
        if storage > 8 || workgroup > 16_384 || invocations > 256 {
            return Err(format!(
                "{storage} storage buffers, {workgroup} bytes of workgroup memory, {invocations} invocations"
            ));
        }
        Ok(())
    });
}

#[test]
fn loops_stay_below_the_limit_of_drivers() {
    let count = |plan: &Plan| {
        let kernels = Stage::all(plan).into_iter().flat_map(|stage| kernels(stage, plan));
        kernels.map(|kernel| kernel.loops).max().unwrap()
    };
    for plan in PLANS.iter() {
        assert!(count(plan) <= MAX_LOOP_ITERATIONS, "{} iterations", count(plan));
    }
    // Control: too many iterations are detected.
    let mut method = Method::default();
    method.set("percentile", "0").unwrap();
    let plan = Plan::new(64, 64, DisparityRange::new(0, 9_999).unwrap(), &method).unwrap();
    assert!(count(&plan) > MAX_LOOP_ITERATIONS);
}

#[test]
fn every_shader_translates_to_spirv_msl_and_hlsl() {
    for_every_kernel(|kernel, module, info| {
        let entry = (ShaderStage::Compute, kernel.shader.entry.to_owned());
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

/// Checks the declared data of `stage` against the bindings of its kernels: all bound data are declared, and
/// all reads are of declared inputs or of data that an earlier kernel of the stage has written.
fn check_data(stage: Stage, plan: &Plan, kernels: &[Kernel]) -> Result<HashSet<Data>, String> {
    let reads: HashSet<_> = stage.reads(plan).collect();
    let writes: HashSet<_> = stage.writes().collect();
    let needs: HashSet<_> = stage.needs(plan).collect();
    let (mut bound, mut written) = (HashSet::new(), HashSet::new());
    for kernel in kernels {
        let (module, info) = validated(&kernel.shader.source())?;
        let info = info.get_entry_point(entry_point(kernel, &module));
        let mut now = Vec::new();
        for binding in &kernel.bound {
            let variable =
                module.global_variables.iter().find(|(_, v)| v.name.as_deref() == Some(binding.name));
            let usage = info[variable.ok_or("no such variable")?.0];
            let level = stage.level().unwrap_or(0) + usize::from(kernel.coarser);
            let all = Data::bound(plan, binding.data, level);
            let error = |what: &str| {
                Err(format!("`{}` of {} {what} {:?} {all:?}", binding.name, kernel.shader.entry, stage))
            };
            if all.is_empty() {
                // The coarsest level has no messages from above, and the finest none from below.
                if NAMES.contains(Data::place_of(binding.data, level).0) {
                    continue;
                }
                return error("is no data of");
            }
            let declared = |set: &HashSet<Data>| all.iter().any(|data| set.contains(data));
            if usage.contains(GlobalUse::WRITE) {
                if !declared(&writes) && !declared(&needs) {
                    return error("is written and not declared by");
                }
                now.extend(all.iter().copied());
            }
            if usage.contains(GlobalUse::READ) && !declared(&reads) && !declared(&written) {
                // Atomic scratch memory, or one of several maps in an array, the others of which stay.
                let both = usage.contains(GlobalUse::WRITE) && (declared(&needs) || all.len() > 1);
                if !both {
                    return error("is read, and neither declared nor written before, by");
                }
            }
            bound.extend(all);
        }
        // The next guide replaces the guide.
        let replaced = |data: &Data| match *data {
            Data::NextGuide(z) => vec![Data::Guide(z)],
            _ => Vec::new(),
        };
        written.extend(now.iter().flat_map(replaced).collect::<Vec<_>>());
        written.extend(now);
    }
    Ok(bound)
}

/// Kernels bind only data that the descriptor of their stage declares, with the declared access, and all
/// declared data are bound in some plan.
#[test]
fn stages_declare_what_their_kernels_bind() {
    let (mut seen, mut unbound, mut bound) = (HashSet::new(), HashSet::new(), HashSet::new());
    for plan in PLANS.iter() {
        for stage in Stage::all(plan).into_iter().filter(|stage| stage.name() != "flood") {
            let kernels = kernels(stage, plan);
            let declared = stage.reads(plan).chain(stage.writes()).chain(stage.needs(plan));
            let declared: Vec<_> = declared.filter(|data| data.is_there(plan)).collect();
            let shaders: Vec<_> = kernels.iter().map(|kernel| kernel.shader.clone()).collect();
            if !seen.insert((stage, shaders, declared.clone())) {
                continue;
            }
            let found = check_data(stage, plan, &kernels).unwrap_or_else(|error| panic!("{error}"));
            unbound.extend(declared.into_iter().map(|data| (stage, data.array(plan).name)));
            bound.extend(found.into_iter().map(|data| (stage, data.array(plan).name)));
        }
    }
    let unbound: Vec<_> = unbound.difference(&bound).collect();
    assert!(unbound.is_empty(), "declared, and bound by no kernel: {unbound:?}");
}

/// Control: undeclared data, and reads of data that are not written, are detected.
#[test]
fn control_undeclared_data_are_found() {
    let plan = &PLANS[0];
    let of = |stage: Stage| kernels(stage, plan);
    check_data(Stage::Support, plan, &of(Stage::Support)).unwrap();
    // Votes read labels, which planes do not declare, and need sums.
    assert!(check_data(Stage::FarPlane, plan, &of(Stage::VoteFill)).is_err());
    // The second kernel reads data that the first one writes.
    let check = |kernels: &[Kernel]| check_data(Stage::Fill, plan, kernels);
    let fill = of(Stage::Fill);
    check(&fill).unwrap();
    assert!(check(&fill[1..]).is_err());
}

/// The match by `plan`, in one piece.
fn program_of(plan: &Plan) -> mrfgs::Result<Program> {
    Program::new(&Tiles::in_one_piece(plan))
}

/// Checks that each datum that `program` reads was written before, or was there from the start.
fn check_order(program: &Program) -> Result<(), String> {
    let mut written = HashSet::new();
    let mut messages = SentMessages::none(0);
    for (step, plan) in program.with_plans() {
        if let Step::Enter(_) | Step::Condition = step {
            messages = SentMessages::none(plan.levels.len());
            written
                .extend(Data::all(plan).into_iter().filter(|data| data.array(plan).start != Start::Anything));
            // Windows hold all labels until they are found.
            written.extend((0..plan.levels.len()).map(Data::Windows));
        }
        // A level whose factors send no messages needs no graph, messages that were not sent count as 0, and a check that is off ignores the right view.
        let counts = |data: &Data| match *data {
            Data::Members(z) | Data::Incoming(z) => plan.floods(z),
            Data::Volume(volume) => !messages.lacks(volume),
            Data::Map(Map::RightLabel) => plan.method.refinement.left_right_check != LeftRightCheck::Off,
            _ => true,
        };
        if let Some(stage) = step.stage() {
            if let Some(data) = stage.reads(plan).filter(counts).find(|data| !written.contains(data)) {
                return Err(format!("{stage:?} reads {data:?}, which nobody has written"));
            }
            written.extend(stage.writes());
            messages.send(stage);
        }
    }
    Ok(())
}

#[test]
fn data_are_written_before_they_are_read() {
    let mut checked = 0;
    for plan in PLANS.iter() {
        // With the least memory, a pair cannot be matched at twice its size.
        let Ok(program) = program_of(plan) else { continue };
        check_order(&program).unwrap_or_else(|error| panic!("{error}: {:?}", plan.method));
        checked += 1;
    }
    assert!(checked > PLANS.len() * 9 / 10, "{checked} of {}", PLANS.len());
    // Control: without the stage that finds the labels, those that read them are noticed.
    let without = |missing: Stage| {
        let mut program = program_of(&PLANS[0]).unwrap();
        program.steps.retain(|step| step.stage() != Some(missing));
        check_order(&program)
    };
    assert!(without(Stage::WinnerTakesAll).is_err());
    assert!(without(Stage::Evidence(0)).is_err());
}
