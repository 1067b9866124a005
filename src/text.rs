//! Text from outside: small files, such as calibrations, config files and lists, and what messages quote of them.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::error::{Error, Result};

/// Reads a whole file of at most `max_bytes`; `what` says what it should be: "config file".
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

/// A text as a message may quote it: in one line, not longer than a glance, and nothing that moves a cursor.
#[must_use]
pub fn one_line(text: &str) -> String {
    const MAX_LENGTH: usize = 160;
    let words = text.split(|c: char| c.is_whitespace() || c.is_control()).filter(|word| !word.is_empty());
    let line = words.collect::<Vec<_>>().join(" ");
    match line.char_indices().nth(MAX_LENGTH) {
        Some((end, _)) => format!("{}...", &line[..end]),
        None => line,
    }
}

/// What a user gave, as a message may quote it: not longer than a glance, and without what a terminal would obey.
#[must_use]
pub fn quoted(text: &str) -> String {
    const MAX_LENGTH: usize = 60;
    let mut characters = text.escape_debug();
    let shown: String = characters.by_ref().take(MAX_LENGTH).collect();
    let more = if characters.next().is_some() { "..." } else { "" };
    format!("`{shown}{more}`")
}

/// How many letters of a word are to be put in, left out or replaced to make it another one, whatever their case.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_between_words_are_counted() {
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
