//! Matches of which only some rows of level 0 are held at a time: the same maps as with all rows, the memory that was planned, and
//! nothing left over from the pair before.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

mod common;

use common::random::{self, Random};
use mrfgs::image::Pair;
use mrfgs::low_level::backend::Backend;
use mrfgs::low_level::backend::cpu::Cpu;
use mrfgs::low_level::engine;
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::solver;
use mrfgs::maps::Maps;
use mrfgs::options::{MatchingCost, Method, Order};
use std::ops::ControlFlow;

/// The maps of a match; `whole` holds all rows, because somebody looks in.
fn maps(backend: &mut dyn Backend, plan: &Plan, pair: &Pair, whole: bool) -> Maps {
    let observer = &mut |_| ControlFlow::Continue(());
    let mut looks = 0;
    let mut look = |_: &mut solver::Inspection| {
        looks += 1;
        Ok(())
    };
    let inspector: Option<solver::Inspector> = if whole { Some(&mut look) } else { None };
    let maps = engine::inspect(backend, plan, pair, observer, inspector).unwrap().maps;
    assert_eq!(looks > 0, whole);
    maps
}

/// Any method whose level 0 is streamed: it takes the levels one after the other and compares by a census.
fn method(random: &mut Random) -> Method {
    let neighbours = random.pick(&[0, 2, 2, 4]);
    let mut method = random::method(random, neighbours);
    method.schedule.order = Order::CoarseFirst;
    method.schedule.final_iterations = random.pick(&[0, 1, 2, 3, 3, 4, 7]);
    method.cost.matching = random.pick(&[MatchingCost::Census, MatchingCost::AdCensus]);
    method.cost.outside_cost = method.cost.outside_cost.min(1.625);
    method.graph.levels = random.within(2, 6);
    method
}

#[test]
fn streamed_maps_are_those_of_whole_levels() {
    let mut random = Random::new(17);
    let (mut streamed, mut differ) = (0, 0);
    for _ in 0..60 {
        let size = (random.within(1, 70) as usize, random.within(100, 260) as usize);
        let labels = random.pick(&[1, 16, 17, 40, 40, 70]);
        let method = method(&mut random);
        let plan = random::plan(size, random.within(0, 20).cast_signed() - 10, labels, &method);
        let pair = random::pair(&mut random, size.0, size.1);
        let expected = maps(&mut Cpu::default(), &plan, &pair, true);
        assert!(
            expected == maps(&mut Cpu::default(), &plan, &pair, false),
            "{size:?}, {labels} labels, {method:?}"
        );
        let held = solver::streamed(&plan);
        streamed += usize::from(!held.holds_all_rows());
        assert!(held.bytes() <= plan.bytes());
        // Control: what is compared differs from pair to pair.
        let other = random::pair(&mut random, size.0, size.1);
        differ += usize::from(expected != maps(&mut Cpu::default(), &plan, &other, false));
    }
    assert!(streamed >= 20, "only {streamed} matches were streamed");
    assert!(differ >= 30, "only {differ} pairs have maps of their own");
}

#[test]
fn nothing_is_left_over_from_the_pair_before() {
    let mut random = Random::new(18);
    let plan = random::plan((60, 250), -3, 40, &Method::default());
    assert!(!solver::streamed(&plan).holds_all_rows());
    let mut backend = Cpu::default();
    for byte in [0xff, 0, 0x7f] {
        let pair = random::pair(&mut random, 60, 250);
        let expected = maps(&mut Cpu::default(), &plan, &pair, true);
        assert!(expected == maps(&mut backend, &plan, &pair, false));
        backend.probe().poison(byte).unwrap();
    }
}

#[test]
fn methods_that_look_at_the_whole_level_hold_all_rows() {
    for preset in ["paper", "fgs"] {
        let plan = random::plan((60, 300), 0, 16, &Method::preset(preset).unwrap());
        assert!(solver::streamed(&plan).holds_all_rows(), "{preset}");
    }
    for (name, value) in
        [("matching", "sad"), ("tolerance", "0.1"), ("order", "together"), ("zone-sigmas", "1")]
    {
        let mut method = Method::default();
        assert!(!solver::streamed(&random::plan((60, 300), 0, 16, &method)).holds_all_rows());
        method.set(name, value).unwrap();
        assert!(solver::streamed(&random::plan((60, 300), 0, 16, &method)).holds_all_rows(), "{name}");
    }
}
