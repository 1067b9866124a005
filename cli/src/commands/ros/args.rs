//! The arguments of `mrfgs ros`.

use std::path::PathBuf;

use mrfgs::low_level::text::quoted;
use mrfgs_node::names::{Names, Rule};
use mrfgs_node::topics::{GID_BYTES, LONG_GID_BYTES, MOST_DOMAIN};

use crate::args::recording::nanoseconds;
use crate::args::{
    CameraArgs, CropArgs, ExecutionArgs, MethodArgs, PriorArgs, PriorTopicArgs, RectificationArgs, Search,
};
use crate::failure::{Failure, Result};
use crate::outputs::AlsoArgs;

/// The default name of the node.
const NODE: &str = "mrfgs";
/// The environment variable of the domain.
const DOMAIN: &str = "ROS_DOMAIN_ID";
/// The environment variable of the ROS release, and the releases with longer identifiers.
const RELEASE: &str = "ROS_DISTRO";
const LONG: [&str; 3] = ["foxy", "galactic", "humble"];
const EXAMPLES: &str = "\
Examples:
  mrfgs ros --method fast --max-disparity 63
  # Rectified images on topics with other names:
  mrfgs ros -r left/image_raw:=/l/image_rect -r right/image_raw:=/r/image_rect
  # Cameras below /stereo, and more topics:
  mrfgs ros -r __ns:=/stereo --also depth,points
  # Cameras that are not triggered together:
  mrfgs ros --tolerance 0.005
  # With a lidar, and where it stands:
  mrfgs ros --prior-topic lidar/points --prior-pose lidar.txt
  # Cameras that stand still:
  mrfgs ros --prior last";

/// The flag `--prior` of nodes.
const PRIOR: &str = "Disparities that are known: a file for all frames, or `last` for the frame before";
const PRIORS: &str = "\
Files are as for `mrfgs match`. With `last`, the disparities measured in a frame are known in the next: for cameras that stand still, \
whose maps then flicker less.";

/// Match live images of two cameras in ROS 2
///
/// A ROS 2 node that needs no ROS installation: it speaks DDS, like Cyclone DDS and Fast DDS. It subscribes to `left/image_raw`,
/// `right/image_raw` and the `camera_info` beside each, and publishes `disparity` (`stereo_msgs/msg/DisparityImage`) with the time and
/// frame of the left image. --also adds topics: depth on `depth/image_rect`, depth-mm on `depth/image_rect_raw` (both with
/// `depth/camera_info`), points on `points2`, sigma on `sigma`, depth-sigma on `depth/sigma`, confidence on `confidence`, validity on
/// `validity`, and in the view of the camera of --into depth-registered on `depth_registered/image` and depth-registered-mm on
/// `depth_registered/image_raw`, with `depth_registered/camera_info`.
///
/// Images on topics such as `image_rect` count as rectified; others are rectified with their `camera_info`. Topics that end in
/// `/compressed` carry `CompressedImage`.
///
/// If matching is slower than the cameras, only the newest pair is matched. Without subscribers nothing is matched. Every ten seconds a
/// line tells how many frames were matched, how long they took and what was skipped. The node ends with Ctrl-C or SIGTERM, with exit status
/// 0. Malformed messages are reported and skipped.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
#[command(mut_arg("prior", |arg| arg.help(PRIOR).long_help(format!("{PRIOR}\n\n{PRIORS}"))))]
#[allow(clippy::struct_excessive_bools, reason = "each is a flag")]
pub(crate) struct Args {
    /// Renames a topic as in ROS: `FROM:=TO`. `__ns:=/NAMESPACE` puts all topics into a namespace, and `__node:=NAME` renames the node,
    /// whose name prefixes topics that start with ~/
    #[arg(short, long, value_name = "FROM:=TO")]
    remap: Vec<Rule>,
    /// Launch files of ROS put this before their flags
    #[arg(long = "ros-args", hide = true)]
    _from_launch_file: bool,
    /// DDS domain, 0 to 232; nodes in other domains are invisible [default: `ROS_DOMAIN_ID`, or 0]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(..=i64::from(MOST_DOMAIN)))]
    domain: Option<u16>,
    /// Requests lost images again, from cameras that support it. Otherwise they are skipped, as is usual for sensors in ROS
    #[arg(long)]
    pub(super) reliable: bool,
    /// Maximum difference in time between the two images of a pair, in seconds: less than half the time between two images of a camera
    /// [default: 0]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = nanoseconds)]
    pub(super) tolerance: Option<u64>,
    #[command(flatten)]
    pub(super) search: Search,
    /// Calibration that replaces the cameras' own, as for `mrfgs match`
    #[arg(long, value_name = "FILE")]
    pub(super) calib: Vec<PathBuf>,
    #[command(flatten)]
    pub(super) crop: CropArgs,
    #[command(flatten)]
    pub(super) numbers: CameraArgs,
    #[command(flatten)]
    pub(super) rectification: RectificationArgs,
    /// Steadies still surfaces: where the image does not change, disparities are averaged with earlier frames, weighted by confidence
    #[arg(long)]
    pub(super) steady: bool,
    /// Corrects the frames if their matches show that the right camera has turned since the calibration
    #[arg(long)]
    pub(super) recalibrate: bool,
    #[command(flatten)]
    pub(super) prior: PriorArgs,
    #[command(flatten)]
    pub(super) prior_topic: PriorTopicArgs,
    #[command(flatten)]
    pub(super) also: AlsoArgs,
    /// Prints errors only
    #[arg(long)]
    pub(super) quiet: bool,

    #[command(flatten)]
    pub(super) method: MethodArgs,
    #[command(flatten)]
    pub(super) execution: ExecutionArgs,
}

impl Args {
    /// The names of the node and its topics.
    pub(super) fn names(&self) -> Result<Names> {
        Names::new(NODE, &self.remap).map_err(|reason| Failure::usage("--remap", reason))
    }

    /// The DDS domain.
    pub(super) fn domain(&self) -> Result<u16> {
        if let Some(domain) = self.domain {
            return Ok(domain);
        }
        match std::env::var(DOMAIN) {
            Ok(text) if !text.is_empty() => {
                let domain = text.trim().parse().ok().filter(|domain| *domain <= MOST_DOMAIN);
                let reason =
                    format!("{} is not a domain; give a number from 0 to {MOST_DOMAIN}", quoted(&text));
                domain.ok_or_else(|| Failure::usage(DOMAIN, reason))
            }
            _ => Ok(0),
        }
    }
}

/// The size of identifiers in bytes, for the ROS release of this shell, else for current releases.
pub(super) fn gid_bytes() -> usize {
    let is_old = std::env::var(RELEASE).is_ok_and(|release| LONG.contains(&release.as_str()));
    if is_old { LONG_GID_BYTES } else { GID_BYTES }
}
