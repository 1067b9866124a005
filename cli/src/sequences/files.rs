//! Images of a folder or of a pattern, in the order of their numbers, and those of two cameras that belong together.

use std::cmp::Ordering;
use std::collections::{HashMap, HashSet};
use std::fs;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use mrfgs::{Error, Result};

/// Which images of two cameras are a pair.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Pairing {
    /// Those with the same number in their names; each has a partner
    #[default]
    Number,
    /// Those with the same number; what has no partner is left out
    Common,
    /// The first with the first, whatever their numbers
    Order,
}

/// What an image in a folder may be called.
const EXTENSIONS: [&str; 9] = ["png", "jpg", "jpeg", "pgm", "ppm", "pnm", "tif", "tiff", "pfm"];

/// The images that `path`, a folder or a pattern, names; `None` where it names something else.
///
/// # Errors
/// Where there is no image, or two have one stem.
pub(super) fn list(path: &Path) -> Result<Option<Vec<PathBuf>>> {
    let text = path.to_string_lossy();
    let (mut files, none) = if path.is_dir() {
        (in_folder(path)?, "holds no images")
    } else if text.contains(['*', '?', '[']) && !path.exists() {
        (of_pattern(path, &text)?, "no image has such a name")
    } else if text.contains('%') && !path.exists() {
        return Err(Error::read(
            path,
            "there is no such file; where numbers differ, write * as in 'left/*.png'",
        ));
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
            let reason = format!("has the stem of {}, and maps are named after it", other.display());
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
    // As shells have it, * leaves hidden files out.
    let options = glob::MatchOptions {
        require_literal_separator: true,
        require_literal_leading_dot: true,
        ..glob::MatchOptions::new()
    };
    let found =
        glob::glob_with(pattern, options).map_err(|e| Error::read(path, format!("is no pattern: {e}")))?;
    let found = found.collect::<Result<Vec<_>, _>>();
    let found = found.map_err(|e| {
        let path = e.path().to_owned();
        Error::read(path, std::io::Error::from(e))
    })?;
    Ok(found.into_iter().filter(|file| file.is_file()).collect())
}

/// The name of a file without its last extension.
pub(super) fn stem(file: &Path) -> String {
    file.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// The images of two cameras, called by `names`, that are pairs, in the order of the left ones.
///
/// # Errors
/// Where an image has no partner and may not be left out, where all are left out, and where they are not as many of both.
pub(super) fn pair(
    cameras: [Vec<PathBuf>; 2],
    pairing: Pairing,
    names: &[String; 2],
) -> Result<[Vec<PathBuf>; 2]> {
    let [left, right] = cameras.each_ref().map(Vec::len);
    match numbers(&cameras).filter(|_| pairing != Pairing::Order) {
        Some(numbers) => partners(cameras, &numbers, pairing, names),
        None if left == right => Ok(cameras),
        None => Err(Error::Mismatch(format!(
            "{} holds {left} images and {} {right}: give as many of the left as of the right camera",
            names[0], names[1]
        ))),
    }
}

/// The images of both cameras that have the same numbers.
fn partners(
    cameras: [Vec<PathBuf>; 2],
    numbers: &[Vec<Numbers>; 2],
    pairing: Pairing,
    names: &[String; 2],
) -> Result<[Vec<PathBuf>; 2]> {
    let known = numbers.each_ref().map(|numbers| numbers.iter().collect::<HashSet<_>>());
    let has_partner = |camera: usize, i: usize| known[1 - camera].contains(&numbers[camera][i]);
    let all = || [0, 1].into_iter().flat_map(|camera| (0..cameras[camera].len()).map(move |i| (camera, i)));
    let mut alone = all().filter(|&(camera, i)| !has_partner(camera, i));
    let any_pair = all().any(|(camera, i)| has_partner(camera, i));
    if (pairing == Pairing::Number || !any_pair)
        && let Some((camera, i)) = alone.next()
    {
        let more = match alone.count() {
            0 => String::new(),
            1 => " (nor has one other)".into(),
            more => format!(" (nor have {more} others)"),
        };
        let common = if any_pair { "leave out such images by --pairing common, or " } else { "" };
        return Err(Error::Mismatch(format!(
            "{} has no partner of its number in {}{more}: {common}take the first with the first by --pairing order",
            cameras[camera][i].display(),
            names[1 - camera]
        )));
    }
    let [left, right] = cameras;
    let mut right: HashMap<_, _> = numbers[1].iter().zip(right).collect();
    let pairs = numbers[0].iter().zip(left).filter_map(|(number, file)| Some((file, right.remove(number)?)));
    Ok(pairs.unzip::<_, _, Vec<_>, Vec<_>>().into())
}

/// Numbers in a name, without leading zeros.
type Numbers = Vec<String>;

/// The numbers by which the names of each camera's images differ. `None` where numbers alone do not tell them apart.
fn numbers(cameras: &[Vec<PathBuf>; 2]) -> Option<[Vec<Numbers>; 2]> {
    let mut all =
        cameras.each_ref().map(|files| files.iter().map(|file| in_name(&stem(file))).collect::<Vec<_>>());
    let mut differing = all.each_ref().map(|names| differing(names));
    // What differs for one camera counts for both: the other one may have a single image.
    if let [Some(left), Some(right)] = &mut differing
        && left.len() == right.len()
    {
        for (left, right) in left.iter_mut().zip(right) {
            *left |= *right;
            *right = *left;
        }
    }
    for (names, differing) in all.iter_mut().zip(&differing) {
        for numbers in names.iter_mut() {
            let mut differs = differing.iter().flatten();
            numbers.retain(|_| *differs.next().unwrap_or(&true));
        }
        if names.iter().collect::<HashSet<_>>().len() < names.len() {
            return None;
        }
    }
    Some(all)
}

/// The numbers in `name`.
fn in_name(name: &str) -> Numbers {
    let digits = name.split(|c: char| !c.is_ascii_digit()).filter(|digits| !digits.is_empty());
    digits.map(|digits| digits.trim_start_matches('0').to_owned()).collect()
}

/// Which numbers of the names differ; `None` where not all have as many.
fn differing(names: &[Numbers]) -> Option<Vec<bool>> {
    let first = names.first()?;
    let as_many = names.iter().all(|numbers| numbers.len() == first.len());
    as_many.then(|| (0..first.len()).map(|i| names.iter().any(|numbers| numbers[i] != first[i])).collect())
}

/// The order of texts in which 9 comes before 10.
fn by_number(a: &str, b: &str) -> Ordering {
    parts(a).cmp(parts(b)).then_with(|| a.cmp(b))
}

/// What is no number, and the number that follows: how many digits it has without leading zeros, and these.
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

    /// What is paired of names without their extensions: pairs, or the error.
    fn paired(left: &str, right: &str, pairing: Pairing) -> Result<String, String> {
        let files = |names: &str| names.split(' ').map(|name| format!("{name}.png").into()).collect();
        let names = ["l".into(), "r".into()];
        let [left, right] = pair([files(left), files(right)], pairing, &names).map_err(|e| e.to_string())?;
        let pairs = left.iter().zip(&right).map(|(l, r)| format!("{}={}", stem(l), stem(r)));
        Ok(pairs.collect::<Vec<_>>().join(" "))
    }

    #[test]
    fn partners_have_the_same_number() {
        for (left, right, pairs) in [
            ("0 1 3", "0 1 3", "0=0 1=1 3=3"),
            // What differs between the cameras alone does not count, nor do zeros in front.
            ("cam0_08 cam0_9", "cam1_8 cam1_09", "cam0_08=cam1_8 cam0_9=cam1_09"),
            ("cam_8_L cam_9_L", "2_cam_1_8_R 2_cam_1_9_R", "cam_8_L=2_cam_1_8_R cam_9_L=2_cam_1_9_R"),
            (
                "000001_10 000001_11 000002_10",
                "000001_10 000001_11 000002_10",
                "000001_10=000001_10 000001_11=000001_11 000002_10=000002_10",
            ),
            ("0001", "7", "0001=7"),
            // Whatever order the names have.
            ("1_a 2_b", "b_1 a_2", "1_a=b_1 2_b=a_2"),
            // Numbers do not tell these apart.
            ("a b", "c d", "a=c b=d"),
            ("1a 1b", "3 4", "1a=3 1b=4"),
        ] {
            assert_eq!(paired(left, right, Pairing::Number).as_deref(), Ok(pairs));
        }
    }

    #[test]
    fn what_has_no_partner_is_named_or_left_out() {
        let (left, right) = ("0 1 3 5 7", "0 1 2 3 4");
        let said = paired(left, right, Pairing::Number).unwrap_err();
        assert!(said.starts_with("5.png has no partner of its number in r (nor have 3 others)"), "{said}");
        assert!(said.contains("--pairing common") && said.contains("--pairing order"), "{said}");
        assert_eq!(paired(left, right, Pairing::Common).unwrap(), "0=0 1=1 3=3");
        assert_eq!(paired(left, right, Pairing::Order).unwrap(), "0=0 1=1 3=2 5=3 7=4");
        let said = paired("1 2", "1 2 x3", Pairing::Number).unwrap_err();
        assert!(said.starts_with("x3.png has no partner of its number in l:"), "{said}");
        // A camera with a single image is no exception.
        assert_eq!(paired("4 5 6", "5", Pairing::Common).unwrap(), "5=5");
        // Clocks of their own: nothing is common.
        for pairing in [Pairing::Number, Pairing::Common] {
            let said = paired("1403 1453", "1404 1454", pairing).unwrap_err();
            assert!(said.contains("--pairing order") && !said.contains("common"), "{said}");
        }
        assert!(paired("1 2", "1", Pairing::Order).unwrap_err().contains("l holds 2 images and r 1"));
    }
}
