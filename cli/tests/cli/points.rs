//! Point clouds: contents, positions, and agreement of all formats.

use mrfgs::maps::flag;

use super::outputs::{BASELINE, FOCAL_LENGTH, MIDDLE, matched, median};
use super::*;

/// A point of a cloud: position, colour, confidence.
pub(super) type Point = ([f64; 3], [u8; 3], u8);

/// An integer level stored as float.
fn whole(value: f32) -> u8 {
    assert!((0.0..=255.0).contains(&value) && value.fract() == 0.0, "{value}");
    value as u8
}

/// Reads a PLY cloud as its header describes it.
pub(super) fn cloud(path: &Path) -> Vec<Point> {
    let bytes = fs::read(path).unwrap();
    let end = b"end_header\n";
    let start = bytes.windows(end.len()).position(|window| window == end).unwrap() + end.len();
    let header = std::str::from_utf8(&bytes[..start]).unwrap();
    assert!(header.starts_with("ply\nformat binary_little_endian 1.0\n"), "{header}");
    assert_eq!(header.matches("\nelement ").count(), 1, "{header}");
    let count: usize =
        header.lines().find_map(|line| line.strip_prefix("element vertex ")).unwrap().parse().unwrap();
    let (mut offset, mut places) = (0, BTreeMap::new());
    for property in header.lines().filter_map(|line| line.strip_prefix("property ")) {
        let (kind, name) = property.split_once(' ').unwrap();
        places.insert(name, offset);
        offset += match kind {
            "float" => 4,
            "uchar" => 1,
            kind => panic!("{kind}"),
        };
    }
    assert_eq!(bytes.len(), start + count * offset, "{header}");
    let points = bytes[start..].chunks_exact(offset);
    let points = points.map(|point| {
        let float = |name| f32::from_le_bytes(point[places[name]..][..4].try_into().unwrap());
        (
            ["x", "y", "z"].map(|name| f64::from(float(name))),
            ["red", "green", "blue"].map(|name| point[places[name]]),
            whole(float("quality")),
        )
    });
    points.collect()
}

#[test]
fn points_are_what_is_measured_and_trusted() {
    let folder = Folder::new();
    let at = |name: &str| folder.join(name);
    let said = matched(&folder, "slanted", "d.pfm --also depth,points,confidence,validity");
    let points = cloud(&at("d.points.ply"));
    assert!(said.contains(&format!("; {} points; unit: ", points.len())), "{said}");
    let (depths, confidence) = (read_pfm(at("d.depth.pfm")), read::grey8(&at("d.confidence.png")).unwrap());
    let validity = read::grey8(&at("d.validity.png")).unwrap();
    let is_trusted = |v: u8| v == 0;
    let trusted = validity.data().iter().filter(|v| is_trusted(**v)).count();
    assert_eq!(points.len(), trusted);
    assert!(trusted > 20_000 && trusted < 240 * 180 - 1000, "some are dropped: {trusted}");
    assert!(validity.data().iter().any(|v| v & flag::LOW_CONFIDENCE != 0));

    // Each point lies on the ray of its pixel, in the order of the pixels.
    let image = image::open(scene("slanted/im0.png")).unwrap().into_rgb8();
    let pixels = (0..180).flat_map(|y| (0..240).map(move |x| (x, y)));
    for ((x, y), (position, colour, sure)) in pixels.filter(|&at| is_trusted(validity[at])).zip(&points) {
        let z = f64::from(depths[(x, y)]);
        let ray = [(x as f64 - MIDDLE[0]) / FOCAL_LENGTH, (y as f64 - MIDDLE[1]) / FOCAL_LENGTH, 1.0];
        for (found, along) in position.iter().zip(ray) {
            assert!((found - along * z).abs() < 1e-5, "{x}, {y}: {position:?}");
        }
        assert_eq!(*colour, image.get_pixel(x as u32, y as u32).0, "{x}, {y}");
        assert_eq!(*sure, confidence[(x, y)]);
    }
}

/// Reads a PCD cloud as its header describes it.
fn pcd(path: &Path) -> Vec<Point> {
    let bytes = fs::read(path).unwrap();
    let end = b"\nDATA binary\n";
    let start = bytes.windows(end.len()).position(|window| window == end).unwrap() + end.len();
    let header = std::str::from_utf8(&bytes[..start]).unwrap();
    let entry = |key: &str| -> Vec<&str> {
        header.lines().find_map(|line| line.strip_prefix(key)).unwrap().split_whitespace().collect()
    };
    let [fields, sizes, kinds] = ["FIELDS ", "SIZE ", "TYPE "].map(entry);
    assert!(sizes.iter().all(|size| *size == "4") && kinds.iter().all(|kind| *kind == "F"), "{header}");
    let count: usize = entry("POINTS ")[0].parse().unwrap();
    assert_eq!(bytes.len(), start + count * 4 * fields.len(), "{header}");
    let points = bytes[start..].chunks_exact(4 * fields.len()).map(|point| {
        let place = |name: &str| 4 * fields.iter().position(|field| *field == name).unwrap();
        let bits = |name| u32::from_le_bytes(point[place(name)..][..4].try_into().unwrap());
        let float = |name| f32::from_bits(bits(name));
        let [_, red, green, blue] = bits("rgb").to_be_bytes();
        (["x", "y", "z"].map(|name| f64::from(float(name))), [red, green, blue], whole(float("intensity")))
    });
    points.collect()
}

