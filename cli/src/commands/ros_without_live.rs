//! The stand-in for `mrfgs ros` without the feature `live`.

use crate::failure::{Failure, Result};
use crate::outputs::WITHOUT_LIVE;

/// Match live images of two cameras in ROS 2, which takes the feature `live`
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Whatever the command takes
    #[arg(hide = true, allow_hyphen_values = true, trailing_var_arg = true)]
    _all: Vec<String>,
}

/// Says what is missing.
pub(crate) fn run(_: &Args) -> Result<()> {
    Err(Failure::usage("ros", WITHOUT_LIVE))
}
