//! Writes the calibration of a rectified pair for OpenCV and in Middlebury's form.

use std::fmt::Write;

use super::matrix::{IDENTITY, Matrix};
use crate::image::calib::{Calibration, Camera, Unit};

/// `calib.txt` in millimetres; if the unit is unknown, it says so. `None` if a camera is missing.
#[must_use]
pub fn middlebury(calibration: &Calibration) -> Option<String> {
    let (cameras, baseline) = calibration.cameras()?;
    let mut text = String::new();
    for (i, Camera { focal_length: [fx, fy], principal_point: [cx, cy] }) in cameras.iter().enumerate() {
        let _ = writeln!(text, "cam{i}=[{fx} 0 {cx}; 0 {fy} {cy}; 0 0 1]");
    }
    let _ = writeln!(text, "doffs={}", calibration.doffs?);
    let _ = writeln!(text, "baseline={}", baseline * calibration.unit.millimetres().unwrap_or(1.0));
    if calibration.unit == Unit::Unknown {
        let _ = writeln!(text, "unit={}", calibration.unit.name());
    }
    for (key, value) in
        [("width", calibration.width), ("height", calibration.height), ("ndisp", calibration.ndisp)]
    {
        if let Some(value) = value {
            let _ = writeln!(text, "{key}={value}");
        }
    }
    Some(text)
}

/// OpenCV's YAML: the cameras of the rectified images, which have no distortion and one orientation, and
/// their rectification, which is the identity. `rotations`, from each real camera to its rectified view, have
/// no OpenCV name and are called `fromRaw`. `None` if a camera is missing.
#[must_use]
pub fn opencv(calibration: &Calibration, rotations: &[Matrix; 2]) -> Option<String> {
    let (cameras, baseline) = calibration.cameras()?;
    let mut text = String::from("%YAML:1.0\n---\n");
    if let (Some(width), Some(height)) = (calibration.width, calibration.height) {
        let _ = writeln!(text, "imageSize: [ {width}, {height} ]");
    }
    let _ = writeln!(text, "unit: {}", calibration.unit.name());
    let mut put = |name: &str, rows: &[&[f64]]| matrix(&mut text, name, rows);
    let tx = [0.0, -baseline];
    for (i, Camera { focal_length: [fx, fy], principal_point: [cx, cy] }) in cameras.into_iter().enumerate() {
        let n = i + 1;
        put(&format!("K{n}"), &[&[fx, 0.0, cx], &[0.0, fy, cy], &[0.0, 0.0, 1.0]]);
        put(&format!("D{n}"), &[&[0.0; 5]]);
        put(&format!("R{n}"), &IDENTITY.each_ref().map(<[f64; 3]>::as_slice));
        put(&format!("P{n}"), &[&[fx, 0.0, cx, tx[i] * fx], &[0.0, fy, cy, 0.0], &[0.0, 0.0, 1.0, 0.0]]);
        put(&format!("fromRaw{n}"), &rotations[i].each_ref().map(<[f64; 3]>::as_slice));
    }
    put("R", &IDENTITY.each_ref().map(<[f64; 3]>::as_slice));
    put("T", &[&[-baseline], &[0.0], &[0.0]]);
    let [[cx, cy], [other, _]] = cameras.map(|camera| camera.principal_point);
    put(
        "Q",
        &[
            &[1.0, 0.0, 0.0, -cx],
            &[0.0, 1.0, 0.0, -cy],
            &[0.0, 0.0, 0.0, cameras[0].focal_length[0]],
            &[0.0, 0.0, 1.0 / baseline, (other - cx) / baseline],
        ],
    );
    Some(text)
}

fn matrix(text: &mut String, name: &str, rows: &[&[f64]]) {
    let (height, width) = (rows.len(), rows[0].len());
    let _ = writeln!(text, "{name}: !!opencv-matrix\n   rows: {height}\n   cols: {width}\n   dt: d");
    // As few digits as identify the number; `{:?}` has a point or an exponent, as OpenCV expects.
    let rows = rows.iter().map(|row| row.iter().map(|v| format!("{v:?}")).collect::<Vec<_>>().join(", "));
    let _ = writeln!(text, "   data: [ {} ]", rows.collect::<Vec<_>>().join(",\n       "));
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::calibration::of_texts;

    #[test]
    fn written_calibrations_are_read_back() {
        for unit in [Unit::Metre, Unit::Millimetre, Unit::Unknown] {
            let calibration = Calibration {
                camera: Some(Camera { focal_length: [501.25, 501.25], principal_point: [319.5, 1.0 / 3.0] }),
                doffs: Some(0.125),
                baseline: Some(0.12),
                width: Some(640),
                height: Some(480),
                unit,
                ..Calibration::default()
            };
            let read = |text: String| {
                let read = of_texts(&[(Path::new("cameras"), text)]).unwrap();
                read.of_rectified_images(None).unwrap().unwrap()
            };
            assert_eq!(read(opencv(&calibration, &[IDENTITY; 2]).unwrap()), calibration);
            let again = read(middlebury(&calibration).unwrap());
            let factor = unit.millimetres().unwrap_or(1.0);
            let unit = if unit == Unit::Unknown { unit } else { Unit::Millimetre };
            assert_eq!(again, Calibration { baseline: Some(0.12 * factor), unit, ..calibration });
        }
        assert_eq!(middlebury(&Calibration::default()), None);
    }
}
