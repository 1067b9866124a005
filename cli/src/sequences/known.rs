//! The prior of each frame of a sequence or of a live node: a file, the cloud of a lidar, or the frame before.

use std::collections::HashMap;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mrfgs::calibration::cameras::Pose;
use mrfgs::check::Warning;
use mrfgs::image::Rect;
use mrfgs::maps::Maps;
use mrfgs::{Error, Matched, Prior};
use mrfgs_ros::messages::{Encoding, Scan, Stamp};

use crate::args::{CameraNeed, CloudPoints, PRIOR_TOPIC, PriorArgs, PriorTopicArgs, PriorView, Way};
use crate::failure::Result;
use crate::remedy;
use crate::text::plural;

/// A cloud at most this many nanoseconds before or after an image belongs to it: a turn of a common lidar, which takes 0.05 to 0.1 s.
pub(crate) const SAME_TIME: u64 = 100_000_000;
/// The word that stands for the frame before.
const LAST: &str = "last";

/// Why a frame has no prior although clouds are known.
pub(crate) enum CloudDoubt {
    /// No cloud belongs to it.
    Missing(String),
    /// The cloud is damaged, or the left view shows none of its points.
    Unusable(String),
}

/// The priors of the frames.
pub(crate) struct FramePriors {
    source: PriorSource,
    flags: PriorArgs,
    view: PriorView,
    /// The part of the view that is matched; `None` for all of it.
    window: Option<Rect>,
}

/// Where the priors come from.
enum PriorSource {
    Nothing,
    /// The same for all frames.
    All(Arc<Prior>),
    /// A file for each frame, by the name of the frame, and the pose of all. Other frames have none.
    Folder(HashMap<String, PathBuf>, Option<Pose>),
    /// The map of the frame before, and how the cameras have moved since then; `None` if they stand still.
    Last(Option<Arc<Way>>),
    /// A cloud of this topic for each frame that has one.
    Topic(String, Box<CloudPoints>),
}

impl FramePriors {
    /// The priors that the flags name, for frames of this view, of which only the `window` is matched.
    pub(crate) fn new(
        flags: &PriorArgs,
        topic: &PriorTopicArgs,
        view: PriorView,
        window: Option<Rect>,
    ) -> Result<Self> {
        let source = match flags.file() {
            None => match &topic.prior_topic {
                Some(topic) => PriorSource::Topic(topic.clone(), Box::new(flags.points(view)?)),
                None => PriorSource::Nothing,
            },
            Some(path) if is_last(path) => PriorSource::Last(flags.way(view)?.map(|way| {
                let corner = window.as_ref().map_or((0, 0), |window| (window.x.start, window.y.start));
                Arc::new(Way { rig: way.rig.of_part(corner.0, corner.1), ..way })
            })),
            Some(path) if path.is_dir() => PriorSource::Folder(by_name(path)?, flags.pose()?),
            Some(_) => flags.read(view)?.map_or(PriorSource::Nothing, PriorSource::All),
        };
        let mut priors = Self { source, flags: flags.clone(), view, window };
        if let PriorSource::All(prior) = &priors.source {
            priors.source = PriorSource::All(priors.part(Arc::clone(prior)));
        }
        Ok(priors)
    }

    /// How each frame follows from the one before, if it does.
    pub(crate) fn follow(&self) -> Option<Follow> {
        match &self.source {
            PriorSource::Last(way) => Some(Follow(way.clone())),
            _ => None,
        }
    }

    /// The prior of the frame called `name`, if it has one by its name.
    pub(crate) fn of(&self, name: &str) -> Result<Option<Arc<Prior>>> {
        match &self.source {
            PriorSource::Nothing | PriorSource::Last(_) | PriorSource::Topic(..) => Ok(None),
            PriorSource::All(prior) => Ok(Some(Arc::clone(prior))),
            PriorSource::Folder(files, pose) => {
                let Some(file) = files.get(name) else { return Ok(None) };
                Ok(Some(self.part(self.flags.read_posed(file, *pose, self.view)?)))
            }
        }
    }

    /// The prior of a frame at the time `stamp` from the cloud that belongs to it, if clouds are known.
    ///
    /// # Errors
    /// What to say of a frame without a cloud, and of a cloud that cannot be used. Frames do without.
    pub(crate) fn of_cloud(
        &self,
        cloud: Option<(&[u8], Encoding)>,
        stamp: Stamp,
    ) -> std::result::Result<Option<Arc<Prior>>, CloudDoubt> {
        let PriorSource::Topic(topic, seen) = &self.source else { return Ok(None) };
        let Some((message, encoding)) = cloud else {
            let within = SAME_TIME as f64 / 1e9;
            return Err(CloudDoubt::Missing(format!(
                "no cloud of {topic} is within {within} s of the left image at {stamp}; such images are matched without one, and the times \
                 in the headers must be of the same clock"
            )));
        };
        let unusable = |reason| CloudDoubt::Unusable(format!("a cloud of {topic} is not used: {reason}"));
        let scan = Scan::decode(message, encoding).map_err(|reason| unusable(format!("it {reason}")))?;
        let prior = seen.prior(scan.points).map_err(|e| unusable(e.to_string()))?;
        Ok(Some(self.part(Arc::new(prior))))
    }

    /// What is known of the part that is matched.
    fn part(&self, prior: Arc<Prior>) -> Arc<Prior> {
        self.window.as_ref().map_or_else(|| Arc::clone(&prior), |window| Arc::new(prior.crop(window)))
    }
}

/// How frames follow from each other: the cameras stand still, or move on a known way.
pub(crate) struct Follow(Option<Arc<Way>>);

