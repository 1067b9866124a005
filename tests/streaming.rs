//! Streamed matches, which hold only some rows of level 0 at a time: the same maps as with all rows, within the planned
//! memory, and independent of the pair before.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

mod common;

use common::devices;
use common::random::{self, Random};
use mrfgs::error::BudgetError;
use mrfgs::image::Pair;
use mrfgs::low_level::backend::Backend;
use mrfgs::low_level::backend::cpu::Cpu;
use mrfgs::low_level::backend::gpu::FaultInjection;
use mrfgs::low_level::engine::{Inspection, Inspector};
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::program::together::streamed;
use mrfgs::maps::Maps;
use mrfgs::options::{MatchingCost, Method, Order};
use mrfgs::{Error, Matcher};
use std::ops::ControlFlow;

/// The maps of a match; with `whole` an inspector makes it hold all rows.
fn maps(backend: &mut dyn Backend, plan: &Plan, pair: &Pair, whole: bool) -> Maps {
    let observer = &mut |_| ControlFlow::Continue(());
    let mut looks = 0;
    let mut look = |_: &mut Inspection| {
        looks += 1;
        Ok(())
    };
    let inspector: Option<Inspector> = if whole { Some(&mut look) } else { None };
    let maps = common::inspect(backend, plan, pair, observer, inspector).unwrap().maps;
    assert_eq!(looks > 0, whole);
    maps
}

/// A plan with so little memory that a device, which prefers to hold all rows, streams as well.
fn plan(size: (usize, usize), min: i32, labels: usize, method: &Method) -> Plan {
    let mut method = method.clone();
    method.tiles.memory = 1;
    random::plan(size, min, labels, &method)
}

/// A random method that streams level 0: coarse-first order, and a matching cost computed by rows.
fn method(random: &mut Random) -> Method {
    let neighbours = random.pick(&[0, 2, 2, 4]);
    let mut method = random::method(random, neighbours);
    method.schedule.order = Order::CoarseFirst;
    method.schedule.final_iterations = random.pick(&[0, 1, 2, 3, 3, 4, 7]);
    method.schedule.looks = random.pick(&[1, 1, 2, 3]);
    let by_rows: Vec<_> = MatchingCost::ALL.iter().copied().filter(|cost| cost.facts().by_rows).collect();
    method.cost.matching = random.pick(&by_rows);
    method.cost.outside_cost = method.cost.outside_cost.min(1.625);
    method.graph.levels = random.within(2, 6);
    method
}

#[test]
fn streamed_maps_equal_those_of_whole_levels() {
    let mut random = Random::new(17);
    let (mut held_less, mut held_costs, mut differ) = (0, 0, 0);
    for i in 0..50 {
        let size = (random.within(1, 70) as usize, random.within(120, 420) as usize);
        let labels = random.pick(&[1, 16, 17, 40, 40, 70]);
        let method = method(&mut random);
        let plan = plan(size, random.within(0, 20).cast_signed() - 10, labels, &method);
        let pair = random::pair(&mut random, size.0, size.1);
        let expected = maps(&mut Cpu::default(), &plan, &pair, true);
        let held = streamed(&plan);
        held_less += usize::from(!held.holds_all_rows());
        assert!(held.bytes() <= plan.bytes());
        // With enough memory the CPU path keeps all costs.
        let more = Plan { memory: 4096, ..plan.clone() };
        held_costs += usize::from(streamed(&more).on_host().holds_costs);
        assert!(!held.on_host().holds_costs && expected == maps(&mut Cpu::default(), &more, &pair, false));
        // The device is slower, so it runs every third case only.
        for (name, mut backend) in devices::backends().into_iter().take(if i % 3 == 0 { 2 } else { 1 }) {
            assert!(
                expected == maps(&mut *backend, &plan, &pair, false),
                "{name}: {size:?}, {labels} labels, {method:?}"
            );
            let (took, bound) = (backend.traffic().bytes_held, held.bytes());
            assert!(
                took <= bound,
                "{name} holds {took} of {bound} bytes: {size:?}, {labels} labels, {method:?}"
            );
        }
        // Control: the maps differ from pair to pair.
        let other = random::pair(&mut random, size.0, size.1);
        differ += usize::from(expected != maps(&mut Cpu::default(), &plan, &other, false));
    }
    assert!(held_less >= 20, "only {held_less} matches were streamed");
    assert_eq!(held_costs, held_less);
    assert!(differ >= 30, "only {differ} pairs have maps of their own");
}

