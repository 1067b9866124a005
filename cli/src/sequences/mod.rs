//! Sequences of pairs: numbered images, streams of frames, and recordings.

pub(crate) mod files;
pub(crate) mod known;
mod pairing;
mod recorded;
mod rectifier;
pub(crate) mod ros;
mod stream;

use std::collections::VecDeque;
use std::mem;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::ValueEnum;
use mrfgs::image::raster::Raster;
use mrfgs::image::read::Reader;
use mrfgs::image::{Pair, Plane, Rect};
use mrfgs::{Error, Result, threads};
use mrfgs_ros::messages::Header;
use mrfgs_ros::recording::Message;

use crate::ffmpeg::Complaint;

pub(crate) use pairing::{Pairing, in_name, pair};
pub(crate) use recorded::Recorded;
use recorded::RecordedViews;
pub(crate) use rectifier::{Rectifier, turned};
use stream::Stream;
pub(crate) use stream::{FrameRate, RawFrames, raw_frames};

/// The arrangement of both views in one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Layout {
    /// Left view on the left
    #[default]
    SideBySide,
    /// Left view on top
    TopBottom,
}

impl Layout {
    /// Splits a frame into left and right view.
    fn split(self, frame: &Raster) -> Result<[Raster<'static>; 2]> {
        let (width, height) = frame.size();
        let (whole, halves) = match self {
            Self::SideBySide => (width, "columns"),
            Self::TopBottom => (height, "rows"),
        };
        if whole % 2 != 0 {
            let reason =
                format!("frames of {width} x {height} cannot hold two views: the number of {halves} is odd");
            return Err(Error::Mismatch(reason));
        }
        let half = whole / 2;
        let parts = [0..half, half..whole].map(|part| match self {
            Self::SideBySide => Rect { x: part, y: 0..height },
            Self::TopBottom => Rect { x: 0..width, y: part },
        });
        let [left, right] = parts.map(|part| frame.crop(&part));
        Ok([left?, right?])
    }
}

/// A source of frames.
enum Source {
    Files { left: VecDeque<PathBuf>, reader: Reader },
    Stream(Stream),
}

impl Source {
    /// Opens `path`: a folder, a pattern or a stream; `raw` describes a stream without a header.
    fn open(path: &Path, raw: Option<RawFrames>, reader: Reader) -> Result<Self> {
        match files::list(path)? {
            Some(left) => Ok(Self::Files { left: left.into(), reader }),
            None => Stream::open(path, raw, reader.max_pixels).map(Self::Stream),
        }
    }

    fn files(&self) -> Vec<&Path> {
        match self {
            Self::Files { left, .. } => left.iter().map(PathBuf::as_path).collect(),
            Self::Stream(stream) => stream.file().into_iter().collect(),
        }
    }

    /// The next frame, with its name if it has one; `None` after the last one.
    fn next(&mut self) -> Option<Result<(Option<String>, Raster<'static>)>> {
        match self {
            Self::Files { left, reader } => {
                let file = left.pop_front()?;
                Some(reader.raster(&file).map(|frame| (Some(files::stem(&file)), frame)))
            }
            Self::Stream(stream) => stream.next().map(|frame| frame.map(|frame| (None, frame))),
        }
    }
}

/// A pair at one point in time.
pub(crate) struct FramePair {
    /// The stem of the left file, the time of a recorded image in seconds, or the frame number from 000000 on.
    pub(crate) name: String,
    /// The ROS header of a recorded left view.
    pub(crate) header: Option<Header>,
    /// The recorded cloud that belongs to it.
    pub(crate) cloud: Option<Arc<Message>>,
    pub(crate) pair: Pair,
}

/// The sources of both views.
#[allow(clippy::large_enum_variant, reason = "there is one of it")]
enum FrameSource {
    /// A source per view; without `right`, each frame of `left` holds both views.
    Sources {
        left: Source,
        right: Option<Source>,
        layout: Layout,
    },
    Recorded(Recorded),
}

/// The frames of a sequence, in order.
pub(crate) struct Frames {
    views: FrameSource,
    /// The number of frames so far.
    count: usize,
    /// `true` where the left view of every frame is ignored.
    mask: Option<Plane<bool>>,
    /// Whether frames are raw images, which may differ in size.
    raw: bool,
    /// (width, height) of the first pair.
    size: Option<(usize, usize)>,
    /// The names of both sources.
    names: [String; 2],
}

/// The name and the header of a left view, and the cloud that belongs to it.
#[derive(Default)]
struct FrameInfo {
    name: Option<String>,
    header: Option<Header>,
    cloud: Option<Arc<Message>>,
}

