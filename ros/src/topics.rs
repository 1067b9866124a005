//! Which topics are those of the left and of the right camera.

use mrfgs::error::Reason;

use crate::messages::{CameraInfo, CompressedImage, Encoding, Image, Type};

/// A topic, and what is known of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topic {
    /// Its name, with its slash.
    pub name: String,
    /// The type of its messages, as ROS 2 writes it: `sensor_msgs/msg/Image`.
    pub kind: String,
    /// How its messages are laid out, where that is known here.
    pub encoding: Option<Encoding>,
    /// How many messages it has, where that is known.
    pub count: Option<u64>,
}

impl Topic {
    /// Whether its messages are images, as they are or compressed.
    #[must_use]
    pub fn has_images(&self) -> bool {
        let is_image = [Image::NAME, CompressedImage::NAME].contains(&self.kind.as_str());
        is_image && self.encoding.is_some()
    }

    /// Whether its images are files of another format.
    #[must_use]
    pub fn is_compressed(&self) -> bool {
        self.kind == CompressedImage::NAME
    }

    /// Whether its messages are parts of a film, such as H.264.
    #[must_use]
    pub fn has_video(&self) -> bool {
        ["CompressedVideo", "FFMPEGPacket"].iter().any(|kind| self.kind.ends_with(kind))
    }

    /// Whether its images are rectified, by its name: `image_rect` and the like, or a part of that name.
    #[must_use]
    pub fn is_rectified(&self) -> bool {
        let is_rectified = |part: &str| part.starts_with("image_rect") || part == "rect";
        self.name.split('/').any(is_rectified)
    }

    /// Whether its images are as the camera took them, by its name.
    #[must_use]
    pub fn is_raw(&self) -> bool {
        !self.is_rectified() && self.name.split('/').any(|part| part == "image_raw")
    }

    /// The names that the topic of its calibration may have, the usual one first.
    #[must_use]
    pub fn camera_infos(&self) -> Vec<String> {
        // Compressed images are one level below those that they were.
        let levels = if self.is_compressed() { 2 } else { 1 };
        let above = self.name.match_indices('/').rev().take(levels).map(|(at, _)| &self.name[..at]);
        above.map(|above| format!("{above}/camera_info")).collect()
    }
}

/// What to do about a film.
const DECODE: &str = "decode it to sensor_msgs/msg/Image first, by the republish node of image_transport, and record that; or give `mrfgs sequence` the films \
                      themselves";

/// What two topics of a pair of cameras are called apart from each other, the most certain first.
const APART: [&[(&str, &str)]; 3] =
    [&[("left", "right"), ("Left", "Right"), ("LEFT", "RIGHT")], &[("0", "1")], &[("1", "2")]];

/// The topics of the left and of the right images among `topics`, by their names.
///
/// # Errors
/// Where there are none or several, in words that list them; `flag` is how the user names two.
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
                return Err(
                    format!("has several pairs of images; give {flag} one of {}", listed(&shown)).into()
                );
            }
        }
    }
    let names: Vec<_> = images.iter().map(|topic| topic.name.clone()).collect();
    Err(match &names[..] {
        [] => none(topics),
        [one] => format!("has images on {one} alone, and a pair takes two topics").into(),
        _ => format!(
            "has no two topics of images called left and right; give {flag} LEFT,RIGHT out of {}",
            listed(&names)
        )
        .into(),
    })
}

/// The topic of images that is called `name`, with or without its slash.
///
/// # Errors
/// Where there is none, in words that list those that are there.
pub fn named<'a>(topics: &'a [Topic], name: &str) -> Result<&'a Topic, Reason> {
    let is_it = |topic: &&Topic| topic.name.trim_start_matches('/') == name.trim_start_matches('/');
    match topics.iter().find(is_it) {
        Some(topic) if topic.has_images() => Ok(topic),
        Some(topic) => Err(wrong(topic)),
        None => {
            let images = topics.iter().filter(|topic| topic.has_images());
            let names: Vec<_> = images.map(|topic| topic.name.clone()).collect();
            if names.is_empty() {
                return Err(none(topics));
            }
            Err(format!("has no topic {name}; it has images on {}", listed(&names)).into())
        }
    }
}

