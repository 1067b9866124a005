//! The flags of a prior: known disparities of the left view.

use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::ValueEnum;
use mrfgs::calibration::cameras::Pose;
use mrfgs::calibration::{pose, trajectory};
use mrfgs::depth::Rig;
use mrfgs::error::ReadError;
use mrfgs::image::read::Reader;
use mrfgs::image::read_cloud;
use mrfgs::low_level::text;
use mrfgs::prior::{PriorKind, PriorPoint};
use mrfgs::{Error, Prior};
use serde::Serialize;

use crate::args::{CameraNeed, Sign};
use crate::failure::{Failure, Result};

/// The name of the group of flags that say what is known. There is at most one of them.
const KNOWN: &str = "known";

/// Largest list of points, in bytes.
const MOST_BYTES: u64 = 1 << 30;

/// How a prior is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Exact but sparse: cleaned, spread, and they decide where no match can be trusted
    Points,
    /// Dense but coarse: it only shifts the balance between disparities
    Surface,
}

/// A unit of lengths.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LengthUnit {
    /// Millimetres
    Mm,
    /// Centimetres
    Cm,
    /// Metres
    M,
}

impl LengthUnit {
    fn millimetres(self) -> f64 {
        match self {
            Self::Mm => 1.0,
            Self::Cm => 10.0,
            Self::M => 1000.0,
        }
    }

    /// The units of the baseline in one of these; 1 if that of the baseline is unknown.
    fn scale(self, rig: &Rig) -> f64 {
        rig.unit().millimetres().map_or(1.0, |theirs| self.millimetres() / theirs)
    }
}

/// The flags of a prior: disparities of the left view that are known before the match.
#[derive(clap::Args, Clone, Serialize)]
#[command(next_help_heading = "What is known of the scene")]
pub(crate) struct PriorArgs {
    /// Disparities of LEFT that are known: points of a lidar or of a bundle adjustment, a terrain model, the map of the last frame
    ///
    /// - A disparity map of LEFT (PFM, TIFF, PNG as in KITTI, NPY; 0 of a PNG, infinity and NaN are unknown), also of another size.
    /// - A depth map of LEFT, with --prior-unit.
    /// - A .csv or .txt file with a line `x,y,disparity` or `x,y,disparity,sigma` for each point, in pixels.
    /// - A point cloud: .ply, .pcd, .las, .laz, .xyz (text), .bin (KITTI), or COLMAP's points3D.txt. It needs a calibration. Points are in
    ///   the frame of the left camera (x right, y down, z forward; with --rectify, as it took LEFT), or moved there by --prior-pose.
    ///
    /// With --rectify, maps and lists belong to the rectified view.
    #[arg(long, value_name = "FILE", group = KNOWN)]
    // Not recorded here, nor is the pose: they are among the inputs.
    #[serde(skip)]
    prior: Option<PathBuf>,
    /// Standard deviation of the known disparities, in pixels [default: 0.25 for points, 1 for surfaces]
    #[arg(long, value_name = "PIXELS", requires = KNOWN, allow_negative_numbers = true)]
    prior_sigma: Option<f64>,
    /// How to use them [default: points where at most a fifth of the pixels are known]
    #[arg(long, value_enum, value_name = "KIND", requires = "prior")]
    prior_kind: Option<Kind>,
    /// Unit of the file. A map with a unit holds depths, and a list x,y,depth [default: pixels of disparity; for a point cloud the unit of
    /// the baseline]
    #[arg(long, value_enum, value_name = "UNIT", requires = KNOWN)]
    prior_unit: Option<LengthUnit>,
    /// Where a point cloud comes from: the rotation and translation that take its points into the frame of the left camera
    ///
    /// A text with 12 or 16 numbers, the rows of [R T]; entries R and T in YAML, JSON or as in KITTI's `calib_velo_to_cam.txt`; KITTI's
    /// `Tr_velo_to_cam` or Tr; or COLMAP's images.txt, whose first image is the left one.
    #[arg(long, value_name = "FILE", requires = KNOWN)]
    #[serde(skip)]
    prior_pose: Option<PathBuf>,
}

