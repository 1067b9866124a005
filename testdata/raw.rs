//! Raw pairs: what two cameras with lenses see that look a little past each other, where the two of a rendered scene stand.
//!
//! Each raw pixel is the mean of rays that go back through the lens, turn with the camera, and end in a view of the scene
//! that is rendered at three times the size. Like `caster.rs`, pinholes need only + - * / and sqrt, so every machine makes
//! the same bytes.

#![allow(dead_code, unreachable_pub, reason = "each target that includes this module uses a part of it")]

use mrfgs::image::Plane;

use super::scenes::Scene;

/// A matrix of three rows.
pub type Matrix = [[f64; 3]; 3];

/// How a lens departs from a pinhole.
#[derive(Clone, Copy, Debug)]
pub enum Lens {
    /// k1, k2, p1, p2, k3.
    RadialTangential([f64; 5]),
    /// k1 to k4 of a fisheye.
    Equidistant([f64; 4]),
}

/// A camera at an eye of the scene.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    /// Focal length in pixels.
    pub focal: f64,
    /// Principal point.
    pub centre: [f64; 2],
    /// What the lens does.
    pub lens: Lens,
    /// From the frame of the scene to that of the camera.
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

/// A third camera: it sees more, from the right of the left one, from above and a little from behind.
pub const THIRD: Camera = Camera {
    focal: 260.0,
    centre: [203.0, 117.0],
    lens: Lens::RadialTangential([-0.12, 0.02, 0.001, -0.0007, 0.0]),
    turn: rotation([0.02, -0.03, 0.012]),
};

/// Where it stands, from the left one, and the size of its images.
pub const THIRD_PLACE: [f64; 3] = [0.06, -0.045, -0.03];
pub const THIRD_SIZE: (usize, usize) = (400, 240);

/// The size of the pair in `testdata/raw`, and how many times larger the scene is rendered that it sees.
pub const SIZE: (usize, usize) = (240, 180);
pub const SCALE: usize = 3;

/// The rotation of the quaternion (1, v), made a unit: by about twice the length of `v`.
pub const fn rotation([x, y, z]: [f64; 3]) -> Matrix {
    let n = 1.0 + x * x + y * y + z * z;
    [
        [(1.0 + x * x - y * y - z * z) / n, 2.0 * (x * y - z) / n, 2.0 * (x * z + y) / n],
        [2.0 * (x * y + z) / n, (1.0 - x * x + y * y - z * z) / n, 2.0 * (y * z - x) / n],
        [2.0 * (x * z - y) / n, 2.0 * (y * z + x) / n, (1.0 - x * x - y * y + z * z) / n],
    ]
}

/// `a` times `b`.
pub fn product(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|y| std::array::from_fn(|x| (0..3).map(|k| a[y][k] * b[k][x]).sum()))
}

/// The inverse of a rotation.
pub fn inverse(m: &Matrix) -> Matrix {
    std::array::from_fn(|y| std::array::from_fn(|x| m[x][y]))
}

/// `m` times `v`.
pub fn turned(m: &Matrix, v: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

impl Camera {
    /// The ray through a point of the image, in the frame of the scene.
    pub fn ray(&self, x: f64, y: f64) -> [f64; 3] {
        let [u, v] = [(x - self.centre[0]) / self.focal, (y - self.centre[1]) / self.focal];
        let [a, b] = match self.lens {
            Lens::RadialTangential([k1, k2, p1, p2, k3]) => {
                let (mut a, mut b) = (u, v);
                // It converges by a factor of three or more a step.
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
                // By halves: the radius grows with the angle.
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

    /// The pixel that shows a point in the frame of the camera.
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

    /// What it sees of a view of the scene. Where that ends it is black.
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

/// Where a ray meets a view of the scene, which is one unit high at depth 1.
pub fn pixel((width, height): (usize, usize), [x, y, z]: [f64; 3]) -> [f64; 2] {
    let f = height as f64;
    [f * x / z + 0.5 * (width - 1) as f64, f * y / z + 0.5 * (height - 1) as f64]
}

/// How the second of two cameras stands to the first where their eyes are `baseline` apart: R and T.
pub fn pose([left, right]: &[Camera; 2], baseline: f64) -> (Matrix, [f64; 3]) {
    (product(&right.turn, &inverse(&left.turn)), turned(&right.turn, [-baseline, 0.0, 0.0]))
}

/// A matrix, as OpenCV writes it.
fn matrix(name: &str, rows: usize, numbers: &[f64]) -> String {
    let data: Vec<_> = numbers.iter().map(|v| format!("{v:?}")).collect();
    let (columns, data) = (numbers.len() / rows, data.join(", "));
    format!("{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: [ {data} ]\n")
}

/// How the third camera, or another one in its place, stands to a left one that is turned by `from`.
pub fn third_pose(third: &Camera, from: &Matrix) -> (Matrix, [f64; 3]) {
    (product(&third.turn, &inverse(from)), turned(&third.turn, THIRD_PLACE).map(|v| -v))
}

/// Where the third camera is in a scene.
pub fn third_eye(scene: &Scene) -> [f64; 3] {
    let [x, y, z] = THIRD_PLACE;
    [x - 0.5 * baseline(scene), y, z]
}

/// A camera beside a pair, as OpenCV writes it, that stands like `pose` to the left one.
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

/// The calibration of a raw pair, as OpenCV writes it.
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

/// The distance of the eyes of a scene.
pub fn baseline(scene: &Scene) -> f64 {
    let text = scene.calibration();
    let line = text.lines().find_map(|line| line.strip_prefix("baseline="));
    line.and_then(|number| number.parse().ok()).expect("a calibration has a baseline")
}

/// The scene that `testdata/raw` shows, at [`SCALE`] times its size.
pub fn scene() -> Scene {
    super::scenes::render("slanted", SCALE * SIZE.0, SCALE * SIZE.1, 31 * SCALE as u32 + 1)
}
