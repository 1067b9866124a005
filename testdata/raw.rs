//! Raw pairs: images from two cameras with lens distortion and slightly different orientations, placed like those of a rendered scene.
//!
//! Each raw pixel averages rays that are undistorted, rotated and traced into a view of the scene rendered at three times the size. As in
//! `caster.rs`, pinhole cameras need only + - * / and sqrt, so that every machine makes the same bytes.

#![allow(dead_code, unreachable_pub, reason = "each target that includes this module uses a part of it")]

use mrfgs::image::Plane;

use super::scenes::Scene;

/// A 3 x 3 matrix, by rows.
pub type Matrix = [[f64; 3]; 3];

/// Lens distortion models.
#[derive(Clone, Copy, Debug)]
pub enum Lens {
    /// k1, k2, p1, p2, k3.
    RadialTangential([f64; 5]),
    /// k1 to k4 of a fisheye lens.
    Equidistant([f64; 4]),
}

/// A camera at one of the viewpoints of the scene.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    /// Focal length in pixels.
    pub focal: f64,
    /// Principal point.
    pub centre: [f64; 2],
    /// Lens distortion.
    pub lens: Lens,
    /// Rotation from scene to camera coordinates.
    pub turn: Matrix,
}

/// The cameras of `testdata/raw`.
pub const CAMERAS: [Camera; 2] = [
    Camera {
        focal: 214.0,
        centre: [121.4, 87.9],
        lens: Lens::RadialTangential([-0.16, 0.03, 0.0008, -0.0005, 0.0]),
        turn: rotation([0.008, -0.010, 0.007]),
    },
    Camera {
        focal: 217.0,
        centre: [117.6, 91.2],
        lens: Lens::RadialTangential([-0.14, 0.02, -0.0006, 0.0007, 0.0]),
        turn: rotation([-0.006, 0.007, -0.009]),
    },
];

/// A third camera with a wider view, to the right of the left camera, above and a little behind it.
pub const THIRD: Camera = Camera {
    focal: 260.0,
    centre: [203.0, 117.0],
    lens: Lens::RadialTangential([-0.12, 0.02, 0.001, -0.0007, 0.0]),
    turn: rotation([0.02, -0.03, 0.012]),
};

/// Position relative to the left camera, and image size.
pub const THIRD_PLACE: [f64; 3] = [0.06, -0.045, -0.03];
pub const THIRD_SIZE: (usize, usize) = (400, 240);

/// Size of the pair in `testdata/raw`, and the factor by which the underlying scene is rendered larger.
pub const SIZE: (usize, usize) = (240, 180);
pub const SCALE: usize = 3;

/// Rotation of the normalized quaternion (1, v), by about twice the length of `v`.
pub const fn rotation([x, y, z]: [f64; 3]) -> Matrix {
    let n = 1.0 + x * x + y * y + z * z;
    [
        [(1.0 + x * x - y * y - z * z) / n, 2.0 * (x * y - z) / n, 2.0 * (x * z + y) / n],
        [2.0 * (x * y + z) / n, (1.0 - x * x + y * y - z * z) / n, 2.0 * (y * z - x) / n],
        [2.0 * (x * z - y) / n, 2.0 * (y * z + x) / n, (1.0 - x * x - y * y + z * z) / n],
    ]
}

pub fn product(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|y| std::array::from_fn(|x| (0..3).map(|k| a[y][k] * b[k][x]).sum()))
}

/// Inverse of a rotation.
pub fn inverse(m: &Matrix) -> Matrix {
    std::array::from_fn(|y| std::array::from_fn(|x| m[x][y]))
}

pub fn turned(m: &Matrix, v: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

impl Camera {
    /// The ray through an image point, in scene coordinates.
    pub fn ray(&self, x: f64, y: f64) -> [f64; 3] {
        let [u, v] = [(x - self.centre[0]) / self.focal, (y - self.centre[1]) / self.focal];
        let [a, b] = match self.lens {
            Lens::RadialTangential([k1, k2, p1, p2, k3]) => {
                let (mut a, mut b) = (u, v);
                // Converges by a factor of at least three per step.
                for _ in 0..40 {
                    let r2 = a * a + b * b;
                    let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
                    let across = 2.0 * p1 * a * b + p2 * (r2 + 2.0 * a * a);
                    let down = p1 * (r2 + 2.0 * b * b) + 2.0 * p2 * a * b;
                    (a, b) = ((u - across) / radial, (v - down) / radial);
                }
                [a, b]
            }
            Lens::Equidistant([k1, k2, k3, k4]) => {
                let radius = (u * u + v * v).sqrt();
                // Bisection: the radius grows with the angle.
                let (mut low, mut high) = (0.0, 1.5);
                for _ in 0..60 {
                    let angle: f64 = 0.5 * (low + high);
                    let a2 = angle * angle;
                    let found = angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))));
                    if found < radius {
                        low = angle;
                    } else {
                        high = angle;
                    }
                }
                let factor = if radius > 0.0 { low.tan() / radius } else { 1.0 };
                [u * factor, v * factor]
            }
        };
        turned(&inverse(&self.turn), [a, b, 1.0])
    }

    /// Projects a point in camera coordinates to a pixel.
    pub fn project(&self, [x, y, z]: [f64; 3]) -> [f64; 2] {
        let [a, b] = [x / z, y / z];
        let r2 = a * a + b * b;
        let [u, v] = match self.lens {
            Lens::RadialTangential([k1, k2, p1, p2, k3]) => {
                let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
                let across = 2.0 * p1 * a * b + p2 * (r2 + 2.0 * a * a);
                let down = p1 * (r2 + 2.0 * b * b) + 2.0 * p2 * a * b;
                [a * radial + across, b * radial + down]
            }
            Lens::Equidistant([k1, k2, k3, k4]) => {
                let radius = r2.sqrt();
                let angle = radius.atan();
                let a2 = angle * angle;
                let found = angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))));
                let factor = if radius > 0.0 { found / radius } else { 1.0 };
                [a * factor, b * factor]
            }
        };
        [self.focal * u + self.centre[0], self.focal * v + self.centre[1]]
    }

    /// Renders the raw image from a view of the scene; it is black outside the view.
    pub fn photograph(&self, (width, height): (usize, usize), view: &Plane<[u8; 3]>) -> Plane<[u8; 3]> {
        const RAYS: usize = 4;
        let part = |i: usize| (i as f64 + 0.5) / RAYS as f64 - 0.5;
        Plane::from_fn(width, height, |x, y| {
            let mut sum = [0.0; 3];
            for (i, j) in (0..RAYS).flat_map(|j| (0..RAYS).map(move |i| (i, j))) {
                let ray = self.ray(x as f64 + part(i), y as f64 + part(j));
                let [u, v] = pixel(view.size(), ray);
                let at = [u, v].map(f64::floor);
                for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    let (px, py) = (at[0] + dx as f64, at[1] + dy as f64);
                    let inside =
                        px >= 0.0 && py >= 0.0 && px < view.width() as f64 && py < view.height() as f64;
                    if inside {
                        let weight = (1.0 - (px - u).abs()) * (1.0 - (py - v).abs());
                        let colour = view[(px as usize, py as usize)];
                        for (sum, level) in sum.iter_mut().zip(colour) {
                            *sum += weight * f64::from(level);
                        }
                    }
                }
            }
            sum.map(|v| (v / (RAYS * RAYS) as f64 + 0.5) as u8)
        })
    }
}

