//! Device failures of every kind that can be injected. Each is reported in one clear line, and where falling
//! back is allowed the CPU path computes the same maps, bit for bit.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

mod common;

use common::devices::open as device;
use mrfgs::error::{DeviceError, MemoryError};
use mrfgs::image::{Image, Pair, Plane, calib::Calibration};
use mrfgs::low_level::backend::Backend;
use mrfgs::low_level::backend::cpu::Cpu;
use mrfgs::low_level::backend::gpu::{FaultInjection, Gpu};
use mrfgs::low_level::engine::Solution;
use mrfgs::low_level::plan::Plan;
use mrfgs::maps::Maps;
use mrfgs::options::{DisparityRange, Execution, Method};
use mrfgs::{Error, Matched, Matcher, Result};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

fn scene() -> (Pair, DisparityRange) {
    let folder = Path::new("testdata/slanted");
    let (left, right) = (folder.join("im0.png"), folder.join("im1.png"));
    let ndisp = Calibration::beside(&left).unwrap().unwrap().ndisp.unwrap();
    (Pair::open(&left, &right).unwrap(), DisparityRange::new(0, ndisp as i32 - 1).unwrap())
}

/// The upper left corner of a pair.
fn corner(pair: &Pair) -> Pair {
    let cut = |image: &Image| Image {
        pixels: Plane::from_fn(31, 17, |x, y| image.pixels[(x, y)]),
        masked: Plane::from_fn(31, 17, |x, y| image.masked[(x, y)]),
    };
    Pair::new(cut(pair.left()), cut(pair.right())).unwrap()
}

fn on(backend: &mut dyn Backend, pair: &Pair, range: DisparityRange) -> Result<Solution> {
    let (width, height) = pair.size();
    let plan = Plan::new(width, height, range, &Method::default()).unwrap();
    common::solve(backend, &plan, pair, &mut |_| ControlFlow::Continue(()))
}

fn expected(pair: &Pair, range: DisparityRange) -> Maps {
    on(&mut Cpu::default(), pair, range).unwrap().maps
}

fn run(matcher: &mut Matcher, pair: &Pair, range: DisparityRange) -> Result<Matched> {
    matcher.run(pair, range)
}

/// Whether a message is one line that names no flag: the remedy is up to the front end.
fn is_clear(message: impl ToString) -> bool {
    let message = message.to_string();
    !message.contains("--") && !message.contains('\n')
}

fn says(cause: &impl ToString, words: &str) -> bool {
    cause.to_string().contains(words) && is_clear(cause.to_string())
}

/// Checks that the maps come from the CPU path, and that the note gives the reason.
fn assert_falls_back(gpu: Result<Gpu>, says: &str) {
    let (pair, range) = scene();
    let mut matcher = Matcher::on(gpu, true, &Execution::default()).unwrap();
    for _ in 0..2 {
        let matched = run(&mut matcher, &pair, range).unwrap();
        assert!(matched.maps == expected(&pair, range));
        assert!(matched.ran_on.contains("CPU"), "{}", matched.ran_on);
        let note = matched.note.expect("a reason");
        assert!(self::says(&note, says), "{note}");
    }
}

#[test]
fn a_good_device_is_used() {
    let Some(gpu) = device(FaultInjection::default()) else { return };
    let (pair, range) = scene();
    let mut matcher = Matcher::on(Ok(gpu), true, &Execution::default()).unwrap();
    let matched = run(&mut matcher, &pair, range).unwrap();
    assert!(matched.maps == expected(&pair, range));
    assert!(matched.note.is_none() && !matched.ran_on.contains("CPU path"), "{}", matched.ran_on);
}

/// The device is lost before the first stage, at a later one, or while the maps are read back.
#[test]
fn lost() {
    let (pair, range) = scene();
    let Some(mut whole) = device(FaultInjection { lost_after: Some(10_000), ..FaultInjection::default() })
    else {
        return;
    };
    assert!(on(&mut whole, &pair, range).is_ok());
    let mut lost = 0;
    for lost_after in [0, 1, 5, 20, 60, 110, 150, 175, 180, 185, 190] {
        let faults = FaultInjection { lost_after: Some(lost_after), ..FaultInjection::default() };
        let mut gpu = device(faults).unwrap();
        match on(&mut gpu, &pair, range) {
            Err(Error::Device(cause)) => {
                lost += 1;
                let said = cause.to_string();
                assert!(said.contains("lost") && is_clear(cause), "after {lost_after}: {said}");
                // The device stays lost.
                assert!(matches!(on(&mut gpu, &pair, range), Err(Error::Device(_))));
            }
            // The match was done by then.
            Ok(solution) => assert!(lost_after > 150 && solution.maps == expected(&pair, range)),
            Err(e) => panic!("after {lost_after}: {e}"),
        }
    }
    assert!(lost >= 7, "{lost}");
    for lost_after in [0, 30] {
        assert_falls_back(
            Ok(device(FaultInjection { lost_after: Some(lost_after), ..FaultInjection::default() }).unwrap()),
            "lost",
        );
    }
}

/// Where falling back is not allowed, the error is returned.
#[test]
fn lost_without_a_fallback() {
    let Some(gpu) = device(FaultInjection { lost_after: Some(3), ..FaultInjection::default() }) else {
        return;
    };
    let (pair, range) = scene();
    let mut matcher = Matcher::on(Ok(gpu), false, &Execution::default()).unwrap();
    assert!(matches!(run(&mut matcher, &pair, range), Err(Error::Device(e)) if is_clear(&e)));
}

