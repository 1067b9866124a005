//! Lens models by the names that programs give them.

use super::node::Entry;
use crate::error::Result;

/// What a name says of a lens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Model {
    /// A pinhole, with whatever distortion.
    Pinhole,
    /// Radial and tangential distortion.
    RadialTangential,
    /// A fisheye of Kannala and Brandt.
    Equidistant,
}

/// In lower case, without what separates words.
const NAMES: [(Model, &[&str]); 3] = [
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
];

impl Model {
    /// The model that `entry` names.
    pub(super) fn of(entry: &Entry) -> Result<Self> {
        let plain = |c: &char| !['_', '-', ' '].contains(c);
        let name: String = entry.word()?.chars().filter(plain).collect::<String>().to_lowercase();
        let known = NAMES.iter().find(|(_, names)| names.contains(&name.as_str()));
        known
            .map(|(model, _)| *model)
            .ok_or_else(|| entry.wrong("a lens model of the guide, such as radtan or equidistant"))
    }

    /// Whether it is a fisheye, where it says that.
    pub(super) fn is_fisheye(self) -> Option<bool> {
        match self {
            Self::Pinhole => None,
            Self::RadialTangential => Some(false),
            Self::Equidistant => Some(true),
        }
    }
}