/// Points that arrive beside the images.
#[derive(clap::Args, Clone)]
#[command(next_help_heading = "What is known of the scene")]
pub(crate) struct PriorTopicArgs {
    /// Topic of a lidar, whose points are known in the images taken at the same time
    ///
    /// It carries `sensor_msgs/msg/PointCloud2` in metres, with x, y and z as float32 or float64. Each pair takes the cloud whose time is
    /// nearest to that of the left image, at most 0.1 s from it. The points must be in the frame of the left camera (x right, y down, z
    /// forward; as it took the image). tf is not read: if they are in another frame, give --prior-pose, with the matrix that
    /// `ros2 run tf2_ros tf2_echo CAMERA LIDAR` prints for the frames of the left image and of the cloud.
    #[arg(long, value_name = "TOPIC", group = KNOWN)]
    pub(crate) prior_topic: Option<String>,
}

/// The view that a prior is for.
#[derive(Clone, Copy)]
pub(crate) struct PriorView {
    /// Width and height of the left view in pixels.
    pub(crate) size: (usize, usize),
    /// The user's sign of disparities.
    pub(crate) sign: Sign,
    /// The cameras, with points in the frame of the left camera that took the image.
    pub(crate) rig: Option<Rig>,
}

/// The flag of a lidar's topic.
pub(crate) const PRIOR_TOPIC: &str = "--prior-topic";
/// The flags of a prior, for messages.
const FLAGS: PriorNames =
    PriorNames { file: "--prior", kind: "--prior-kind", unit: "--prior-unit", pose: POSE };
/// The flag of a pose.
pub(crate) const POSE: &str = "--prior-pose";

impl PriorArgs {
    /// The file, if there is one.
    pub(crate) fn file(&self) -> Option<&Path> {
        self.prior.as_deref()
    }

    /// The files that no output may overwrite, each with its name.
    pub(crate) fn inputs(&self) -> impl Iterator<Item = (&'static str, &Path)> {
        let files = [("the file of --prior", &self.prior), ("the file of --prior-pose", &self.prior_pose)];
        files.into_iter().filter_map(|(name, file)| Some((name, file.as_deref()?)))
    }

    /// Why the cameras are needed, if they are.
    pub(crate) fn need(&self) -> Option<CameraNeed> {
        self.file().and_then(|path| self.need_of(path))
    }

    /// Why the cameras are needed for a file that is read as the flags say, if they are.
    pub(crate) fn need_of(&self, path: &Path) -> Option<CameraNeed> {
        self.at(path).need()
    }

    /// Reads the prior for a view.
    pub(crate) fn read(&self, view: PriorView) -> Result<Option<Arc<Prior>>> {
        self.check_sigma()?;
        self.file().map(|path| self.at(path).read(view)).transpose()
    }

    /// Reads `path` in place of the file of --prior, with `pose` in place of the file of --prior-pose.
    pub(crate) fn read_posed(&self, path: &Path, pose: Option<Pose>, view: PriorView) -> Result<Arc<Prior>> {
        self.check_sigma()?;
        PriorFile { pose: pose.map(CloudPose::Known), ..self.at(path) }.read(view)
    }

    /// Reads the pose of a point cloud, if there is one.
    pub(crate) fn pose(&self) -> Result<Option<Pose>> {
        Ok(self.prior_pose.as_deref().map(pose::read).transpose()?)
    }

    /// Reads how the cameras move from frame to frame, if --prior-pose says it.
    pub(crate) fn way(&self, view: PriorView) -> Result<Option<Way>> {
        let Some(file) = &self.prior_pose else { return Ok(None) };
        let needed = || Failure::usage(POSE, "moves the last frame, which needs a calibration; add one");
        let rig = view.rig.ok_or_else(needed)?;
        let scale = self.prior_unit.map_or(1.0, |unit| unit.scale(&rig));
        let motions = trajectory::motions(&trajectory::read(file)?).into_iter();
        let motions = motions.map(|Pose { rotation, translation }| {
            let translation = translation.map(|v| v * scale);
            Pose { rotation, translation }
        });
        Ok(Some(Way { file: file.clone(), rig, motions: motions.collect() }))
    }

