//! The arguments of `mrfgs ros`.

use std::path::PathBuf;

use mrfgs::low_level::text::quoted;
use mrfgs_node::names::{Names, Rule};
use mrfgs_node::topics::{GID_BYTES, LONG_GID_BYTES, MOST_DOMAIN};

use crate::args::{CameraArgs, CropArgs, ExecutionArgs, MethodArgs, RectificationArgs, Search, nanoseconds};
use crate::failure::{Failure, Result};
use crate::outputs::AlsoArgs;

/// The name of the node, unless it is given another one.
const NODE: &str = "mrfgs";
/// The variable that names the domain.
const DOMAIN: &str = "ROS_DOMAIN_ID";
/// The variable that names the release of ROS, and those whose identifiers are longer.
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
  mrfgs ros --tolerance 0.005";

/// Match what two cameras publish in ROS 2, live
///
/// A node of ROS 2 that takes no ROS: it speaks DDS, as ROS does by Cyclone DDS, Fast DDS and others. It subscribes to the images
/// `left/image_raw` and `right/image_raw` and to the `camera_info` beside each, and publishes `disparity`
/// (`stereo_msgs/msg/DisparityImage`) with the time and the frame of the left image. With --also depth, depth-mm, points, sigma, depth-sigma,
/// confidence and validity it publishes these, too: on `depth/image_rect`, `depth/image_rect_raw`, `points2`, `sigma`, `depth/sigma`,
/// `confidence` and `validity`, and depths with a `depth/camera_info`; with --also depth-registered and depth-registered-mm the depths that
/// the camera of --into sees, on `depth_registered/image` and `depth_registered/image_raw`, with a `depth_registered/camera_info`.
///
/// Images on topics such as `image_rect` are rectified; others are rectified by their `camera_info`. Topics that end in `/compressed`
/// hold `CompressedImage`.
///
/// A node that is slower than its cameras leaves out all pairs but the newest one. While nobody subscribes, nothing is matched. Every
/// ten seconds it says how many frames it has matched, how long they took and what it left out. It ends with Ctrl-C or SIGTERM, and then
/// its exit status is 0. What a camera sends that makes no sense is told and left out.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
#[allow(clippy::struct_excessive_bools, reason = "each is a flag")]
pub(crate) struct Args {
    /// Gives a topic another name, as ROS does: `FROM:=TO`. `__ns:=/NAMESPACE` puts all topics below a namespace, and `__node:=NAME`
    /// renames the node, below which topics are that begin with ~/
    #[arg(short, long, value_name = "FROM:=TO")]
    remap: Vec<Rule>,
    /// What launch files of ROS begin their flags with
    #[arg(long = "ros-args", hide = true)]
    _from_launch_file: bool,
    /// The domain, 0 to 232: nodes of other domains are not seen [default: that of the variable `ROS_DOMAIN_ID`, or 0]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(..=i64::from(MOST_DOMAIN)))]
    domain: Option<u16>,
    /// Has images that were lost sent again, by cameras that offer it. Else they are lost, as ROS has it for sensors
    #[arg(long)]
    pub(super) reliable: bool,
    /// How far the times of two images may be apart that are a pair, in seconds: less than half of the time between two images of a
    /// camera [default: 0]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = nanoseconds)]
    pub(super) tolerance: Option<u64>,
    #[command(flatten)]
    pub(super) search: Search,
    /// Calibration, in the place of what the cameras say: as `mrfgs match` takes it
    #[arg(long, value_name = "FILE")]
    pub(super) calib: Vec<PathBuf>,
    #[command(flatten)]
    pub(super) crop: CropArgs,
    #[command(flatten)]
    pub(super) numbers: CameraArgs,
    #[command(flatten)]
    pub(super) rectification: RectificationArgs,
    /// Where the image does not change, the disparity follows that of the frames before, weighted by confidence: still surfaces flicker
    /// less
    #[arg(long)]
    pub(super) steady: bool,
    /// Where matches in the frames show that the right camera has turned since the calibration, corrects the frames from then on
    #[arg(long)]
    pub(super) recalibrate: bool,
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
    /// The names that the topics get.
    pub(super) fn names(&self) -> Result<Names> {
        Names::new(NODE, &self.remap).map_err(|reason| Failure::usage("--remap", reason))
    }

    /// The domain of DDS.
    pub(super) fn domain(&self) -> Result<u16> {
        if let Some(domain) = self.domain {
            return Ok(domain);
        }
        match std::env::var(DOMAIN) {
            Ok(text) if !text.is_empty() => {
                let domain = text.trim().parse().ok().filter(|domain| *domain <= MOST_DOMAIN);
                let reason = format!("{} is no domain; give a number from 0 to {MOST_DOMAIN}", quoted(&text));
                domain.ok_or_else(|| Failure::usage(DOMAIN, reason))
            }
            _ => Ok(0),
        }
    }
}

/// The bytes of identifiers in the release of ROS whose set-up this shell has read, or in today's.
pub(super) fn gid_bytes() -> usize {
    let is_old = std::env::var(RELEASE).is_ok_and(|release| LONG.contains(&release.as_str()));
    if is_old { LONG_GID_BYTES } else { GID_BYTES }
}
