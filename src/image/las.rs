//! Point clouds as LAS and LAZ files, for PDAL, QGIS and photogrammetry: the feature `las`.

use std::io::Cursor;

use las::point::{Classification, Format};
use las::{Color, Header, Transform, Vector};

use super::cloud::{Cloud, Point};

/// A cloud as LAS, or as LAZ if `compressed`. Intensity is 257 times the confidence.
///
/// # Errors
/// The reason, for a cloud that the format cannot hold.
pub(super) fn encode(cloud: &Cloud, compressed: bool) -> Result<Vec<u8>, String> {
    // A LAS writer with too many points panics when it is dropped.
    if u32::try_from(cloud.points.len()).is_err() {
        return Err("LAS 1.2 holds at most 4294967295 points; write PLY".into());
    }
    encoded(cloud, compressed).map_err(|error| error.to_string())
}

/// LAS 1.2, the oldest version with colours, for the widest support.
fn encoded(cloud: &Cloud, compressed: bool) -> las::Result<Vec<u8>> {
    let transform = Transform { scale: scale(&cloud.points), offset: 0.0 };
    let mut header = las::Builder::from((1, 2));
    header.point_format = Format { is_compressed: compressed, ..Format::new(2)? };
    header.transforms = Vector { x: transform, y: transform, z: transform };
    header.system_identifier = "OTHER".into();
    header.generating_software = concat!("mrfgs ", env!("CARGO_PKG_VERSION")).into();
    // The standard record for text.
    header.vlrs.push(las::Vlr {
        user_id: "LASF_Spec".into(),
        record_id: 3,
        description: "Text Area Description".into(),
        data: format!("{}; intensity is the confidence times 257\0", cloud.about()).into_bytes(),
    });
    let header: Header = header.into_header()?;
    let mut writer = las::Writer::new(Cursor::new(Vec::new()), header)?;
    for &Point { position, colour, confidence } in &cloud.points {
        // Use the stored coordinates, so that the bounds in the header match them.
        let stored = |v: f32| transform.inverse(f64::from(v)).map(|steps| transform.direct(steps));
        let [x, y, z] = position.map(stored);
        let (x, y, z) = (x?, y?, z?);
        // Scale 8-bit levels to 16 bits, as the standard requires.
        let [red, green, blue] = colour.map(|level| u16::from(level) * 257);
        writer.write_point(las::Point {
            x,
            y,
            z,
            intensity: u16::from(confidence) * 257,
            return_number: 1,
            number_of_returns: 1,
            classification: Classification::Unclassified,
            color: Some(Color { red, green, blue }),
            ..las::Point::default()
        })?;
    }
    Ok(writer.into_inner()?.into_inner())
}

/// The step of coordinates: the largest power of ten up to a millionth of the distance of the nearest point,
/// or the smallest with which 32 bits reach the farthest point. A millionth is far below the precision of a
/// match, whose depth changes by 1/d of itself per pixel of disparity d.
fn scale(points: &[Point]) -> f64 {
    let powers = || (-60..=60).map(|n| if n < 0 { 1.0 / 10_f64.powi(-n) } else { 10_f64.powi(n) });
    let far = points.iter().flat_map(|p| p.position).fold(0.0, |far: f64, v| far.max(f64::from(v).abs()));
    let squared = |p: &Point| p.position.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>();
    let near = points.iter().map(squared).fold(f64::INFINITY, f64::min).sqrt();
    let fine = powers().take_while(|step| *step <= 1e-6 * near).last();
    let coarse = powers().find(|step| step * f64::from(i32::MAX) >= far);
    match (fine, coarse) {
        (Some(fine), Some(coarse)) if !points.is_empty() => fine.max(coarse),
        // No points, or no finite positions.
        _ => 0.001,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cloud(positions: &[[f32; 3]]) -> Vec<Point> {
        positions.iter().map(|&position| Point { position, colour: [0; 3], confidence: 0 }).collect()
    }

    #[test]
    fn steps_are_fine_and_reach_all_points() {
        let same = |positions: &[[f32; 3]], step: f64| {
            let found = scale(&cloud(positions));
            assert!((found / step - 1.0).abs() < 1e-12, "{found} and not {step}");
        };
        same(&[], 0.001);
        // A millionth of 3 m, and of 3000 mm.
        same(&[[0.0, 0.0, 3.0], [-9.0, 2.0, 40.0]], 1e-6);
        same(&[[0.0, 0.0, 3000.0]], 1e-3);
        // A point near infinity makes the steps coarser.
        same(&[[0.0, 0.0, 3.0], [0.0, -1e6, 2.0]], 1e-3);
        same(&[[0.0, 0.0, 3.0], [0.0, 0.0, 2.1e3]], 1e-6);
        same(&[[0.0, 0.0, 3.0], [0.0, 0.0, 2.2e3]], 1e-5);
    }

    #[test]
    fn points_at_infinity_are_refused() {
        let points = cloud(&[[0.0, 0.0, f32::INFINITY]]);
        assert!(encode(&Cloud { points, ..Cloud::default() }, false).is_err());
        assert!(encode(&Cloud::default(), true).is_ok());
    }
}
