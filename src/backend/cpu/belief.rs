//! Beliefs: see [`crate::backend::Stage::Belief`].

use super::message::Message;
use crate::graph::LevelGraph;
use rayon::prelude::*;

pub(super) fn run<M: Message>(
    stride: usize,
    graph: &LevelGraph,
    evidence: &[u8],
    dependency: &[M],
    down: &[M],
    up: &[M],
    belief: &mut [u16],
) {
    let width = graph.width();
    belief.par_chunks_mut(width * stride).enumerate().for_each(|(y, row)| {
        for (x, belief) in row.chunks_exact_mut(stride).enumerate() {
            let pixel = y * width + x;
            let at = pixel * stride;
            for (b, &e) in belief.iter_mut().zip(&evidence[at..][..stride]) {
                *b = e.into();
            }
            // Empty at the coarsest and the finest level.
            for messages in [down, up] {
                if let Some(message) = messages.get(at..at + stride) {
                    add(belief, message);
                }
            }
            for &entry in graph.incoming_of(pixel) {
                add(belief, &dependency[entry as usize * stride..][..stride]);
            }
        }
    });
}

fn add<M: Message>(belief: &mut [u16], message: &[M]) {
    for (b, &m) in belief.iter_mut().zip(message) {
        let m: u16 = m.into();
        *b += m;
    }
}
