//! Sequences of pairs: numbered images, streams of frames, and recordings.

mod files;
mod pairing;
mod recorded;
mod rectifier;
pub(crate) mod ros;
mod stream;

use std::collections::VecDeque;
use std::mem;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use mrfgs::image::raster::Raster;
use mrfgs::image::read::Reader;
use mrfgs::image::{Pair, Plane, Rect};
use mrfgs::{Error, Result, threads};
use mrfgs_ros::messages::Header;

use crate::ffmpeg::Complaint;

pub(crate) use pairing::Pairing;
pub(crate) use recorded::Recorded;
pub(crate) use rectifier::{Rectifier, turned};
use stream::Stream;
pub(crate) use stream::{FrameRate, RawFrames, raw_frames};

/// How both views lie in one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Layout {
    /// The left view on the left
    #[default]
    SideBySide,
    /// The left view on top
    TopBottom,
}

impl Layout {
    /// The left and the right view.
    fn split(self, frame: &Raster) -> Result<[Raster<'static>; 2]> {
        let (width, height) = frame.size();
        let (whole, halves) = match self {
            Self::SideBySide => (width, "columns"),
            Self::TopBottom => (height, "rows"),
        };
        if whole % 2 != 0 {
            let reason =
                format!("{width} x {height} pixels are no two views: the {halves} are an odd number");
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

/// Where frames come from.
enum Source {
    Files { left: VecDeque<PathBuf>, reader: Reader },
    Stream(Stream),
}

impl Source {
    /// What `path` holds: a folder, a pattern, or a stream; `raw` says what a stream without a header holds.
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

    /// The next frame and, where it has one, its name; `None` after the last one.
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

/// Both views at one time.
pub(crate) struct Frame {
    /// The stem of the file of the left view, the time of a recorded one in seconds, or the number of the frame, from 000000 on.
    pub(crate) name: String,
    /// Time and camera of a recorded left view.
    pub(crate) header: Option<Header>,
    pub(crate) pair: Pair,
}

/// The sources of both views.
#[allow(clippy::large_enum_variant, reason = "there is one of it")]
enum Views {
    /// One for each view; without the right one, frames hold both.
    Sources {
        left: Source,
        right: Option<Source>,
        layout: Layout,
    },
    Recorded(Recorded),
}

/// The frames of a sequence, in order.
pub(crate) struct Frames {
    views: Views,
    /// How many came so far.
    count: usize,
    /// Where the left view of every frame is ignored.
    mask: Option<Plane<bool>>,
    /// Whether they are images as the cameras took them, which may differ in size.
    raw: bool,
    /// (width, height) of the first pair.
    size: Option<(usize, usize)>,
    /// The names of both sources.
    names: [String; 2],
}

/// What is known of the left view.
#[derive(Default)]
struct About {
    name: Option<String>,
    header: Option<Header>,
}

/// Both views of one time.
type Rasters = (About, [Raster<'static>; 2]);

impl Frames {
    /// The frames of two sources, or of one with both views in each frame.
    ///
    /// # Errors
    /// Where there is none, or images of two cameras are no pairs; errors of streams.
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
            let pairs = pairing::pair([mem::take(l).into(), mem::take(r).into()], pairing, &names)?;
            [*l, *r] = pairs.map(Into::into);
        }
        Ok(Self {
            views: Views::Sources { left, right, layout },
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
        let views = Views::Recorded(recorded);
        Self { views, count: 0, mask: None, raw: false, size: None, names: [name.clone(), name] }
    }

    /// The sources where frames come from files and streams, left and right.
    fn sources(&self) -> impl Iterator<Item = &Source> {
        let (left, right) = match &self.views {
            Views::Sources { left, right, .. } => (Some(left), right.as_ref()),
            Views::Recorded(_) => (None, None),
        };
        left.into_iter().chain(right)
    }

    /// How many there are, where that is known.
    pub(crate) fn len(&self) -> Option<usize> {
        match self.sources().next()? {
            Source::Files { left, .. } => Some(left.len() + self.count),
            Source::Stream(_) => None,
        }
    }

    /// How many frames a second the left source has, where it says so.
    pub(crate) fn rate(&self) -> Option<FrameRate> {
        match self.sources().next()? {
            Source::Files { .. } => None,
            Source::Stream(stream) => stream.rate(),
        }
    }

    /// Whether they are images of two cameras.
    pub(crate) fn are_images_of_two(&self) -> bool {
        self.sources().count() == 2 && !self.have_stream()
    }

    /// Whether a stream is among the sources.
    pub(crate) fn have_stream(&self) -> bool {
        self.sources().any(|source| matches!(source, Source::Stream(_)))
    }

    /// The first image of the left camera, where frames are images.
    pub(crate) fn first_image(&self) -> Option<&Path> {
        match self.sources().next()? {
            Source::Files { left, .. } => left.front().map(PathBuf::as_path),
            Source::Stream(_) => None,
        }
    }

    /// The films that ffmpeg decodes, each with what that complains of by its end.
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

    /// Takes frames as two cameras took them, to be rectified.
    pub(crate) fn taken_raw(self) -> Self {
        Self { raw: true, ..self }
    }

    /// The files that are read, none of which an output may overwrite.
    pub(crate) fn files(&self) -> Vec<&Path> {
        match &self.views {
            Views::Sources { .. } => self.sources().flat_map(Source::files).collect(),
            Views::Recorded(recorded) => recorded.files().collect(),
        }
    }

    fn rasters(&mut self) -> Option<Result<Rasters>> {
        let of = |name| About { name, header: None };
        let (left, right) = match &mut self.views {
            Views::Recorded(recorded) => {
                return Some(recorded.next()?.map(|(header, views)| {
                    let name = Some(header.stamp.to_string());
                    (About { name, header: Some(header) }, views)
                }));
            }
            Views::Sources { left, right: None, layout } => {
                return Some(left.next()?.and_then(|(name, frame)| {
                    let split = layout.split(&frame);
                    let views = split.map_err(|e| named(e, name.as_ref().unwrap_or(&self.names[0])))?;
                    Ok((of(name), views))
                }));
            }
            Views::Sources { left, right: Some(right), .. } => (left, right),
        };
        let (l, r) = threads::join(|| left.next(), || right.next());
        let ended = |which: usize| {
            let (one, other) = (&self.names[which], &self.names[1 - which]);
            Error::Mismatch(format!("{one} ends here and {other} goes on"))
        };
        match (l, r) {
            (None, None) => None,
            (Some(Err(e)), _) | (_, Some(Err(e))) => Some(Err(e)),
            (None, Some(_)) => Some(Err(ended(0))),
            (Some(_), None) => Some(Err(ended(1))),
            (Some(Ok((name, l))), Some(Ok((_, r)))) => Some(Ok((of(name), [l, r]))),
        }
    }

    fn frame(&mut self, (About { name, header }, [left, right]): Rasters) -> Result<Frame> {
        let name = name.unwrap_or_else(|| format!("{:06}", self.count));
        let left = match &self.mask {
            Some(mask) => left.masked_by(mask.clone()).map_err(|e| named(e, &name))?,
            None => left,
        };
        let pair = if self.raw { Pair::of_raw_frames(left, right) } else { Pair::of_frames(left, right) };
        let pair = pair.map_err(|e| named(e, &name))?;
        let (size, (width, height)) = (*self.size.get_or_insert(pair.size()), pair.size());
        if size != (width, height) {
            let reason = format!("is {width} x {height} and those before it are {} x {}", size.0, size.1);
            return Err(Error::Mismatch(format!("frame {name} {reason}: all frames have one size")));
        }
        self.count += 1;
        Ok(Frame { name, header, pair })
    }
}

/// An error of a frame that names it.
fn named(error: Error, name: &str) -> Error {
    match error {
        Error::Mismatch(reason) => Error::Mismatch(format!("frame {name}: {reason}")),
        error => error,
    }
}

impl Iterator for Frames {
    type Item = Result<Frame>;

    fn next(&mut self) -> Option<Self::Item> {
        let rasters = self.rasters()?;
        Some(rasters.and_then(|rasters| self.frame(rasters)))
    }
}
