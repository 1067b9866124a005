//! The Python module `mrfgs._mrfgs`: arrays in, arrays out, with the crate `mrfgs` in between.

mod arrays;
mod blocks;
mod calibration;
mod depth;
mod drift;
mod evaluation;
mod exceptions;
mod files;
mod matched;
mod matcher;
mod options;
mod prior;
mod range;
mod rectification;
mod sequence;
mod steady;
mod third;
mod words;

use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;

#[pymodule]
fn _mrfgs(module: &Bound<PyModule>) -> PyResult<()> {
    // Import numpy now: the crate `numpy` imports it on first use and panics if Ctrl-C interrupts that. numpy.ma too, as Python 3.9 and
    // 3.10 exit if Ctrl-C interrupts a first import, even if it is caught.
    module.py().import("numpy.ma")?;
    let _ = PyArray1::<u8>::zeros(module.py(), 0, false).readonly();
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("MatchWarning", module.py().get_type::<exceptions::MatchWarning>())?;
    module.add_function(wrap_pyfunction!(matcher::match_, module)?)?;
    module.add_function(wrap_pyfunction!(options::options, module)?)?;
    module.add_function(wrap_pyfunction!(options::presets, module)?)?;
    module.add_function(wrap_pyfunction!(evaluation::evaluate, module)?)?;
    module.add_function(wrap_pyfunction!(evaluation::read_disparity, module)?)?;
    module.add_function(wrap_pyfunction!(evaluation::read_image, module)?)?;
    module.add_class::<blocks::PyBlocks>()?;
    module.add_class::<calibration::PyCalibration>()?;
    module.add_class::<drift::PyDrift>()?;
    module.add_class::<matched::PyMatched>()?;
    module.add_class::<sequence::PyMatchedSequence>()?;
    module.add_class::<matcher::PyMatcher>()?;
    module.add_class::<files::PyPairWindows>()?;
    module.add_class::<depth::PyPoints>()?;
    module.add_class::<rectification::PyRectification>()?;
    module.add_class::<depth::PyRig>()?;
    module.add_class::<steady::PySteady>()?;
    module.add_class::<third::PyThirdCamera>()
}
