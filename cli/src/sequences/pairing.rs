//! Pairs images of two cameras by the numbers in their names.

use std::collections::{HashMap, HashSet};
use std::path::PathBuf;

use clap::ValueEnum;
use mrfgs::{Error, Result};

use super::files::stem;

/// How images of two cameras are paired.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Pairing {
    /// By the number in their names; every image needs a partner
    #[default]
    Number,
    /// By the number in their names; images without a partner are skipped
    Common,
    /// By order: the first with the first, whatever their numbers
    Order,
}

/// Pairs the images of two cameras, called `names` in errors, in the order of the left ones.
///
/// # Errors
/// If an image without a partner may not be skipped, if all would be skipped, or if the counts differ in [`Pairing::Order`].
pub(crate) fn pair(
    cameras: [Vec<PathBuf>; 2],
    pairing: Pairing,
    names: &[String; 2],
) -> Result<[Vec<PathBuf>; 2]> {
    let [left, right] = cameras.each_ref().map(Vec::len);
    match numbers(&cameras).filter(|_| pairing != Pairing::Order) {
        Some(numbers) => partners(cameras, &numbers, pairing, names),
        None if left == right => Ok(cameras),
        None => Err(Error::Mismatch(format!(
            "{} has {left} images but {} has {right}: give the same number for both cameras",
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
            1 => " (nor does one other)".into(),
            more => format!(" (nor do {more} others)"),
        };
        let common = if any_pair { "skip such images with --pairing common, or " } else { "" };
        return Err(Error::Mismatch(format!(
            "{} does not have a partner with its number in {}{more}: {common}pair images in order with --pairing order",
            cameras[camera][i].display(),
            names[1 - camera]
        )));
    }
    let [left, right] = cameras;
    let mut right: HashMap<_, _> = numbers[1].iter().zip(right).collect();
    let pairs = numbers[0].iter().zip(left).filter_map(|(number, file)| Some((file, right.remove(number)?)));
    Ok(pairs.unzip::<_, _, Vec<_>, Vec<_>>().into())
}

/// The numbers in a name, without leading zeros.
pub(crate) type Numbers = Vec<String>;

/// For each camera, the numbers in which its names differ; `None` if numbers alone do not identify its images.
fn numbers(cameras: &[Vec<PathBuf>; 2]) -> Option<[Vec<Numbers>; 2]> {
    let mut all =
        cameras.each_ref().map(|files| files.iter().map(|file| in_name(&stem(file))).collect::<Vec<_>>());
    let mut differing = all.each_ref().map(|names| differing(names));
    // A number that varies for one camera counts for both, since the other may have a single image.
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
pub(crate) fn in_name(name: &str) -> Numbers {
    let digits = name.split(|c: char| !c.is_ascii_digit()).filter(|digits| !digits.is_empty());
    digits.map(|digits| digits.trim_start_matches('0').to_owned()).collect()
}

/// Which numbers of the names differ; `None` if the names have different counts of numbers.
fn differing(names: &[Numbers]) -> Option<Vec<bool>> {
    let first = names.first()?;
    let as_many = names.iter().all(|numbers| numbers.len() == first.len());
    as_many.then(|| (0..first.len()).map(|i| names.iter().any(|numbers| numbers[i] != first[i])).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The pairs, or the error, for names without extensions.
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
            // Differences between the cameras and leading zeros do not count.
            ("cam0_08 cam0_9", "cam1_8 cam1_09", "cam0_08=cam1_8 cam0_9=cam1_09"),
            ("cam_8_L cam_9_L", "2_cam_1_8_R 2_cam_1_9_R", "cam_8_L=2_cam_1_8_R cam_9_L=2_cam_1_9_R"),
            (
                "000001_10 000001_11 000002_10",
                "000001_10 000001_11 000002_10",
                "000001_10=000001_10 000001_11=000001_11 000002_10=000002_10",
            ),
            ("0001", "7", "0001=7"),
            // Names sort in different orders.
            ("1_a 2_b", "b_1 a_2", "1_a=b_1 2_b=a_2"),
            // Numbers do not identify these.
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
        assert!(
            said.starts_with("5.png does not have a partner with its number in r (nor do 3 others)"),
            "{said}"
        );
        assert!(said.contains("--pairing common") && said.contains("--pairing order"), "{said}");
        assert_eq!(paired(left, right, Pairing::Common).unwrap(), "0=0 1=1 3=3");
        assert_eq!(paired(left, right, Pairing::Order).unwrap(), "0=0 1=1 3=2 5=3 7=4");
        let said = paired("1 2", "1 2 x3", Pairing::Number).unwrap_err();
        assert!(said.starts_with("x3.png does not have a partner with its number in l:"), "{said}");
        // A camera with a single image follows the same rule.
        assert_eq!(paired("4 5 6", "5", Pairing::Common).unwrap(), "5=5");
        // The cameras have separate clocks, so no number is common.
        for pairing in [Pairing::Number, Pairing::Common] {
            let said = paired("1403 1453", "1404 1454", pairing).unwrap_err();
            assert!(said.contains("--pairing order") && !said.contains("common"), "{said}");
        }
        assert!(paired("1 2", "1", Pairing::Order).unwrap_err().contains("l has 2 images but r has 1"));
    }
}
