//! Whole matches: every output of the GPU path equals the CPU path's, bit for bit. On rendered scenes,
//! on real pairs where `MRFGS_MIDDLEBURY` names their folder, and on a device with small bindings.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

mod common;

use common::devices;
use mrfgs::error::{DeviceError, MemoryError};
use mrfgs::image::{Image, Pair, Plane, calib::Calibration};
use mrfgs::low_level::backend::cpu::Cpu;
use mrfgs::low_level::backend::gpu::FaultInjection;
use mrfgs::low_level::backend::{Backend, Stage, Volume};
use mrfgs::low_level::engine::Solution;
use mrfgs::low_level::front::Prepared;
use mrfgs::low_level::plan::Plan;
use mrfgs::options::{DisparityRange, MatchSize, Method, PRESETS};
use mrfgs::{Conditioning, Error};
use pollster::block_on;
use std::io::Write;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

fn load(folder: &Path) -> (Pair, DisparityRange) {
    let (left, right) = (folder.join("im0.png"), folder.join("im1.png"));
    let ndisp = Calibration::beside(&left).unwrap().unwrap().ndisp.unwrap();
    (Pair::open(&left, &right).unwrap(), DisparityRange::new(0, ndisp as i32 - 1).unwrap())
}

fn matched(backend: &mut dyn Backend, pair: &Pair, range: DisparityRange, method: &Method) -> Solution {
    let (width, height) = pair.size();
    let plan = Plan::new(width, height, range, method).unwrap();
    common::solve(backend, &plan, pair, &mut |_| ControlFlow::Continue(())).unwrap()
}

/// The names of the outputs in which two matches differ.
fn differences(a: &Solution, b: &Solution) -> Vec<&'static str> {
    let mut all = Vec::new();
    let mut add = |name, differs| {
        if differs {
            all.push(name);
        }
    };
    add("disparity", a.maps.disparity != b.maps.disparity);
    add("raw", a.maps.raw != b.maps.raw);
    add("confidence", a.maps.confidence != b.maps.confidence);
    add("validity", a.maps.validity != b.maps.validity);
    add("iterations", a.iterations != b.iterations);
    all
}

/// The presets that match at most at the pair's own size; twice the size needs more of a device.
fn presets_at_one_size() -> impl Iterator<Item = &'static str> {
    let all = PRESETS.iter().filter(|preset| preset.method().schedule.match_size != MatchSize::Double);
    all.map(|preset| preset.name)
}

/// The upper left part of an image, of this size.
fn cut(image: &Image, width: usize, height: usize) -> Image {
    Image {
        pixels: Plane::from_fn(width, height, |x, y| image.pixels[(x, y)]),
        masked: Plane::from_fn(width, height, |x, y| image.masked[(x, y)]),
    }
}

/// Whether to compare every scene by every preset, which takes long: `MRFGS_PARITY` is `all`.
fn everything() -> bool {
    std::env::var("MRFGS_PARITY").is_ok_and(|v| v == "all")
}

/// Compares one scene by every preset, and the others by the default preset unless [`everything`] is set.
#[test]
fn presets_on_rendered_scenes() {
    let Some(mut gpu) = devices::gpu() else { return };
    for scene in ["slanted", "mixed", "thin", "wall", "repetitive", "exposure"] {
        let (pair, range) = load(&Path::new("testdata").join(scene));
        let by_every_preset = everything() || scene == "slanted";
        for preset in PRESETS.iter().filter(|preset| by_every_preset || preset.name == "default") {
            let (preset, method) = (preset.name, preset.method());
            let expected = matched(&mut Cpu::default(), &pair, range, &method);
            let actual = matched(&mut gpu, &pair, range, &method);
            assert!(
                differences(&actual, &expected).is_empty(),
                "{scene} {preset}: {:?}",
                differences(&actual, &expected)
            );
        }
    }
}