/// The topic of the calibration of the camera that has taken the images of `topic`.
#[must_use]
pub fn camera_info<'a>(topics: &'a [Topic], topic: &Topic) -> Option<&'a Topic> {
    let named = |name: String| topics.iter().find(|topic| topic.name == name);
    let found = topic.camera_infos().into_iter().find_map(named)?;
    (found.kind == CameraInfo::NAME && found.encoding.is_some() && found.count != Some(0)).then_some(found)
}

fn is_of_camera(topic: &Topic) -> bool {
    topic.has_images() && topic.count != Some(0) && !topic.name.ends_with("/compressedDepth")
}

/// Whether `left` becomes `right` where one word of it is replaced.
fn differ(left: &str, right: &str, word: &str, other: &str) -> bool {
    let replaced = |(at, _)| [&left[..at], other, &left[at + word.len()..]].concat() == right;
    left.match_indices(word).any(replaced)
}

/// Why the messages of a topic are not taken.
fn wrong(topic: &Topic) -> Reason {
    let Topic { name, kind, .. } = topic;
    if [Image::NAME, CompressedImage::NAME].contains(&kind.as_str()) {
        return format!("{name} is neither in CDR nor in the bytes of ROS 1").into();
    }
    if topic.has_video() {
        return format!("{name} holds a film ({kind}) and not images; {DECODE}").into();
    }
    let kind = if kind.is_empty() { "messages of no type" } else { kind };
    format!("{name} holds {kind}, not sensor_msgs/msg/Image or CompressedImage; give the topic of images")
        .into()
}

/// Why there are no images at all.
fn none(topics: &[Topic]) -> Reason {
    if topics.is_empty() {
        return "holds no messages".into();
    }
    let shown: Vec<_> = topics.iter().map(|topic| format!("{} ({})", topic.name, topic.kind)).collect();
    if topics.iter().any(Topic::has_video) {
        return format!("has films and no images on its topics; {DECODE}; it has {}", listed(&shown)).into();
    }
    format!("has no images of sensor_msgs/msg/Image or CompressedImage; it has {}", listed(&shown)).into()
}

/// Names with commas, but not hundreds of them.
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
            // Words count more than numbers.
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
    fn what_is_not_certain_is_listed() {
        for (names, words) in [
            (
                "/left/image_raw /right/image_raw /left/image_rect /right/image_rect",
                "several pairs of images; give --topics one of /left/image_raw,/right/image_raw, /left/image_rect",
            ),
            ("/front /back", "LEFT,RIGHT out of /front, /back"),
            ("/front", "/front alone"),
            ("/left/camera_info", "no images & /left/camera_info (sensor_msgs/msg/CameraInfo)"),
            // Of three cameras, 0 and 1 are a pair, but not 1 and 2.
            ("/left/image /right/image/compressed", "LEFT,RIGHT out of"),
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
        assert!(said.contains("has films and no images") && said.contains("republish"), "{said}");
        let said = named(&films, "/left/video").unwrap_err().to_string();
        assert!(said.contains("/left/video holds a film (foxglove.CompressedVideo)"), "{said}");
        let topics = topics("/left/image /left/camera_info");
        assert_eq!(named(&topics, "left/image").unwrap().name, "/left/image");
        assert!(
            named(&topics, "/lift")
                .unwrap_err()
                .to_string()
                .contains("has no topic /lift; it has images on /left/image")
        );
        assert!(
            named(&topics, "/left/camera_info")
                .unwrap_err()
                .to_string()
                .contains("holds sensor_msgs/msg/CameraInfo")
        );
        assert_eq!(camera_info(&topics, &topics[0]).unwrap().name, "/left/camera_info");
    }
}
