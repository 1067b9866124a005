//! Flags of the outputs beside a disparity map: their selection, checks and writing.

use std::fmt;
use std::path::{Path, PathBuf};

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use mrfgs::calibration::cameras::ThirdCamera;
use mrfgs::calibration::third;
use mrfgs::colour::{self, ColourMap};
use mrfgs::depth::Rig;
use mrfgs::image::cloud::PointFrame;
use mrfgs::image::write::Writer;
use mrfgs::image::{Plane, write};
use mrfgs::maps::Maps;
use mrfgs::options::{DisparityRange, Method};
use serde::{Serialize, Serializer};

use crate::failure::{Failure, Result};
use crate::outputs::also::{self, ALL, Also, Kind};
use crate::outputs::empty;
use crate::outputs::limits::Limits;
use crate::outputs::messages::{self, Content};
use crate::outputs::outcome::{Of, Outcome, View};
use crate::outputs::page::{self, Page};
use crate::text::plural;

/// The outputs beside the disparity map.
#[derive(clap::Args, Serialize)]
#[command(next_help_heading = "More outputs")]
pub(crate) struct AlsoArgs {
    /// Also writes these outputs beside the disparity map, as STEM.WORD.EXTENSION: `--also raw,validity` with d.pfm writes d.raw.pfm and
    /// d.validity.png
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = parser())]
    // Not recorded: the file names tell.
    #[serde(skip)]
    also: Vec<&'static Also>,
    /// Colour map of the previews and of the page [default: turbo]
    #[arg(long, value_name = "NAME", value_parser = colours())]
    #[serde(serialize_with = "colours_in_a_word")]
    colours: Option<ColourMap>,
    /// Calibration of the camera of --also depth-registered, such as a colour camera: lens, image size and pose relative to the left
    /// camera. OpenCV (K, D, R, T and a size), a Kalibr chain (its last camera), or an OAK file
    #[arg(long, value_name = "FILE")]
    // Not recorded here: it is among the inputs.
    #[serde(skip)]
    pub(crate) into: Option<PathBuf>,
    #[command(flatten)]
    #[serde(flatten)]
    pub(crate) limits: Limits,
}

fn parser() -> impl TypedValueParser<Value = &'static Also> {
    let words =
        ALL.iter().map(|also| PossibleValue::new(also.word).help(also.help).hide(also.help.is_empty()));
    PossibleValuesParser::new(words).try_map(|word| also::of_word(&word).ok_or("no such word"))
}

/// The values of `--colours`, with their help.
const COLOURS: [(&str, &str, ColourMap); 3] = [
    ("turbo", "Cold to warm", ColourMap::Turbo),
    ("viridis", "Violet to yellow, with even steps of lightness", ColourMap::Viridis),
    ("grey", "Dark to bright", ColourMap::Grey),
];

fn colours() -> impl TypedValueParser<Value = ColourMap> {
    PossibleValuesParser::new(COLOURS.map(|(name, help, _)| PossibleValue::new(name).help(help)))
        .try_map(|word| COLOURS.into_iter().find(|map| map.0 == word).map(|map| map.2).ok_or("no such word"))
}

#[allow(clippy::ref_option, clippy::trivially_copy_pass_by_ref, reason = "serde hands it over so")]
fn colours_in_a_word<S: Serializer>(colours: &Option<ColourMap>, to: S) -> Result<S::Ok, S::Error> {
    let colours = colours.unwrap_or_default();
    COLOURS.iter().find(|map| map.2 == colours).map(|map| map.0).serialize(to)
}

