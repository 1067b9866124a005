//! The kind of an output, by its name.

use std::path::Path;

use crate::ffmpeg;
use crate::outputs::is_printed;

/// The prefix of a viewer's address.
const WEB_SOCKET: &str = "ws://";

/// The kind of an output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Folder,
    Film,
    Recording,
    Viewer,
}

impl Kind {
    pub(super) fn of(output: &Path) -> Self {
        let ends =
            |with: &str| output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(with));
        if address(output).is_some() {
            Self::Viewer
        } else if is_printed(output) || ends("y4m") || ffmpeg::writes(output) && !output.is_dir() {
            Self::Film
        } else if ends("mcap") && !output.is_dir() {
            Self::Recording
        } else {
            Self::Folder
        }
    }

    /// Whether it receives ROS messages.
    pub(super) fn takes_messages(self) -> bool {
        matches!(self, Self::Recording | Self::Viewer)
    }

    /// Its name for messages.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Folder => "a folder",
            Self::Film => "a film",
            Self::Recording => "a recording",
            Self::Viewer => "a viewer",
        }
    }
}

/// The address (host and port) of a viewer's output.
pub(super) fn address(output: &Path) -> Option<&str> {
    output.to_str()?.strip_prefix(WEB_SOCKET).map(|address| address.trim_end_matches('/'))
}
