//! Which images of a recording form pairs.

use std::str::FromStr;

#[derive(clap::Args, Clone)]
pub(crate) struct RecordingArgs {
    /// Topics of the left and right images of a recording, such as `/left/image_raw,/right/image_raw` [default: guessed from their names]
    #[arg(long, value_name = "LEFT,RIGHT")]
    pub(crate) topics: Option<Topics>,
    /// Maximum difference in time between the two images of a pair, in seconds [default: 0]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = nanoseconds)]
    pub(crate) tolerance: Option<u64>,
}

/// The names of the left and the right topic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Topics(pub(crate) [String; 2]);

impl FromStr for Topics {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let names: Vec<&str> = text.split(',').map(str::trim).collect();
        match names[..] {
            [left, right] if left != right && !left.is_empty() && !right.is_empty() => {
                Ok(Self([left, right].map(str::to_owned)))
            }
            _ => {
                Err("give the topics of the left and right images, such as /left/image_raw,/right/image_raw"
                    .into())
            }
        }
    }
}

/// Parses seconds, 0 to 3600, into nanoseconds.
pub(crate) fn nanoseconds(text: &str) -> Result<u64, String> {
    let seconds = text.parse().ok().filter(|seconds: &f64| (0.0..=3600.0).contains(seconds));
    let seconds = seconds.ok_or("give a number of seconds from 0 to 3600")?;
    Ok((seconds * 1e9).round() as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn topics_are_two_names() {
        assert_eq!("/a, /b".parse(), Ok(Topics(["/a".into(), "/b".into()])));
        for text in ["", "/a", "/a,", "/a,/a", "/a,/b,/c"] {
            assert!(text.parse::<Topics>().is_err(), "{text}");
        }
        assert_eq!(nanoseconds("0.002"), Ok(2_000_000));
        for text in ["", "-1", "NaN", "inf", "4000"] {
            assert!(nanoseconds(text).is_err(), "{text}");
        }
    }
}
