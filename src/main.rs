//! The command line of mrfgs.

fn main() {}