    /// The flag that needs a calibration to move the last frame, if it is given.
    pub(crate) fn need_of_way(&self) -> Option<CameraNeed> {
        let with_unit = self.prior_unit.is_some();
        self.prior_pose.as_ref().map(|_| CameraNeed { flag: POSE.into(), unit: with_unit, optional: false })
    }

    fn check_sigma(&self) -> Result<()> {
        match self.prior_sigma.filter(|sigma| !(*sigma > 0.0 && sigma.is_finite())) {
            Some(sigma) => Err(Failure::usage("--prior-sigma", format!("{sigma} is not above 0"))),
            None => Ok(()),
        }
    }

    /// How the points of clouds from a topic become priors of a view.
    pub(crate) fn points(&self, view: PriorView) -> Result<CloudPoints> {
        self.check_sigma()?;
        let reason = "needs the unit of the baseline, as points are in metres in ROS; add an entry `unit` to the calibration: mm, cm or m, \
                      or add it to --baseline";
        let needed = || Failure::usage(PRIOR_TOPIC, reason);
        let rig = view.rig.filter(|rig| rig.unit().millimetres().is_some()).ok_or_else(needed)?;
        let pose = self.pose()?;
        let unit = self.prior_unit.unwrap_or(LengthUnit::M);
        let sigma = self.prior_sigma.unwrap_or(PriorKind::Points.usual_sigma());
        Ok(CloudPoints { size: view.size, rig, pose, scale: unit.scale(&rig), sigma })
    }

    fn at<'a>(&'a self, path: &'a Path) -> PriorFile<'a> {
        let &Self { prior_sigma: sigma, prior_kind: kind, prior_unit: unit, .. } = self;
        let pose = self.prior_pose.as_deref().map(CloudPose::File);
        PriorFile { path, sigma, kind, unit, pose, names: FLAGS }
    }
}

/// The way of moving cameras.
pub(crate) struct Way {
    pub(crate) file: PathBuf,
    /// The cameras, with points in the frame of the left camera that took the image.
    pub(crate) rig: Rig,
    /// The motion from each frame to the next, which points of the scene seem to make. Lengths are in the unit of the baseline.
    pub(crate) motions: Vec<Pose>,
}

/// How points of the scene become the prior of a view.
pub(crate) struct CloudPoints {
    size: (usize, usize),
    rig: Rig,
    /// The pose of the points.
    pose: Option<Pose>,
    /// The baseline's units in a unit of the points.
    scale: f64,
    /// Standard deviation in pixels.
    sigma: f64,
}

impl CloudPoints {
    /// The prior of these points.
    pub(crate) fn prior(&self, points: impl IntoIterator<Item = [f64; 3]>) -> mrfgs::Result<Prior> {
        let placed = |point| self.pose.map_or(point, |pose| pose.moved(point)).map(|v| v * self.scale);
        self.rig.prior(self.size, points.into_iter().map(placed), self.sigma)
    }
}

/// The flags or columns of a prior, for messages.
#[derive(Clone, Copy)]
pub(crate) struct PriorNames {
    pub(crate) file: &'static str,
    pub(crate) kind: &'static str,
    pub(crate) unit: &'static str,
    pub(crate) pose: &'static str,
}

/// Where the pose of a point cloud comes from.
#[derive(Clone, Copy)]
pub(crate) enum CloudPose<'a> {
    File(&'a Path),
    Known(Pose),
}

/// A file of known disparities, and how to use it.
#[derive(Clone, Copy)]
pub(crate) struct PriorFile<'a> {
    pub(crate) path: &'a Path,
    /// Standard deviation in pixels, above 0; `None` for the usual one.
    pub(crate) sigma: Option<f64>,
    pub(crate) kind: Option<Kind>,
    /// The unit of lengths in the file.
    pub(crate) unit: Option<LengthUnit>,
    /// The pose of a point cloud.
    pub(crate) pose: Option<CloudPose<'a>>,
    pub(crate) names: PriorNames,
}

