//! One iteration within a level.

use crate::common::random::{self, Random};
use crate::common::twin;
use crate::common::{graphs, prepare};
use crate::{on_all, same};
use mrfgs::low_level::backend::cpu::Cpu;
use mrfgs::low_level::backend::{Backend, Stage, Volume};
use mrfgs::options::Method;

#[test]
fn flood() {
    on_all(|case, backend, random| {
        let state = case.state(random, true);
        for (z, graph) in case.graphs.iter().enumerate() {
            state.write(backend);
            backend.run(Stage::Flood(z)).unwrap();
            let others = [&state.evidence[z][..], &state.down[z], &state.up[z]];
            let old = (&state.belief[z][..], &state.dependency[z][..]);
            let (beliefs, messages) = twin::flood::flood(&case.plan, z, graph, &state.has[z], old, others);
            same(&case.plan, backend, Volume::Dependency(z), &messages)?;
            same(&case.plan, backend, Volume::Belief(z), &beliefs)?;
        }
        Ok(())
    });
}

/// Every thread of the CPU path sweeps its own bands; beliefs near borders must wait for their messages.
#[test]
fn sweeps_in_bands_equal_the_two_stages() {
    let mut random = Random::new(11);
    for preset in ["default", "paper"] {
        // The rows do not divide evenly into bands.
        let plan = random::plan((9, 133), -2, 21, &Method::preset(preset).unwrap());
        let pair = random::pair(&mut random, 9, 133);
        let graphs = graphs(pair.left(), &plan);
        let state = random::state(&mut random, &plan, &graphs, true);
        let run = |threads: usize, stages: &[Stage]| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut cpu = Cpu::default();
                prepare(&mut cpu, &plan, &pair, &graphs);
                state.write(&mut cpu);
                for &stage in stages {
                    cpu.run(stage).unwrap();
                }
                [Volume::Dependency(0), Volume::Belief(0)].map(|volume| cpu.probe().read(volume).unwrap())
            })
        };
        let expected = run(1, &[Stage::Dependency(0), Stage::Belief(0)]);
        for threads in [1, 2, 3] {
            assert!(run(threads, &[Stage::Flood(0)]) == expected, "{preset}, {threads} threads");
        }
        // Control: summing beliefs before messages are sent gives a different result.
        assert!(run(2, &[Stage::Belief(0), Stage::Dependency(0)]) != expected, "{preset}");
    }
}
