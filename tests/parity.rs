//! Whole matches: every output of the GPU path is the CPU path's, bit for bit, on rendered scenes and, where
//! `MRFGS_MIDDLEBURY` names their folder, on real pairs; also on a device that shows a shader little at once.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

mod common;

use common::devices;
use mrfgs::backend::cpu::Cpu;
use mrfgs::backend::gpu::Handicap;
use mrfgs::backend::{Backend, Stage, Volume};
use mrfgs::image::{Image, Pair, Plane, calib::Calibration, read};
use mrfgs::options::{DisparityRange, Method, PRESETS};
use mrfgs::plan::Plan;
use mrfgs::solver::{Solution, solve};
use mrfgs::{Error, graph};
use std::io::Write;
use std::ops::ControlFlow;
use std::path::Path;

fn load(folder: &Path) -> (Pair, DisparityRange) {
    let (left, right) = (folder.join("im0.png"), folder.join("im1.png"));
    let ndisp = Calibration::beside(&left).unwrap().unwrap().ndisp.unwrap();
    (read::pair(&left, &right, None).unwrap(), DisparityRange::new(0, ndisp as i32 - 1).unwrap())
}

fn matched(backend: &mut dyn Backend, pair: &Pair, range: DisparityRange, method: &Method) -> Solution {
    let (width, height) = pair.size();
    let plan = Plan::new(width, height, range, method).unwrap();
    solve(backend, &plan, pair, &mut |_| ControlFlow::Continue(())).unwrap()
}

/// The outputs in which two matches differ.
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

/// The part of an image in these columns and rows.
fn cut(image: &Image, width: usize, height: usize) -> Image {
    Image {
        pixels: Plane::from_fn(width, height, |x, y| image.pixels[(x, y)]),
        masked: Plane::from_fn(width, height, |x, y| image.masked[(x, y)]),
    }
}

#[test]
fn presets_on_rendered_scenes() {
    let Some(mut gpu) = devices::gpu() else { return };
    for scene in ["slanted", "thin", "wall", "repetitive", "exposure", "mixed"] {
        let (pair, range) = load(&Path::new("testdata").join(scene));
        for (preset, _) in PRESETS {
            let method = Method::preset(preset).unwrap();
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
fn one_option_less_shows() {
    // The comparison can fail: a method that differs in its last digit gives other maps.
    let (pair, range) = load(Path::new("testdata/slanted"));
    let method = Method::default();
    let mut other = method.clone();
    other.temperature *= 1.1;
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

#[test]
fn a_device_that_shows_little_at_once() {
    let (pair, range) = load(Path::new("testdata/mixed"));
    for (preset, _) in PRESETS {
        let method = Method::preset(preset).unwrap();
        let expected = matched(&mut Cpu::default(), &pair, range, &method);
        // From a few bands to bands of a row or two.
        for max_binding in [4 << 20, 1 << 20, 700_000] {
            let Some(mut gpu) =
                devices::open(Handicap { max_binding: Some(max_binding), ..Handicap::default() })
            else {
                return;
            };
            let actual = matched(&mut gpu, &pair, range, &method);
            assert!(
                differences(&actual, &expected).is_empty(),
                "{preset} in bindings of {max_binding}: {:?}",
                differences(&actual, &expected)
            );
        }
    }
}

#[test]
fn a_device_that_shows_too_little_says_so() {
    let Some(mut gpu) = devices::open(Handicap { max_binding: Some(100_000), ..Handicap::default() }) else {
        return;
    };
    let (pair, range) = load(Path::new("testdata/mixed"));
    let (width, height) = pair.size();
    let plan = Plan::new(width, height, range, &Method::default()).unwrap();
    let result = solve(&mut gpu, &plan, &pair, &mut |_| ControlFlow::Continue(()));
    assert!(matches!(&result, Err(Error::Memory(m)) if m.contains("--backend cpu")), "{result:?}");
    // And goes on to serve what it can.
    let small = Pair::new(cut(pair.left(), 20, 15), cut(pair.right(), 20, 15)).unwrap();
    let range = DisparityRange::new(0, 15).unwrap();
    let method = Method::default();
    let (a, b) =
        (matched(&mut gpu, &small, range, &method), matched(&mut Cpu::default(), &small, range, &method));
    assert!(differences(&a, &b).is_empty());
}

/// Mesa 22 stops an invocation silently after some 65,000 iterations of its loops; the engine stays below half of
/// that, or declines.
#[test]
fn the_largest_label_counts() {
    let Some(mut gpu) = devices::gpu() else { return };
    let (pair, _) = load(Path::new("testdata/slanted"));
    let small = Pair::new(cut(pair.left(), 9, 5), cut(pair.right(), 9, 5)).unwrap();
    let mut served = 0;
    for (preset, _) in PRESETS {
        let method = Method::preset(preset).unwrap();
        for labels in [4_000, 5_900, 9_000, 16_384] {
            let range = DisparityRange::new(-labels / 2, labels - labels / 2 - 1).unwrap();
            let plan = Plan::new(9, 5, range, &method).unwrap();
            let expected = matched(&mut Cpu::default(), &small, range, &method);
            match solve(&mut gpu, &plan, &small, &mut |_| ControlFlow::Continue(())) {
                Ok(actual) => {
                    served += 1;
                    assert!(differences(&actual, &expected).is_empty(), "{preset}, {labels} labels");
                }
                Err(Error::Device(reason)) => {
                    assert!(
                        labels > 5_900 && reason.contains("--backend cpu"),
                        "{preset}, {labels}: {reason}"
                    );
                }
                Err(e) => panic!("{preset}, {labels} labels: {e}"),
            }
        }
    }
    assert!(served >= 5, "{served}");
}

#[test]
fn a_device_is_used_for_pair_after_pair() {
    let Some(mut gpu) = devices::gpu() else { return };
    let (pair, range) = load(Path::new("testdata/thin"));
    let method = Method::default();
    let first = matched(&mut gpu, &pair, range, &method);
    let small = Pair::new(cut(pair.left(), 31, 17), cut(pair.right(), 31, 17)).unwrap();
    matched(&mut gpu, &small, DisparityRange::new(-3, 9).unwrap(), &Method::preset("paper").unwrap());
    assert!(differences(&first, &matched(&mut gpu, &pair, range, &method)).is_empty());
}

#[test]
fn volumes_of_a_real_pair() {
    let Ok(folder) = std::env::var("MRFGS_MIDDLEBURY") else {
        let _ = writeln!(std::io::stderr(), "SKIPPED on real pairs: MRFGS_MIDDLEBURY names no folder");
        return;
    };
    let Some(mut gpu) = devices::gpu() else { return };
    let (pair, range) = load(&Path::new(&folder).join("Teddy"));
    let method = Method::default();
    let (width, height) = pair.size();
    let plan = Plan::new(width, height, range, &method).unwrap();
    let mut cpu = Cpu::default();
    let graphs = graph::build(pair.left(), &plan);
    let backends: [&mut dyn Backend; 2] = [&mut cpu, &mut gpu];
    let costs = backends.map(|backend| {
        backend.prepare(&plan, &pair, graphs.clone()).unwrap();
        backend.run(Stage::Cost).unwrap();
        backend.read(Volume::Cost(0)).unwrap()
    });
    assert!(costs[0] == costs[1]);
    let (a, b) = (matched(&mut gpu, &pair, range, &method), matched(&mut cpu, &pair, range, &method));
    assert!(differences(&a, &b).is_empty(), "{:?}", differences(&a, &b));
}