#[test]
fn a_device_streams_images_of_any_height() {
    let Some(mut gpu) = devices::gpu() else { return };
    let mut random = Random::new(20);
    for height in (320..=353).step_by(3).chain([321, 322, 352]) {
        let mut method = Method::default();
        (method.refinement.right_map, method.schedule.final_iterations) = (true, random.pick(&[0, 3]));
        let plan = plan((40, height), 0, 24, &method);
        assert!(!streamed(&plan).holds_all_rows());
        let pair = random::pair(&mut random, 40, height);
        let expected = maps(&mut Cpu::default(), &plan, &pair, true);
        assert!(expected == maps(&mut gpu, &plan, &pair, false), "height {height}");
    }
}

/// In small buffers a ring is split into pieces of fewer rows.
#[test]
fn a_device_streams_in_small_buffers() {
    let mut random = Random::new(21);
    let plan = plan((40, 300), 0, 300, &Method::default());
    assert!(!streamed(&plan).holds_all_rows());
    let pair = random::pair(&mut random, 40, 300);
    let expected = maps(&mut Cpu::default(), &plan, &pair, true);
    // 14 rows of dependency messages per buffer; then 57 rows, 7 of them per binding.
    for (buffer, binding) in [(1 << 19, 1 << 19), (1 << 21, 1 << 18)] {
        let faults =
            FaultInjection { max_buffer: Some(buffer), max_binding: Some(binding), ..Default::default() };
        let Some(mut gpu) = devices::open(faults) else { return };
        assert!(expected == maps(&mut gpu, &plan, &pair, false), "buffers of {buffer} bytes");
    }
}

#[test]
fn a_device_with_enough_memory_holds_all_rows() {
    let Some(mut gpu) = devices::gpu() else { return };
    let mut random = Random::new(19);
    let pair = random::pair(&mut random, 64, 400);
    let held = [1, 4096].map(|memory| {
        let mut method = Method::default();
        method.tiles.memory = memory;
        maps(&mut gpu, &random::plan((64, 400), 0, 64, &method), &pair, false);
        gpu.traffic().bytes_held
    });
    assert!(held[0] < held[1] * 3 / 4, "{held:?}");
}

#[test]
fn nothing_remains_of_the_pair_before() {
    let mut random = Random::new(18);
    let plan = plan((60, 330), -3, 40, &Method::default());
    assert!(!streamed(&plan).holds_all_rows());
    for (name, mut backend) in devices::backends() {
        for byte in [0xff, 0, 0x7f] {
            let pair = random::pair(&mut random, 60, 330);
            let expected = maps(&mut Cpu::default(), &plan, &pair, true);
            assert!(expected == maps(&mut *backend, &plan, &pair, false), "{name}");
            backend.probe().poison(byte).unwrap();
        }
    }
}

/// Inspecting the steps needs memory for all rows.
#[test]
fn inspection_is_refused_where_not_all_rows_fit() {
    let mut random = Random::new(22);
    let pair = random::pair(&mut random, 64, 400);
    let mib = |plan: &Plan| plan.bytes().div_ceil(1 << 20) as u32;
    let whole = random::plan((64, 400), 0, 64, &Method::default());
    let (least, enough) = (mib(&streamed(&whole)), mib(&whole));
    assert!(least < enough);
    for (memory, fits) in [(least, false), (enough - 1, false), (enough, true)] {
        let mut method = Method::default();
        method.tiles.memory = memory;
        let mut matcher = Matcher::builder().method(method).device("cpu").build().unwrap();
        assert_eq!(matcher.job(&pair, 0..=63).run().unwrap().tiles.count(), 1);
        let steps = matcher.job(&pair, 0..=63).inspect(|_| Ok(())).run();
        match steps {
            Ok(_) => assert!(fits, "{memory} MiB"),
            Err(e) => {
                let needed = u64::from(enough);
                assert!(!fits && e == Error::Budget(BudgetError::Steps { needed }), "{memory} MiB: {e}");
            }
        }
    }
}

#[test]
fn methods_that_need_the_whole_level_hold_all_rows() {
    for preset in ["paper", "fgs"] {
        let plan = random::plan((60, 300), 0, 16, &Method::preset(preset).unwrap());
        assert!(streamed(&plan).holds_all_rows(), "{preset}");
    }
    for (name, value) in
        [("matching", "sad"), ("tolerance", "0.1"), ("order", "together"), ("zone-sigmas", "1")]
    {
        let mut method = Method::default();
        assert!(!streamed(&random::plan((60, 300), 0, 16, &method)).holds_all_rows());
        method.set(name, value).unwrap();
        assert!(streamed(&random::plan((60, 300), 0, 16, &method)).holds_all_rows(), "{name}");
    }
}
