//! Bodies and their intersections with rays.

use super::paint::Paint;
use super::vector::{Basis, Vec3, add, dot, scale, sub, unit};

/// The points `from + t * along`. For a camera's ray t is the depth, because `along` has z = 1.
pub struct Ray {
    pub from: Vec3,
    pub along: Vec3,
}

impl Ray {
    pub fn at(&self, t: f64) -> Vec3 {
        add(self.from, scale(self.along, t))
    }
}

#[derive(Clone, Copy)]
pub enum Outline {
    Rectangle,
    Ellipse,
}

pub enum Shape {
    /// The part of the frame's x-y plane within `half` of the centre.
    Flat {
        half: [f64; 2],
        outline: Outline,
    },
    Sphere {
        radius: f64,
    },
    /// An open tube along the frame's z axis, `half` long to either side of the centre.
    Tube {
        radius: f64,
        half: f64,
    },
}

pub struct Body {
    shape: Shape,
    centre: Vec3,
    frame: Basis,
    /// Square of a radius that slightly exceeds the body's.
    reach: f64,
    pub paint: Paint,
    pub seed: u32,
}

impl Body {
    pub fn new(shape: Shape, centre: Vec3, frame: Basis, paint: Paint, seed: u32) -> Self {
        let reach = 1.001
            * match shape {
                Shape::Flat { half, .. } => half[0] * half[0] + half[1] * half[1],
                Shape::Sphere { radius } => radius * radius,
                Shape::Tube { radius, half } => radius * radius + half * half,
            };
        Self { shape, centre, frame, reach, paint, seed }
    }

    /// The first intersection of the ray with t > 0.
    pub fn meet(&self, ray: &Ray) -> Option<f64> {
        let from = sub(ray.from, self.centre);
        let (a, b, c) = (dot(ray.along, ray.along), dot(ray.along, from), dot(from, from));
        if b * b < a * (c - self.reach) {
            return None; // most rays miss the bounding sphere
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

    /// The surface point `p` in body coordinates, and the normal there.
    pub fn surface(&self, p: Vec3) -> (Vec3, Vec3) {
        let local = self.frame.local(sub(p, self.centre));
        let normal = match self.shape {
            Shape::Flat { .. } => return ([local[0], local[1], 0.0], self.frame.0[2]),
            Shape::Sphere { .. } => local,
            Shape::Tube { .. } => [local[0], local[1], 0.0],
        };
        (local, unit(self.frame.world(normal)))
    }
}

/// The roots of a t^2 + 2 b t + c = 0, smaller one first.
fn roots(a: f64, b: f64, c: f64) -> Option<[f64; 2]> {
    let discriminant = b * b - a * c;
    (discriminant > 0.0).then(|| {
        let root = discriminant.sqrt();
        [(-b - root) / a, (-b + root) / a]
    })
}
