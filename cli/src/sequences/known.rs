//! The prior of each frame of a sequence or of a live node: a file, the cloud of a lidar, or the frame before.

use std::collections::HashMap;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mrfgs::check::Warning;
use mrfgs::image::Rect;
use mrfgs::{Error, Matched, Prior};
use mrfgs_ros::messages::{Encoding, Scan, Stamp};

use crate::args::{CameraNeed, CloudPoints, PRIOR_TOPIC, PriorArgs, PriorTopicArgs, PriorView};
use crate::failure::Result;
use crate::remedy;

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
    /// A file for each frame, by the name of the frame. Other frames have none.
    Folder(HashMap<String, PathBuf>),
    /// The map of the frame before.
    Last,
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
            Some(path) if is_last(path) => PriorSource::Last,
            Some(path) if path.is_dir() => PriorSource::Folder(by_name(path)?),
            Some(_) => flags.read(view)?.map_or(PriorSource::Nothing, PriorSource::All),
        };
        let mut priors = Self { source, flags: flags.clone(), view, window };
        if let PriorSource::All(prior) = &priors.source {
            priors.source = PriorSource::All(priors.part(Arc::clone(prior)));
        }
        Ok(priors)
    }

    /// Whether each frame follows from the one before.
    pub(crate) fn follow(&self) -> bool {
        matches!(self.source, PriorSource::Last)
    }

    /// The prior of the frame called `name`, if it has one by its name.
    pub(crate) fn of(&self, name: &str) -> Result<Option<Arc<Prior>>> {
        match &self.source {
            PriorSource::Nothing | PriorSource::Last | PriorSource::Topic(..) => Ok(None),
            PriorSource::All(prior) => Ok(Some(Arc::clone(prior))),
            PriorSource::Folder(files) => {
                let Some(file) = files.get(name) else { return Ok(None) };
                Ok(Some(self.part(self.flags.read_file(file, self.view)?)))
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

/// The warning that the images contradict what is known, if they do.
pub(crate) fn contradicted(matched: &Matched) -> Option<String> {
    let is_doubt = |warning: &Warning| matches!(warning, Warning::Contradicted { .. });
    let doubt = || matched.warnings().into_iter().find(is_doubt);
    matched.prior.as_ref().and_then(|_| doubt()).map(|doubt| remedy::warning(&doubt, &remedy::FLAGS))
}

/// Why the cameras are needed, if they are.
pub(crate) fn need(flags: &PriorArgs, topic: &PriorTopicArgs) -> Result<Option<CameraNeed>> {
    match flags.file() {
        None if topic.prior_topic.is_some() => Ok(Some(CameraNeed { flag: PRIOR_TOPIC.into(), unit: true })),
        Some(path) if path.is_dir() => Ok(by_name(path)?.values().find_map(|file| flags.need_of(file))),
        _ => Ok(flags.need()),
    }
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
