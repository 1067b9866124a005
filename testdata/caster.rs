//! A small ray-caster with two eyes. It knows no scene: `scenes.rs` has those.
//!
//! A [`World`] is a handful of bodies (flat pieces, spheres, tubes) in front of two parallel cameras. A ray through
//! any point of either image meets the bodies in closed form, so both views, the disparity of both and what one
//! hides from the other come from the same exact geometry: nothing is warped, nothing interpolated.
//!
//! Units: the left and right eye look along z from (-b/2, 0, 0) and (b/2, 0, 0); x points right, y down. At depth
//! 1 an image is one unit high, and the disparity there is [`REACH`] times the largest label; at depth z it is
//! that over z. Nothing visible is nearer than depth 1.
//!
//! Arithmetic is limited to + - * / sqrt and integer hashes, which IEEE 754 defines to the last bit: every machine
//! renders the same bytes. Pixel (x, y) has its centre at (x, y).

use mrfgs::image::Plane;
use rayon::prelude::*;

/// A rendered stereo pair with its exact truth.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The name, which is the folder's too.
    pub name: &'static str,
    /// The reference view.
    pub left: Plane<[u8; 3]>,
    /// The other view.
    pub right: Plane<[u8; 3]>,
    /// Disparity at each pixel centre of the left view: left x is seen at x - d in the right view.
    pub truth: Plane<f32>,
    /// Disparity at each pixel centre of the right view: right x is seen at x + d in the left view.
    pub truth_right: Plane<f32>,
    /// 255 where the point at the left pixel's centre is seen in the right view too, 128 where something hides it
    /// there or it falls outside. 0 (unknown) never occurs.
    pub mask: Plane<u8>,
    /// Number of labels 0 ..= labels - 1 that is enough to search (`ndisp`).
    pub labels: u32,
    /// What recorded the left and the right view.
    pub sensors: [Sensor; 2],
}

impl Scene {
    /// What `calib.txt` holds: the cameras, in world units, and the labels to search.
    pub fn calibration(&self) -> String {
        let (width, height) = self.left.size();
        // An image is one unit high at depth 1.
        let camera = format!("[{height} 0 {}; 0 {height} {}; 0 0 1]", middle(width), middle(height));
        let baseline = REACH * f64::from(self.labels - 1) / height as f64;
        format!(
            "cam0={camera}\ncam1={camera}\ndoffs=0\nbaseline={baseline}\nwidth={width}\nheight={height}\nndisp={}\n",
            self.labels
        )
    }
}

// ---------------------------------------------------------------------------------------------- the two cameras

/// Disparity at depth 1, as a part of the largest label.
const REACH: f64 = 0.95;

/// Two parallel cameras before a world.
struct Rig<'a> {
    world: &'a World,
    width: usize,
    height: usize,
    /// Disparity in pixels at depth 1.
    unit_disparity: f64,
    /// A pixel is the mean of `grid` x `grid` samples.
    grid: usize,
}

#[derive(Clone, Copy, PartialEq)]
enum Side {
    Left,
    Right,
}

