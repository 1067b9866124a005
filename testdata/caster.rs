//! A small ray caster with two cameras. The scenes are in `scenes.rs`.
//!
//! A [`World`] is a few bodies (planar pieces, spheres, tubes) in front of two parallel cameras. Rays intersect the bodies in closed form,
//! so both views, both disparity maps and the occlusions come from the same exact geometry: nothing is warped or interpolated.
//!
//! Shapes, paints and sensors have modules of their own.
//!
//! Units: the cameras look along z from (-b/2, 0, 0) and (b/2, 0, 0), plus the position of the rig; x points right, y down. At depth 1 an
//! image is one unit high, and the disparity is [`REACH`] times the largest label; at depth z it is that divided by z. Nothing visible is
//! nearer than depth 1.
//!
//! Arithmetic is limited to + - * / sqrt and integer hashes, which are exact by IEEE 754, so that every machine renders the same bytes.
//! Pixel (x, y) has its centre at (x, y).

mod body;
mod noise;
mod paint;
mod sensor;
mod vector;

use body::{Body, Outline, Ray, Shape};
use mrfgs::image::Plane;
use noise::hash;
use rayon::prelude::*;
use sensor::{middle, place};
use vector::{Basis, dot};

pub use paint::{Paint, Pattern, paint};
pub use sensor::Sensor;
pub use vector::{Vec3, add, mix, scale, sub, unit};

/// A rendered stereo pair with exact ground truth.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Name of the scene and of its folder.
    pub name: &'static str,
    /// The left view, which is the reference.
    pub left: Plane<[u8; 3]>,
    /// The right view.
    pub right: Plane<[u8; 3]>,
    /// Disparity at the pixel centres of the left view: left x matches right x - d.
    pub truth: Plane<f32>,
    /// Disparity at the pixel centres of the right view: right x matches left x + d.
    pub truth_right: Plane<f32>,
    /// 255 where the point at the centre of the left pixel is visible in the right view, 128 where it is occluded or outside. 0 (unknown)
    /// never occurs.
    pub mask: Plane<u8>,
    /// Number of labels to search, 0 ..= labels - 1 (`ndisp`).
    pub labels: u32,
    /// Sensors of the left and the right view.
    pub sensors: [Sensor; 2],
}

impl Scene {
    /// What a lidar beside the left camera measures: lines of `x,y,disparity`, a point at every fifth pixel of every twelfth row, with
    /// errors of up to a quarter of a pixel. Every 23rd point has a wrong disparity.
    pub fn lidar(&self) -> String {
        let (width, height) = self.truth.size();
        let places = (6..height).step_by(12).flat_map(|y| (2..width).step_by(5).map(move |x| (x, y)));
        let line = |(i, (x, y)): (u32, (usize, usize))| {
            // Between 0 and 1.
            let random = f64::from(i.wrapping_mul(0x9e37_79b9) >> 12) / f64::from(1 << 20);
            let truth = f64::from(self.truth[(x, y)]);
            let disparity = if i % 23 == 9 { random * 31.0 } else { truth + 0.5 * (random - 0.5) };
            format!("{x},{y},{disparity:.2}")
        };
        let lines: Vec<String> = (0_u32..).zip(places).map(line).collect();
        format!("x,y,disparity\n{}\n", lines.join("\n"))
    }

    /// The content of `calib.txt`: cameras, baseline in metres, and number of labels.
    pub fn calibration(&self) -> String {
        let (width, height) = self.left.size();
        // An image is one unit high at depth 1.
        let camera = format!("[{height} 0 {}; 0 {height} {}; 0 0 1]", middle(width), middle(height));
        let baseline = REACH * f64::from(self.labels - 1) / height as f64;
        format!(
            "cam0={camera}\ncam1={camera}\ndoffs=0\nbaseline={baseline}\nwidth={width}\nheight={height}\nndisp={}\nunit=m\n",
            self.labels
        )
    }
}

// ---------------------------------------------------------------------------------------------- the two cameras

/// Disparity at depth 1, as a fraction of the largest label.
const REACH: f64 = 0.95;

