//! What `--also` writes beside a disparity map: one table, from which every command follows.

use std::path::{Path, PathBuf};

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use mrfgs::calibration::cameras::ThirdCamera;
use mrfgs::calibration::third;
use mrfgs::colour::{self, ColourMap};
use mrfgs::depth::Rig;
use mrfgs::image::cloud::Frame;
use mrfgs::image::write::Writer;
use mrfgs::image::{Plane, write};
use mrfgs::maps::Maps;
use mrfgs::options::{DisparityRange, Method};

use crate::failure::{Failure, Result};
use crate::outputs::limits::Limits;
use crate::outputs::messages::{self, Content};
use crate::outputs::outcome::{Of, Outcome, View};
use crate::text::plural;

/// An output beside the disparity map.
#[derive(Debug)]
pub(crate) struct Also {
    /// The word of `--also`, which is also in the name of the file. With an extension it asks for another format than that of
    /// the word alone.
    pub(crate) word: &'static str,
    /// Empty where the help of another word tells of it.
    help: &'static str,
    kind: Kind,
    /// The key of the method that makes it.
    key: Option<&'static str>,
}

/// What an output shows, and thereby the format of its file.
#[derive(Clone, Copy, Debug)]
enum Kind {
    /// A map of disparities of a view, in the format of the disparity map.
    Disparity(View, fn(&Maps) -> Option<Plane<f32>>),
    /// A map of bytes, as 8-bit PNG.
    Bytes(fn(&Maps) -> &Plane<u8>),
    /// The depth of every disparity, as float PFM, or TIFF where the disparity map is one.
    Depth,
    /// The same in whole millimetres, as 16-bit PNG.
    Millimetres,
    /// Depths in the view of a third camera, as float or in whole millimetres.
    Registered { millimetres: bool },
    /// The errors to expect, of disparities or of depths, as float like depths.
    Sigma(Of),
    /// A cloud of points, as PLY unless the word has an extension.
    Points(Frame),
    /// The disparity map in colours, as PNG; with the left image on its left if `beside`.
    Picture { beside: bool },
}

/// All outputs, in the order in which they are written. One more is one more row.
static ALL: [Also; 20] = [
    row(
        "raw",
        "The disparity map before post-processing, in the format of the disparity map",
        Kind::Disparity(View::Left, |maps| Some(maps.raw_map())),
    ),
    Also {
        key: Some("right-map"),
        ..row(
            "right",
            "The disparity map of the right view, refined like that of the left one, in the format of the disparity map: \
             right (x, y) with disparity d is seen at left (x + d, y)",
            Kind::Disparity(View::Right, Maps::right_map),
        )
    },
    row(
        "depth",
        "The depth of every pixel, as float: .pfm (+infinity where there is none), or .tif (NaN) if the disparity map is \
         TIFF",
        Kind::Depth,
    ),
    row(
        "depth-mm",
        "The depth of every pixel in millimetres, as ROS and TUM have it: 16-bit .png, 0 where there is none or it is above \
         65535. It takes a calibration whose unit is known",
        Kind::Millimetres,
    ),
    row(
        "depth-registered",
        "The depth as the camera of --into sees it, along its axis and at its pixels, as float like depth: nothing where it sees \
         what LEFT does not",
        Kind::Registered { millimetres: false },
    ),
    row(
        "depth-registered-mm",
        "The same in millimetres, as depth-mm",
        Kind::Registered { millimetres: true },
    ),
    row(
        "points",
        "Points with the colours of LEFT and their confidence: binary .ply (`quality`), x to the right, y down, z forward \
         of the left camera. Invalid, filled and low-confidence pixels are left out. points.pcd writes PCD (`intensity`, \
         for ROS, PCL and Open3D), points.las and points.laz write LAS 1.2 and LAZ (intensity: 257 times the confidence)",
        Kind::Points(Frame::Matched),
    ),
    row("points.pcd", "", Kind::Points(Frame::Matched)),
    row("points.las", "", Kind::Points(Frame::Matched)),
    row("points.laz", "", Kind::Points(Frame::Matched)),
    row(
        "points-original",
        "The same in the frame of the left camera before --rectify: that of the calibration. Also as .pcd, .las and .laz",
        Kind::Points(Frame::Original),
    ),
    row("points-original.pcd", "", Kind::Points(Frame::Original)),
    row("points-original.las", "", Kind::Points(Frame::Original)),
    row("points-original.laz", "", Kind::Points(Frame::Original)),
    row(
        "confidence",
        "The confidence: 8-bit .png, 0 to 255, how far the runner-up label is behind the best one, in 1/8 nat, as a mean over the pixels around",
        Kind::Bytes(|maps| &maps.confidence),
    ),
    row(
        "validity",
        "Why a pixel is what it is: 8-bit .png, the sum of 1 outside (the match is not in the right image), 2 \
         occluded, 4 small region, 8 low confidence, 16 filled, 32 masked, 64 tie (two disparities match equally \
         well), 128 outvoted (by the pixels around it); 0 is measured and trusted",
        Kind::Bytes(|maps| &maps.validity),
    ),
    row(
        "sigma",
        "The error to expect of every measured disparity, in pixels, from its confidence: about two thirds are nearer to the truth. \
         As float: .pfm (+infinity where nothing was measured), or .tif (NaN) if the disparity map is TIFF",
        Kind::Sigma(Of::Disparities),
    ),
    row(
        "depth-sigma",
        "The error to expect of every depth, in its unit, likewise: Z sigma / (d + doffs)",
        Kind::Sigma(Of::Depths),
    ),
    row("preview", "The disparity map in colours, with a scale: .png", Kind::Picture { beside: false }),
    row("side-by-side", "LEFT and beside it the preview: .png", Kind::Picture { beside: true }),
];