impl World {
    /// Both views and their truth.
    ///
    /// # Panics
    /// When no pixel or no label is asked for, and when the image is more than three times as wide as high or its rows
    /// are fewer than half the labels: slanted walls would come too close at its sides.
    pub fn shoot(&self, name: &'static str, width: usize, height: usize, labels: u32) -> Scene {
        assert!(
            width > 0 && height > 0 && labels > 0,
            "a scene of {width} x {height} pixels and {labels} labels"
        );
        assert!(width <= 3 * height, "{width} x {height} pixels: the scenes are not that wide");
        assert!(labels as usize <= 2 * height, "{labels} labels are too many for {height} rows");
        let unit_disparity = REACH * f64::from(labels - 1);
        // Megapixels would take minutes at the quality of the small ones.
        let grid = if width * height > 1 << 20 { 2 } else { 4 };
        Rig { world: self, width, height, unit_disparity, grid }.shoot(name, labels)
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

    /// The ray through the point (x, y) of an image.
    fn ray(&self, side: Side, x: f64, y: f64) -> Ray {
        let scale = self.height as f64;
        let half_base = 0.5 * self.unit_disparity / scale;
        let eye = if side == Side::Left { -half_base } else { half_base };
        let [u, v] = place((self.width, self.height), x, y);
        Ray { from: [eye, 0.0, 0.0], along: [u, v, 1.0] }
    }

    fn disparity(&self, side: Side, x: f64, y: f64) -> f64 {
        self.unit_disparity / self.world.nearest(&self.ray(side, x, y)).0
    }

    /// Whether what the left view shows at (x, y) is the frontmost thing in the right view as well.
    fn seen_twice(&self, x: f64, y: f64) -> bool {
        let d = self.disparity(Side::Left, x, y);
        x >= d && self.disparity(Side::Right, x - d, y) <= d * (1.0 + 1e-9)
    }

    /// One view as its sensor records it.
    fn picture(&self, side: Side) -> Plane<[u8; 3]> {
        let sensor = match side {
            Side::Left => &self.world.sensors[0],
            Side::Right => &self.world.sensors[1],
        };
        let (grid, samples) = (self.grid, self.grid * self.grid);
        let part = |i: usize, of: usize| (i as f64 + 0.5) / of as f64 - 0.5;
        self.plane(|x, y| {
            let mut sum = [0.0; 3];
            for i in 0..samples {
                let ray = self.ray(side, x as f64 + part(i % grid, grid), y as f64 + part(i / grid, grid));
                // Each sample looks at another part of the lamp, no two of them at one height or one width.
                let lamp = [part(i, samples), part(7 * i % samples, samples)];
                sum = add(sum, self.world.colour(&ray, lamp, 1.0 / self.height as f64));
            }
            sensor.record(scale(sum, 1.0 / samples as f64), (self.width, self.height), x, y)
        })
    }
}

/// Where the point (x, y) of an image is, from its middle, when the image is one unit high.
fn place((width, height): (usize, usize), x: f64, y: f64) -> [f64; 2] {
    let scale = height as f64;
    [(x - middle(width)) / scale, (y - middle(height)) / scale]
}

/// The middle of so many pixels.
fn middle(pixels: usize) -> f64 {
    0.5 * (pixels - 1) as f64
}

/// What turns light (1 is white) into bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor {
    pub gain: f64,
    /// The part of the light that is lost one image height away from `brightest`; it grows with the square of the
    /// distance.
    pub fall_off: f64,
    /// The place in the image that gets all light, in image heights from its middle.
    pub brightest: [f64; 2],
    /// Added after the gain, in grey levels.
    pub offset: f64,
    /// Standard deviation in grey levels.
    pub noise: f64,
    seed: u32,
}

impl Sensor {
    /// The grey level that light makes at (x, y) of an image of this size, but for the noise.
    pub fn level(&self, light: f64, size: (usize, usize), x: f64, y: f64) -> f64 {
        255.0 * self.gain * light * self.passes(size, x, y) + self.offset
    }

    /// The light that makes this grey level at (x, y): [`Self::level`] the other way round.
    pub fn light(&self, level: f64, size: (usize, usize), x: f64, y: f64) -> f64 {
        (level - self.offset) / (255.0 * self.gain * self.passes(size, x, y))
    }

    /// The part of the light that reaches (x, y).
    fn passes(&self, size: (usize, usize), x: f64, y: f64) -> f64 {
        let [u, v] = place(size, x, y);
        let [u, v] = [u - self.brightest[0], v - self.brightest[1]];
        1.0 - self.fall_off * (u * u + v * v)
    }

