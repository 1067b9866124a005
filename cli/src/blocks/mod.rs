//! Large pairs in blocks: a folder with a file for each matched block, from which all outputs are joined.

mod folder;
mod joined;
mod stored;

pub(crate) use folder::{BlockFiles, BlockFolder, Fingerprint, Known};
pub(crate) use joined::Bands;
pub(crate) use stored::BlockRecord;