#[test]
fn a_changed_option_is_noticed() {
    // Control: a slightly different method gives different maps.
    let (pair, range) = load(Path::new("testdata/slanted"));
    let method = Method::default();
    let mut other = method.clone();
    other.messages.temperature *= 1.1;
    let (a, b) = (
        matched(&mut Cpu::default(), &pair, range, &method),
        matched(&mut Cpu::default(), &pair, range, &other),
    );
    assert!(differences(&a, &a.clone()).is_empty());
    let found = differences(&a, &b);
    assert!(
        found.contains(&"disparity") && found.contains(&"raw") && found.contains(&"confidence"),
        "{found:?}"
    );
}

/// The limits of the weakest WebGPU device.
fn minimum() -> FaultInjection {
    FaultInjection { max_binding: Some(128 << 20), max_buffer: Some(256 << 20), ..FaultInjection::default() }
}

#[test]
fn small_devices() {
    let (pair, range) = load(Path::new("testdata/mixed"));
    let binding = |bytes| FaultInjection { max_binding: Some(bytes), ..FaultInjection::default() };
    let buffer = |bytes| FaultInjection { max_buffer: Some(bytes), ..FaultInjection::default() };
    for preset in presets_at_one_size() {
        let method = Method::preset(preset).unwrap();
        let expected = matched(&mut Cpu::default(), &pair, range, &method);
        let handicaps = [
            FaultInjection {
                max_binding: Some(700_000),
                max_buffer: Some(2 << 20),
                max_groups: Some(150),
                ..FaultInjection::default()
            },
            minimum(),
            // Bands of one or two rows.
            binding(700_000),
            // Pieces of a few rows.
            buffer(2 << 20),
            // Dispatches that wrap around.
            FaultInjection { max_groups: Some(150), ..FaultInjection::default() },
        ];
        // The first case sets all limits at once; the others show which limit fails.
        let tried = if preset == "default" { handicaps.len() } else { 1 };
        for faults in handicaps.into_iter().take(tried) {
            let Some(mut gpu) = devices::open(faults) else { return };
            let actual = matched(&mut gpu, &pair, range, &method);
            assert!(
                differences(&actual, &expected).is_empty(),
                "{preset} with {faults:?}: {:?}",
                differences(&actual, &expected)
            );
        }
    }
}

/// All buffers are filled with garbage first, so nothing is read before it is written.
#[test]
fn poisoned_buffers() {
    for preset in presets_at_one_size() {
        let mut method = Method::preset(preset).unwrap();
        method.schedule.tolerance = 0.5;
        let (pair, range) = load(Path::new("testdata/thin"));
        // The set of buffers does not depend on the size.
        let pair = Pair::new(cut(pair.left(), 240, 90), cut(pair.right(), 240, 90)).unwrap();
        let expected = matched(&mut Cpu::default(), &pair, range, &method);
        let mut backends: Vec<Box<dyn Backend>> = vec![Box::new(Cpu::default())];
        for max_buffer in [None, Some(1 << 20)] {
            let gpu = devices::open(FaultInjection { max_buffer, ..FaultInjection::default() });
            backends.extend(gpu.map(|gpu| Box::new(gpu) as Box<dyn Backend>));
        }
        for backend in &mut backends {
            let name = backend.describe();
            matched(backend.as_mut(), &pair, range, &method);
            for byte in [0xff, 0x5a] {
                backend.probe().poison(byte).unwrap();
                let actual = matched(backend.as_mut(), &pair, range, &method);
                assert!(
                    differences(&actual, &expected).is_empty(),
                    "{name}, {preset}, {byte}: {:?}",
                    differences(&actual, &expected)
                );
            }
            // Control: the garbage reaches the result buffers.
            backend.probe().poison(0x5a).unwrap();
            assert!(differences(&matched_maps_only(backend.as_mut()), &expected).contains(&"disparity"));
        }
    }
}

/// The maps that the backend holds at the moment.
fn matched_maps_only(backend: &mut dyn Backend) -> Solution {
    let requested = backend.request_maps().unwrap();
    let (maps, traffic, cells) =
        (block_on(backend.maps(requested)).unwrap().0, backend.traffic(), backend.cells());
    Solution {
        prior: None,
        maps,
        iterations: 0,
        conditioning: Conditioning::default(),
        host_times: Vec::new(),
        mosaic_times: Vec::new(),
        traffic,
        cells,
    }
}