    fn record(&self, light: Vec3, size: (usize, usize), x: usize, y: usize) -> [u8; 3] {
        [0, 1, 2].map(|c| {
            let bytes = hash([x as u32, y as u32, c as u32, self.seed]).to_le_bytes();
            // The sum of four uniform bytes is close to normal: mean 510, standard deviation 147.8.
            let normal = (bytes.map(f64::from).iter().sum::<f64>() - 510.0) / 147.8;
            let level = self.level(light[c], size, x as f64, y as f64) + self.noise * normal;
            (level + 0.5).clamp(0.0, 255.0) as u8
        })
    }
}

// ------------------------------------------------------------------------------------------------- the geometry

pub type Vec3 = [f64; 3];

pub fn add(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub fn scale(a: Vec3, k: f64) -> Vec3 {
    [a[0] * k, a[1] * k, a[2] * k]
}

fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub fn unit(a: Vec3) -> Vec3 {
    scale(a, 1.0 / dot(a, a).sqrt())
}

pub fn mix(a: Vec3, b: Vec3, t: f64) -> Vec3 {
    add(scale(a, 1.0 - t), scale(b, t))
}

/// Three perpendicular unit vectors: the body's own x, y and z.
#[derive(Clone, Copy)]
struct Frame([Vec3; 3]);

impl Frame {
    /// z along `z`, y as close to `y` as that allows.
    fn new(z: Vec3, y: Vec3) -> Self {
        let z = unit(z);
        let x = unit(cross(y, z));
        Self([x, cross(z, x), z])
    }

    fn local(&self, v: Vec3) -> Vec3 {
        self.0.map(|axis| dot(axis, v))
    }

    fn world(&self, v: Vec3) -> Vec3 {
        let [x, y, z] = self.0;
        add(add(scale(x, v[0]), scale(y, v[1])), scale(z, v[2]))
    }
}

/// The points `from + t * along`. For a camera's ray t is the depth, because `along` has z = 1.
struct Ray {
    from: Vec3,
    along: Vec3,
}

impl Ray {
    fn at(&self, t: f64) -> Vec3 {
        add(self.from, scale(self.along, t))
    }
}

#[derive(Clone, Copy)]
enum Outline {
    Rectangle,
    Ellipse,
}

enum Shape {
    /// The part of the frame's x-y plane within `half` of the centre.
    Flat {
        half: [f64; 2],
        outline: Outline,
    },
    Sphere {
        radius: f64,
    },
    /// An open tube along the frame's z, `half` to either side of the centre.
    Tube {
        radius: f64,
        half: f64,
    },
}

struct Body {
    shape: Shape,
    centre: Vec3,
    frame: Frame,
    /// Square of the distance from the centre within which all of it lies, and a little more.
    reach: f64,
    paint: Paint,
    seed: u32,
}

impl Body {
    /// Where the ray first meets the body, beyond t = 0.
    fn meet(&self, ray: &Ray) -> Option<f64> {
        let from = sub(ray.from, self.centre);
        let (a, b, c) = (dot(ray.along, ray.along), dot(ray.along, from), dot(from, from));
        if b * b < a * (c - self.reach) {
            return None; // past all of it, and most rays are
        }
        match self.shape {
            Shape::Flat { half, outline } => {
                let [x, y, z] = self.frame.0;
                let t = -dot(z, from) / dot(z, ray.along);
                let p = add(from, scale(ray.along, t));
                let [a, b] = [dot(x, p) / half[0], dot(y, p) / half[1]];
                let inside = match outline {
                    Outline::Rectangle => a.abs() <= 1.0 && b.abs() <= 1.0,
                    Outline::Ellipse => a * a + b * b <= 1.0,
                };
                (inside && t > 0.0).then_some(t)
            }
            Shape::Sphere { radius } => {
                let roots = roots(a, b, c - radius * radius);
                roots?.into_iter().find(|&t| t > 0.0)
            }
            Shape::Tube { radius, half } => {
                let [p, v] = [from, ray.along].map(|w| self.frame.local(w));
                let roots = roots(
                    v[0] * v[0] + v[1] * v[1],
                    v[0] * p[0] + v[1] * p[1],
                    p[0] * p[0] + p[1] * p[1] - radius * radius,
                );
                roots?.into_iter().find(|&t| t > 0.0 && (p[2] + t * v[2]).abs() <= half)
            }
        }
    }

    /// The point `p` of the surface in the body's own coordinates, and the surface's normal there.
    fn surface(&self, p: Vec3) -> (Vec3, Vec3) {
        let local = self.frame.local(sub(p, self.centre));
        let normal = match self.shape {
            Shape::Flat { .. } => return ([local[0], local[1], 0.0], self.frame.0[2]),
            Shape::Sphere { .. } => local,
            Shape::Tube { .. } => [local[0], local[1], 0.0],
        };
        (local, unit(self.frame.world(normal)))
    }
}

/// The solutions of a t^2 + 2 b t + c = 0, the smaller one first.
fn roots(a: f64, b: f64, c: f64) -> Option<[f64; 2]> {
    let discriminant = b * b - a * c;
    (discriminant > 0.0).then(|| {
        let root = discriminant.sqrt();
        [(-b - root) / a, (-b + root) / a]
    })
}

// ---------------------------------------------------------------------------------------------------- the light

/// Bodies, and who looks at them.
pub struct World {
    bodies: Vec<Body>,
    pub sensors: [Sensor; 2],
    seed: u32,
}

/// Towards the lamp: over the viewer's left shoulder.
const LAMP: Vec3 = [-0.45, -0.8, -0.65];

/// How far the lamp reaches sideways, as a part of its distance: the softness of shadows.
const LAMP_SIZE: f64 = 0.16;

impl World {
    pub fn new(seed: u32) -> Self {
        let sensor =
            |seed| Sensor { gain: 1.0, fall_off: 0.0, brightest: [0.0; 2], offset: 0.0, noise: 1.0, seed };
        Self { bodies: Vec::new(), sensors: [sensor(2 * seed), sensor(2 * seed + 1)], seed }
    }

    /// Depth and index of the body that the ray meets first.
    fn nearest(&self, ray: &Ray) -> (f64, Option<usize>) {
        let mut first = (f64::INFINITY, None);
        for (i, body) in self.bodies.iter().enumerate() {
            if let Some(t) = body.meet(ray).filter(|&t| t < first.0) {
                first = (t, Some(i));
            }
        }
        first
    }

    /// The colour that a camera's ray brings home, lit from the given part of the lamp (each -0.5 ..= 0.5). `pixel`
    /// is the width of a pixel at depth 1. Surfaces are matt, so that a point has one colour whoever looks at it.
    fn colour(&self, ray: &Ray, part: [f64; 2], pixel: f64) -> Vec3 {
        let (depth, Some(i)) = self.nearest(ray) else { return [0.0; 3] };
        let body = &self.bodies[i];
        let point = ray.at(depth);
        let (local, mut normal) = body.surface(point);
        if dot(normal, ray.along) > 0.0 {
            normal = scale(normal, -1.0);
        }
        let [a, b] = part.map(|p| LAMP_SIZE * p);
        let lamp = unit(add(LAMP, [a, -0.5 * (a + b), b]));
        let towards = Ray { from: add(point, scale(normal, 1e-6)), along: lamp };
        let facing = dot(normal, lamp);
        let lit = facing > 0.0 && !self.bodies.iter().any(|body| body.meet(&towards).is_some());
        let ambient = 0.5 - 0.12 * normal[1];
        let light = ambient + if lit { 0.55 * facing } else { 0.0 };
        scale(body.paint.colour(local, depth * pixel, body.seed), light)
    }
}

// ------------------------------------------------------------------------------------------------- the textures

#[derive(Clone, Copy)]
pub enum Pattern {
    /// The first colour alone.
    Plain,
    /// A slow change between the two colours, over about this length.
    Wash(f64),
    /// Patches of this size with ragged borders.
    Blotches(f64),
    /// Stripes across the body's x, with this period.
    Stripes(f64),
    /// Rings across the body's z, with this period.
    Rings(f64),
    /// Cubes of this size.
    Checker(f64),
}

/// A pattern of two colours under a band-limited grain that is carved out of the solid.
#[derive(Clone, Copy)]
pub struct Paint {
    pattern: Pattern,
    colours: [Vec3; 2],
    /// Standard deviation of the grain, as a part of the colour.
    grain: f64,
    /// Size of the coarsest grain.
    cell: f64,
    /// Factors on the body's coordinates before the grain is looked up: below 1 draws it out.
    stretch: Vec3,
}

/// A paint of two colours, given as 0xRRGGBB, with a medium grain.
pub fn paint(pattern: Pattern, colours: [u32; 2]) -> Paint {
    let colours = colours.map(|c| [c >> 16, c >> 8, c].map(|byte| f64::from(byte & 255) / 255.0));
    Paint { pattern, colours, grain: 0.16, cell: 0.12, stretch: [1.0; 3] }
}

impl Paint {
    pub fn grain(self, grain: f64, cell: f64) -> Self {
        Self { grain, cell, ..self }
    }

    pub fn stretch(self, stretch: Vec3) -> Self {
        Self { stretch, ..self }
    }

    /// The colour at a point of the body; no detail is much finer than `pixel`.
    fn colour(&self, p: Vec3, pixel: f64, seed: u32) -> Vec3 {
        let odd = |cells: f64| if cells.floor() as i64 & 1 == 0 { 0.0 } else { 1.0 };
        let t = match self.pattern {
            Pattern::Plain => 0.0,
            Pattern::Wash(size) => 0.5 + 0.7 * noise(scale(p, 1.0 / size), seed ^ 1),
            Pattern::Blotches(size) => 0.5 + 2.0 * octaves(p, size, pixel, 0.45, seed ^ 1),
            Pattern::Stripes(period) => odd(2.0 * p[0] / period),
            Pattern::Rings(period) => odd(2.0 * p[2] / period),
            Pattern::Checker(size) => odd(p.iter().map(|c| (c / size).floor()).sum()),
        };
        let base = mix(self.colours[0], self.colours[1], t.clamp(0.0, 1.0));
        if self.grain == 0.0 {
            return base;
        }
        let q = [p[0] * self.stretch[0], p[1] * self.stretch[1], p[2] * self.stretch[2]];
        let grain = octaves(q, self.cell, pixel, 0.8, seed).clamp(-2.5, 2.5);
        scale(base, 1.0 + self.grain * grain)
    }
}

/// Noise of standard deviation about 1 in octaves from `cell` down to about two pixels, each `gain` times as
/// strong as the one before. Octaves fade with depth, hence alike in both views.
fn octaves(p: Vec3, cell: f64, pixel: f64, gain: f64, seed: u32) -> f64 {
    let (mut q, mut cell, mut weight) = (scale(p, 1.0 / cell), cell, 1.0);
    let (mut sum, mut power) = (0.0, 0.0);
    for octave in 0..12_u32 {
        let fade = (cell / pixel - 1.5).clamp(0.0, 1.0);
        if fade == 0.0 && octave > 0 {
            break;
        }
        let w = if octave == 0 { weight } else { weight * fade };
        sum += w * noise(q, seed.wrapping_add(octave.wrapping_mul(0x51ed_270b)));
        power += w * w;
        // Twice as fine, and turned (3-4-5) so that the lattices do not line up.
        q = [1.6 * q[0] - 1.2 * q[1], 1.2 * q[0] + 1.6 * q[1], 2.0 * q[2]];
        cell *= 0.5;
        weight *= gain;
    }
    2.4 * sum / power.sqrt()
}

/// Value noise in -1 ..= 1: random values on the integer lattice, blended smoothly.
fn noise(p: Vec3, seed: u32) -> f64 {
    let cell = p.map(|c| c.floor() as i32);
    let part = [0, 1, 2].map(|i| p[i] - f64::from(cell[i]));
    let [u, v, w] = part.map(|f| f * f * (3.0 - 2.0 * f));
    let value = |dx: i32, dy: i32, dz: i32| {
        let corner = [cell[0] + dx, cell[1] + dy, cell[2] + dz].map(|c| c as u32);
        f64::from(hash([corner[0], corner[1], corner[2], seed])) * (2.0 / 4_294_967_295.0) - 1.0
    };
    let blend = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let layer = |dz| {
        let top = blend(value(0, 0, dz), value(1, 0, dz), u);
        let bottom = blend(value(0, 1, dz), value(1, 1, dz), u);
        blend(top, bottom, v)
    };
    if w == 0.0 { layer(0) } else { blend(layer(0), layer(1), w) }
}

/// A random-looking word for each input.
fn hash([a, b, c, d]: [u32; 4]) -> u32 {
    let mut h = a.wrapping_mul(0x9e37_79b1);
    h = h.wrapping_add(b.wrapping_mul(0x85eb_ca77)).wrapping_add(c.wrapping_mul(0xc2b2_ae3d));
    h = h.wrapping_add(d.wrapping_mul(0x27d4_eb2f)).wrapping_add(0x1656_67b1);
    h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
    h ^ (h >> 16)
}

// ------------------------------------------------------------------------------------------------- the bodies

pub const UP: Vec3 = [0.0, -1.0, 0.0];
pub const VIEWER: Vec3 = [0.0, 0.0, -1.0];
/// Half the side of what has no visible end.
const ENDLESS: f64 = 40.0;

impl World {
    fn put(&mut self, shape: Shape, centre: Vec3, frame: Frame, paint: Paint) {
        let seed = hash([self.seed, self.bodies.len() as u32, 0, 0]);
        let reach = 1.001
            * match shape {
                Shape::Flat { half, .. } => half[0] * half[0] + half[1] * half[1],
                Shape::Sphere { radius } => radius * radius,
                Shape::Tube { radius, half } => radius * radius + half * half,
            };
        self.bodies.push(Body { shape, centre, frame, reach, paint, seed });
    }

    /// A rectangle that faces `normal`; `half` its width and height.
    pub fn card(&mut self, centre: Vec3, normal: Vec3, up: Vec3, half: [f64; 2], paint: Paint) {
        self.put(Shape::Flat { half, outline: Outline::Rectangle }, centre, Frame::new(normal, up), paint);
    }

    /// A plane without visible end.
    pub fn plane(&mut self, point: Vec3, normal: Vec3, paint: Paint) {
        let up = if normal[1].abs() > normal[2].abs() { VIEWER } else { UP };
        self.card(point, normal, up, [ENDLESS; 2], paint);
    }

    pub fn disc(&mut self, centre: Vec3, normal: Vec3, radius: f64, paint: Paint) {
        let up = if normal[1].abs() > normal[2].abs() { VIEWER } else { UP };
        let shape = Shape::Flat { half: [radius; 2], outline: Outline::Ellipse };
        self.put(shape, centre, Frame::new(normal, up), paint);
    }

    pub fn ball(&mut self, centre: Vec3, radius: f64, axis: Vec3, paint: Paint) {
        self.put(Shape::Sphere { radius }, centre, Frame::new(axis, VIEWER), paint);
    }

    /// A round bar between two points, closed at both ends.
    pub fn bar(&mut self, a: Vec3, b: Vec3, radius: f64, paint: Paint) {
        let axis = sub(b, a);
        let half = 0.5 * dot(axis, axis).sqrt();
        let side = if axis[2].abs() > axis[1].abs() { UP } else { VIEWER };
        self.put(Shape::Tube { radius, half }, mix(a, b, 0.5), Frame::new(axis, side), paint);
        self.disc(a, scale(axis, -1.0), radius, paint);
        self.disc(b, axis, radius, paint);
    }

    /// A cuboid whose front looks along `front`; `half` its width, height and depth.
    pub fn block(&mut self, centre: Vec3, front: Vec3, up: Vec3, half: Vec3, paint: Paint) {
        let frame = Frame::new(front, up);
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
