//! Renders a point cloud from `mrfgs match --also points`, seen from beside and above the camera:
//! `cargo run --release --example render-cloud FILE.ply PICTURE.png [RIGHT UP]`.
//!
//! RIGHT and UP are the angles by which the viewer orbits the middle of the cloud, in degrees [default: 20 10]. Each point is drawn as a
//! square of the size of its pixel, nearest in front.

use std::process::ExitCode;

use image::{Rgb, RgbImage};

const WIDTH: u32 = 640;
const HEIGHT: u32 = 480;
const GROUND: Rgb<u8> = Rgb([24, 28, 34]);

/// Position and colour of a point of the cloud.
type Point = ([f64; 3], Rgb<u8>);

fn main() -> ExitCode {
    match run(&std::env::args().skip(1).collect::<Vec<_>>()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(reason) => {
            eprintln!("render-cloud: {reason}");
            ExitCode::FAILURE
        }
    }
}

pub(crate) fn run(args: &[String]) -> Result<(), String> {
    let (files, degrees) = args.split_at(args.len().min(2));
    let degrees: Result<Vec<f64>, _> = degrees.iter().map(|angle| angle.parse()).collect();
    let ([cloud, picture], Some([right, up])) = (files, degrees.ok().and_then(angles)) else {
        return Err("give FILE.ply PICTURE.png [RIGHT UP], the last two in degrees".into());
    };
    let bytes = std::fs::read(cloud).map_err(|e| format!("cannot read {cloud}: {e}"))?;
    let points = read(&bytes).map_err(|reason| format!("cannot read {cloud}: {reason}"))?;
    let rendered = render(&points, right.to_radians(), up.to_radians());
    rendered.save(picture).map_err(|e| format!("cannot write {picture}: {e}"))
}

fn angles(degrees: Vec<f64>) -> Option<[f64; 2]> {
    if degrees.is_empty() { Some([20.0, 10.0]) } else { degrees.try_into().ok() }
}

/// Reads the points of a binary PLY file.
fn read(bytes: &[u8]) -> Result<Vec<Point>, String> {
    const END: &[u8] = b"end_header\n";
    let start = bytes.windows(END.len()).position(|window| window == END).ok_or("no end of a PLY header")?;
    let header = String::from_utf8_lossy(&bytes[..start]);
    if !header.starts_with("ply\nformat binary_little_endian 1.0\n") {
        return Err("not a binary little-endian PLY file".into());
    }
    let (mut size, mut names) = (0, std::collections::BTreeMap::new());
    for property in header.lines().filter_map(|line| line.strip_prefix("property ")) {
        let (kind, name) = property.split_once(' ').unwrap_or_default();
        names.insert(name, size);
        size += match kind {
            "float" => 4,
            "uchar" => 1,
            _ => return Err(format!("property {property}: neither float nor uchar")),
        };
    }
    let place = |name: &str| names.get(name).copied().ok_or(format!("no property {name}"));
    let [x, y, z] = [place("x")?, place("y")?, place("z")?];
    let [red, green, blue] = [place("red")?, place("green")?, place("blue")?];
    let points = bytes[start + END.len()..].chunks_exact(size).map(|point| {
        let float = |at: usize| f64::from(f32::from_le_bytes([0, 1, 2, 3].map(|i| point[at + i])));
        ([x, y, z].map(float), Rgb([red, green, blue].map(|at| point[at])))
    });
    let points: Vec<_> = points.collect();
    if points.is_empty() { Err("holds no point".into()) } else { Ok(points) }
}

/// A point projected to the viewer: position and size at depth 1, in units of the cloud.
struct Splat {
    place: [f64; 2],
    depth: f64,
    size: f64,
    colour: Rgb<u8>,
}

/// Renders the points from `right` and `up` of the camera that took them (radians), looking at their middle.
fn render(points: &[Point], right: f64, up: f64) -> RgbImage {
    let middle = [0, 1, 2].map(|axis| quantile(points.iter().map(|(p, _)| p[axis]), 0.5));
    // Rotates around the vertical, then the horizontal axis through the middle; z becomes the distance along the viewing direction.
    let turned = |p: &[f64; 3]| {
        let [x, y, z] = [0, 1, 2].map(|axis| p[axis] - middle[axis]);
        let (x, z) = (x * right.cos() + z * right.sin(), z * right.cos() - x * right.sin());
        let (y, z) = (y * up.cos() - z * up.sin(), z * up.cos() + y * up.sin());
        [x, y, z + middle[2]]
    };
    // Estimates the pixel spacing at depth 1, then projects each point with its size in the new view.
    let size = |axis: usize| {
        let places = || points.iter().map(|(p, _)| p[axis] / p[2]);
        quantile(places(), 1.0) - quantile(places(), 0.0)
    };
    let pixel = (size(0) * size(1) / points.len() as f64).sqrt();
    let splats = points.iter().filter_map(|(p, colour)| {
        let [x, y, z] = turned(p);
        let splat = Splat { place: [x / z, y / z], depth: z, size: pixel * p[2] / z, colour: *colour };
        (z > 0.0).then_some(splat)
    });
    let splats: Vec<Splat> = splats.collect();

    // The view contains nearly all of the points.
    let ends =
        |axis: usize| [0.005, 0.995].map(|share| quantile(splats.iter().map(|s| s.place[axis]), share));
    let [[left, far_right], [top, bottom]] = [ends(0), ends(1)];
    let scale = 0.92 * (f64::from(WIDTH) / (far_right - left)).min(f64::from(HEIGHT) / (bottom - top));
    let mut picture = RgbImage::from_pixel(WIDTH, HEIGHT, GROUND);
    let mut nearest = vec![f64::INFINITY; (WIDTH * HEIGHT) as usize];
    for Splat { place: [u, v], depth, size, colour } in splats {
        let span = |at: f64, [low, high]: [f64; 2], pixels: u32| {
            let middle = (at - 0.5 * (low + high)) * scale + 0.5 * f64::from(pixels);
            let [from, to] = [-0.55, 0.55].map(|half| (middle + half * size * scale).round() as i64);
            from.max(0)..(to + 1).min(i64::from(pixels))
        };
        for y in span(v, [top, bottom], HEIGHT) {
            for x in span(u, [left, far_right], WIDTH) {
                let (x, y) = (x as u32, y as u32);
                let nearest = &mut nearest[(y * WIDTH + x) as usize];
                if depth < *nearest {
                    *nearest = depth;
                    picture.put_pixel(x, y, colour);
                }
            }
        }
    }
    picture
}

/// The quantile of the values at `share` (0 to 1).
fn quantile(values: impl Iterator<Item = f64>, share: f64) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share) as usize]
}
