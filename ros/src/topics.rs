//! Finds the topics of the left and the right camera.

use mrfgs::error::Reason;

use crate::messages::{CameraInfo, CompressedImage, Encoding, Image, PointCloud2, Type};

/// A topic and its properties.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topic {
    /// The name, with its slash.
    pub name: String,
    /// The message type, as in ROS 2: `sensor_msgs/msg/Image`.
    pub kind: String,
    /// The serialization of its messages; `None` if it is not supported.
    pub encoding: Option<Encoding>,
    /// The number of messages, if known.
    pub count: Option<u64>,
}

impl Topic {
    /// Whether its messages are images, raw or compressed.
    #[must_use]
    pub fn has_images(&self) -> bool {
        let is_image = [Image::NAME, CompressedImage::NAME].contains(&self.kind.as_str());
        is_image && self.encoding.is_some()
    }

    /// Whether it has this name, with or without leading slash.
    fn is_called(&self, name: &str) -> bool {
        self.name.trim_start_matches('/') == name.trim_start_matches('/')
    }

    /// Whether its images are compressed files.
    #[must_use]
    pub fn is_compressed(&self) -> bool {
        self.kind == CompressedImage::NAME
    }

    /// Whether its messages are parts of a film, such as H.264.
    #[must_use]
    pub fn has_video(&self) -> bool {
        ["CompressedVideo", "FFMPEGPacket"].iter().any(|kind| self.kind.ends_with(kind))
    }

    /// Whether its images are rectified, according to its name: `image_rect` and the like.
    #[must_use]
    pub fn is_rectified(&self) -> bool {
        let is_rectified = |part: &str| part.starts_with("image_rect") || part == "rect";
        self.name.split('/').any(is_rectified)
    }

    /// Whether its images are raw, according to its name.
    #[must_use]
    pub fn is_raw(&self) -> bool {
        !self.is_rectified() && self.name.split('/').any(|part| part == "image_raw")
    }

    /// Possible names of the topic of its calibration, the usual one first.
    #[must_use]
    pub fn camera_infos(&self) -> Vec<String> {
        // Compressed images are one level below the original ones.
        let levels = if self.is_compressed() { 2 } else { 1 };
        let above = self.name.match_indices('/').rev().take(levels).map(|(at, _)| &self.name[..at]);
        above.map(|above| format!("{above}/camera_info")).collect()
    }
}

/// How to handle a film.
const DECODE: &str = "decode it to sensor_msgs/msg/Image with the republish node of image_transport and record that, or give `mrfgs sequence` the films \
                      themselves";

/// Words that distinguish the topics of two cameras, most reliable first.
const APART: [&[(&str, &str)]; 3] =
    [&[("left", "right"), ("Left", "Right"), ("LEFT", "RIGHT")], &[("0", "1")], &[("1", "2")]];

/// Finds the topics of the left and the right images among `topics` by their names.
///
/// # Errors
/// If there is none or more than one, with a list of them; `flag` is the flag that selects topics.
pub fn pair<'a>(topics: &'a [Topic], flag: &str) -> Result<[&'a Topic; 2], Reason> {
    let images: Vec<&Topic> = topics.iter().filter(|topic| is_of_camera(topic)).collect();
    for words in APART {
        let mut found: Vec<[&Topic; 2]> = Vec::new();
        for left in &images {
            for right in &images {
                if left.kind == right.kind && words.iter().any(|(l, r)| differ(&left.name, &right.name, l, r))
                {
                    found.push([left, right]);
                }
            }
        }
        match found[..] {
            [] => {}
            [pair] => return Ok(pair),
            _ => {
                let shown = found.iter().map(|[left, right]| format!("{},{}", left.name, right.name));
                let shown: Vec<_> = shown.collect();
                return Err(format!(
                    "contains several pairs of image topics; select one with {flag}: {}",
                    listed(&shown)
                )
                .into());
            }
        }
    }
    let names: Vec<_> = images.iter().map(|topic| topic.name.clone()).collect();
    Err(match &names[..] {
        [] => none(topics),
        [one] => format!("contains images on {one} only, but a pair needs two topics").into(),
        _ => format!(
            "contains no image topics named left and right; select two with {flag} LEFT,RIGHT from {}",
            listed(&names)
        )
        .into(),
    })
}

/// The topic of clouds called `name`, with or without leading slash.
///
/// # Errors
/// If there is none, with a list of existing ones.
pub fn clouds<'a>(topics: &'a [Topic], name: &str) -> Result<&'a Topic, Reason> {
    let all = || topics.iter().filter(|topic| topic.kind == PointCloud2::NAME && topic.encoding.is_some());
    all().find(|topic| topic.is_called(name)).ok_or_else(|| {
        let names: Vec<_> = all().map(|topic| topic.name.clone()).collect();
        let others = if names.is_empty() {
            "no clouds at all".into()
        } else {
            format!("clouds on {}", listed(&names))
        };
        format!("contains no {} on {name}, but {others}", PointCloud2::NAME).into()
    })
}

/// The image topic called `name`, with or without leading slash.
///
/// # Errors
/// If there is none, with a list of existing ones.
pub fn named<'a>(topics: &'a [Topic], name: &str) -> Result<&'a Topic, Reason> {
    match topics.iter().find(|topic| topic.is_called(name)) {
        Some(topic) if topic.has_images() => Ok(topic),
        Some(topic) => Err(wrong(topic)),
        None => {
            let images = topics.iter().filter(|topic| topic.has_images());
            let names: Vec<_> = images.map(|topic| topic.name.clone()).collect();
            if names.is_empty() {
                return Err(none(topics));
            }
            Err(format!("has no topic {name}; there are images on {}", listed(&names)).into())
        }
    }
}

