//! Depths as another camera sees them (registration).

use crate::calibration::cameras::ThirdCamera;
use crate::image::Plane;

/// Neighbours whose disparities differ by at most this much, in pixels, belong to one surface.
const STEP: f32 = 1.0;

/// A pixel that covers more than this many pixels of the other camera in width or height gives no depth,
/// since the map does not resolve so much.
const WIDEST: f64 = 64.0;

/// A corner of a pixel, as the other camera sees it.
#[derive(Clone, Copy)]
struct Vertex {
    /// Its position in the image.
    at: [f64; 2],
    /// 1 / Z, which is linear in the image over a plane.
    nearness: f64,
}

/// The depths of a map of `disparities` along the axis of `camera`, at its pixels; +infinity where the map shows nothing.
/// `point` gives the position of the pixel (x, y) at a disparity, in the frame of the camera.
///
/// Each pixel is a piece of surface with the footprint of the pixel. Pieces of one surface share their corners, so no gaps open
/// between them where the other camera magnifies them; gaps between surfaces stay open. The nearest piece hides the others.
pub(crate) fn render(
    disparities: &Plane<f32>,
    camera: &ThirdCamera,
    point: impl Fn(f64, f64, f64) -> Option<[f64; 3]>,
) -> Plane<f32> {
    let (width, height) = camera.size;
    let mut depths = Plane::filled(width, height, f32::INFINITY);
    let vertex = |x: usize, y: usize, [right, below]: [bool; 2]| {
        let d = at_corner(disparities, [x, y], [right, below]);
        let at = |count: usize, after: bool| count as f64 + if after { 0.5 } else { -0.5 };
        let point = point(at(x, right), at(y, below), d)?;
        Some(Vertex { at: camera.lens.project(point)?, nearness: 1.0 / point[2] })
    };
    for y in 0..disparities.height() {
        for x in 0..disparities.width() {
            if !disparities[(x, y)].is_finite() {
                continue;
            }
            let corners = [[false, false], [true, false], [true, true], [false, true]];
            let [Some(a), Some(b), Some(c), Some(d)] = corners.map(|corner| vertex(x, y, corner)) else {
                continue;
            };
            fill(&mut depths, [a, b, c]);
            fill(&mut depths, [a, c, d]);
        }
    }
    depths
}

/// The disparity at a corner of a pixel: the mean of the pixels around it that belong to the same surface.
fn at_corner(disparities: &Plane<f32>, [x, y]: [usize; 2], [right, below]: [bool; 2]) -> f64 {
    let beside = |count: usize, after: bool| if after { Some(count + 1) } else { count.checked_sub(1) };
    let value = |x: Option<usize>, y: Option<usize>| {
        let (x, y) = (x?, y?);
        let inside = x < disparities.width() && y < disparities.height();
        inside.then(|| disparities[(x, y)]).filter(|d| d.is_finite())
    };
    let (across, down) = (beside(x, right), beside(y, below));
    // The four pixels around the corner, in circular order.
    let around = [value(Some(x), Some(y)), value(across, Some(y)), value(across, down), value(Some(x), down)];
    let joins =
        |i: usize, j: usize| matches!((around[i], around[j]), (Some(a), Some(b)) if (a - b).abs() <= STEP);
    let mut joined = [true, joins(0, 1), false, joins(0, 3)];
    joined[2] = (joined[1] && joins(1, 2)) || (joined[3] && joins(3, 2));
    joined[1] |= joined[2] && joins(2, 1);
    joined[3] |= joined[2] && joins(2, 3);
    let surface = around.iter().zip(joined).filter(|(_, joined)| *joined).filter_map(|(d, _)| *d);
    // Sums of four are exact, so all pixels of the surface get the same mean.
    let (sum, count) = surface.fold((0.0, 0.0), |(sum, count), d| (sum + f64::from(d), count + 1.0));
    sum / count
}

/// Draws a triangle, edges included, where nothing nearer is drawn.
fn fill(depths: &mut Plane<f32>, corners: [Vertex; 3]) {
    let [a, b, c] = corners.map(|corner| corner.at);
    let cross = |[ax, ay]: [f64; 2], [bx, by]: [f64; 2], [x, y]: [f64; 2]| {
        (bx - ax) * (y - ay) - (by - ay) * (x - ax)
    };
    let area = cross(a, b, c);
    // The pixels whose centres may be inside.
    let span = |axis: usize, count: usize| {
        let values = [a, b, c].map(|at| at[axis]);
        let (least, most) =
            (values.into_iter().fold(f64::MAX, f64::min), values.into_iter().fold(f64::MIN, f64::max));
        let fits = most - least <= WIDEST && most >= 0.0 && least <= count as f64 - 1.0;
        fits.then(|| least.max(0.0).ceil() as usize..=(most.min(count as f64 - 1.0).floor() as usize))
    };
    let (Some(columns), Some(rows)) = (span(0, depths.width()), span(1, depths.height())) else { return };
    if area == 0.0 {
        return;
    }
    for y in rows {
        for x in columns.clone() {
            let at = [x as f64, y as f64];
            let shares = [cross(b, c, at), cross(c, a, at), cross(a, b, at)].map(|part| part / area);
            if shares.iter().all(|share| *share >= 0.0) {
                let nearness: f64 =
                    shares.iter().zip(corners).map(|(share, corner)| share * corner.nearness).sum();
                let depth = &mut depths[(x, y)];
                *depth = depth.min((1.0 / nearness) as f32);
            }
        }
    }
}