impl PriorFile<'_> {
    /// Why the cameras are needed, if they are.
    pub(crate) fn need(&self) -> Option<CameraNeed> {
        let with_unit = self.unit.is_some();
        let flag = if with_unit { self.names.unit } else { self.names.file };
        (with_unit || is_cloud(self.path)).then(|| CameraNeed {
            flag: flag.into(),
            unit: with_unit,
            optional: false,
        })
    }

    /// Reads the prior for a view, whose cameras must be known if they are needed.
    pub(crate) fn read(&self, view: PriorView) -> Result<Arc<Prior>> {
        let is_cloud = is_cloud(self.path);
        // A file that does not exist is reported when it is read.
        if self.pose.is_some() && !is_cloud && self.path.exists() {
            let reason =
                format!("only applies to a point cloud, which {} is not; remove it", self.path.display());
            return Err(Failure::usage(self.names.pose, reason));
        }
        if self.kind() == Some(PriorKind::Surface) && (is_cloud || is_list(self.path)) {
            let reason = format!("{} holds points; give a map for a surface", self.path.display());
            return Err(Failure::usage(self.names.kind, reason));
        }
        let prior = match view.rig {
            Some(rig) if is_cloud => self.cloud(view, &rig),
            None if is_cloud => Err(self.refused(" is a point cloud, which needs a calibration; add one")),
            _ if is_list(self.path) => self.listed(view),
            _ => self.map(view),
        };
        prior.map(Arc::new)
    }

    /// The given standard deviation, or the usual one of a prior of this kind.
    fn sigma_of(&self, kind: PriorKind) -> f64 {
        self.sigma.unwrap_or(kind.usual_sigma())
    }

    fn kind(&self) -> Option<PriorKind> {
        self.kind.map(|kind| match kind {
            Kind::Points => PriorKind::Points,
            Kind::Surface => PriorKind::Surface,
        })
    }

    /// A failure that names the file; `reason` follows directly, with its punctuation.
    fn refused(&self, reason: impl Display) -> Failure {
        Failure::usage(self.names.file, format!("{}{reason}", self.path.display()))
    }

    /// The failure of the library to take what the file holds.
    fn of_library(&self, e: Error) -> Failure {
        match e {
            Error::Mismatch(reason) => self.refused(format_args!(": {reason}")),
            e => e.into(),
        }
    }

    /// The baselines' units in a unit of the file.
    fn scale(&self, rig: &Rig) -> f64 {
        self.unit.map_or(1.0, |unit| unit.scale(rig))
    }

    /// The points of a cloud that the left view sees.
    fn cloud(&self, view: PriorView, rig: &Rig) -> Result<Prior> {
        let pose = match self.pose {
            Some(CloudPose::File(file)) => Some(pose::read(file)?),
            Some(CloudPose::Known(pose)) => Some(pose),
            None => None,
        };
        let (scale, sigma) = (self.scale(rig), self.sigma_of(PriorKind::Points));
        let points = CloudPoints { size: view.size, rig: *rig, pose, scale, sigma };
        points.prior(read_cloud::positions(self.path)?).map_err(|e| self.of_library(e))
    }

    /// A value of the file, a disparity or with a unit a depth, as a disparity; not finite if it is none.
    fn disparity(&self, value: f64, view: PriorView) -> f64 {
        match view.rig.filter(|_| self.unit.is_some()) {
            Some(rig) if value > 0.0 && value.is_finite() => rig.disparity(value * self.scale(&rig)),
            Some(_) => f64::INFINITY,
            None if view.sign == Sign::default() => value,
            None => -value,
        }
    }

    fn map(&self, view: PriorView) -> Result<Prior> {
        let reader = Reader::default();
        let map = match self.unit {
            None => reader.disparity(self.path),
            // Whole numbers count the unit.
            Some(_) => match reader.scaled_disparity(self.path, 1.0) {
                Err(Error::Read { cause: ReadError::NeedlessScale, .. }) => reader.disparity(self.path),
                read => read,
            },
        }?;
        let map = map.map(|&value| {
            let value = f64::from(value);
            if value.is_finite() { self.disparity(value, view) as f32 } else { f32::INFINITY }
        });
        let kind = self.kind().unwrap_or_else(|| PriorKind::of_map(&map));
        let sigma = self.sigma_of(kind);
        let (own, (width, _)) = (map.size().0, view.size);
        let stretch = if self.unit.is_some() { 1.0 } else { width as f32 / own as f32 };
        let prior = Prior::resized(kind, &map.map(|d| d * stretch), view.size, sigma);
        prior.map_err(|e| self.of_library(e))
    }

    fn listed(&self, view: PriorView) -> Result<Prior> {
        let text = text::read(self.path, MOST_BYTES, "a list of points")?;
        let text = str::from_utf8(&text).map_err(|_| self.refused(" is not UTF-8 text"))?;
        let points = PriorPoint::listed(text, self.sigma).map_err(|e| self.of_library(e))?.into_iter();
        let points =
            points.map(|point| PriorPoint { disparity: self.disparity(point.disparity, view), ..point });
        Prior::points(view.size, points).map_err(|e| self.of_library(e))
    }
}