/// The pair is uploaded once and the maps are read back once, without any other transfer.
#[test]
fn nothing_else_is_transferred() {
    let Some(mut gpu) = devices::open(FaultInjection::default()) else { return };
    let (pair, range) = load(Path::new("testdata/slanted"));
    let method = Method::default();
    matched(&mut gpu, &pair, range, &method);
    let traffic = gpu.traffic();
    // Disparity and raw disparity in 16 bits, and flags, of 240 x 180 pixels in rows of 256.
    assert_eq!(traffic.bytes_down, 3 * 2 * 256 * 180, "{traffic:?}");
    // With a tolerance, a few more words are read back to tell when it was reached.
    let mut tolerant = method.clone();
    (tolerant.schedule.tolerance, tolerant.schedule.final_iterations) = (0.5, 20);
    let iterations = matched(&mut gpu, &pair, range, &tolerant).iterations;
    assert!(gpu.traffic().bytes_down - traffic.bytes_down < 64);
    assert_eq!(iterations, matched(&mut Cpu::default(), &pair, range, &tolerant).iterations);
    assert!(iterations < 3 * 5 + 20, "{iterations}");
    // A second pair of the same plan takes the same dispatches and uploads no parameters.
    matched(&mut gpu, &pair, range, &method);
    matched(&mut gpu, &pair, range, &method);
    assert_eq!(gpu.traffic().dispatches, traffic.dispatches);
    assert!(gpu.traffic().bytes_up < traffic.bytes_up);
}

/// Disparities are read back in 16 bits up to the largest range that fits, also of pixels of the right view without a label.
#[test]
fn packed_maps() {
    let Some(mut gpu) = devices::gpu() else { return };
    let (pair, _) = load(Path::new("testdata/slanted"));
    // An odd width that almost fills rows.
    let small = Pair::new(cut(pair.left(), 127, 17), cut(pair.right(), 127, 17)).unwrap();
    for preset in ["default", "fast"] {
        let mut method = Method::preset(preset).unwrap();
        method.refinement.right_map = true;
        let mut bytes = Vec::new();
        for labels in [255, 256, 257] {
            let range = DisparityRange::new(-100, labels - 101).unwrap();
            let actual = matched(&mut gpu, &small, range, &method);
            let expected = matched(&mut Cpu::default(), &small, range, &method);
            assert!(differences(&actual, &expected).is_empty(), "{preset}, {labels} labels");
            bytes.push(gpu.traffic().bytes_down);
        }
        assert_eq!([2 * bytes[0], 2 * bytes[1]], [bytes[2]; 2], "{preset}");
    }
}

#[test]
fn a_device_with_too_small_bindings_is_an_error() {
    let Some(mut gpu) =
        devices::open(FaultInjection { max_binding: Some(100_000), ..FaultInjection::default() })
    else {
        return;
    };
    let (pair, range) = load(Path::new("testdata/mixed"));
    let (width, height) = pair.size();
    let plan = Plan::new(width, height, range, &Method::default()).unwrap();
    let result = common::solve(&mut gpu, &plan, &pair, &mut |_| ControlFlow::Continue(()));
    assert!(matches!(&result, Err(Error::Memory(MemoryError::Buffer { .. }))), "{result:?}");
    // The device still matches smaller pairs.
    let small = Pair::new(cut(pair.left(), 20, 15), cut(pair.right(), 20, 15)).unwrap();
    let range = DisparityRange::new(0, 15).unwrap();
    let method = Method::default();
    let (a, b) =
        (matched(&mut gpu, &small, range, &method), matched(&mut Cpu::default(), &small, range, &method));
    assert!(differences(&a, &b).is_empty());
}

