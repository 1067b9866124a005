//! Small text files, such as calibrations, config files and lists, and quotations in messages.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::error::{Error, Result};

/// Reads a whole file of at most `max_bytes`; `what` is its kind, such as "config file".
///
/// # Errors
/// [`Error::Read`] when it cannot be read or is larger.
pub fn read(path: &Path, max_bytes: u64, what: &str) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let read = File::open(path).and_then(|file| file.take(max_bytes + 1).read_to_end(&mut bytes));
    read.map_err(|e| Error::opening(path, e))?;
    if bytes.len() as u64 > max_bytes {
        return Err(Error::read(path, format!("larger than any {what}; is it one?")));
    }
    Ok(bytes)
}

/// Text for quoting in a message: one line of limited length, without control characters.
#[must_use]
pub(crate) fn one_line(text: &str) -> String {
    const MAX_LENGTH: usize = 160;
    let words = text.split(|c: char| c.is_whitespace() || c.is_control()).filter(|word| !word.is_empty());
    let line = words.collect::<Vec<_>>().join(" ");
    match line.char_indices().nth(MAX_LENGTH) {
        Some((end, _)) => format!("{}...", &line[..end]),
        None => line,
    }
}

/// Input of a user for quoting in a message: of limited length, with control characters escaped.
#[must_use]
pub fn quoted(text: &str) -> String {
    const MAX_LENGTH: usize = 60;
    let mut characters = text.escape_debug();
    let shown: String = characters.by_ref().take(MAX_LENGTH).collect();
    let more = if characters.next().is_some() { "..." } else { "" };
    format!("`{shown}{more}`")
}

/// The edit distance between two words, ignoring case: letters to insert, delete or replace.
#[cfg(feature = "cameras")]
pub(crate) fn letters_apart(one: &str, other: &str) -> usize {
    let (one, other) = (one.to_lowercase(), other.to_lowercase());
    let mut row: Vec<usize> = (0..=other.chars().count()).collect();
    for (i, a) in one.chars().enumerate() {
        let mut before = std::mem::replace(&mut row[0], i + 1);
        for (j, b) in other.chars().enumerate() {
            let replaced = before + usize::from(a != b);
            before = row[j + 1];
            row[j + 1] = replaced.min(before + 1).min(row[j] + 1);
        }
    }
    row.last().copied().unwrap_or_default()
}

#[cfg(all(test, feature = "cameras"))]
mod tests {
    use super::*;

    #[test]
    fn edit_distances_are_counted() {
        for (one, other, letters) in [
            ("ndisp", "ndisp", 0),
            ("NDISP", "ndisp", 0),
            ("ndips", "ndisp", 2),
            ("doff", "doffs", 1),
            ("", "abc", 3),
            ("abc", "", 3),
        ] {
            assert_eq!(letters_apart(one, other), letters, "{one} {other}");
        }
    }
}
