//! Wide lens models: the image radius of a point of the plane z = 1 at the distance `tangent` from the axis.

/// The angle times a polynomial of its square, k1 to k4, and its derivative by the angle (Kannala and Brandt).
pub(super) fn equidistant([k1, k2, k3, k4]: [f64; 4], angle: f64) -> [f64; 2] {
    let a2 = angle * angle;
    let radius = angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))));
    [radius, 1.0 + a2 * (3.0 * k1 + a2 * (5.0 * k2 + a2 * (7.0 * k3 + a2 * 9.0 * k4)))]
}

/// A unit sphere around the camera, seen from `xi` behind its centre (Mei and Rives).
pub(super) fn unified(xi: f64, tangent: f64) -> f64 {
    tangent / (1.0 + xi * (tangent * tangent + 1.0).sqrt())
}

/// Two unit spheres, `xi` apart, seen through the unified model of `alpha` (Usenko, Demmel and Cremers).
pub(super) fn double_sphere(xi: f64, alpha: f64, tangent: f64) -> f64 {
    let r2 = tangent * tangent;
    let z = xi * (r2 + 1.0).sqrt() + 1.0;
    tangent / (alpha * (r2 + z * z).sqrt() + (1.0 - alpha) * z)
}

/// An ellipsoid instead of the sphere (Khomutenko, Garcia and Martinet).
pub(super) fn extended_unified(alpha: f64, beta: f64, tangent: f64) -> f64 {
    tangent / (alpha * (beta * tangent * tangent + 1.0).sqrt() + 1.0 - alpha)
}

/// The radius is the angle, up to the one parameter of the field of view (Devernay and Faugeras).
pub(super) fn field_of_view(w: f64, tangent: f64) -> f64 {
    libm::atan(2.0 * tangent * libm::tan(w / 2.0)) / w
}
