//! The names of lens models in the files of different programs.

use super::node::Entry;
use crate::error::Result;

/// A lens model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Model {
    /// A pinhole, with any distortion.
    Pinhole,
    /// Radial and tangential distortion.
    RadialTangential,
    /// The fisheye of Kannala and Brandt.
    Equidistant,
    /// The unified model of Mei and Rives.
    Unified,
    /// Double sphere.
    DoubleSphere,
    /// The extended unified model.
    ExtendedUnified,
    /// The field-of-view model.
    FieldOfView,
}

/// Names in lower case, without separators.
const NAMES: [(Model, &[&str]); 7] = [
    (Model::Pinhole, &["pinhole", "perspective", "none"]),
    (
        Model::RadialTangential,
        &[
            "plumbbob",
            "radtan",
            "radialtangential",
            "rationalpolynomial",
            "rational",
            "brown",
            "brownconrady",
            "opencv",
            "pinholeradtan8",
            "pinholefull",
        ],
    ),
    (
        Model::Equidistant,
        &[
            "equidistant",
            "equi",
            "fisheye",
            "kannalabrandt",
            "kannalabrandt4",
            "kannalabrandt8",
            "kb4",
            "kb8",
            "opencvfisheye",
        ],
    ),
    (Model::Unified, &["omni", "omnidir", "mei", "unified"]),
    (Model::DoubleSphere, &["ds", "doublesphere"]),
    (Model::ExtendedUnified, &["eucm", "extendedunified"]),
    (Model::FieldOfView, &["fov", "atan"]),
];

impl Model {
    /// The model that `entry` names.
    pub(super) fn of(entry: &Entry) -> Result<Self> {
        let plain = |c: &char| !['_', '-', ' '].contains(c);
        let name: String = entry.word()?.chars().filter(plain).collect::<String>().to_lowercase();
        let known = NAMES.iter().find(|(_, names)| names.contains(&name.as_str()));
        let expected = "a lens model of the guide, such as radtan or equidistant";
        known.map(|(model, _)| *model).ok_or_else(|| entry.wrong(expected))
    }

    /// Whether the model is OpenCV's fisheye; `None` if the name leaves that open.
    pub(super) fn is_fisheye(self) -> Option<bool> {
        match self {
            Self::Pinhole | Self::Unified => None,
            Self::Equidistant => Some(true),
            _ => Some(false),
        }
    }
}
