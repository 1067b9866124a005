//! Vectors and frames.

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

pub fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub fn unit(a: Vec3) -> Vec3 {
    scale(a, 1.0 / dot(a, a).sqrt())
}

pub fn mix(a: Vec3, b: Vec3, t: f64) -> Vec3 {
    add(scale(a, 1.0 - t), scale(b, t))
}

/// An orthonormal frame: the body's x, y and z axes.
#[derive(Clone, Copy)]
pub struct Basis(pub [Vec3; 3]);

impl Basis {
    /// A frame with z along `z`, and y as close to `y` as possible.
    pub fn new(z: Vec3, y: Vec3) -> Self {
        let z = unit(z);
        let x = unit(cross(y, z));
        Self([x, cross(z, x), z])
    }

    pub fn local(&self, v: Vec3) -> Vec3 {
        self.0.map(|axis| dot(axis, v))
    }

    pub fn world(&self, v: Vec3) -> Vec3 {
        let [x, y, z] = self.0;
        add(add(scale(x, v[0]), scale(y, v[1])), scale(z, v[2]))
    }
}
