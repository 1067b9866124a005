//! `mrfgs sequence` with a rig whose right camera has turned since its calibration.

use mrfgs::calibration::matrix::rotation;

use super::*;

/// How far the right camera looks up, right and clockwise relative to `wrong.yml`, in degrees.
const TURNED: [f64; 3] = [0.4, 0.0, -0.5];

/// Frames of a static scene, and calibrations of the rig: the true one, and one from before the turn.
fn rig() -> Folder {
    let folder = Folder::new();
    for (view, name) in [("left", "im0.png"), ("right", "im1.png")] {
        fs::create_dir(folder.join(view)).unwrap();
        for step in 0..4 {
            let frame = folder.join(view).join(format!("{step}.png"));
            fs::copy(scene(&format!("slanted/{name}")), frame).unwrap();
        }
    }
    for (name, degrees) in [("right.yml", [0.0; 3]), ("wrong.yml", TURNED)] {
        let matrix = |name: &str, columns: usize, values: &[f64]| {
            let rows = values.len() / columns;
            format!(
                "{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: {values:?}\n"
            )
        };
        let mut text = "%YAML:1.0\n---\nimageSize: [ 240, 180 ]\nunit: m\n".to_owned();
        for camera in ["1", "2"] {
            let values = [180.0, 0.0, 119.5, 0.0, 180.0, 89.5, 0.0, 0.0, 1.0];
            text += &matrix(&format!("K{camera}"), 3, &values);
            text += &matrix(&format!("D{camera}"), 5, &[0.0; 5]);
        }
        // Points turn opposite to the camera, and this is the earlier pose.
        let before = rotation(degrees.map(f64::to_radians));
        text += &matrix("R", 3, before.as_flattened());
        text += &matrix("T", 1, &before.map(|row| -0.16 * row[0]));
        fs::write(folder.join(name), text).unwrap();
    }
    folder
}

/// The last line of the records.
fn last(folder: &Folder, file: &str) -> Value {
    let text = fs::read_to_string(folder.join(file)).unwrap();
    serde_json::from_str(text.lines().last().unwrap()).unwrap()
}

#[test]
fn a_turned_camera_is_reported_and_corrected() {
    let folder = rig();
    let line = "sequence left right maps --rectify --max-disparity 31 --method fast --device cpu";
    let said = "the right camera has turned since the calibration, in degrees: 0.4";
    run(&folder, &format!("{line} --calib wrong.yml --json wrong.json")).succeeded().says(said);
    let corrected =
        run(&folder, &format!("{line} --calib wrong.yml --json corrected.json --recalibrate")).succeeded();
    corrected.says(said);
    corrected.says("frames are corrected for this");
    let right =
        run(&folder, &format!("{line} --calib right.yml --json right.json --recalibrate")).succeeded();
    assert!(!right.stderr.contains("has turned"), "control: {}", right.stderr);

    for (file, expected) in [("wrong.json", TURNED), ("corrected.json", TURNED), ("right.json", [0.0; 3])] {
        let record = last(&folder, file);
        for (i, expected) in expected.into_iter().enumerate() {
            let found = record["turned"][i].as_f64().unwrap();
            // Matches in such small images do not determine a turn to the side.
            let most = if i == 1 { 0.2 } else { 0.05 };
            assert!((found - expected).abs() < most, "{file}: {}", record["turned"]);
        }
    }
    let measured = |file| last(&folder, file)["measured"].as_f64().unwrap();
    // Corrected frames lose some of the border.
    let [wrong, corrected, right] = ["wrong.json", "corrected.json", "right.json"].map(measured);
    assert!(corrected > wrong + 1.0 && right > corrected, "{wrong}, {corrected}, {right}");
}

#[test]
fn it_needs_the_cameras() {
    let folder = rig();
    let line = "sequence left right maps --max-disparity 31 --method fast --device cpu --recalibrate";
    run(&folder, line).failed(2, "--recalibrate: needs camera values; add --calib");
    assert!(!folder.join("maps").exists());
    // With --focal the frames count as rectified, which they are.
    let told = run(&folder, &format!("{line} --focal 180 --baseline 0.16m --json -")).succeeded();
    told.prints("\"turned\":[");
}