const fn row(word: &'static str, help: &'static str, kind: Kind) -> Also {
    Also { word, help, kind, key: None }
}

/// The outputs beside the disparity map.
#[derive(clap::Args)]
#[command(next_help_heading = "More outputs")]
pub(crate) struct AlsoArgs {
    /// Writes more files beside the disparity map, as STEM.WORD.EXTENSION: `--also raw,validity` with d.pfm writes d.raw.pfm
    /// and d.validity.png
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = parser())]
    also: Vec<&'static Also>,
    /// Colours of the previews, from far to near [default: turbo]
    #[arg(long, value_name = "NAME", value_parser = colours())]
    colours: Option<ColourMap>,
    /// The camera of --also depth-registered, such as that of a rig's colours: its lens, its size, and how it stands to the left
    /// camera. One camera by the names of OpenCV (K, D, R, T and a size), Kalibr's chain, whose last camera it is, or the file of an OAK
    #[arg(long, value_name = "FILE")]
    pub(crate) into: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) limits: Limits,
}

fn parser() -> impl TypedValueParser<Value = &'static Also> {
    let words =
        ALL.iter().map(|also| PossibleValue::new(also.word).help(also.help).hide(also.help.is_empty()));
    PossibleValuesParser::new(words)
        .try_map(|word| ALL.iter().find(|also| also.word == word).ok_or("no such word"))
}

fn colours() -> impl TypedValueParser<Value = ColourMap> {
    let maps = [
        ("turbo", "Cold to warm", ColourMap::Turbo),
        ("viridis", "Violet to yellow, with even steps of lightness", ColourMap::Viridis),
        ("grey", "Dark to bright", ColourMap::Grey),
    ];
    PossibleValuesParser::new(maps.map(|(name, help, _)| PossibleValue::new(name).help(help))).try_map(
        move |word| maps.into_iter().find(|map| map.0 == word).map(|map| map.2).ok_or("no such word"),
    )
}

