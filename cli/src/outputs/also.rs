//! The table of `--also` outputs, which every command uses.

use std::path::{Path, PathBuf};

use mrfgs::depth::Rig;
use mrfgs::image::cloud::PointFrame;
use mrfgs::image::{Plane, write};
use mrfgs::maps::Maps;
use mrfgs::options::DisparityRange;

use crate::args::CameraNeed;
use crate::failure::{Failure, Result};
use crate::outputs::messages;
use crate::outputs::outcome::{Of, View};

/// An output beside the disparity map.
#[derive(Debug)]
pub(crate) struct Also {
    /// The word after `--also`, which is also in the file name. An extension selects another format.
    pub(crate) word: &'static str,
    /// Empty if another word's help describes it.
    pub(super) help: &'static str,
    pub(super) kind: Kind,
    /// The key of the method that enables it.
    pub(super) key: Option<&'static str>,
}

/// The content of an output, which determines its file format.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kind {
    /// A disparity map of a view, in the format of the main disparity map.
    Disparity(View, fn(&Maps) -> Option<Plane<f32>>),
    /// An 8-bit map, as PNG.
    Bytes(fn(&Maps) -> &Plane<u8>),
    /// Depths, as float PFM, or TIFF if the disparity map is one.
    Depth,
    /// Depths in whole millimetres, as 16-bit PNG.
    Millimetres,
    /// Depths in the view of a third camera, as float or in whole millimetres.
    Registered { millimetres: bool },
    /// Expected errors of disparities or depths, as float like depths.
    Sigma(Of),
    /// A point cloud, as PLY unless the word has an extension.
    Points(PointFrame),
    /// The disparity map in colours, as PNG, with the left image to its left if `beside`.
    Picture { beside: bool },
    /// The map and its surface, as a page.
    View,
}

/// All outputs, in the order in which they are written.
pub(super) static ALL: &[Also] = &[
    row(
        "raw",
        "The disparity map before post-processing, in the format of the disparity map",
        Kind::Disparity(View::Left, |maps| Some(maps.raw_map())),
    ),
    Also {
        key: Some("right-map"),
        ..row(
            "right",
            "The disparity map of the right view, post-processed like the left one, in the same format: \
             right (x, y) with disparity d appears at left (x + d, y)",
            Kind::Disparity(View::Right, Maps::right_map),
        )
    },
    row(
        "depth",
        "The depth of every pixel, as float: .pfm (+infinity if unknown), or .tif (NaN) if the disparity map is \
         TIFF",
        Kind::Depth,
    ),
    row(
        "depth-mm",
        "The depth of every pixel in millimetres, as in ROS and TUM: 16-bit .png, 0 if unknown or above \
         65535. Needs a calibration with a known unit",
        Kind::Millimetres,
    ),
    row(
        "depth-registered",
        "The depth seen by the camera of --into, along its axis and at its pixels, as float like depth; unknown where it sees \
         something that LEFT does not",
        Kind::Registered { millimetres: false },
    ),
    row(
        "depth-registered-mm",
        "Like depth-registered, in millimetres like depth-mm",
        Kind::Registered { millimetres: true },
    ),
    row(
        "points",
        "A point cloud with the colours of LEFT and confidences: binary .ply (`quality`), x to the right, y down, z forward \
         of the left camera. Invalid, filled and low-confidence pixels are left out. points.pcd writes PCD (`intensity`, \
         for ROS, PCL and Open3D), points.las and points.laz write LAS 1.2 and LAZ (intensity: 257 times the confidence)",
        Kind::Points(PointFrame::Matched),
    ),
    row("points.pcd", "", Kind::Points(PointFrame::Matched)),
    row("points.las", "", Kind::Points(PointFrame::Matched)),
    row("points.laz", "", Kind::Points(PointFrame::Matched)),
    row(
        "points-original",
        "Like points, in the frame of the left camera before --rectify, as in the calibration. Also as .pcd, .las and .laz",
        Kind::Points(PointFrame::Original),
    ),
    row("points-original.pcd", "", Kind::Points(PointFrame::Original)),
    row("points-original.las", "", Kind::Points(PointFrame::Original)),
    row("points-original.laz", "", Kind::Points(PointFrame::Original)),
    row(
        "confidence",
        "How sure each pixel is: 8-bit .png, from 0 (guessed) to 255 (sure). How much worse the second-best disparity fits (in 1/8 nat), averaged over neighbouring pixels",
        Kind::Bytes(|maps| &maps.confidence),
    ),
    row(
        "validity",
        "The status of each pixel: 8-bit .png, the sum of 1 outside (the match is not in the right image), 2 \
         occluded, 4 small region, 8 low confidence, 16 filled, 32 masked, 64 tie (two disparities match equally \
         well), 128 outvoted (by neighbouring pixels); 0 is measured and trusted",
        Kind::Bytes(|maps| &maps.validity),
    ),
    row(
        "sigma",
        "The expected error of every measured disparity, in pixels, from its confidence: about two thirds of the errors are smaller. \
         As float: .pfm (+infinity where nothing was measured), or .tif (NaN) if the disparity map is TIFF",
        Kind::Sigma(Of::Disparities),
    ),
    row(
        "depth-sigma",
        "The expected error of every depth, in its unit: Z sigma / (d + doffs)",
        Kind::Sigma(Of::Depths),
    ),
    row("preview", "The disparity map in colours, with a colour bar: .png", Kind::Picture { beside: false }),
    row("side-by-side", "LEFT and the preview side by side: .png", Kind::Picture { beside: true }),
    VIEW,
];

