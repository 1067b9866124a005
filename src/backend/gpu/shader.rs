//! Shaders, assembled from the stage's own file, the shared parts that it imports, and constants from Rust.

use crate::maps::{FRACTION, flag};
use crate::plan::{VolumeWidth, WINDOW_RUN};
use crate::weights::{MEDIAN_WEIGHT, WINDOW_ROW_BITS};
use std::fmt::Write;

/// Invocations per workgroup.
pub(super) const WORKGROUP: u32 = 64;

/// The shared parts, by their names in `#import` lines.
const SHARED: &[(&str, &str)] = &[
    ("band", include_str!("../../../shaders/shared/band.wgsl")),
    ("image", include_str!("../../../shaders/shared/image.wgsl")),
    ("maps", include_str!("../../../shaders/shared/maps.wgsl")),
    ("messages", include_str!("../../../shaders/shared/messages.wgsl")),
    ("prior", include_str!("../../../shaders/shared/prior.wgsl")),
    ("sections", include_str!("../../../shaders/shared/sections.wgsl")),
    ("volume", include_str!("../../../shaders/shared/volume.wgsl")),
    ("windows", include_str!("../../../shaders/shared/windows.wgsl")),
    ("weighted_median", include_str!("../../../shaders/shared/weighted_median.wgsl")),
];
/// The base of `messages`, by the width of messages and beliefs.
const NARROW: &str = include_str!("../../../shaders/shared/narrow.wgsl");
const WIDE: &str = include_str!("../../../shaders/shared/wide.wgsl");

/// A constant of a shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Constant {
    /// `bool`.
    Bool(bool),
    /// `i32`.
    I32(i32),
    /// `u32`.
    U32(u32),
}

impl From<bool> for Constant {
    fn from(value: bool) -> Self {
        Self::Bool(value)
    }
}

impl From<i32> for Constant {
    fn from(value: i32) -> Self {
        Self::I32(value)
    }
}

impl From<u32> for Constant {
    fn from(value: u32) -> Self {
        Self::U32(value)
    }
}

/// The constants of the shared part `name`.
fn constants_of(name: &str) -> Vec<(&'static str, Constant)> {
    match name {
        "band" => vec![("GROUP", WORKGROUP.into())],
        "maps" => {
            let flags = [
                ("OUTSIDE", flag::OUTSIDE),
                ("OCCLUDED", flag::OCCLUDED),
                ("SPECKLE", flag::SPECKLE),
                ("LOW_CONFIDENCE", flag::LOW_CONFIDENCE),
                ("FILLED", flag::FILLED),
                ("MASKED", flag::MASKED),
                ("TIE", flag::TIE),
                ("OUTVOTED", flag::OUTVOTED),
                ("INVALID", flag::INVALID),
                ("VALIDITY", u8::MAX),
            ];
            let flags = flags.map(|(name, bits)| (name, u32::from(bits).into()));
            flags.into_iter().chain([("FRACTION", FRACTION.into())]).collect()
        }
        "windows" => vec![("WINDOW_RUN", (WINDOW_RUN as u32).into())],
        "weighted_median" => vec![
            ("MEDIAN_WEIGHT", u32::from(MEDIAN_WEIGHT).into()),
            ("WINDOW_ROW_BITS", WINDOW_ROW_BITS.into()),
        ],
        _ => Vec::new(),
    }
}

/// An entry point of a stage's shader, specialized by constants. Equal ones are compiled once.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Shader {
    /// Name of the stage that it belongs to.
    pub stage: &'static str,
    /// The entry point.
    pub entry: &'static str,
    text: &'static str,
    /// Width of messages and beliefs.
    pub(super) width: Option<VolumeWidth>,
    /// The constants that specialize it.
    pub constants: Vec<(&'static str, Constant)>,
}

impl Shader {
    /// The entry point `entry` of the shader of `stage`, with the file contents `text`.
    pub(super) const fn new(stage: &'static str, entry: &'static str, text: &'static str) -> Self {
        Self { stage, entry, text, width: None, constants: Vec::new() }
    }

    /// The source: constants, imported parts, then its own file.
    #[must_use]
    pub fn source(&self) -> String {
        let mut parts = Vec::new();
        let body = without_imports(self.text, &mut parts);
        let mut source = String::new();
        let shared = parts.iter().flat_map(|part| constants_of(part));
        for (name, value) in shared.chain(self.constants.iter().copied()) {
            let _ = match value {
                Constant::Bool(value) => writeln!(source, "const {name} = {value};"),
                Constant::I32(value) => writeln!(source, "const {name}: i32 = {value};"),
                Constant::U32(value) => writeln!(source, "const {name}: u32 = {value}u;"),
            };
        }
        if let Some(width) = self.width {
            source += match width {
                VolumeWidth::Narrow => NARROW,
                VolumeWidth::Wide => WIDE,
            };
        }
        for part in &parts {
            source += &without_imports(shared_part(part), &mut Vec::new());
        }
        source + &body
    }
}

/// The number of the binding `name` in the shader `source`.
#[must_use]
pub fn binding_number(source: &str, name: &str) -> Option<u32> {
    let bindings = source.lines().filter_map(|line| line.strip_prefix("@group(0) @binding("));
    let mut parts = bindings.filter_map(|line| {
        let (number, variable) = line.split_once(") var<")?;
        let (_, variable) = variable.split_once("> ")?;
        Some((number, variable.split_once(':')?.0))
    });
    parts.find(|part| part.1 == name)?.0.parse().ok()
}

fn shared_part(name: &str) -> &'static str {
    SHARED.iter().find(|part| part.0 == name).expect("an import names a file in shaders/shared").1
}

/// `text` without its `#import` lines. Adds imported parts, and their imports, to `parts` once each.
fn without_imports<'a>(text: &'a str, parts: &mut Vec<&'a str>) -> String {
    let mut body = String::with_capacity(text.len());
    for line in text.lines() {
        let Some(names) = line.strip_prefix("#import ") else {
            body += line;
            body.push('\n');
            continue;
        };
        for name in names.split_whitespace() {
            if !parts.contains(&name) {
                without_imports(shared_part(name), parts);
                parts.push(name);
            }
        }
    }
    body
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn imports_come_once_and_before_their_users() {
        let text = "#import messages volume\n#import band\nfn main() {}\n";
        let mut parts = Vec::new();
        assert_eq!(without_imports(text, &mut parts), "fn main() {}\n");
        assert_eq!(parts, ["volume", "messages", "band"]);
    }

    #[test]
    fn constants_have_their_types() {
        let constants = vec![("A", 3.into()), ("B", 4u32.into()), ("C", true.into())];
        let shader = Shader { constants, ..Shader::new("a", "main", "") };
        assert_eq!(shader.source(), "const A: i32 = 3;\nconst B: u32 = 4u;\nconst C = true;\n");
    }
}
