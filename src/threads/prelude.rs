//! Loops that are shared among the threads of the pool that they run in.

pub(crate) use rayon::prelude::*;
pub(crate) use rayon::{current_num_threads, join};