const VIEW: Also = row(
    "view",
    "A page to look at: LEFT, the map in colours with its values under the pointer, and the surface in 3-D. One .html file \
     that needs no network",
    Kind::View,
);

/// The output of this word.
pub(crate) fn of_word(word: &str) -> Option<&'static Also> {
    ALL.iter().find(|also| also.word == word)
}

/// The page of `--show`.
pub(crate) fn view() -> &'static Also {
    &VIEW
}

const fn row(word: &'static str, help: &'static str, kind: Kind) -> Also {
    Also { word, help, kind, key: None }
}

impl Also {
    /// The flag that selects it.
    pub(crate) fn flag(&self) -> String {
        format!("--also {}", self.word)
    }

    /// Whether it holds depths along the axis of the left camera.
    pub(super) fn is_depth(&self) -> bool {
        matches!(self.kind, Kind::Depth)
    }

    /// Whether each of its values depends on its own pixel alone, so that it can be written by bands of rows.
    pub(crate) fn comes_by_bands(&self) -> bool {
        !matches!(self.kind, Kind::Registered { .. } | Kind::Points(_) | Kind::Picture { .. } | Kind::View)
    }

    /// Whether it is the page.
    pub(crate) fn is_view(&self) -> bool {
        matches!(self.kind, Kind::View)
    }

    /// Its topic in ROS; `None` if it is never published.
    pub(super) fn topic(&self) -> Option<messages::Topic> {
        match self.kind {
            Kind::Depth => Some(messages::DEPTH),
            Kind::Millimetres => Some(messages::MILLIMETRES),
            Kind::Sigma(Of::Disparities) => Some(messages::SIGMA),
            Kind::Sigma(Of::Depths) => Some(messages::DEPTH_SIGMA),
            Kind::Points(PointFrame::Matched) if self.word == self.stem() => Some(messages::POINTS),
            Kind::Bytes(_) => Some(messages::of_bytes(self.word)),
            Kind::Registered { millimetres: false } => Some(messages::REGISTERED),
            Kind::Registered { millimetres: true } => Some(messages::REGISTERED_MILLIMETRES),
            Kind::Points(_) | Kind::Disparity(..) | Kind::Picture { .. } | Kind::View => None,
        }
    }

    /// Whether it needs the unit of the baseline.
    pub(crate) fn takes_unit(&self) -> bool {
        matches!(self.kind, Kind::Millimetres | Kind::Registered { millimetres: true })
    }

    /// The need of this output for the cameras.
    pub(crate) fn need(&self) -> CameraNeed {
        CameraNeed { flag: self.flag(), unit: self.takes_unit(), optional: self.is_view() }
    }

    /// Refuses to publish it in ROS if the unit of the baseline of `rig` is unknown.
    pub(crate) fn check_metres(&self, rig: &Rig) -> Result<()> {
        if rig.unit().millimetres().is_none() {
            let reason = "is in metres in ROS, but the unit of the baseline is unknown; add an entry `unit` to the calibration: mm, cm or \
                          m, or add it to --baseline";
            return Err(Failure::usage(self.flag(), reason));
        }
        Ok(())
    }

    /// The word without its extension.
    fn stem(&self) -> &'static str {
        self.word.split('.').next().unwrap_or(self.word)
    }

    /// The path of its file beside the disparity map `output`.
    pub(crate) fn beside(&self, output: &Path) -> PathBuf {
        let own = output.extension().unwrap_or_default().to_string_lossy();
        let is_tiff = ["tif", "tiff"].iter().any(|tiff| own.eq_ignore_ascii_case(tiff));
        let extension = match self.kind {
            Kind::Disparity(..) => &*own,
            Kind::Depth | Kind::Registered { millimetres: false } | Kind::Sigma(_) if is_tiff => &*own,
            Kind::Depth | Kind::Registered { millimetres: false } | Kind::Sigma(_) => "pfm",
            Kind::Points(_) => self.word.split_once('.').map_or("ply", |(_, extension)| extension),
            Kind::Bytes(_) | Kind::Millimetres | Kind::Registered { .. } | Kind::Picture { .. } => "png",
            Kind::View => "html",
        };
        output.with_extension(format!("{}.{extension}", self.stem()))
    }

    /// Checks before any computing that it can be written to `path`, with disparities in `range`.
    pub(crate) fn check(&self, path: &Path, range: DisparityRange) -> mrfgs::Result<()> {
        match self.kind {
            Kind::Disparity(..) => write::check_disparity_path(path, range.min, range.max),
            Kind::Depth | Kind::Registered { millimetres: false } | Kind::Sigma(_) => {
                write::check_depth_path(path)
            }
            Kind::Points(..) | Kind::View => write::check_path(path),
            Kind::Bytes(_) | Kind::Millimetres | Kind::Registered { .. } | Kind::Picture { .. } => {
                write::check_png_path(path)
            }
        }
    }
}

/// The parts between stem and extension in the names of all output files, such as ".raw".
pub(crate) fn endings() -> impl Iterator<Item = String> {
    ALL.iter().map(|also| format!(".{}", also.stem()))
}

/// The paths of all possible outputs beside the disparity map `output`.
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
