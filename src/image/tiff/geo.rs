//! The georeference of a TIFF file.

use tiff::tags::{ByteOrder, Tag, Type};

use super::directory::Directory;
use crate::image::georeference::{Field, Georeference, RATIONAL_POLYNOMIALS};

/// The tags of GeoTIFF and their types, and that of the rational polynomials of satellites (GDAL's RFC 22).
const TAGS: [(Tag, Type); 7] = [
    (Tag::ModelPixelScaleTag, Type::DOUBLE),
    (Tag::ModelTiepointTag, Type::DOUBLE),
    (Tag::ModelTransformationTag, Type::DOUBLE),
    (Tag::GeoKeyDirectoryTag, Type::SHORT),
    (Tag::GeoDoubleParamsTag, Type::DOUBLE),
    (Tag::GeoAsciiParamsTag, Type::ASCII),
    (RATIONAL_POLYNOMIALS, Type::DOUBLE),
];
/// Most bytes of a tag: enough for twenty thousand tie points.
const MAX_BYTES: usize = 1 << 20;

/// The georeference that the directory declares. It is dropped if a tag has another type, no value, more than
/// [`MAX_BYTES`] bytes, or leaves the file: the remaining tags would place the image elsewhere.
pub(super) fn georeference(directory: &Directory) -> Option<Georeference> {
    let there = TAGS.iter().filter(|(tag, _)| directory.has(*tag));
    let fields: Vec<Field> = there.map(|&(tag, kind)| field(directory, tag, kind)).collect::<Option<_>>()?;
    (!fields.is_empty()).then(|| Georeference { fields: fields.into() })
}

fn field(directory: &Directory, tag: Tag, kind: Type) -> Option<Field> {
    let (stored, values) = directory.values(tag).ok()??;
    if stored != kind.to_u16() || values.is_empty() || values.len() > MAX_BYTES {
        return None;
    }
    let mut bytes = values.into_owned();
    directory.order.convert(kind, &mut bytes, ByteOrder::native());
    Some(Field { tag, kind, bytes })
}