impl AlsoArgs {
    /// The selected outputs, each once, in the order of the table.
    pub(crate) fn wanted(&self) -> impl Iterator<Item = &'static Also> {
        ALL.iter().filter(|also| self.also.iter().any(|wanted| wanted.word == also.word))
    }

    /// Reads the camera of `--into`.
    ///
    /// # Errors
    /// If the file is malformed, if an output needs a camera that is not given, or if no output uses the given one.
    pub(crate) fn third(&self) -> Result<Option<ThirdCamera>> {
        match (&self.into, self.wanted().find(|also| matches!(also.kind, Kind::Registered { .. }))) {
            (Some(file), Some(_)) => Ok(Some(third::read(file)?)),
            (None, None) => Ok(None),
            (Some(_), None) => Err(Failure::usage(
                "--into",
                "is only used by --also depth-registered and depth-registered-mm; add one of them, or remove --into",
            )),
            (None, Some(also)) => {
                let reason = "needs a third camera; add --into FILE, or use --also depth";
                Err(Failure::usage(also.flag(), reason))
            }
        }
    }

    /// The camera of `--into` for messages; the frame is named after the file.
    pub(crate) fn framed(&self, third: Option<&ThirdCamera>) -> Option<messages::Third> {
        let stem = self.into.as_ref()?.file_stem()?;
        third.map(|camera| messages::Third { frame_id: stem.to_string_lossy().into_owned(), camera: *camera })
    }

    /// Refuses --colours without a picture, unless the command `shows` a page, and points in the original frame without a rectification.
    pub(crate) fn check(&self, rectifies: bool, shows: bool) -> Result<()> {
        self.check_clip()?;
        let is_picture = |also: &Also| matches!(also.kind, Kind::Picture { .. } | Kind::View);
        if self.colours.is_some() && !shows && !self.wanted().any(is_picture) {
            let reason = "needs a picture; add --also preview or --also view, or remove --colours";
            return Err(Failure::usage("--colours", reason));
        }
        let is_original = |also: &&Also| matches!(also.kind, Kind::Points(PointFrame::Original));
        if let Some(word) = self.wanted().find(is_original).filter(|_| !rectifies) {
            let reason = "needs images rectified by `mrfgs match`; add --rectify there, or use --also points";
            return Err(Failure::usage(word.flag(), reason));
        }
        Ok(())
    }

    /// Enables every selected output in `method`.
    pub(crate) fn made_by(&self, mut method: Method) -> Result<Method> {
        method.set_all(self.wanted().filter_map(|also| also.key).map(|key| (key, "true")))?;
        Ok(method)
    }

    /// The selected output that takes most of the camera: a unit first, else any camera, else one that can do without.
    pub(crate) fn take_cameras(&self) -> Option<&'static Also> {
        let is_of_cameras = |also: &&Also| {
            matches!(
                also.kind,
                Kind::Depth | Kind::Registered { .. } | Kind::Sigma(Of::Depths) | Kind::Points(..)
            )
        };
        let first = || self.wanted().find(is_of_cameras);
        self.wanted()
            .find(|also| also.takes_unit())
            .or_else(first)
            .or_else(|| self.wanted().find(|also| also.is_view()))
    }

    /// Whether a selected output shows the left image.
    pub(crate) fn show_left(&self) -> bool {
        self.wanted()
            .any(|also| matches!(also.kind, Kind::Points(..) | Kind::Picture { beside: true } | Kind::View))
    }

    /// The selected outputs for an existing map; depth by default.
    ///
    /// # Errors
    /// For an output that needs more than the map.
    pub(crate) fn of_map(&self) -> Result<Vec<&'static Also>> {
        let mut wanted: Vec<_> = self.wanted().collect();
        if wanted.is_empty() {
            wanted.extend(also::of_word("depth"));
        }
        let is_of_map = |also: &&Also| {
            matches!(
                also.kind,
                Kind::Depth
                    | Kind::Millimetres
                    | Kind::Registered { .. }
                    | Kind::Points(PointFrame::Matched)
                    | Kind::Picture { .. }
            )
        };
        match wanted.iter().find(|also| !is_of_map(also)) {
            Some(word) if word.is_view() => {
                Err(Failure::usage(word.flag(), "is what `mrfgs view MAP` makes; use that, or remove it"))
            }
            Some(word) => {
                Err(Failure::usage(word.flag(), "can only be computed by a match, not from MAP; remove it"))
            }
            None => Ok(wanted),
        }
    }

    /// Why depths or the wanted points of what is in front of the cameras come out empty, and what helps.
    pub(crate) fn left_out(&self, outcome: &Outcome) -> Option<String> {
        let points = self.wanted().any(|also| matches!(also.kind, Kind::Points(_)));
        empty::left_out(self.limits, outcome, points)
    }

    /// Refuses --clip-depth without depths or points.
    fn check_clip(&self) -> Result<()> {
        if self.limits.clip_depth.is_some() && self.take_cameras().is_none_or(Also::is_view) {
            let reason = "needs depths or points; add --also depth or --also points, or remove --clip-depth";
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

    /// The picture of a film: the preview, with the left image beside it if so selected.
    pub(crate) fn film_picture(&self, outcome: &Outcome) -> Plane<[u8; 3]> {
        self.picture(self.show_left(), outcome)
    }

    /// Refuses outputs that a film cannot show.
    pub(crate) fn check_film(&self) -> Result<()> {
        self.check_clip()?;
        match self.wanted().find(|also| !matches!(also.kind, Kind::Picture { .. })) {
            Some(also) => Err(Failure::usage(
                also.flag(),
                "writes a file per frame, but OUTPUT is a film; give a folder as OUTPUT",
            )),
            None => Ok(()),
        }
    }

    /// Refuses outputs that ROS has no message for; `remedy` ends the error.
    pub(crate) fn check_messages(&self, remedy: &str) -> Result<()> {
        self.check(false, false)?;
        match self.wanted().find(|also| also.topic().is_none()) {
            Some(also) => {
                let reason = format!(
                    "cannot be sent as a ROS message; possible are depth, depth-mm, depth-registered, depth-registered-mm, points, confidence, validity, \
                     sigma and depth-sigma; {remedy}"
                );
                Err(Failure::usage(also.flag(), reason))
            }
            None => Ok(()),
        }
    }

    /// The topics of the selected outputs, each with its message type.
    #[cfg(feature = "live")]
    pub(crate) fn topics(&self) -> impl Iterator<Item = messages::Topic> {
        self.wanted().filter_map(Also::topic)
    }

    /// The selected outputs, to be sent as messages.
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
            Kind::Disparity(..) | Kind::Picture { .. } | Kind::View => None,
        };
        self.wanted().filter_map(content).collect()
    }

    /// The values of `also`, if each depends on its own pixel alone and is known.
    fn values(&self, also: &Also, outcome: &Outcome) -> Option<Values> {
        let &Outcome { maps, sign, rig, .. } = outcome;
        let near = |rig: &Rig| self.limits.near(outcome.final_map(self.limits), rig);
        match also.kind {
            Kind::Disparity(view, map) => map(maps).map(|map| Values::Float(sign.map(map), view)),
            Kind::Bytes(map) => Some(Values::Bytes(map(maps).clone())),
            Kind::Depth => rig.map(|rig| Values::Float(rig.depths(&near(&rig)), View::Left)),
            Kind::Millimetres => rig.and_then(|rig| rig.millimetres(&near(&rig)).map(Values::Words)),
            Kind::Sigma(of) => {
                outcome.sigmas(of, self.limits).map(|sigmas| Values::Float(sigmas, View::Left))
            }
            Kind::Registered { .. } | Kind::Points(_) | Kind::Picture { .. } | Kind::View => None,
        }
    }

    /// Writes `also` to `path`. Returns a remark for the user, if there is one.
    pub(crate) fn write(&self, also: &Also, path: &Path, outcome: &Outcome) -> Result<Option<String>> {
        let &Outcome { maps, left, rig, rectifying, third, .. } = outcome;
        match also.kind {
            Kind::Registered { millimetres } => {
                let Some((rig, camera)) = rig.zip(third) else { return Ok(None) };
                let map = self.limits.near(outcome.final_map(self.limits), &rig);
                if !millimetres {
                    // The georeference of the map does not apply to a third camera.
                    let depths = rig.registered(&map, &camera);
                    Writer::default().depth(path, &depths)?;
                    return Ok(Some(format!("depths of --into {}", Span::of(&depths))));
                }
                if let Some(depths) = rig.registered_millimetres(&map, &camera) {
                    write::picture(path, &depths)?;
                }
            }
            Kind::Points(frame) => {
                let rig = match frame {
                    PointFrame::Matched => rig,
                    PointFrame::Original => rig.zip(rectifying).map(|(rig, by)| rig.in_original_frame(&by)),
                };
                let (Some(rig), Some(left)) = (rig, left) else { return Ok(None) };
                let cloud = rig.cloud(&self.limits.trusted(maps, &rig), left);
                write::cloud(path, &cloud)?;
                let count = cloud.points.len();
                return Ok(Some(format!("{count} point{}", plural(count))));
            }
            Kind::Picture { beside } => write::picture(path, &self.picture(beside, outcome))?,
            Kind::View => Page {
                map: &outcome.final_map(self.limits),
                confidence: Some(&maps.confidence),
                validity: Some(&maps.validity),
                left,
                rig,
                clip_depth: self.limits.clip_depth,
                colours: self.colours.unwrap_or_default(),
            }
            .save(path, &page::name(path))?,
            _ => match self.values(also, outcome) {
                None => {}
                Some(Values::Bytes(levels)) => write::picture(path, &levels)?,
                Some(Values::Words(levels)) => write::picture(path, &levels)?,
                Some(Values::Float(map, view)) => {
                    outcome.writer(view).disparity(path, &map)?;
                    return Ok(also.is_depth().then(|| format!("depths {}", Span::of(&map))));
                }
            },
        }
        Ok(None)
    }

    /// Like [`Self::write`], for maps of this size that come as bands of rows; `outcome` makes that of a band. Only for an output that
    /// [comes by bands](Also::comes_by_bands).
    pub(crate) fn write_in_bands(
        &self,
        also: &Also,
        path: &Path,
        size: (usize, usize),
        bands: impl Iterator<Item = mrfgs::Result<Maps>>,
        outcome: &dyn for<'a> Fn(&'a Maps) -> Outcome<'a>,
    ) -> Result<Option<String>> {
        let mut bands = bands.map(|maps| maps.map(|maps| self.values(also, &outcome(&maps)))).peekable();
        let missing = || mrfgs::Error::write(path, "a part of the map is missing");
        match bands.peek() {
            Some(Ok(Some(Values::Bytes(_)))) => {
                let mut bands = bands.map(|values| match values? {
                    Some(Values::Bytes(levels)) => Ok(levels),
                    _ => Err(missing()),
                });
                write::picture_in_bands(path, size, &mut bands)?;
            }
            Some(Ok(Some(Values::Words(_)))) => {
                let mut bands = bands.map(|values| match values? {
                    Some(Values::Words(levels)) => Ok(levels),
                    _ => Err(missing()),
                });
                write::picture_in_bands(path, size, &mut bands)?;
            }
            Some(Ok(Some(Values::Float(_, view)))) => {
                let (view, mut span) = (*view, Span::default());
                let mut bands = bands.map(|values| match values? {
                    Some(Values::Float(map, _)) => {
                        span.add(&map);
                        Ok(map)
                    }
                    _ => Err(missing()),
                });
                let nothing = Maps::blank((1, 1), false);
                outcome(&nothing).writer(view).disparity_in_bands(path, size, &mut bands)?;
                return Ok(also.is_depth().then(|| format!("depths {span}")));
            }
            // Without cameras, there is nothing to write.
            Some(Ok(None)) | None => {}
            Some(Err(e)) => return Err(e.clone().into()),
        }
        Ok(None)
    }
}

/// The values of an output.
enum Values {
    /// Disparities, depths or errors, in the pixels of a view.
    Float(Plane<f32>, View),
    Bytes(Plane<u8>),
    Words(Plane<u16>),
}

/// The smallest and the largest known depth.
#[derive(Clone, Copy, Default)]
struct Span(Option<(f32, f32)>);

impl Span {
    fn of(depths: &Plane<f32>) -> Self {
        let mut span = Self::default();
        span.add(depths);
        span
    }

    fn add(&mut self, depths: &Plane<f32>) {
        for &depth in depths.data().iter().filter(|depth| depth.is_finite()) {
            let (least, most) = self.0.unwrap_or((depth, depth));
            self.0 = Some((least.min(depth), most.max(depth)));
        }
    }
}

impl fmt::Display for Span {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Some((least, most)) => write!(f, "{least:.3} to {most:.3}"),
            None => f.write_str("of no pixel"),
        }
    }
}