impl AlsoArgs {
    /// The wanted outputs, each once, in the order of the table.
    pub(crate) fn wanted(&self) -> impl Iterator<Item = &'static Also> {
        ALL.iter().filter(|also| self.also.iter().any(|wanted| wanted.word == also.word))
    }

    /// The camera of `--into`.
    ///
    /// # Errors
    /// For a file that makes no sense, and where an output takes a camera that is not given, or none takes the one that is.
    pub(crate) fn third(&self) -> Result<Option<ThirdCamera>> {
        match (&self.into, self.wanted().find(|also| matches!(also.kind, Kind::Registered { .. }))) {
            (Some(file), Some(_)) => Ok(Some(third::read(file)?)),
            (None, None) => Ok(None),
            (Some(_), None) => Err(Failure::usage(
                "--into",
                "is the camera of --also depth-registered and depth-registered-mm; add one of them, or leave it out",
            )),
            (None, Some(also)) => {
                let reason = "is in the view of a third camera; give that by --into, or take --also depth";
                Err(Failure::usage(also.flag(), reason))
            }
        }
    }

    /// The camera of `--into` for messages, in a frame that is called as the file without its extension.
    pub(crate) fn framed(&self, third: Option<&ThirdCamera>) -> Option<messages::Third> {
        let stem = self.into.as_ref()?.file_stem()?;
        third.map(|camera| messages::Third { frame_id: stem.to_string_lossy().into_owned(), camera: *camera })
    }

    /// Refuses colours without a picture, and the original camera where the images are not rectified.
    pub(crate) fn check(&self, rectifies: bool) -> Result<()> {
        self.check_clip()?;
        let is_picture = |also: &Also| matches!(also.kind, Kind::Picture { .. });
        if self.colours.is_some() && !self.wanted().any(is_picture) {
            let reason = "are those of a preview; add --also preview, or leave --colours out";
            return Err(Failure::usage("--colours", reason));
        }
        let is_original = |also: &&Also| matches!(also.kind, Kind::Points(Frame::Original));
        if let Some(word) = self.wanted().find(is_original).filter(|_| !rectifies) {
            let reason =
                "is of images that `mrfgs match` rectifies; add --rectify there, or take --also points";
            return Err(Failure::usage(word.flag(), reason));
        }
        Ok(())
    }

    /// `method`, which makes every wanted output.
    pub(crate) fn made_by(&self, mut method: Method) -> Result<Method> {
        method.set_all(self.wanted().filter_map(|also| also.key).map(|key| (key, "true")))?;
        Ok(method)
    }

    /// The wanted output that takes most of the cameras.
    pub(crate) fn take_cameras(&self) -> Option<&'static Also> {
        let is_of_cameras = |also: &&Also| {
            matches!(
                also.kind,
                Kind::Depth | Kind::Registered { .. } | Kind::Sigma(Of::Depths) | Kind::Points(..)
            )
        };
        let first = || self.wanted().find(is_of_cameras);
        self.wanted().find(|also| also.takes_unit()).or_else(first)
    }

    /// Whether a wanted output shows the left image.
    pub(crate) fn show_left(&self) -> bool {
        self.wanted().any(|also| matches!(also.kind, Kind::Points(..) | Kind::Picture { beside: true }))
    }

    /// The wanted outputs of a map that is there: depth where none are named.
    ///
    /// # Errors
    /// For an output that takes more than the map.
    pub(crate) fn of_map(&self) -> Result<Vec<&'static Also>> {
        let mut wanted: Vec<_> = self.wanted().collect();
        if wanted.is_empty() {
            wanted.extend(ALL.iter().find(|also| also.word == "depth"));
        }
        let is_of_map = |also: &&Also| {
            matches!(
                also.kind,
                Kind::Depth
                    | Kind::Millimetres
                    | Kind::Registered { .. }
                    | Kind::Points(Frame::Matched)
                    | Kind::Picture { .. }
            )
        };
        match wanted.iter().find(|also| !is_of_map(also)) {
            Some(word) => Err(Failure::usage(
                word.flag(),
                "is found by a match, and MAP does not hold it; leave it out",
            )),
            None => Ok(wanted),
        }
    }

    /// Refuses a limit of depths without depths.
    fn check_clip(&self) -> Result<()> {
        if self.limits.clip_depth.is_some() && self.take_cameras().is_none() {
            let reason = "is of depths and points; add --also depth or points, or leave it out";
            return Err(Failure::usage("--clip-depth", reason));
        }
        Ok(())
    }

    /// The disparity map in colours, with the left image `beside` it.
    fn picture(&self, beside: bool, outcome: &Outcome) -> Plane<[u8; 3]> {
        let (DisparityRange { min, max }, map) = (outcome.range, outcome.final_map(self.limits));
        let colours = self.colours.unwrap_or_default();
        let preview = colour::preview(&map, min as f32, max as f32, colours);
        match outcome.left.filter(|_| beside) {
            Some(left) => colour::side_by_side(&left.to_rgb8(), &preview),
            None => preview,
        }
    }

    /// What a film shows: the preview, or that with the left image beside it where that is the wanted output.
    pub(crate) fn film_picture(&self, outcome: &Outcome) -> Plane<[u8; 3]> {
        self.picture(self.show_left(), outcome)
    }

    /// Refuses outputs that no film shows.
    pub(crate) fn check_film(&self) -> Result<()> {
        self.check_clip()?;
        match self.wanted().find(|also| !matches!(also.kind, Kind::Picture { .. })) {
            Some(also) => Err(Failure::usage(
                also.flag(),
                "is a file of each frame, and OUTPUT is a film; give the name of a folder as OUTPUT",
            )),
            None => Ok(()),
        }
    }

    /// Refuses outputs that are no message of ROS; `remedy` says what helps.
    pub(crate) fn check_messages(&self, remedy: &str) -> Result<()> {
        self.check(false)?;
        match self.wanted().find(|also| also.topic().is_none()) {
            Some(also) => {
                let reason = format!(
                    "is no message of ROS, which are depth, depth-mm, depth-registered, depth-registered-mm, points, confidence, validity, \
                     sigma and depth-sigma; {remedy}"
                );
                Err(Failure::usage(also.flag(), reason))
            }
            None => Ok(()),
        }
    }

    /// The topics of the wanted outputs, each with the type of its messages.
    pub(crate) fn topics(&self) -> impl Iterator<Item = messages::Topic> {
        self.wanted().filter_map(Also::topic)
    }

    /// The wanted outputs as messages.
    pub(crate) fn contents(&self, outcome: &Outcome) -> Vec<Content> {
        let &Outcome { maps, left, rig, third, .. } = outcome;
        let near = |rig: &Rig| self.limits.near(outcome.final_map(self.limits), rig);
        let content = |also: &Also| match also.kind {
            Kind::Bytes(map) => Some(Content::Bytes(also.word, map(maps).clone())),
            Kind::Depth => rig.map(|rig| Content::Depth(rig.depths(&near(&rig)))),
            Kind::Sigma(of) => {
                let sigmas = outcome.sigmas(of, self.limits)?;
                Some(match of {
                    Of::Disparities => Content::Sigma(sigmas),
                    Of::Depths => Content::DepthSigma(sigmas),
                })
            }
            Kind::Millimetres => rig.and_then(|rig| rig.millimetres(&near(&rig)).map(Content::Millimetres)),
            Kind::Points(_) => {
                let (rig, left) = rig.zip(left)?;
                Some(Content::Points(rig.cloud(&self.limits.trusted(maps, &rig), left)))
            }
            Kind::Registered { millimetres } => {
                let (rig, camera) = rig.zip(third)?;
                if millimetres {
                    let depths = rig.registered_millimetres(&near(&rig), &camera)?;
                    Some(Content::RegisteredMillimetres(depths))
                } else {
                    Some(Content::Registered(rig.registered(&near(&rig), &camera)))
                }
            }
            Kind::Disparity(..) | Kind::Picture { .. } => None,
        };
        self.wanted().filter_map(content).collect()
    }

    /// Writes `also` to `path`. Returns what there is to say of it.
    pub(crate) fn write(&self, also: &Also, path: &Path, outcome: &Outcome) -> Result<Option<String>> {
        let &Outcome { maps, sign, left, rig, rectifying, third, .. } = outcome;
        match also.kind {
            Kind::Disparity(view, map) => {
                let Some(map) = map(maps) else { return Ok(None) };
                outcome.writer(view).disparity(path, &sign.map(map))?;
            }
            Kind::Bytes(map) => write::picture(path, map(maps))?,
            Kind::Depth => {
                let Some(rig) = rig else { return Ok(None) };
                let depths = rig.depths(&self.limits.near(outcome.final_map(self.limits), &rig));
                outcome.writer(View::Left).depth(path, &depths)?;
                return Ok(Some(format!("depths {}", span(&depths))));
            }
            Kind::Millimetres => {
                let near = |rig: &Rig| self.limits.near(outcome.final_map(self.limits), rig);
                let Some(depths) = rig.and_then(|rig| rig.millimetres(&near(&rig))) else { return Ok(None) };
                write::picture(path, &depths)?;
            }
            Kind::Registered { millimetres } => {
                let Some((rig, camera)) = rig.zip(third) else { return Ok(None) };
                let map = self.limits.near(outcome.final_map(self.limits), &rig);
                if !millimetres {
                    // A third camera sees nothing of a map's georeference.
                    let depths = rig.registered(&map, &camera);
                    Writer::default().depth(path, &depths)?;
                    return Ok(Some(format!("depths of --into {}", span(&depths))));
                }
                if let Some(depths) = rig.registered_millimetres(&map, &camera) {
                    write::picture(path, &depths)?;
                }
            }
            Kind::Sigma(of) => {
                let Some(sigmas) = outcome.sigmas(of, self.limits) else { return Ok(None) };
                outcome.writer(View::Left).depth(path, &sigmas)?;
            }
            Kind::Points(frame) => {
                let rig = match frame {
                    Frame::Matched => rig,
                    Frame::Original => rig.zip(rectifying).map(|(rig, by)| rig.in_original_frame(&by)),
                };
                let (Some(rig), Some(left)) = (rig, left) else { return Ok(None) };
                let cloud = rig.cloud(&self.limits.trusted(maps, &rig), left);
                write::cloud(path, &cloud)?;
                let count = cloud.points.len();
                return Ok(Some(format!("{count} point{}", plural(count))));
            }
            Kind::Picture { beside } => write::picture(path, &self.picture(beside, outcome))?,
        }
        Ok(None)
    }
}

