//! Images of a folder or a pattern, in the order of their numbers.

use std::cmp::Ordering;
use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use mrfgs::{Error, Result};

/// Extensions of images in a folder.
const EXTENSIONS: [&str; 11] =
    ["png", "jpg", "jpeg", "pgm", "ppm", "pnm", "tif", "tiff", "bmp", "pfm", "npy"];

/// The images of `path`, a folder or a pattern; `None` for anything else.
///
/// # Errors
/// If there is no image, or two have the same stem.
pub(crate) fn list(path: &Path) -> Result<Option<Vec<PathBuf>>> {
    let text = path.to_string_lossy();
    let (mut files, none) = if path.is_dir() {
        (in_folder(path)?, "contains no images")
    } else if text.contains(['*', '?', '[']) && !path.exists() {
        (of_pattern(path, &text)?, "no image matches")
    } else if text.contains('%') && !path.exists() {
        (of_numbers(path, &text)?, "no image matches")
    } else {
        return Ok(None);
    };
    if files.is_empty() {
        return Err(Error::read(path, none));
    }
    files.sort_by(|a, b| by_number(&a.to_string_lossy(), &b.to_string_lossy()));
    let mut stems = HashMap::new();
    for file in &files {
        if let Some(other) = stems.insert(stem(file).to_lowercase(), file) {
            let reason = format!(
                "has the same name as {} up to the extension, so their maps would collide; rename one",
                other.display()
            );
            return Err(Error::read(file, reason));
        }
    }
    Ok(Some(files))
}

fn in_folder(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).and_then(Iterator::collect::<std::io::Result<Vec<_>>>);
    let entries = entries.map_err(|e| Error::read(folder, e))?;
    let is_image = |path: &Path| {
        let hidden = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        !hidden && EXTENSIONS.contains(&extension.as_str()) && path.is_file()
    };
    Ok(entries.into_iter().map(|entry| entry.path()).filter(|path| is_image(path)).collect())
}

fn of_pattern(path: &Path, pattern: &str) -> Result<Vec<PathBuf>> {
    // `*` does not match hidden files, as in shells.
    let options = glob::MatchOptions {
        require_literal_separator: true,
        require_literal_leading_dot: true,
        ..glob::MatchOptions::new()
    };
    let found = glob::glob_with(pattern, options)
        .map_err(|e| Error::read(path, format!("is not a valid pattern: {e}")))?;
    let found = found.collect::<Result<Vec<_>, _>>();
    let found = found.map_err(|e| {
        let path = e.path().to_owned();
        Error::read(path, std::io::Error::from(e))
    })?;
    Ok(found.into_iter().filter(|file| file.is_file()).collect())
}

/// The images of a printf pattern such as frame_%04d.png, as in ffmpeg and OpenCV.
fn of_numbers(path: &Path, pattern: &str) -> Result<Vec<PathBuf>> {
    let no_pattern = || {
        let reason =
            "there is no such file; in patterns write numbers as %d or %04d, or anything as * ('left/*.png')";
        Error::read(path, reason)
    };
    let (before, rest) = pattern.split_once('%').ok_or_else(no_pattern)?;
    let (width, after) = rest.split_once('d').ok_or_else(no_pattern)?;
    let digits = match width.strip_prefix('0') {
        None if width.is_empty() => 1,
        Some(digits) => digits.parse::<usize>().ok().filter(|digits| *digits > 0).ok_or_else(no_pattern)?,
        None => return Err(no_pattern()),
    };
    if after.contains('%') {
        return Err(no_pattern());
    }
    let [start, end] = [before, after].map(glob::Pattern::escape);
    let mut found = of_pattern(path, &format!("{start}*{end}"))?;
    // A number with more digits than the width has no leading zeros, as in printf.
    let fits = |number: &str| {
        let few = digits == 1 || number.len() == digits;
        let is_number = !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit());
        is_number && (few || number.len() > digits && !number.starts_with('0'))
    };
    found.retain(|file| {
        let name = file.to_string_lossy();
        name.strip_prefix(before).and_then(|rest| rest.strip_suffix(after)).is_some_and(fits)
    });
    Ok(found)
}

/// The name of a file without its last extension.
pub(crate) fn stem(file: &Path) -> String {
    file.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// Orders texts by the numbers in them, so that 9 comes before 10.
fn by_number(a: &str, b: &str) -> Ordering {
    parts(a).cmp(parts(b)).then_with(|| a.cmp(b))
}

/// Splits a text into pairs of non-digits and a number: (non-digits, number of digits without leading zeros, these digits).
fn parts(text: &str) -> impl Iterator<Item = (&str, usize, &str)> {
    let mut rest = text;
    std::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let (words, tail) = rest.split_at(rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len()));
        let (digits, tail) = tail.split_at(tail.find(|c: char| !c.is_ascii_digit()).unwrap_or(tail.len()));
        rest = tail;
        let number = digits.trim_start_matches('0');
        Some((words, number.len(), number))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_count() {
        let mut names = ["f10.png", "f9.png", "f009.png", "e11b2.png", "f1.png", "e11b10.png"];
        names.sort_by(|a, b| by_number(a, b));
        assert_eq!(names, ["e11b2.png", "e11b10.png", "f1.png", "f009.png", "f9.png", "f10.png"]);
    }
}