impl Follow {
    /// Whether the cameras move.
    pub(crate) fn moves(&self) -> bool {
        self.0.is_some()
    }

    /// The prior of the frame after `done`, from the maps of frame `done`. Without a pose for that frame there is none.
    ///
    /// # Errors
    /// The errors of [`Rig::prior_after`](mrfgs::depth::Rig::prior_after).
    pub(crate) fn next(&self, done: usize, maps: &Maps) -> mrfgs::Result<Option<Prior>> {
        let Some(way) = &self.0 else { return Ok(Some(Prior::of_maps(maps))) };
        way.motions.get(done).map(|motion| way.rig.prior_after(maps, motion)).transpose()
    }

    /// The warning that the file has no pose for frame `done` (from 0) and later ones, if `done` is the first of them.
    pub(crate) fn ended(&self, done: usize) -> Option<String> {
        let way = self.0.as_ref().filter(|way| way.motions.len() + 1 == done)?;
        let file = way.file.display();
        Some(format!(
            "{file} has poses of {done} frame{}; later ones are matched without the last; give a line for each frame",
            plural(done)
        ))
    }
}

/// The warning that the images contradict what is known, if they do.
pub(crate) fn contradicted(matched: &Matched) -> Option<String> {
    let is_doubt = |warning: &Warning| matches!(warning, Warning::Contradicted { .. });
    let doubt = || matched.warnings().into_iter().find(is_doubt);
    matched.prior.as_ref().and_then(|_| doubt()).map(|doubt| remedy::warning(&doubt, &remedy::FLAGS))
}

/// Why the cameras are needed, if they are.
pub(crate) fn need(flags: &PriorArgs, topic: &PriorTopicArgs) -> Result<Option<CameraNeed>> {
    match flags.file() {
        None if topic.prior_topic.is_some() => {
            Ok(Some(CameraNeed { flag: PRIOR_TOPIC.into(), unit: true, optional: false }))
        }
        Some(path) if is_last(path) => Ok(flags.need_of_way()),
        Some(path) if path.is_dir() => Ok(by_name(path)?.values().find_map(|file| flags.need_of(file))),
        _ => Ok(flags.need()),
    }
}

/// Whether the frame before is known, and poses say how the cameras move.
#[cfg(feature = "live")]
pub(crate) fn is_moved_last(flags: &PriorArgs) -> bool {
    flags.file().is_some_and(is_last) && flags.need_of_way().is_some()
}

/// Whether the frame before is meant, and no file.
fn is_last(path: &Path) -> bool {
    path == Path::new(LAST) && !path.exists()
}

/// The visible files of a folder by their names without the extension.
fn by_name(folder: &Path) -> Result<HashMap<String, PathBuf>> {
    let entries = fs::read_dir(folder).and_then(Iterator::collect::<std::io::Result<Vec<_>>>);
    let entries = entries.map_err(|e| Error::read(folder, e))?.into_iter().map(|entry| entry.path());
    let mut files = HashMap::new();
    for file in entries.filter(|file| file.is_file()) {
        let name = file.file_stem().map(OsStr::to_string_lossy).unwrap_or_default().into_owned();
        if name.starts_with('.') {
            continue;
        }
        if let Some(other) = files.insert(name, file.clone()) {
            let [file, other] = [file, other].map(|file| file.display().to_string());
            let reason = format!("{file} and {other} are for the same frame; keep one");
            return Err(Error::read(folder, reason).into());
        }
    }
    if files.is_empty() {
        return Err(Error::read(
            folder,
            "holds no files; give one for each frame, named after its left image",
        )
        .into());
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::Sign;
    use clap::Parser;
    use mrfgs::depth::Rig;
    use mrfgs::image::Plane;
    use mrfgs::image::calib::Calibration;
    use mrfgs::prior::PriorKind;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        prior: PriorArgs,
        #[command(flatten)]
        topic: PriorTopicArgs,
    }

    #[test]
    fn the_pose_of_a_folder_is_read_once() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name).display().to_string();
        fs::create_dir(at("scans")).unwrap();
        // Each scan has a point on the axis, one ahead of the other, in front of a lidar that stands 1 to the right.
        fs::write(at("scans/a.xyz"), "-1 0 2\n").unwrap();
        fs::write(at("scans/b.xyz"), "-1 0 4\n").unwrap();
        fs::write(at("pose.txt"), "1 0 0 1 0 1 0 0 0 0 1 0").unwrap();
        let line = ["mrfgs", "--prior", &at("scans"), "--prior-pose", &at("pose.txt")];
        let Line { prior, topic } = Line::parse_from(line);
        let text = "cam0=[8 0 4; 0 8 3; 0 0 1]\ndoffs=0\nbaseline=1\n";
        let known = Calibration::of_text(Path::new("calib.txt"), text).unwrap();
        let view = PriorView { size: (8, 6), sign: Sign::default(), rig: Some(Rig::new(&known).unwrap()) };
        let priors = FramePriors::new(&prior, &topic, view, None).unwrap();
        // It is gone before the first frame.
        fs::remove_file(at("pose.txt")).unwrap();
        for (frame, disparity) in [("a", 4.0), ("b", 2.0)] {
            let expected =
                Plane::from_fn(8, 6, |x, y| if (x, y) == (4, 3) { disparity } else { f32::INFINITY });
            let expected = Prior::map(PriorKind::Points, &expected, PriorKind::Points.usual_sigma()).unwrap();
            assert_eq!(*priors.of(frame).unwrap().unwrap(), expected, "{frame}");
        }
        // Control: it is needed.
        assert!(FramePriors::new(&prior, &topic, view, None).is_err());
    }
}