/// The least and the largest of what is known.
fn span(depths: &Plane<f32>) -> String {
    let known = || depths.data().iter().copied().filter(|depth| depth.is_finite());
    match known().reduce(f32::min).zip(known().reduce(f32::max)) {
        Some((least, most)) => format!("{least:.3} to {most:.3}"),
        None => "of no pixel".into(),
    }
}

impl Also {
    /// The flag that asks for it.
    pub(crate) fn flag(&self) -> String {
        format!("--also {}", self.word)
    }

    /// Its topic in ROS; `None` where it is no message there.
    fn topic(&self) -> Option<messages::Topic> {
        match self.kind {
            Kind::Depth => Some(messages::DEPTH),
            Kind::Millimetres => Some(messages::MILLIMETRES),
            Kind::Sigma(Of::Disparities) => Some(messages::SIGMA),
            Kind::Sigma(Of::Depths) => Some(messages::DEPTH_SIGMA),
            Kind::Points(Frame::Matched) if self.word == self.stem() => Some(messages::POINTS),
            Kind::Bytes(_) => Some(messages::of_bytes(self.word)),
            Kind::Registered { millimetres: false } => Some(messages::REGISTERED),
            Kind::Registered { millimetres: true } => Some(messages::REGISTERED_MILLIMETRES),
            Kind::Points(_) | Kind::Disparity(..) | Kind::Picture { .. } => None,
        }
    }