/// The topic with the calibration of the camera of `topic`.
#[must_use]
pub fn camera_info<'a>(topics: &'a [Topic], topic: &Topic) -> Option<&'a Topic> {
    let named = |name: String| topics.iter().find(|topic| topic.name == name);
    let found = topic.camera_infos().into_iter().find_map(named)?;
    (found.kind == CameraInfo::NAME && found.encoding.is_some() && found.count != Some(0)).then_some(found)
}

fn is_of_camera(topic: &Topic) -> bool {
    topic.has_images() && topic.count != Some(0) && !topic.name.ends_with("/compressedDepth")
}

/// Whether replacing one occurrence of `word` by `other` turns `left` into `right`.
fn differ(left: &str, right: &str, word: &str, other: &str) -> bool {
    let replaced = |(at, _)| [&left[..at], other, &left[at + word.len()..]].concat() == right;
    left.match_indices(word).any(replaced)
}

/// Why the messages of a topic are not supported.
fn wrong(topic: &Topic) -> Reason {
    let Topic { name, kind, .. } = topic;
    if [Image::NAME, CompressedImage::NAME].contains(&kind.as_str()) {
        return format!("{name} is serialized neither as CDR nor as ROS 1").into();
    }
    if topic.has_video() {
        return format!("{name} contains a film ({kind}), not images; {DECODE}").into();
    }
    let kind = if kind.is_empty() { "messages without a type" } else { kind };
    format!("{name} contains {kind}, not sensor_msgs/msg/Image or CompressedImage; give an image topic")
        .into()
}

/// Why there are no images at all.
fn none(topics: &[Topic]) -> Reason {
    if topics.is_empty() {
        return "contains no messages".into();
    }
    let shown: Vec<_> = topics.iter().map(|topic| format!("{} ({})", topic.name, topic.kind)).collect();
    if topics.iter().any(Topic::has_video) {
        return format!("contains films but no images; {DECODE}; its topics are {}", listed(&shown)).into();
    }
    format!(
        "contains no images of sensor_msgs/msg/Image or CompressedImage; its topics are {}",
        listed(&shown)
    )
    .into()
}

/// Names separated by commas, but not hundreds of them.
fn listed(names: &[String]) -> String {
    const MOST: usize = 12;
    let shown = names[..names.len().min(MOST)].join(", ");
    match names.len().saturating_sub(MOST) {
        0 => shown,
        more => format!("{shown} and {more} more"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn topics(names: &str) -> Vec<Topic> {
        let topic = |name: &str| {
            let kind = if name.ends_with("compressed") { CompressedImage::NAME } else { Image::NAME };
            let kind = if name.ends_with("info") { CameraInfo::NAME } else { kind };
            Topic { name: name.into(), kind: kind.into(), encoding: Some(Encoding::Cdr), count: None }
        };
        names.split(' ').map(topic).collect()
    }

    fn found(names: &str) -> Result<String, String> {
        let topics = topics(names);
        let pair = pair(&topics, "--topics").map_err(|reason| reason.to_string())?;
        Ok(pair.map(|topic| topic.name.clone()).join(" "))
    }

    #[test]
    fn pairs_are_found_by_their_names() {
        for (names, pair) in [
            ("/right/image_raw /left/image_raw /left/camera_info", "/left/image_raw /right/image_raw"),
            ("/cam1/image_raw /cam0/image_raw", "/cam0/image_raw /cam1/image_raw"),
            (
                "/camera/infra2/image_rect_raw /camera/infra1/image_rect_raw",
                "/camera/infra1/image_rect_raw /camera/infra2/image_rect_raw",
            ),
            // Words take precedence over numbers.
            ("/a0/left /a0/right /a1", "/a0/left /a0/right"),
            (
                "/left/image/compressed /right/image/compressed /front",
                "/left/image/compressed /right/image/compressed",
            ),
        ] {
            assert_eq!(found(names).as_deref(), Ok(pair));
        }
    }

    #[test]
    fn ambiguous_topics_are_listed() {
        for (names, words) in [
            (
                "/left/image_raw /right/image_raw /left/image_rect /right/image_rect",
                "several pairs of image topics; select one with --topics: /left/image_raw,/right/image_raw, /left/image_rect",
            ),
            ("/front /back", "LEFT,RIGHT from /front, /back"),
            ("/front", "/front only"),
            ("/left/camera_info", "no images & /left/camera_info (sensor_msgs/msg/CameraInfo)"),
            // An image topic and a compressed one are not a pair.
            ("/left/image /right/image/compressed", "LEFT,RIGHT from"),
        ] {
            let said = found(names).unwrap_err();
            assert!(words.split(" & ").all(|word| said.contains(word)), "{said}");
        }
        let films = ["/left/video", "/right/video"].map(|name| Topic {
            name: name.into(),
            kind: "foxglove.CompressedVideo".into(),
            encoding: None,
            count: None,
        });
        let said = pair(&films, "--topics").unwrap_err().to_string();
        assert!(said.contains("contains films but no images") && said.contains("republish"), "{said}");
        let said = named(&films, "/left/video").unwrap_err().to_string();
        assert!(said.contains("/left/video contains a film (foxglove.CompressedVideo)"), "{said}");
        let topics = topics("/left/image /left/camera_info");
        assert_eq!(named(&topics, "left/image").unwrap().name, "/left/image");
        assert!(
            named(&topics, "/lift")
                .unwrap_err()
                .to_string()
                .contains("has no topic /lift; there are images on /left/image")
        );
        assert!(
            named(&topics, "/left/camera_info")
                .unwrap_err()
                .to_string()
                .contains("contains sensor_msgs/msg/CameraInfo")
        );
        assert_eq!(camera_info(&topics, &topics[0]).unwrap().name, "/left/camera_info");
    }
}
