//! The parts of the engine that the tests, the benches and the front ends of mrfgs use. They change more often than the rest.

/// The backends, which run the stages: the CPU path and GPUs.
pub mod backend {
    pub use crate::backend::{Backend, Map, NO_LABEL, Promise, Stage, Ticket, Traffic, Volume, volume_shape};

    /// The CPU path.
    pub mod cpu {
        pub use crate::backend::cpu::Cpu;
    }

    /// GPUs, and the shaders.
    pub mod gpu {
        pub use crate::backend::gpu::{
            Bound, Constant, FaultInjection, Gpu, Kernel, MAX_LOOP_ITERATIONS, Shader, UniformLayout,
            binding_number, kernels, may_have_gpu, other_kernels,
        };
        #[cfg(not(target_arch = "wasm32"))]
        pub use crate::backend::gpu::{devices, has_automatic};
    }

    /// Access to the data of a backend, for tests.
    pub mod probe {
        pub use crate::backend::probe::Probe;
    }
}

/// Runs a list of steps on a backend.
pub mod engine {
    pub use crate::engine::{Inspection, Inspector, Solution, finish, solve, start};
}

/// Data that a match derives from a pair: illumination, texture zones, sparse matches, label ranges.
pub mod front {
    pub use crate::front::{Prepared, matches, prepare};
    #[cfg(feature = "paper")]
    pub use crate::front::{label_range, zones};

    /// The conditioning of a pair.
    pub mod conditioning {
        pub use crate::front::conditioning::condition;
    }

    /// The correction of the illumination.
    #[cfg(feature = "paper")]
    pub mod illumination {
        pub use crate::front::illumination::homomorphic;
    }
}

/// The members of the dependency factors.
pub mod graph {
    pub use crate::graph::{LevelGraph, code, of_level};
}

/// The plan of a match, known before it runs: levels, integer parameters, bounds, memory.
pub mod plan {
    pub use crate::plan::{
        COST_MAX, FullSize, HARD_CAP, LevelPlan, Plan, Truncation, TruncationRule, UNITS_PER_NAT,
        VolumeWidth, patches, votes,
    };
}

/// Data that belongs to one process, and how it behaves when the process forks.
pub mod process {
    pub use crate::process::{Own, Turns};
}

/// A match as a list of steps: the schedule, and tiles for pairs that exceed the memory.
pub mod program {
    pub use crate::program::{Program, Run, SentMessages, Step};

    /// The basic list of steps.
    pub mod schedule {
        pub use crate::program::schedule::{flood, join};
    }

    /// Tiles for pairs that exceed the memory.
    pub mod tiles {
        pub use crate::program::tiles::{OVERLAP, Tiles};
    }

    /// The wavefront of stages over bands of rows.
    pub mod together {
        pub use crate::program::together::streamed;
    }
}

/// A lower bound on the cost of message passing, to compare a machine with.
pub mod roofline {
    pub use crate::roofline::{bytes, label_updates, message_stages};
}

/// The stages, exactly defined.
pub mod stage {
    pub use crate::stage::prior::{LabelPrior, LevelPriors};
    pub use crate::stage::{Data, Map, NO_ANCHOR, Start};
}

/// Reads small text files, and quotes them in messages.
pub mod text {
    pub use crate::text::{quoted, read};
}

/// Progress and time of a match.
pub mod watch {
    pub use crate::watch::{Followed, Observer, Watch};
}

/// Weights in integers, and the functions that they come from.
pub mod weights {
    pub use crate::weights::{MedianWeights, patch_weights};
}