    /// Whether it takes the unit of the baseline, too.
    pub(crate) fn takes_unit(&self) -> bool {
        matches!(self.kind, Kind::Millimetres | Kind::Registered { millimetres: true })
    }

    /// Refuses it as a message where the unit of the baseline of `rig` is not known.
    pub(crate) fn check_metres(&self, rig: &Rig) -> Result<()> {
        if rig.unit().millimetres().is_none() {
            let reason = "is in metres in ROS, and nothing says the unit of the baseline; add an entry `unit` to the calibration: mm, cm or \
                          m, or give it with --baseline";
            return Err(Failure::usage(self.flag(), reason));
        }
        Ok(())
    }

    /// Its word without an extension.
    fn stem(&self) -> &'static str {
        self.word.split('.').next().unwrap_or(self.word)
    }

    /// Its file beside the disparity map `output`.
    pub(crate) fn beside(&self, output: &Path) -> PathBuf {
        let own = output.extension().unwrap_or_default().to_string_lossy();
        let is_tiff = ["tif", "tiff"].iter().any(|tiff| own.eq_ignore_ascii_case(tiff));
        let extension = match self.kind {
            Kind::Disparity(..) => &*own,
            Kind::Depth | Kind::Registered { millimetres: false } | Kind::Sigma(_) if is_tiff => &*own,
            Kind::Depth | Kind::Registered { millimetres: false } | Kind::Sigma(_) => "pfm",
            Kind::Points(_) => self.word.split_once('.').map_or("ply", |(_, extension)| extension),
            Kind::Bytes(_) | Kind::Millimetres | Kind::Registered { .. } | Kind::Picture { .. } => "png",
        };
        output.with_extension(format!("{}.{extension}", self.stem()))
    }

    /// Says before any computing whether it can be written to `path`, with disparities in `range`.
    pub(crate) fn check(&self, path: &Path, range: DisparityRange) -> mrfgs::Result<()> {
        match self.kind {
            Kind::Disparity(..) => write::check_disparity_path(path, range.min, range.max),
            Kind::Depth | Kind::Registered { millimetres: false } | Kind::Sigma(_) => {
                write::check_depth_path(path)
            }
            Kind::Points(..) => write::check_path(path),
            Kind::Bytes(_) | Kind::Millimetres | Kind::Registered { .. } | Kind::Picture { .. } => {
                write::check_png_path(path)
            }
        }
    }
}

