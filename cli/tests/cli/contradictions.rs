//! Self-contradictory calibrations: the error names both entries and the discrepancy.

use super::calibrations::{opencv, rectify, stored, turned, with_numbers};
use super::*;

/// The file to change, the change, and words of the error. A change is a text and its replacement, or for an entry `NAME * factor`, which
/// scales all its numbers, or `NAME turned degrees`, which turns a rotation about the y axis.
const CONTRADICTIONS: &[(&str, &str, &str)] = &[
    ("model", "fisheye: 0\ndistortion_model: equidistant", "distortion_model: contradicts fisheye"),
    ("model", "fisheye: 1\ncamera_model: brown_conrady", "camera_model: contradicts fisheye"),
    (
        "model",
        "distortion_model: plumb_bob\ncamera_model: fisheye",
        "camera_model: contradicts distortion_model & keep the one that is right",
    ),
    ("model", "distortion_model: equidistant", "D1: expected the 4 coefficients of a fisheye & 5 numbers"),
    ("model", "camera_model: fisheye", "D1: expected the 4 coefficients of a fisheye"),
    ("model", "camera_model: KANNALA_BRANDT", "D1: expected the 4 coefficients of a fisheye"),
    ("model", "distortion_model: scaramuzza", "distortion_model: expected a lens model & `scaramuzza`"),
    ("model", "camera_model: cylinder", "camera_model: expected a lens model & `cylinder`"),
    ("stored", "T * 1000", "P2: says a baseline of 0.1636 and T one of 163.6 & a factor of 1000 & one unit"),
    ("stored", "T * 1.05", "P2: says a baseline of 0.1636 and T one of 0.1718 & a factor of 1.050"),
    ("stored", "T * 0.1", "P2: says a baseline & a factor of 10.00"),
    ("stored", "Q * 1000", "Q: says a baseline of 0.0001636 and T one of 0.1636 & 1000"),
    ("stored", "Q * 0.5", "Q: says a baseline of 0.3272 and T one of 0.1636 & a factor of 2.000"),
    ("stored", "T * -1", "R1 and R2, that contradicts T by 180.00 degrees & leave out R1, R2, P1 and P2"),
    ("stored", "R turned 0.2", "that contradicts R by 0.20 degrees & leave out R1, R2, P1 and P2"),
    ("stored", "R turned -3", "that contradicts R by 3.00 degrees"),
    ("stored", "R1 turned 0.15", "that contradicts R by 0.15 degrees"),
    ("stored", "R2 turned 1", "degrees & or calibrate again"),
    (
        "calib.txt",
        "cam1=[216 0 118.5; 0 216 89.5; 0 0 1]",
        "line 5: cam1: its focal length contradicts that of cam0 by 0.23 % & rectify again",
    ),
    (
        "calib.txt",
        "cam1=[215.5 0 118.5; 0 215.5 91; 0 0 1]",
        "line 5: cam1: its row cy=91 contradicts cy=89.5 of cam0 by 1.50 px",
    ),
    (
        "calib.txt",
        "cam1=[215.5 0 120; 0 215.5 89.5; 0 0 1]",
        "line 5: cam1: cx1 - cx0 = 1.500 contradicts doffs=0 by 1.50 px",
    ),
];

#[test]
fn contradictory_calibrations_are_reported() {
    let folder = Folder::new();
    for (kind, change, words) in CONTRADICTIONS {
        let text = match *kind {
            "model" => format!("{}\n{change}\n", opencv()),
            "calib.txt" => {
                let text = "cam0=[215.5 0 118.5; 0 215.5 89.5; 0 0 1]\ndoffs=0\nbaseline=160\nwidth=240\n";
                format!("{text}{change}\n")
            }
            _ => match change.split(' ').collect::<Vec<_>>()[..] {
                [name, "*", factor] => {
                    let factor: f64 = factor.parse().unwrap();
                    with_numbers(&stored(), name, |numbers| numbers.iter().map(|v| v * factor).collect())
                }
                [name, _, degrees] => turned(&stored(), name, degrees.parse().unwrap()),
                _ => unreachable!("{change}"),
            },
        };
        fs::write(folder.join("a-file"), text).unwrap();
        let told = rectify(&folder, "a-file");
        told.failed(1, &format!("a-file & {words}"));
        assert_eq!(listing(&folder).len(), 1, "{change}: no output");
    }
    // Control: the unchanged file is consistent.
    fs::write(folder.join("a-file"), stored()).unwrap();
    rectify(&folder, "a-file").succeeded().says("240 x 180, 98.7 % of the left");
}
