//! Where the pixels of an image lie on the ground.

use std::fmt;
use std::sync::Arc;

use tiff::tags::{Tag, Type};

/// Where the pixels of an image lie on the ground: the tags of GeoTIFF, which are copied and not interpreted. Clones share them.
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

/// Prints only the tags: a grid of tie points would fill a log.
impl fmt::Debug for Georeference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Georeference")
            .field(&self.fields.iter().map(|field| field.tag).collect::<Vec<_>>())
            .finish()
    }
}