/// Mesa 22 stops an invocation silently after about 65,000 iterations of its loops. The engine stays below
/// half of that, or rejects the match.
#[test]
fn the_largest_label_counts() {
    let Some(mut gpu) = devices::gpu() else { return };
    let (pair, _) = load(Path::new("testdata/slanted"));
    let small = Pair::new(cut(pair.left(), 9, 5), cut(pair.right(), 9, 5)).unwrap();
    let mut served = 0;
    for preset in presets_at_one_size() {
        let method = Method::preset(preset).unwrap();
        for labels in [4_000, 5_900, 9_000, 16_384] {
            let range = DisparityRange::new(-labels / 2, labels - labels / 2 - 1).unwrap();
            let plan = Plan::new(9, 5, range, &method).unwrap();
            let expected = matched(&mut Cpu::default(), &small, range, &method);
            match common::solve(&mut gpu, &plan, &small, &mut |_| ControlFlow::Continue(())) {
                Ok(actual) => {
                    served += 1;
                    assert!(differences(&actual, &expected).is_empty(), "{preset}, {labels} labels");
                }
                Err(Error::Device(DeviceError::TooLargeForShader { .. })) => {
                    assert!(labels > 5_900, "{preset}, {labels}");
                }
                Err(e) => panic!("{preset}, {labels} labels: {e}"),
            }
        }
    }
    assert!(served >= 5, "{served}");
}

#[test]
fn a_device_matches_pairs_of_different_plans() {
    let Some(mut gpu) = devices::gpu() else { return };
    let (pair, range) = load(Path::new("testdata/thin"));
    let method = Method::default();
    let first = matched(&mut gpu, &pair, range, &method);
    let small = Pair::new(cut(pair.left(), 31, 17), cut(pair.right(), 31, 17)).unwrap();
    matched(&mut gpu, &small, DisparityRange::new(-3, 9).unwrap(), &Method::preset("paper").unwrap());
    assert!(differences(&first, &matched(&mut gpu, &pair, range, &method)).is_empty());
}

/// The folders in `MRFGS_MIDDLEBURY` that hold a pair. If it is not set, none, with a note on stderr.
fn real_pairs() -> Vec<PathBuf> {
    let Ok(folder) = std::env::var("MRFGS_MIDDLEBURY") else {
        let _ = writeln!(std::io::stderr(), "SKIPPED on real pairs: MRFGS_MIDDLEBURY names no folder");
        return Vec::new();
    };
    let entries = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path());
    let mut pairs: Vec<_> = entries.filter(|path| path.join("im0.png").is_file()).collect();
    pairs.sort();
    assert!(!pairs.is_empty(), "{folder} holds no pair");
    pairs
}

#[test]
fn volumes_of_a_real_pair() {
    let Some(folder) = real_pairs().pop() else { return };
    let Some(mut gpu) = devices::gpu() else { return };
    let (pair, range) = load(&folder);
    let (width, height) = pair.size();
    let plan = Plan::new(width, height, range, &Method::default()).unwrap();
    let mut cpu = Cpu::default();
    let backends: [&mut dyn Backend; 2] = [&mut cpu, &mut gpu];
    let costs = backends.map(|backend| {
        backend.prepare(&plan, Prepared::new(&pair)).unwrap();
        backend.run(Stage::Cost).unwrap();
        backend.probe().read(Volume::Cost(0)).unwrap()
    });
    assert!(costs[0] == costs[1]);
}

/// Real pairs by the default preset with the limits of the device, and the first one also with the WebGPU
/// minimum. With [`everything`], all pairs with both limits and by every preset.
#[test]
fn maps_of_real_pairs() {
    for (index, folder) in real_pairs().into_iter().enumerate() {
        let (pair, range) = load(&folder);
        for preset in PRESETS.iter().filter(|preset| everything() || preset.name == "default") {
            let (preset, method) = (preset.name, preset.method());
            let expected = matched(&mut Cpu::default(), &pair, range, &method);
            let limits = if everything() || index == 0 { 2 } else { 1 };
            for faults in [FaultInjection::default(), minimum()].into_iter().take(limits) {
                let Some(mut gpu) = devices::open(faults) else { return };
                let actual = matched(&mut gpu, &pair, range, &method);
                let name = folder.display();
                assert!(
                    differences(&actual, &expected).is_empty(),
                    "{name}, {preset}, {faults:?}: {:?}",
                    differences(&actual, &expected)
                );
                println!("{name}, {preset}, {faults:?}: the same maps");
            }
        }
    }
}