/// Reads uncompressed LAS by the offsets of the standard; returns the coordinate step and the points.
fn las(path: &Path) -> (f64, Vec<Point>) {
    let bytes = fs::read(path).unwrap();
    let u16_at = |at: usize| u16::from_le_bytes(bytes[at..][..2].try_into().unwrap());
    let u32_at = |at: usize| u32::from_le_bytes(bytes[at..][..4].try_into().unwrap()) as usize;
    let f64_at = |at: usize| f64::from_le_bytes(bytes[at..][..8].try_into().unwrap());
    assert_eq!((&bytes[..4], &bytes[24..26]), (&b"LASF"[..], &[1, 2][..]), "LAS 1.2");
    assert_eq!((bytes[104], u16_at(105), u16_at(90), u16_at(92)), (2, 26, 0, 0), "point format, and no date");
    let (start, count, step) = (u32_at(96), u32_at(107), f64_at(131));
    assert!(bytes[131..139] == bytes[139..147] && bytes[131..139] == bytes[147..155], "one step");
    assert_eq!(bytes[155..179], [0; 24], "positions are relative to the camera");
    assert_eq!((bytes.len(), u32_at(111)), (start + 26 * count, count), "first returns");
    let words = String::from_utf8_lossy(&bytes[227..start]).into_owned();
    assert!(words.contains("Text Area") && words.contains("y down"), "{words}");
    let points = (0..count).map(|i| start + 26 * i).map(|at| {
        let position = [0, 4, 8].map(|i| step * f64::from(u32_at(at + i) as u32 as i32));
        let level = |i: usize| {
            assert_eq!(u16_at(at + i) % 257, 0, "all 16 bits");
            (u16_at(at + i) / 257) as u8
        };
        (position, [20, 22, 24].map(level), level(12))
    });
    let points: Vec<_> = points.collect();
    for (axis, at) in [(0, 179), (1, 195), (2, 211)] {
        let values = || points.iter().map(|point| point.0[axis]);
        let ends = [values().fold(f64::MIN, f64::max), values().fold(f64::MAX, f64::min)];
        assert!(
            (f64_at(at) - ends[0]).abs() < 1e-6 * step && (f64_at(at + 8) - ends[1]).abs() < 1e-6 * step,
            "bounds"
        );
    }
    (step, points)
}

/// The largest distance along an axis between corresponding points.
fn apart(some: &[Point], others: &[Point]) -> f64 {
    assert_eq!(some.len(), others.len());
    let pairs = some.iter().zip(others).flat_map(|(a, b)| {
        assert_eq!((a.1, a.2), (b.1, b.2), "colour and confidence");
        [0, 1, 2].map(|i| (a.0[i] - b.0[i]).abs())
    });
    pairs.fold(0.0, f64::max)
}

#[test]
fn every_format_holds_the_same_points() {
    let folder = Folder::new();
    let at = |name: &str| folder.join(name);
    let said = matched(&folder, "slanted", "d.pfm --also points,points.pcd,points.las,points.laz");
    let points = cloud(&at("d.points.ply"));
    assert!(points.len() > 20_000);
    assert_eq!(said.matches(" points").count(), 1, "{said}");
    assert!(apart(&pcd(&at("d.points.pcd")), &points).total_cmp(&0.0).is_eq(), "all bits");
    let (step, rounded) = las(&at("d.points.las"));
    let off = apart(&rounded, &points);
    assert!(off > 0.0 && off <= 0.5001 * step, "{off} with steps of {step}");
    let nearest = points.iter().map(|(p, ..)| p[2]).fold(f64::MAX, f64::min);
    assert!((1e-7..=1e-6).contains(&(step / nearest)), "{step} at {nearest}");
    // Control: the comparison detects a point that is one step off.
    let mut moved = rounded.clone();
    moved[7].0[1] += step;
    assert!(apart(&moved, &points) > 0.5001 * step);

    let unpacked = las::Reader::from_path(at("d.points.laz")).unwrap().read_all().unwrap();
    let plain = fs::read(at("d.points.las")).unwrap();
    assert!(plain.ends_with(unpacked.raw_bytes()), "compression is lossless");
    assert_eq!(unpacked.len(), points.len());
    let bytes = |name: &str| fs::metadata(at(name)).unwrap().len();
    assert!(2 * bytes("d.points.laz") < bytes("d.points.las"), "{}", bytes("d.points.laz"));
}

/// Height above the floor of `repetitive` in the left camera's frame, half a baseline left of the scene's centre.
fn above_the_floor([_, y, z]: [f64; 3]) -> f64 {
    (0.6 - y) - 0.1 * (z - 1.2)
}

#[test]
fn points_of_a_plane_are_coplanar() {
    let folder = Folder::new();
    matched(&folder, "repetitive", "d.pfm --also points --quiet");
    let truth = read_pfm(scene("repetitive/disp0GT.pfm"));
    let on_floor: Vec<_> = cloud(&folder.join("d.points.ply"))
        .into_iter()
        .filter(|(p, ..)| {
            let pixel = [0, 1].map(|i| (p[i] / p[2] * FOCAL_LENGTH + MIDDLE[i]).round());
            let z = BASELINE * FOCAL_LENGTH / f64::from(truth[(pixel[0] as usize, pixel[1] as usize)]);
            let there = [0, 1].map(|i| (pixel[i] - MIDDLE[i]) / FOCAL_LENGTH * z);
            above_the_floor([there[0], there[1], z]).abs() < 1e-4
        })
        .map(|(p, ..)| p)
        .collect();
    assert!(on_floor.len() > 2000, "{} points", on_floor.len());
    let off = median(on_floor.iter().map(|p| above_the_floor(*p).abs()).collect());
    assert!(off < 0.01, "{off} world units above or below the floor");
    let flipped = median(on_floor.iter().map(|p| above_the_floor([p[0], -p[1], p[2]]).abs()).collect());
    assert!(flipped > 0.5, "the check detects a frame with y up: {flipped}");
}