/// Both views at one point in time.
type Rasters = (FrameInfo, [Raster<'static>; 2]);

impl Frames {
    /// The frames of two sources, or of one source with both views in each frame.
    ///
    /// # Errors
    /// If a source has no images, the images of two cameras cannot be paired, or a stream fails.
    pub(crate) fn open(
        left: &Path,
        right: Option<&Path>,
        pairing: Pairing,
        layout: Layout,
        raw: Option<RawFrames>,
        reader: Reader,
    ) -> Result<Self> {
        let shown = |path: &Path| {
            if path == Path::new("-") { "standard input".into() } else { path.display().to_string() }
        };
        let names = [shown(left), shown(right.unwrap_or(left))];
        let mut left = Source::open(left, raw, reader)?;
        let mut right = right.map(|right| Source::open(right, raw, reader)).transpose()?;
        if let (Source::Files { left: l, .. }, Some(Source::Files { left: r, .. })) = (&mut left, &mut right)
        {
            let pairs = pair([mem::take(l).into(), mem::take(r).into()], pairing, &names)?;
            [*l, *r] = pairs.map(Into::into);
        }
        Ok(Self {
            views: FrameSource::Sources { left, right, layout },
            count: 0,
            mask: None,
            raw: false,
            size: None,
            names,
        })
    }

    /// The frames of a recording.
    pub(crate) fn of_recording(recorded: Recorded) -> Self {
        let name = recorded.path().display().to_string();
        let views = FrameSource::Recorded(recorded);
        Self { views, count: 0, mask: None, raw: false, size: None, names: [name.clone(), name] }
    }

    /// The sources of frames from files and streams, left then right; none for a recording.
    fn sources(&self) -> impl Iterator<Item = &Source> {
        let (left, right) = match &self.views {
            FrameSource::Sources { left, right, .. } => (Some(left), right.as_ref()),
            FrameSource::Recorded(_) => (None, None),
        };
        left.into_iter().chain(right)
    }

    /// The number of frames, if known.
    pub(crate) fn len(&self) -> Option<usize> {
        match self.sources().next()? {
            Source::Files { left, .. } => Some(left.len() + self.count),
            Source::Stream(_) => None,
        }
    }

    /// The frame rate of the left source, if it is known.
    pub(crate) fn rate(&self) -> Option<FrameRate> {
        match self.sources().next()? {
            Source::Files { .. } => None,
            Source::Stream(stream) => stream.rate(),
        }
    }

    /// Whether both sources are image files.
    pub(crate) fn are_images_of_two(&self) -> bool {
        self.sources().count() == 2 && !self.have_stream()
    }

    /// Whether a source is a stream.
    pub(crate) fn have_stream(&self) -> bool {
        self.sources().any(|source| matches!(source, Source::Stream(_)))
    }

    /// The first left image, if frames are image files.
    pub(crate) fn first_image(&self) -> Option<&Path> {
        match self.sources().next()? {
            Source::Files { left, .. } => left.front().map(PathBuf::as_path),
            Source::Stream(_) => None,
        }
    }

    /// The films that ffmpeg decodes, each with a handle to ffmpeg's warning.
    pub(crate) fn films(&self) -> impl Iterator<Item = (&Path, Complaint)> {
        self.sources().filter_map(|source| match source {
            Source::Files { .. } => None,
            Source::Stream(stream) => stream.film(),
        })
    }

    /// Ignores the left view of every frame where `mask` is `true`.
    pub(crate) fn masked_by(mut self, mask: Plane<bool>) -> Self {
        self.mask = Some(mask);
        self
    }

    /// Treats frames as raw images, to be rectified later.
    pub(crate) fn taken_raw(self) -> Self {
        Self { raw: true, ..self }
    }

    /// The input files, which no output may overwrite.
    pub(crate) fn files(&self) -> Vec<&Path> {
        match &self.views {
            FrameSource::Sources { .. } => self.sources().flat_map(Source::files).collect(),
            FrameSource::Recorded(recorded) => recorded.files().collect(),
        }
    }

    fn rasters(&mut self) -> Option<Result<Rasters>> {
        let of = |name| FrameInfo { name, ..FrameInfo::default() };
        let (left, right) = match &mut self.views {
            FrameSource::Recorded(recorded) => {
                return Some(recorded.next()?.map(|RecordedViews { header, views, cloud }| {
                    let name = Some(header.stamp.to_string());
                    (FrameInfo { name, header: Some(header), cloud }, views)
                }));
            }
            FrameSource::Sources { left, right: None, layout } => {
                return Some(left.next()?.and_then(|(name, frame)| {
                    let split = layout.split(&frame);
                    let views = split.map_err(|e| named(e, name.as_ref().unwrap_or(&self.names[0])))?;
                    Ok((of(name), views))
                }));
            }
            FrameSource::Sources { left, right: Some(right), .. } => (left, right),
        };
        let (l, r) = threads::join(|| left.next(), || right.next());
        let ended = |which: usize| {
            let (one, other) = (&self.names[which], &self.names[1 - which]);
            Error::Mismatch(format!("{one} ends here but {other} goes on"))
        };
        match (l, r) {
            (None, None) => None,
            (Some(Err(e)), _) | (_, Some(Err(e))) => Some(Err(e)),
            (None, Some(_)) => Some(Err(ended(0))),
            (Some(_), None) => Some(Err(ended(1))),
            (Some(Ok((name, l))), Some(Ok((_, r)))) => Some(Ok((of(name), [l, r]))),
        }
    }

    fn frame(&mut self, (FrameInfo { name, header, cloud }, [left, right]): Rasters) -> Result<FramePair> {
        let name = name.unwrap_or_else(|| format!("{:06}", self.count));
        let left = match &self.mask {
            Some(mask) => left.masked_by(mask.clone()).map_err(|e| named(e, &name))?,
            None => left,
        };
        let pair = if self.raw { Pair::of_raw_frames(left, right) } else { Pair::of_frames(left, right) };
        let pair = pair.map_err(|e| named(e, &name))?;
        let (size, (width, height)) = (*self.size.get_or_insert(pair.size()), pair.size());
        if size != (width, height) {
            let reason = format!("is {width} x {height} but earlier ones are {} x {}", size.0, size.1);
            return Err(Error::Mismatch(format!(
                "frame {name} {reason}: all frames must have the same size"
            )));
        }
        self.count += 1;
        Ok(FramePair { name, header, cloud, pair })
    }
}

/// Adds the name of the frame to an error.
fn named(error: Error, name: &str) -> Error {
    match error {
        Error::Mismatch(reason) => Error::Mismatch(format!("frame {name}: {reason}")),
        error => error,
    }
}

impl Iterator for Frames {
    type Item = Result<FramePair>;

    fn next(&mut self) -> Option<Self::Item> {
        let rasters = self.rasters()?;
        Some(rasters.and_then(|rasters| self.frame(rasters)))
    }
}