/// Where a ray intersects a view of the scene, which is one unit high at depth 1.
pub fn pixel((width, height): (usize, usize), [x, y, z]: [f64; 3]) -> [f64; 2] {
    let f = height as f64;
    [f * x / z + 0.5 * (width - 1) as f64, f * y / z + 0.5 * (height - 1) as f64]
}

/// Pose of the second camera relative to the first, with the given baseline: R and T.
pub fn pose([left, right]: &[Camera; 2], baseline: f64) -> (Matrix, [f64; 3]) {
    (product(&right.turn, &inverse(&left.turn)), turned(&right.turn, [-baseline, 0.0, 0.0]))
}

/// A matrix in OpenCV's YAML.
fn matrix(name: &str, rows: usize, numbers: &[f64]) -> String {
    let data: Vec<_> = numbers.iter().map(|v| format!("{v:?}")).collect();
    let (columns, data) = (numbers.len() / rows, data.join(", "));
    format!("{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: [ {data} ]\n")
}

/// Pose of the third camera, or another in its place, relative to a left camera with rotation `from`.
pub fn third_pose(third: &Camera, from: &Matrix) -> (Matrix, [f64; 3]) {
    (product(&third.turn, &inverse(from)), turned(&third.turn, THIRD_PLACE).map(|v| -v))
}

/// Position of the third camera in a scene.
pub fn third_eye(scene: &Scene) -> [f64; 3] {
    let [x, y, z] = THIRD_PLACE;
    [x - 0.5 * baseline(scene), y, z]
}

/// A third camera in OpenCV's YAML, with `pose` relative to the left one.
pub fn third(
    camera: &Camera,
    (width, height): (usize, usize),
    (rotation, translation): (Matrix, [f64; 3]),
) -> String {
    let Camera { focal, centre: [cx, cy], lens, .. } = *camera;
    let (fisheye, coefficients) = match lens {
        Lens::RadialTangential(k) => (0, k.to_vec()),
        Lens::Equidistant(k) => (1, k.to_vec()),
    };
    format!("%YAML:1.0\n---\nimage_size: [ {width}, {height} ]\nunit: m\nfisheye: {fisheye}\n")
        + &matrix("K", 3, &[focal, 0.0, cx, 0.0, focal, cy, 0.0, 0.0, 1.0])
        + &matrix("D", 1, &coefficients)
        + &matrix("R", 3, rotation.as_flattened())
        + &matrix("T", 3, &translation)
}

/// The calibration of a raw pair in OpenCV's YAML.
pub fn calibration(cameras: &[Camera; 2], (width, height): (usize, usize), baseline: f64) -> String {
    let mut text = format!("%YAML:1.0\n---\nimageSize: [ {width}, {height} ]\nunit: m\n");
    for (n, camera) in (1..).zip(cameras) {
        let Camera { focal, centre: [cx, cy], lens, .. } = *camera;
        text += &matrix(&format!("K{n}"), 3, &[focal, 0.0, cx, 0.0, focal, cy, 0.0, 0.0, 1.0]);
        text += &match lens {
            Lens::RadialTangential(k) => matrix(&format!("D{n}"), 1, &k),
            Lens::Equidistant(k) => matrix(&format!("D{n}"), 1, &k),
        };
    }
    if let Lens::Equidistant(_) = cameras[0].lens {
        text += "fisheye: 1\n";
    }
    let (rotation, translation) = pose(cameras, baseline);
    text + &matrix("R", 3, rotation.as_flattened()) + &matrix("T", 3, &translation)
}

/// The baseline of a scene.
pub fn baseline(scene: &Scene) -> f64 {
    let text = scene.calibration();
    let line = text.lines().find_map(|line| line.strip_prefix("baseline="));
    line.and_then(|number| number.parse().ok()).expect("a calibration has a baseline")
}

/// The scene of `testdata/raw` at [`SCALE`] times its size.
pub fn scene() -> Scene {
    super::scenes::render("slanted", SCALE * SIZE.0, SCALE * SIZE.1, 31 * SCALE as u32 + 1)
}
