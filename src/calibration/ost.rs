//! `ost.txt`, in which ROS's `camera_calibration` saves one camera or a pair.

use super::node::Node;
use crate::text::quoted;

/// The entries, each with its name in `camera_info`.
const ENTRIES: [(&str, &str); 6] = [
    ("width", "image_width"),
    ("height", "image_height"),
    ("camera matrix", "camera_matrix"),
    ("distortion", "distortion_coefficients"),
    ("rectification", "rectification_matrix"),
    ("projection", "projection_matrix"),
];

/// Whether a text is such a file.
pub(super) fn is(text: &str) -> bool {
    text.starts_with("# oST version")
        || text.starts_with("[image]") && text.lines().any(|line| line.trim() == "camera matrix")
}

/// The cameras, with the entries of `camera_info`. The error is one line.
pub(super) fn parse(text: &str) -> Result<Vec<Node>, String> {
    let mut cameras: Vec<Vec<(String, Node)>> = Vec::new();
    for (i, line) in text.lines().map(str::trim).enumerate() {
        let wrong = |reason: &str| Err(format!("line {}: {reason}", i + 1));
        if line == "[image]" {
            cameras.push(Vec::new());
            continue;
        }
        if line.is_empty() || line.starts_with(['#', '[']) {
            continue;
        }
        let Some(camera) = cameras.last_mut() else { return wrong("expected [image] before it") };
        if let Some((_, name)) = ENTRIES.iter().find(|(called, _)| *called == line) {
            if camera.iter().any(|(other, _)| other == name) {
                return wrong(&format!("{} is there twice; keep one", quoted(line)));
            }
            camera.push(((*name).into(), Node::Scalar(String::new())));
        } else if let Some((_, Node::Scalar(numbers))) = camera.last_mut() {
            numbers.push(' ');
            numbers.push_str(line);
        } else {
            return wrong("expected the name of an entry, such as camera matrix");
        }
    }
    Ok(cameras.into_iter().map(with_model).collect())
}

/// Adds the model: fisheyes have 4 coefficients, other lenses 5 or more.
fn with_model(mut camera: Vec<(String, Node)>) -> Node {
    let fisheye = camera.iter().any(|(name, node)| {
        name == ENTRIES[3].1 && matches!(node, Node::Scalar(text) if text.split_whitespace().count() == 4)
    });
    let model = if fisheye { "equidistant" } else { "plumb_bob" };
    camera.push(("distortion_model".into(), Node::Scalar(model.into())));
    Node::Map(camera)
}
