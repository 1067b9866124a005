//! Pairs without a calibration: rectified from their own matches, and rotated upright.

use super::files::{Png, exif_orientation};
use super::*;

/// A grey copy of a picture, stored as by a camera with this orientation.
fn stored(name: &str, orientation: u8, to: &Path) {
    let upright = image::open(scene(name)).unwrap().to_luma8();
    // The inverse of the reader's rotation.
    let turned = match orientation {
        3 => image::imageops::rotate180(&upright),
        6 => image::imageops::rotate270(&upright),
        8 => image::imageops::rotate90(&upright),
        _ => upright,
    };
    let rows: Vec<u8> = turned.rows().flat_map(|row| std::iter::once(0).chain(row.map(|p| p.0[0]))).collect();
    let exif = exif_orientation(orientation);
    let png = Png {
        size: turned.dimensions(),
        depth: 8,
        colour: 0,
        interlaced: false,
        chunks: &[(*b"eXIf", &exif)],
        rows: &rows,
    };
    fs::write(to, png.bytes()).unwrap();
}

#[test]
fn a_pair_is_rectified_by_its_matches() {
    let folder = Folder::new();
    let rectified = run(&folder, "rectify @raw/left.png @raw/right.png out --maps").succeeded();
    rectified.says(
        "rectified without a calibration, so there is no scale & matches agree & in 95 % & of the left",
    );
    let written: Vec<_> = listing(&folder.join("out")).into_keys().collect();
    assert_eq!(written.len(), 8, "two pictures, two masks, four maps: {written:?}");
    assert!(!folder.join("out/calib.txt").exists());

    // Rectifying within `match` gives the same bits.
    let end = "--device cpu";
    // Without the flag no range is found, and the error suggests it.
    run(&folder, &format!("match @raw/left.png @raw/right.png a.pfm {end}"))
        .failed(1, "no range & not rectified & --rectify & --calib FILE & --max-disparity");
    assert!(!folder.join("a.pfm").exists());
    // Nor where the views are of two scenes.
    for (view, name) in [("slanted/im0.png", "l.png"), ("repetitive/im1.png", "r.png")] {
        fs::copy(scene(view), folder.join(name)).unwrap();
    }
    run(&folder, &format!("match l.png r.png a.pfm {end}"))
        .failed(1, "too few matches & check that both show the same scene, or give --max-disparity");
    let said = run(
        &folder,
        &format!("match @raw/left.png @raw/right.png a.pfm --rectify {end} --json a.json --also preview"),
    );
    said.succeeded().says("rectified without a calibration");
    run(&folder, &format!("match out/im0.png out/im1.png b.pfm {end}")).succeeded();
    assert!(fs::read(folder.join("a.pfm")).unwrap() == fs::read(folder.join("b.pfm")).unwrap());
    let record = json(folder.join("a.json"));
    assert_eq!(record["rectified"], true);
    let trust = &record["trust"];
    assert!(trust["agreeing"].as_u64() <= trust["matches"].as_u64(), "{record}");
    assert!(
        trust["percentile95"].as_f64().unwrap() < 1.5 && trust["coverage"].as_f64().unwrap() > 0.5,
        "{trust}"
    );

    // The share seen in both views is nearly that of the calibration, and almost zero without a rectification.
    run(
        &folder,
        &format!(
            "match @raw/left.png @raw/right.png c.pfm --rectify --calib @raw/cameras.yml {end} --json c.json"
        ),
    )
    .succeeded();
    let measured = |record: &Value| record["measured"].as_f64().unwrap();
    let by_calibration = json(folder.join("c.json"));
    assert!(measured(&record) > measured(&by_calibration) - 25.0, "{record} {by_calibration}");
    assert!(by_calibration.get("trust").is_none());
    let end = format!("{end} --min-disparity -10 --max-disparity 50");
    let raw = run(&folder, &format!("match @raw/left.png @raw/right.png d.pfm {end} --json -")).succeeded();
    assert!(raw.json().get("trust").is_none() && raw.json()["rectified"] == false);
    assert!(measured(&raw.json()) < measured(&record) - 20.0, "{}", raw.json());

    run(&folder, "rectify @raw/left.png @raw/right.png quiet --quiet").succeeded();
    assert_eq!(run(&folder, "rectify @raw/left.png @raw/right.png again --quiet").stderr, "");
    assert!(listing(&folder.join("quiet")).len() == 4);
}

#[test]
fn photos_are_rotated_upright() {
    let folder = Folder::new();
    for (name, view) in [("left", "im0"), ("right", "im1")] {
        stored(&format!("slanted/{view}.png"), 1, &folder.join(format!("{name}.png")));
        stored(&format!("slanted/{view}.png"), 6, &folder.join(format!("{name}6.png")));
        stored(&format!("slanted/{view}.png"), 3, &folder.join(format!("{name}3.png")));
        stored(&format!("slanted/{view}.png"), 8, &folder.join(format!("{name}8.png")));
    }
    let end = "--max-disparity 31 --device cpu";
    let map = |pair: &str, flags: &str| {
        let run = run(&folder, &format!("match {pair} d.pfm {end} {flags}")).succeeded();
        (fs::read(folder.join("d.pfm")).unwrap(), run.stderr)
    };
    let (upright, said) = map("left.png right.png", "");
    assert!(!said.contains("orientation"), "{said}");
    for pair in
        ["left6.png right6.png", "left3.png right3.png", "left8.png right6.png", "left.png right3.png"]
    {
        let (turned, said) = map(pair, "--orient");
        assert!(turned == upright && !said.contains("orientation"), "{pair}: {said}");
    }
    // Without the flag a line suggests it.
    for (pair, which) in
        [("left3.png right3.png", "both images are"), ("left.png right3.png", "the right image is")]
    {
        let (as_stored, said) = map(pair, "");
        let lines = said.lines().filter(|line| line.contains("stored turned"));
        let [line] = lines.collect::<Vec<_>>()[..] else { panic!("{said}") };
        assert!(line.contains(which) && line.contains("--orient"), "{line}");
        assert!(as_stored != upright, "{pair}");
    }
    run(&folder, "match left.png right6.png d.pfm").failed(1, "240 x 180 & 180 x 240");

    // Without a calibration each image is rotated by its own tag, and the mask fits the upright image.
    image::GrayImage::from_fn(240, 180, |x, _| image::Luma([if x < 9 { 255 } else { 0 }]))
        .save(folder.join("mask.png"))
        .unwrap();
    let bits = |pair: &str, out: &str| {
        run(&folder, &format!("rectify {pair} {out} --mask mask.png")).succeeded();
        listing(&folder.join(out)).into_values().collect::<Vec<_>>()
    };
    let upright = bits("left.png right.png", "a");
    assert!(upright == bits("left6.png right8.png", "b"));
    assert!(upright == bits("left3.png right.png", "c"));
    let (map, said) = map("left8.png right3.png", "--rectify --min-disparity -9");
    assert!(said.contains("rectified without a calibration") && !said.contains("orientation"), "{said}");
    assert!(!map.is_empty());

    // A calibration applies to pixels as stored.
    let calibrated =
        |pair: &str, out: &str| run(&folder, &format!("rectify {pair} {out} --calib @raw/cameras.yml"));
    calibrated("left3.png right3.png", "d").succeeded();
    calibrated("left.png right.png", "e").succeeded();
    let first = |name: &str| fs::read(folder.join(name).join("im0.png")).unwrap();
    assert!(first("d") != first("e"));
    calibrated("left6.png right6.png", "f").failed(1, "180 x 240");
}