/// Two parallel cameras in front of a world.
struct Rig<'a> {
    world: &'a World,
    width: usize,
    height: usize,
    /// Disparity in pixels at depth 1.
    unit_disparity: f64,
    /// Each pixel averages `grid` x `grid` samples.
    grid: usize,
}

#[derive(Clone, Copy, PartialEq)]
enum Side {
    Left,
    Right,
}

impl World {
    /// Renders both views and their ground truth.
    ///
    /// # Panics
    /// If there are no pixels or no labels, the image is more than three times as wide as high, or it has fewer rows than half the labels:
    /// slanted walls would come too close at its sides.
    pub fn shoot(&self, name: &'static str, width: usize, height: usize, labels: u32) -> Scene {
        assert!(
            width > 0 && height > 0 && labels > 0,
            "a scene of {width} x {height} pixels and {labels} labels"
        );
        assert!(width <= 3 * height, "{width} x {height} pixels: the scenes are not that wide");
        assert!(labels as usize <= 2 * height, "{labels} labels are too many for {height} rows");
        let unit_disparity = REACH * f64::from(labels - 1);
        // Large images would take minutes with as many samples as small ones.
        let grid = if width * height > 1 << 20 { 2 } else { 4 };
        Rig { world: self, width, height, unit_disparity, grid }.shoot(name, labels)
    }

    /// The image that a camera at `eye` records with its own sensor. `ray` gives the ray through a pixel, with length 1 along the optical
    /// axis; `pixel` is the width of a pixel at depth 1.
    pub fn photograph(
        &self,
        size: (usize, usize),
        eye: Vec3,
        pixel: f64,
        ray: impl Fn(f64, f64) -> Vec3,
    ) -> Plane<[u8; 3]> {
        const GRID: usize = 4;
        let (samples, sensor) = (GRID * GRID, Sensor::new(2 * self.seed + 2));
        let part = |i: usize, of: usize| (i as f64 + 0.5) / of as f64 - 0.5;
        Plane::from_fn(size.0, size.1, |x, y| {
            let mut sum = [0.0; 3];
            for i in 0..samples {
                let along = ray(x as f64 + part(i % GRID, GRID), y as f64 + part(i / GRID, GRID));
                let lamp = [part(i, samples), part(7 * i % samples, samples)];
                sum = add(sum, self.colour(&Ray { from: eye, along }, lamp, pixel));
            }
            sensor.record(scale(sum, 1.0 / samples as f64), size, x, y)
        })
    }

    /// The depths along the optical axis of a camera at `eye`. `ray` gives the ray through a pixel, with length 1 along that axis.
    pub fn depths(
        &self,
        (width, height): (usize, usize),
        eye: Vec3,
        ray: impl Fn(f64, f64) -> Vec3,
    ) -> Plane<f32> {
        Plane::from_fn(width, height, |x, y| {
            self.nearest(&Ray { from: eye, along: ray(x as f64, y as f64) }).0 as f32
        })
    }
}

