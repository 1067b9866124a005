//! The pair on its way to the device: images of whole 8-bit levels go up in one word a pixel, and the device takes these apart.

use super::shader::Kernel;
use super::steps::{Job, Recorder};
use crate::error::Result;
use crate::plan::Plan;

const SHADER: &str = include_str!("../../../shaders/upload.wgsl");

pub(super) fn jobs(_: &Plan) -> Vec<Job> {
    vec![Job::new::<()>(Kernel::new("upload", "main", SHADER), 0)]
}

/// Takes the words of the pair apart. They are in the spare maps, which no stage needs before.
pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, l) = (r.buffers, r.params());
    r.rows(&jobs(r.plan)[0], &(), l.width, |rows| {
        vec![
            (1, b.spare_disparity.bind(rows)),
            (2, b.spare_flags.bind(rows)),
            (3, b.left.bind(rows)),
            (4, b.right.bind(rows)),
        ]
    })
}
