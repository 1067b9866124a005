//! Renders a point cloud from `mrfgs match --also points`, seen from beside and above the camera:
//! `cargo run --release --example render-cloud FILE.ply PICTURE.png [RIGHT UP]`.
//!
//! RIGHT and UP are the angles by which the viewer orbits the middle of the cloud, in degrees [default: 20 10]. Points of neighbouring
//! pixels on one surface are joined by triangles, so surfaces are closed; points without such neighbours are left out.

use std::collections::HashMap;
use std::process::ExitCode;

use image::{Rgb, RgbImage};

const WIDTH: u32 = 640;
const HEIGHT: u32 = 480;
const GROUND: Rgb<u8> = Rgb([24, 28, 34]);
/// Pixels are joined while the depth changes by at most this many times the distance between them. Floors seen at a low angle stay below
/// it; the step from an object to the wall behind it is above it.
const STEEPEST: f64 = 25.0;

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

/// A corner of the surface as the viewer sees it: its place in the picture, its distance, its colour.
#[derive(Clone, Copy)]
struct Corner {
    place: [f64; 2],
    depth: f64,
    colour: [f64; 3],
}

/// Renders the surface from `right` and `up` of the camera that took the points (radians), looking at their middle.
fn render(points: &[Point], right: f64, up: f64) -> RgbImage {
    let middle = [0, 1, 2].map(|axis| quantile(points.iter().map(|(p, _)| p[axis]), 0.5));
    // Rotates around the vertical, then the horizontal axis through the middle; z becomes the distance along the viewing direction.
    let turned = |p: &[f64; 3]| {
        let [x, y, z] = [0, 1, 2].map(|axis| p[axis] - middle[axis]);
        let (x, z) = (x * right.cos() + z * right.sin(), z * right.cos() - x * right.sin());
        let (y, z) = (y * up.cos() - z * up.sin(), z * up.cos() + y * up.sin());
        [x, y, z + middle[2]]
    };
    let mut corners: Vec<Corner> = points
        .iter()
        .map(|(p, colour)| {
            let [x, y, depth] = turned(p);
            Corner { place: [x / depth, y / depth], depth, colour: colour.0.map(f64::from) }
        })
        .collect();

    // The view contains nearly all of the points.
    let ends =
        |axis: usize| [0.005, 0.995].map(|share| quantile(corners.iter().map(|c| c.place[axis]), share));
    let [[left, far_right], [top, bottom]] = [ends(0), ends(1)];
    let [width, height] = [WIDTH, HEIGHT].map(f64::from);
    let scale = 0.92 * (width / (far_right - left)).min(height / (bottom - top));
    for Corner { place, .. } in &mut corners {
        let [u, v] = *place;
        *place = [
            (u - 0.5 * (left + far_right)) * scale + 0.5 * width,
            (v - 0.5 * (top + bottom)) * scale + 0.5 * height,
        ];
    }
    let mut picture = RgbImage::from_pixel(WIDTH, HEIGHT, GROUND);
    let mut nearest = vec![f64::INFINITY; (WIDTH * HEIGHT) as usize];
    for triangle in triangles(points) {
        draw(triangle.map(|i| corners[i]), &mut picture, &mut nearest);
    }
    picture
}

/// The triangles between neighbouring pixels of one surface, as indices of points.
fn triangles(points: &[Point]) -> Vec<[usize; 3]> {
    let place = |p: &[f64; 3], axis: usize| p[axis] / p[2];
    // Points come row by row, and most have their neighbour beside them, so the median step is that of a pixel.
    let steps = points.windows(2).map(|two| place(&two[1].0, 0) - place(&two[0].0, 0));
    let pixel = quantile(steps.filter(|step| *step > 0.0), 0.5);
    let [left, top] = [0, 1].map(|axis| quantile(points.iter().map(|(p, _)| place(p, axis)), 0.0));
    let at = |p: &[f64; 3]| {
        [(0, left), (1, top)].map(|(axis, low)| ((place(p, axis) - low) / pixel).round() as i64)
    };
    let grid: HashMap<[i64; 2], usize> = points.iter().enumerate().map(|(i, (p, _))| (at(p), i)).collect();
    let mut out = Vec::new();
    for (p, _) in points {
        let [x, y] = at(p);
        let square = [[x, y], [x + 1, y], [x, y + 1], [x + 1, y + 1]].map(|cell| grid.get(&cell).copied());
        for corners in [[0, 1, 2], [1, 3, 2]] {
            let [Some(a), Some(b), Some(c)] = corners.map(|i| square[i]) else { continue };
            let depths = [a, b, c].map(|i| points[i].0[2]);
            let [near, far] =
                [depths.into_iter().fold(f64::INFINITY, f64::min), depths.into_iter().fold(0.0, f64::max)];
            if far - near <= STEEPEST * pixel * near {
                out.push([a, b, c]);
            }
        }
    }
    out
}

/// Draws a triangle where it is nearer than what is there.
fn draw(corners: [Corner; 3], picture: &mut RgbImage, nearest: &mut [f64]) {
    if corners.iter().any(|corner| corner.depth <= 0.0) {
        return;
    }
    let [a, b, c] = corners.map(|corner| corner.place);
    // Twice the signed area of a triangle.
    let area = |[px, py]: [f64; 2], [qx, qy]: [f64; 2], [rx, ry]: [f64; 2]| {
        (qx - px) * (ry - py) - (rx - px) * (qy - py)
    };
    let all = area(a, b, c);
    let span = |axis: usize, pixels: u32| {
        let ends = [a, b, c].map(|place| place[axis]);
        let low = ends.into_iter().fold(f64::INFINITY, f64::min).floor().max(0.0) as u32;
        let high = ends.into_iter().fold(f64::NEG_INFINITY, f64::max).ceil().max(0.0) as u32;
        low..(high + 1).min(pixels)
    };
    if all == 0.0 {
        return;
    }
    for y in span(1, HEIGHT) {
        for x in span(0, WIDTH) {
            let here = [f64::from(x) + 0.5, f64::from(y) + 0.5];
            let weights = [area(here, b, c), area(a, here, c), area(a, b, here)].map(|part| part / all);
            if weights.iter().any(|weight| *weight < 0.0) {
                continue;
            }
            let mean = |of: &dyn Fn(&Corner) -> f64| -> f64 {
                weights.iter().zip(&corners).map(|(weight, corner)| weight * of(corner)).sum()
            };
            let depth = mean(&|corner| corner.depth);
            let nearest = &mut nearest[(y * WIDTH + x) as usize];
            if depth < *nearest {
                *nearest = depth;
                let colour = [0, 1, 2].map(|channel| mean(&|corner| corner.colour[channel]).round() as u8);
                picture.put_pixel(x, y, Rgb(colour));
            }
        }
    }
}

/// The quantile of the values at `share` (0 to 1).
fn quantile(values: impl Iterator<Item = f64>, share: f64) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share) as usize]
}