impl Rig<'_> {
    fn shoot(&self, name: &'static str, labels: u32) -> Scene {
        Scene {
            name,
            left: self.picture(Side::Left),
            right: self.picture(Side::Right),
            truth: self.plane(|x, y| self.disparity(Side::Left, x as f64, y as f64) as f32),
            truth_right: self.plane(|x, y| self.disparity(Side::Right, x as f64, y as f64) as f32),
            mask: self.plane(|x, y| if self.seen_twice(x as f64, y as f64) { 255 } else { 128 }),
            labels,
            sensors: self.world.sensors,
        }
    }

    fn plane<T: Send>(&self, f: impl Fn(usize, usize) -> T + Sync) -> Plane<T> {
        let f = &f;
        let rows = (0..self.height).into_par_iter();
        let data = rows.flat_map_iter(|y| (0..self.width).map(move |x| f(x, y))).collect();
        Plane::new(self.width, self.height, data)
    }

    /// The ray through the image point (x, y).
    fn ray(&self, side: Side, x: f64, y: f64) -> Ray {
        let scale = self.height as f64;
        let half_base = 0.5 * self.unit_disparity / scale;
        let eye = if side == Side::Left { -half_base } else { half_base };
        let [u, v] = place((self.width, self.height), x, y);
        Ray { from: add(self.world.rig, [eye, 0.0, 0.0]), along: [u, v, 1.0] }
    }

    fn disparity(&self, side: Side, x: f64, y: f64) -> f64 {
        self.unit_disparity / self.world.nearest(&self.ray(side, x, y)).0
    }

    /// Whether the point at (x, y) of the left view is also visible in the right view.
    fn seen_twice(&self, x: f64, y: f64) -> bool {
        let d = self.disparity(Side::Left, x, y);
        x >= d && self.disparity(Side::Right, x - d, y) <= d * (1.0 + 1e-9)
    }

    /// One view as recorded by its sensor.
    fn picture(&self, side: Side) -> Plane<[u8; 3]> {
        let sensor = match side {
            Side::Left => &self.world.sensors[0],
            Side::Right => &self.world.sensors[1],
        };
        let (grid, samples) = (self.grid, self.grid * self.grid);
        let part = |i: usize, of: usize| (i as f64 + 0.5) / of as f64 - 0.5;
        let place = |at: usize, i: usize| at as f64 + sensor.spread * part(i, grid);
        self.plane(|x, y| {
            let mut sum = [0.0; 3];
            for i in 0..samples {
                let ray = self.ray(side, place(x, i % grid), place(y, i / grid) - sensor.lower);
                // Stratifies the samples of the lamp: no two share a row or a column.
                let lamp = [part(i, samples), part(7 * i % samples, samples)];
                sum = add(sum, self.world.colour(&ray, lamp, 1.0 / self.height as f64));
            }
            sensor.record(scale(sum, 1.0 / samples as f64), (self.width, self.height), x, y)
        })
    }
}

// ---------------------------------------------------------------------------------------------------- the light

/// Bodies and the stereo rig that looks at them.
pub struct World {
    bodies: Vec<Body>,
    /// Midpoint between the cameras.
    pub rig: Vec3,
    pub sensors: [Sensor; 2],
    seed: u32,
}

/// Direction of the lamp: over the viewer's left shoulder.
const LAMP: Vec3 = [-0.45, -0.8, -0.65];

/// Width of the lamp relative to its distance: the softness of shadows.
const LAMP_SIZE: f64 = 0.16;

/// Intersection of a ray and a body.
struct Met<'a> {
    body: &'a Body,
    depth: f64,
    point: Vec3,
    /// The point in body coordinates.
    local: Vec3,
    /// Normal on the side of the ray's origin.
    normal: Vec3,
}

impl World {
    pub fn new(seed: u32) -> Self {
        Self { bodies: Vec::new(), rig: [0.0; 3], sensors: [2 * seed, 2 * seed + 1].map(Sensor::new), seed }
    }

    /// Depth and index of the first body that the ray intersects.
    fn nearest(&self, ray: &Ray) -> (f64, Option<usize>) {
        let mut first = (f64::INFINITY, None);
        for (i, body) in self.bodies.iter().enumerate() {
            if let Some(t) = body.meet(ray).filter(|&t| t < first.0) {
                first = (t, Some(i));
            }
        }
        first
    }

    /// The colour seen along a camera's ray, lit from a point of the lamp (`part`, each -0.5 ..= 0.5). `pixel` is the width of a pixel at
    /// depth 1. On matt surfaces the colour does not depend on the viewpoint.
    fn colour(&self, ray: &Ray, part: [f64; 2], pixel: f64) -> Vec3 {
        let Some(met) = self.meet(ray) else { return [0.0; 3] };
        let own = self.matt(&met, part, met.depth * pixel);
        let gloss = met.body.paint.gloss;
        if gloss == 0.0 {
            return own;
        }
        let along = sub(ray.along, scale(met.normal, 2.0 * dot(met.normal, ray.along)));
        let mirrored = Ray { from: add(met.point, scale(met.normal, 1e-6)), along };
        let shown = self.meet(&mirrored).map(|far| self.matt(&far, part, (met.depth + far.depth) * pixel));
        add(own, scale(shown.unwrap_or_default(), gloss))
    }