#[test]
fn not_there() {
    let missing = || Err(DeviceError::NoDriver.into());
    assert!(Matcher::on(missing(), false, &Execution::default()).is_err());
    assert_falls_back(missing(), "no Vulkan or Metal driver");
}

/// Too little memory for the plan is detected before any buffer is allocated, and a smaller pair still fits.
#[test]
fn out_of_memory() {
    let (pair, range) = scene();
    let faults = FaultInjection { memory: Some(12 << 20), ..FaultInjection::default() };
    let Some(mut gpu) = device(faults) else { return };
    let error = on(&mut gpu, &pair, range).unwrap_err();
    assert!(matches!(&error, Error::Memory(e) if says(e, "has 12 MiB")), "{error}");
    assert_eq!(gpu.traffic().bytes_up, 0);
    let small = corner(&pair);
    assert!(on(&mut gpu, &small, range).unwrap().maps == expected(&small, range));

    let mut matcher = Matcher::on(Ok(gpu), true, &Execution::default()).unwrap();
    let matched = run(&mut matcher, &pair, range).unwrap();
    assert!(matched.maps == expected(&pair, range));
    assert!(matched.ran_on.contains("CPU") && matched.note.unwrap().to_string().contains("MiB"));
    let matched = run(&mut matcher, &small, range).unwrap();
    assert!(matched.maps == expected(&small, range));
    assert!(!matched.ran_on.contains("CPU path") && matched.note.is_none(), "{}", matched.ran_on);
}

/// Buffers and bindings too small for a single row.
#[test]
fn too_small() {
    let (pair, range) = scene();
    for faults in [
        FaultInjection { max_buffer: Some(200_000), ..FaultInjection::default() },
        FaultInjection { max_buffer: Some(700_000), ..FaultInjection::default() },
        FaultInjection { max_binding: Some(100_000), ..FaultInjection::default() },
    ] {
        let Some(mut gpu) = device(faults) else { return };
        let error = on(&mut gpu, &pair, range).unwrap_err();
        assert!(
            matches!(&error, Error::Memory(e @ MemoryError::Buffer { .. }) if is_clear(e)),
            "{faults:?}: {error}"
        );
        assert_falls_back(Ok(gpu), "allows");
    }
}

#[test]
fn hangs() {
    let faults = FaultInjection { patience: Some(Duration::ZERO), ..FaultInjection::default() };
    let Some(mut gpu) = device(faults) else { return };
    let (pair, range) = scene();
    let error = on(&mut gpu, &pair, range).unwrap_err();
    assert!(matches!(&error, Error::Device(e) if says(e, "hangs")), "{error}");
    assert!(matches!(on(&mut gpu, &pair, range), Err(Error::Device(_))));
    assert_falls_back(Ok(gpu), "hangs");
}

/// A driver that rejects a shader, here because of its workgroup size.
#[test]
fn refuses_a_shader() {
    let faults = FaultInjection { max_invocations: Some(32), ..FaultInjection::default() };
    let Some(mut gpu) = device(faults) else { return };
    let (pair, range) = scene();
    let error = on(&mut gpu, &pair, range).unwrap_err();
    assert!(matches!(&error, Error::Device(e) if says(e, "workgroup")), "{error}");
    assert_falls_back(Ok(gpu), "workgroup");
}

/// A driver that computes nothing, or wrong values: the self-test on a small pair detects it.
#[test]
fn computes_nothing() {
    let faults = FaultInjection { noop: true, ..FaultInjection::default() };
    let gpu = || Gpu::with_faults(None, faults);
    let (pair, range) = scene();
    // This driver does not even report an error.
    assert!(on(&mut gpu().unwrap(), &pair, range).unwrap().maps != expected(&pair, range));
    assert_falls_back(gpu(), "self-test");
    let mut matcher = Matcher::on(gpu(), false, &Execution::default()).unwrap();
    let error = run(&mut matcher, &pair, range).unwrap_err();
    assert!(matches!(&error, Error::Device(e) if says(e, "self-test")), "{error}");
}

/// Times are recorded with and without timestamps on the device, and add up to more than 0.
#[test]
fn a_device_without_a_clock() {
    let (pair, range) = scene();
    let execution = Execution { timings: true, ..Execution::default() };
    for no_clock in [false, true] {
        let Some(gpu) = device(FaultInjection { no_clock, ..FaultInjection::default() }) else { return };
        let mut matcher = Matcher::on(Ok(gpu), true, &execution).unwrap();
        let matched = run(&mut matcher, &pair, range).unwrap();
        assert!(matched.maps == expected(&pair, range));
        let of = |stage| matched.timings.iter().filter(move |t| t.stage == stage);
        // The host records no times between the two stages of a sweep.
        let sweep = if no_clock { "flood" } else { "dependency" };
        assert_eq!(of(sweep).count(), matched.plan.levels.len());
        assert_eq!(of("graph").count(), matched.plan.levels.len());
        // The coarsest level: three in each of five phases, and one in each of the second look.
        assert_eq!(of(sweep).map(|t| t.runs).max(), Some(20));
        for stage in ["upload", "cost", "plane", "download"] {
            assert!(of(stage).all(|t| t.runs == 1 && t.time > Duration::ZERO), "{stage}, {no_clock}");
            assert_eq!(of(stage).count(), 1, "{stage}");
        }
    }
}
