//! The position of the pixels of an image on the ground.

use std::fmt;
use std::sync::Arc;

use tiff::tags::{Tag, Type};

/// 92 numbers: two errors, offsets and scales of line, sample, latitude, longitude and height, and four times 20 coefficients.
pub(super) const RATIONAL_POLYNOMIALS: Tag = Tag::Unknown(50_844);

/// The position of an image's pixels on the ground: the tags of GeoTIFF, with rational polynomials. Tags are
/// copied; only the position of the first pixel is interpreted. Clones share them.
#[derive(Clone, PartialEq, Eq)]
pub struct Georeference {
    pub(super) fields: Arc<[Field]>,
}

/// A tag of GeoTIFF.
#[derive(Clone, PartialEq, Eq)]
pub(super) struct Field {
    pub(super) tag: Tag,
    pub(super) kind: Type,
    /// The values, in the byte order of the machine.
    pub(super) bytes: Vec<u8>,
}

impl Georeference {
    /// The georeference of the part of the image whose first pixel is (x, y).
    pub(super) fn moved(&self, x: usize, y: usize) -> Self {
        let fields = self.fields.iter().map(|field| field.moved(x as f64, y as f64));
        Self { fields: fields.collect() }
    }
}

impl Field {
    fn moved(&self, x: f64, y: f64) -> Self {
        let mut field = self.clone();
        if self.kind != Type::DOUBLE {
            return field;
        }
        let mut values: Vec<f64> = bytemuck::pod_collect_to_vec(&self.bytes);
        match self.tag {
            // Column, row and height of a pixel, and its position on the ground.
            Tag::ModelTiepointTag => values.chunks_exact_mut(6).for_each(|tie| {
                tie[0] -= x;
                tie[1] -= y;
            }),
            // A matrix, row by row.
            Tag::ModelTransformationTag if values.len() == 16 => {
                values.chunks_exact_mut(4).for_each(|row| row[3] += row[0] * x + row[1] * y);
            }
            RATIONAL_POLYNOMIALS if values.len() == 92 => {
                values[2] -= y;
                values[3] -= x;
            }
            _ => return field,
        }
        field.bytes = bytemuck::cast_slice(&values).to_vec();
        field
    }
}

/// Prints only the tags: a grid of tie points would fill a log.
impl fmt::Debug for Georeference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Georeference")
            .field(&self.fields.iter().map(|field| field.tag).collect::<Vec<_>>())
            .finish()
    }
}
