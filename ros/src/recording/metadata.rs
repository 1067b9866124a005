//! The `metadata.yaml` of a ROS 2 bag. `rosbag2` writes one entry per line, and only four matter, so no YAML parser is needed.

use std::fs;
use std::io::Read;
use std::path::Path;

/// More than any bag's metadata needs.
const MOST_BYTES: u64 = 1 << 26;

/// The metadata of a bag. Missing entries stay empty.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Metadata {
    /// The names of its files, in order.
    pub(super) files: Vec<String>,
    /// The number of messages.
    pub(super) count: Option<u64>,
    /// The codec of compressed messages or files; empty if uncompressed.
    pub(super) packed: String,
}

impl Metadata {
    /// Reads the `metadata.yaml` at `path`.
    pub(super) fn read(path: &Path) -> Self {
        let mut bytes = Vec::new();
        // It is optional.
        let _ = fs::File::open(path).and_then(|file| file.take(MOST_BYTES).read_to_end(&mut bytes));
        Self::of(&String::from_utf8_lossy(&bytes))
    }

    fn of(text: &str) -> Self {
        let (mut found, mut in_files, mut at_top) = (Self::default(), false, None);
        for line in text.lines() {
            let indent = line.len() - line.trim_start().len();
            let line = line.trim();
            if let Some(name) = line.strip_prefix("- ").filter(|_| in_files) {
                found.files.push(name_of(name));
                continue;
            }
            let Some((key, value)) = line.split_once(':') else { continue };
            // Topics have counts too, indented further.
            let top = *at_top.get_or_insert_with(|| indent.max(1));
            in_files = key == "relative_file_paths";
            match key {
                "rosbag2_bagfile_information" => at_top = None,
                _ if indent != top => {}
                "relative_file_paths" => {
                    let list = value.trim().trim_start_matches('[').trim_end_matches(']');
                    found.files = list.split(',').map(name_of).filter(|name| !name.is_empty()).collect();
                }
                "message_count" => found.count = value.trim().parse().ok(),
                "compression_format" => unquoted(value).clone_into(&mut found.packed),
                _ => {}
            }
        }
        found
    }
}

fn unquoted(text: &str) -> &str {
    text.trim().trim_matches(['"', '\''])
}

/// The name of a file; old releases include the folder.
fn name_of(path: &str) -> String {
    unquoted(path).rsplit('/').next().unwrap_or_default().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_rosbag2_writes_is_read() {
        let by_rosbag2 = "rosbag2_bagfile_information:\n  version: 4\n  storage_identifier: sqlite3\n  relative_file_paths:\n    - drive/a_0.db3\n    - \
                          'a_1.db3'\n  duration:\n    nanoseconds: 1\n  message_count: 30\n  topics_with_message_count:\n    - topic_metadata:\n        name: /a\n      \
                          message_count: 12\n  compression_format: zstd\n  compression_mode: FILE\n";
        let sorted = "rosbag2_bagfile_information:\n  compression_format: ''\n  files:\n  - duration:\n      nanoseconds: 0\n    message_count: 7\n    path: \
                      b_0.mcap\n  message_count: 7\n  relative_file_paths:\n  - b_0.mcap\n  topics_with_message_count:\n  - message_count: 4\n    topic_metadata:\n      \
                      name: /a\n";
        let short = "rosbag2_bagfile_information:\n  relative_file_paths: [c_0.db3, \"c_1.db3\"]\n";
        let wanted = |files: &[&str], count, packed: &str| Metadata {
            files: files.iter().map(|file| (*file).to_owned()).collect(),
            count,
            packed: packed.into(),
        };
        assert_eq!(Metadata::of(by_rosbag2), wanted(&["a_0.db3", "a_1.db3"], Some(30), "zstd"));
        assert_eq!(Metadata::of(sorted), wanted(&["b_0.mcap"], Some(7), ""));
        assert_eq!(Metadata::of(short), wanted(&["c_0.db3", "c_1.db3"], None, ""));
        for text in ["", "a text", "message_count", "- \n:\n", "relative_file_paths: []"] {
            assert_eq!(Metadata::of(text), Metadata::default(), "{text}");
        }
    }
}
