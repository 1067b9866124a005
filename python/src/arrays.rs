//! Arrays of any layout, byte order and masking, as images and masks of the crate `mrfgs`.

use std::borrow::Cow;

use mrfgs::image::Plane;
use mrfgs::image::raster::{Raster, Samples};
use numpy::{
    Element, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyMemoryError, PyTypeError, PyValueError};
use pyo3::prelude::*;

/// What is given for `name` as an array, in the byte order of this machine and aligned; copied where it is not. A masked array
/// stays one.
fn array<'py>(name: &str, given: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyUntypedArray>> {
    let numpy = given.py().import("numpy")?;
    let wrong = |_| PyTypeError::new_err(format!("{name}: give a numpy array"));
    let array = numpy.call_method1("asanyarray", (given,)).map_err(wrong)?;
    let array = array
        .cast_into::<PyUntypedArray>()
        .map_err(|_| PyTypeError::new_err(format!("{name}: give a numpy array")))?;
    let aligned: bool = array.getattr("flags")?.getattr("aligned")?.extract()?;
    let native = array.dtype().is_native_byteorder() != Some(false);
    if aligned && native {
        return Ok(array);
    }
    let dtype = array.dtype().call_method1("newbyteorder", ("=",))?;
    Ok(array.call_method1("astype", (dtype,))?.cast_into()?)
}

/// The values of an array, row by row: borrowed where they lie so, else copied.
fn values<'a, T: Element + Copy>(name: &str, array: &'a PyReadonlyArrayDyn<T>) -> PyResult<Cow<'a, [T]>> {
    // A slice has the order of the memory, which is that of the rows in C-ordered arrays alone.
    if array.is_c_contiguous()
        && let Ok(slice) = array.as_slice()
    {
        return Ok(Cow::Borrowed(slice));
    }
    // A broadcast array may be far larger than what it takes.
    let mut copy = Vec::new();
    let lacking = |_| {
        let gib = array.len() as f64 * size_of::<T>() as f64 / f64::from(1 << 30);
        PyMemoryError::new_err(format!("{name}: a copy of {gib:.1} GiB cannot be had; give a smaller image"))
    };
    copy.try_reserve_exact(array.len()).map_err(lacking)?;
    copy.extend(array.as_array().iter().copied());
    Ok(copy.into())
}

/// An image in an array, kept alive and unchanged while it is read.
pub(crate) struct Image<'py> {
    name: &'static str,
    pixels: Pixels<'py>,
    /// Where a masked array is masked.
    masked: Option<Plane<bool>>,
}

enum Pixels<'py> {
    Byte(PyReadonlyArrayDyn<'py, u8>),
    Word(PyReadonlyArrayDyn<'py, u16>),
    Float(PyReadonlyArrayDyn<'py, f32>),
    Double(PyReadonlyArrayDyn<'py, f64>),
}

impl<'py> Image<'py> {
    pub(crate) fn of(name: &'static str, given: &Bound<'py, PyAny>) -> PyResult<Self> {
        let array = array(name, given)?;
        let masked = masked(name, &array)?;
        let of_kind = |array: &Bound<'py, PyUntypedArray>| {
            let array = array.as_any();
            fn readonly<'py, T: Element>(array: &Bound<'py, PyAny>) -> Option<PyReadonlyArrayDyn<'py, T>> {
                array.cast::<PyArrayDyn<T>>().ok().map(|array| array.readonly())
            }
            readonly(array)
                .map(Pixels::Byte)
                .or_else(|| readonly(array).map(Pixels::Word))
                .or_else(|| readonly(array).map(Pixels::Float))
                .or_else(|| readonly(array).map(Pixels::Double))
        };
        let pixels = of_kind(&array).ok_or_else(|| {
            let kind = array.dtype().to_string();
            PyTypeError::new_err(format!(
                "{name}: give an array of uint8, uint16, float32 or float64, not {kind}"
            ))
        })?;
        Ok(Self { name, pixels, masked })
    }

    pub(crate) fn raster(&self) -> PyResult<Raster<'_>> {
        let name = self.name;
        let (shape, samples) = match &self.pixels {
            Pixels::Byte(a) => (a.shape(), Samples::Byte(values(name, a)?)),
            Pixels::Word(a) => (a.shape(), Samples::Word(values(name, a)?)),
            Pixels::Float(a) => (a.shape(), Samples::Float(values(name, a)?)),
            Pixels::Double(a) => (a.shape(), Samples::Double(values(name, a)?)),
        };
        let (height, width, channels) = match *shape {
            [height, width] => (height, width, 1),
            [height, width, channels] => (height, width, channels),
            _ => {
                let reason =
                    format!("{name}: give an array of shape (height, width) or (height, width, channels)");
                return Err(PyValueError::new_err(reason));
            }
        };
        let raster = Raster::new(width, height, channels, samples);
        let raster = raster.and_then(|raster| match &self.masked {
            Some(masked) => raster.masked_by(masked.clone()),
            None => Ok(raster),
        });
        raster.map_err(|error| PyValueError::new_err(format!("{name}: {error}")))
    }
}

/// Where a masked array is masked, in any of its channels; `None` for other arrays.
fn masked(name: &str, array: &Bound<PyUntypedArray>) -> PyResult<Option<Plane<bool>>> {
    let numpy = array.py().import("numpy")?;
    let ma = numpy.getattr("ma")?;
    if !array.is_instance(&ma.getattr("MaskedArray")?)? {
        return Ok(None);
    }
    let mut mask = ma.call_method1("getmaskarray", (array,))?;
    if array.ndim() == 3 {
        mask = mask.call_method1("any", (2,))?;
    }
    plane(name, &mask).map(Some)
}

/// A mask: where an array of shape (height, width) is not 0.
pub(crate) fn mask(given: &Bound<PyAny>) -> PyResult<Plane<bool>> {
    let array = array("mask", given)?;
    let kind: char = array.dtype().getattr("kind")?.extract()?;
    if !"biuf".contains(kind) {
        return Err(PyTypeError::new_err(
            "mask: give an array of bool, or of numbers that are 0 where pixels count",
        ));
    }
    plane("mask", &array.call_method1("astype", ("bool",))?)
}

fn plane(name: &str, mask: &Bound<PyAny>) -> PyResult<Plane<bool>> {
    let mask = mask.cast::<PyArrayDyn<bool>>()?.readonly();
    match *mask.shape() {
        [height, width] => Ok(Plane::new(width, height, values(name, &mask)?.into_owned())),
        _ => Err(PyValueError::new_err(format!("{name}: give an array of shape (height, width)"))),
    }
}