/// Whether a file holds a list of points in the left view.
fn is_list(path: &Path) -> bool {
    ends_in(path, &["csv", "txt"]) && !is_cloud(path)
}

/// Whether a file holds points of the scene.
fn is_cloud(path: &Path) -> bool {
    let is_of_colmap = path.file_name().is_some_and(|name| name.eq_ignore_ascii_case("points3D.txt"));
    is_of_colmap || ends_in(path, &["ply", "pcd", "las", "laz", "xyz", "bin"])
}

fn ends_in(path: &Path, ends: &[&str]) -> bool {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    ends.iter().any(|end| extension.eq_ignore_ascii_case(end))
}

#[cfg(test)]
mod tests {
    use super::*;
    use Sign::{LeftMinusRight, RightMinusLeft};

    fn given(name: &str, text: &str, sigma: Option<f64>) -> (tempfile::TempDir, PriorArgs) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        let args = PriorArgs {
            prior: Some(path),
            prior_sigma: sigma,
            prior_kind: None,
            prior_unit: None,
            prior_pose: None,
        };
        (folder, args)
    }

    fn view(sign: Sign) -> PriorView {
        PriorView { size: (8, 6), sign, rig: None }
    }

    fn points(text: &str, sign: Sign) -> std::result::Result<Arc<Prior>, String> {
        let (_folder, args) = given("points.csv", text, None);
        args.read(view(sign)).map(Option::unwrap).map_err(|e| e.to_string())
    }

    #[test]
    fn points_are_listed_with_and_without_names_and_sigma() {
        let all = points("x,y,d,sigma\n1,2,3.5,0.5\n 4, 5 , 6\n", LeftMinusRight).unwrap();
        assert_eq!((all.count(), all.kind()), (2, PriorKind::Points));
        assert_eq!(points("1,2,-3.5,0.5\n4,5,-6", RightMinusLeft).unwrap(), all);
    }

    #[test]
    fn bad_lists_are_named_with_their_line() {
        let line = points("1,2,3\n1,2,x\n", LeftMinusRight).unwrap_err();
        assert!(line.contains("points.csv: line 2: "), "{line}");
        assert!(points("", LeftMinusRight).unwrap_err().contains("no point"));
        assert!(points("90,2,3\n", LeftMinusRight).unwrap_err().contains("none of the 1 points"));
        assert!(points("1,2,3,-1\n", LeftMinusRight).unwrap_err().contains("-1 px"));
        let (_folder, args) = given("points.csv", "1,2,3", Some(-1.0));
        assert!(args.read(view(LeftMinusRight)).unwrap_err().to_string().contains("--prior-sigma"));
    }
}
