//! The graph of a level, and its transposed table.

use crate::common::compare::compare_maps;
use crate::common::devices::backends;
use crate::common::random::{self, Random};
use crate::common::{graphs, twin};
use crate::{cases, on_all};
use mrfgs::low_level::backend::Stage;
use mrfgs::low_level::front::Prepared;

#[test]
fn graph() {
    on_all(|case, backend, _| {
        let expected = twin::graph::graphs(case.pair.left(), &case.plan);
        for (z, codes) in expected.into_iter().enumerate() {
            backend.run(Stage::Graph(z)).unwrap();
            if backend.probe().graph(z).unwrap().codes() != codes {
                return Err(format!("the graph of level {z} is not the twin's"));
            }
        }
        Ok(())
    });
}

/// A graph that was set is read back unchanged.
#[test]
fn a_graph_can_be_set() {
    on_all(|case, backend, _| {
        for (z, graph) in case.graphs.iter().enumerate() {
            if backend.probe().graph(z).unwrap() != *graph {
                return Err(format!("another graph of level {z}"));
            }
        }
        Ok(())
    });
}

#[test]
fn the_transposed_table_has_every_member_once() {
    for case in cases() {
        for graph in case.graphs.iter().chain(&graphs(case.pair.left(), &case.plan)) {
            let mut incoming = vec![Vec::new(); graph.width() * graph.height()];
            for factor in 0..incoming.len() {
                for (slot, member) in twin::members(graph, factor).into_iter().enumerate() {
                    assert_eq!(graph.member(factor, slot), member);
                    if let Some(pixel) = member {
                        incoming[pixel].push((factor, slot));
                    }
                }
            }
            for (pixel, slots) in incoming.iter().enumerate() {
                let found = graph.incoming_of(pixel).iter().map(|entry| {
                    let (dx, dy, slot) = entry.parts();
                    (pixel.wrapping_add_signed(dy * graph.width() as isize + dx), slot)
                });
                assert_eq!(found.collect::<Vec<_>>(), *slots, "pixel {pixel} of {}", case.name);
            }
        }
    }
}

#[test]
fn downsample() {
    for case in cases() {
        let (actual, expected) = (case.pair.left().downsampled(), twin::graph::downsample(case.pair.left()));
        compare_maps("pixels", &actual.pixels, &expected.pixels).unwrap();
        compare_maps("mask", &actual.masked, &expected.masked).unwrap();
    }
}

/// Negative control: a slightly larger range sigma changes a neighbour somewhere.
#[test]
fn control_a_changed_sigma_is_found() {
    let mut random = Random::new(8);
    let method = random::method(&mut random, 8);
    let plan = random::plan((31, 19), 0, 4, &method);
    let mut other = plan.clone();
    other.method.graph.sigma_range *= 1.05;
    let pair = loop {
        let pair = random::pair(&mut random, 31, 19);
        let image = pair.left();
        if image.pixels[(0, 0)] != image.pixels[(1, 0)] && !image.masked.data().contains(&true) {
            break pair;
        }
    };
    for (name, mut backend) in backends() {
        backend.prepare(&plan, Prepared::new(&pair)).unwrap();
        backend.run(Stage::Graph(0)).unwrap();
        let graph = backend.probe().graph(0).unwrap();
        assert_eq!(graph.codes(), twin::graph::graphs(pair.left(), &plan)[0], "{name}");
        assert_ne!(graph.codes(), twin::graph::graphs(pair.left(), &other)[0], "{name}");
    }
}