/// What stands between stem and extension in the names of all such files: ".raw" and the like.
pub(crate) fn endings() -> impl Iterator<Item = String> {
    ALL.iter().map(|also| format!(".{}", also.stem()))
}

/// The files of all outputs beside the disparity map `output`, wanted or not.
pub(crate) fn all_beside(output: &Path) -> impl Iterator<Item = PathBuf> {
    ALL.iter().map(|also| also.beside(output))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_named_after_the_map() {
        let names = |output: &str| -> Vec<String> {
            all_beside(Path::new(output)).map(|path| path.to_str().unwrap().to_owned()).collect()
        };
        let of_pfm = "raw.pfm right.pfm depth.pfm depth-mm.png depth-registered.pfm \
                      depth-registered-mm.png points.ply points.pcd points.las points.laz \
                      points-original.ply points-original.pcd points-original.las points-original.laz \
                      confidence.png validity.png sigma.pfm depth-sigma.pfm preview.png";
        let of_pfm: Vec<_> = of_pfm.split(' ').map(|end| format!("a/b.c.{end}")).collect();
        assert_eq!(names("a/b.c.pfm")[..19], of_pfm);
        assert_eq!(names("d.png")[..2], ["d.raw.png", "d.right.png"]);
        assert_eq!(names("d.TIFF")[..3], ["d.raw.TIFF", "d.right.TIFF", "d.depth.TIFF"]);
    }
}