    /// The first intersection of the ray.
    fn meet(&self, ray: &Ray) -> Option<Met<'_>> {
        let (depth, Some(i)) = self.nearest(ray) else { return None };
        let body = &self.bodies[i];
        let point = ray.at(depth);
        let (local, mut normal) = body.surface(point);
        if dot(normal, ray.along) > 0.0 {
            normal = scale(normal, -1.0);
        }
        Some(Met { body, depth, point, local, normal })
    }

    /// Diffuse light from a point of a surface; details finer than about `detail` are suppressed.
    fn matt(&self, met: &Met, part: [f64; 2], detail: f64) -> Vec3 {
        let &Met { body, point, local, normal, .. } = met;
        let [a, b] = part.map(|p| LAMP_SIZE * p);
        let lamp = unit(add(LAMP, [a, -0.5 * (a + b), b]));
        let towards = Ray { from: add(point, scale(normal, 1e-6)), along: lamp };
        let facing = dot(normal, lamp);
        let lit = facing > 0.0 && !self.bodies.iter().any(|body| body.meet(&towards).is_some());
        let ambient = 0.5 - 0.12 * normal[1];
        let light = ambient + if lit { 0.55 * facing } else { 0.0 };
        scale(body.paint.colour(local, detail, body.seed), light)
    }
}

// ------------------------------------------------------------------------------------------------- the bodies

pub const UP: Vec3 = [0.0, -1.0, 0.0];
pub const VIEWER: Vec3 = [0.0, 0.0, -1.0];
/// Half the side of planes without a visible end.
const ENDLESS: f64 = 40.0;

impl World {
    fn put(&mut self, shape: Shape, centre: Vec3, frame: Basis, paint: Paint) {
        let seed = hash([self.seed, self.bodies.len() as u32, 0, 0]);
        self.bodies.push(Body::new(shape, centre, frame, paint, seed));
    }

    /// A rectangle facing `normal`; `half` is half its width and height.
    pub fn card(&mut self, centre: Vec3, normal: Vec3, up: Vec3, half: [f64; 2], paint: Paint) {
        self.put(Shape::Flat { half, outline: Outline::Rectangle }, centre, Basis::new(normal, up), paint);
    }

    /// A plane without visible ends.
    pub fn plane(&mut self, point: Vec3, normal: Vec3, paint: Paint) {
        let up = if normal[1].abs() > normal[2].abs() { VIEWER } else { UP };
        self.card(point, normal, up, [ENDLESS; 2], paint);
    }

    pub fn disc(&mut self, centre: Vec3, normal: Vec3, radius: f64, paint: Paint) {
        let up = if normal[1].abs() > normal[2].abs() { VIEWER } else { UP };
        let shape = Shape::Flat { half: [radius; 2], outline: Outline::Ellipse };
        self.put(shape, centre, Basis::new(normal, up), paint);
    }

    pub fn ball(&mut self, centre: Vec3, radius: f64, axis: Vec3, paint: Paint) {
        self.put(Shape::Sphere { radius }, centre, Basis::new(axis, VIEWER), paint);
    }

    /// A round bar between two points, closed at both ends.
    pub fn bar(&mut self, a: Vec3, b: Vec3, radius: f64, paint: Paint) {
        let axis = sub(b, a);
        let half = 0.5 * dot(axis, axis).sqrt();
        let side = if axis[2].abs() > axis[1].abs() { UP } else { VIEWER };
        self.put(Shape::Tube { radius, half }, mix(a, b, 0.5), Basis::new(axis, side), paint);
        self.disc(a, scale(axis, -1.0), radius, paint);
        self.disc(b, axis, radius, paint);
    }

    /// A cuboid with its front facing `front`; `half` is half its width, height and depth.
    pub fn block(&mut self, centre: Vec3, front: Vec3, up: Vec3, half: Vec3, paint: Paint) {
        let frame = Basis::new(front, up);
        for axis in 0..3 {
            let [side, top] = [[2, 1], [0, 2], [0, 1]][axis];
            for sign in [-1.0, 1.0] {
                let normal = scale(frame.0[axis], sign);
                let middle = add(centre, scale(normal, half[axis]));
                self.card(middle, normal, frame.0[top], [half[side], half[top]], paint);
            }
        }
    }
}
