//! Conversion between numpy arrays of any layout, byte order and masking and the crate's images, maps and masks.

use std::borrow::Cow;

use mrfgs::calibration::matrix::Matrix;
use mrfgs::image::raster::{Raster, Samples};
use mrfgs::image::{self, Pair, Plane};
use numpy::{
    Element, IntoPyArray, PyArray2, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn,
    PyUntypedArray, PyUntypedArrayMethods, ToPyArray,
};
use pyo3::exceptions::{PyMemoryError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyString, PyTuple};

use crate::exceptions::{self, exception};

/// The argument `name` as an aligned array in native byte order, copied if necessary. A masked array stays one.
fn array<'py>(name: &str, given: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyUntypedArray>> {
    let (py, numpy) = (given.py(), given.py().import("numpy")?);
    if is_path(given)? {
        return Err(PyTypeError::new_err(format!(
            "{name}: give a numpy array, not the path of a file; read images with mrfgs.read_image and maps with mrfgs.read_disparity"
        )));
    }
    let wrong = || PyTypeError::new_err(format!("{name}: give a numpy array"));
    // Some libraries offer their arrays only through this protocol.
    let by_dlpack = given.hasattr("__dlpack__")? && !given.hasattr("__array__")?;
    let array = numpy.call_method1(if by_dlpack { "from_dlpack" } else { "asanyarray" }, (given,));
    let array = array.map_err(|error| exceptions::instead(py, error, wrong()))?;
    let mut array = array.cast_into::<PyUntypedArray>().map_err(|_| wrong())?;
    // Single precision represents every half-precision value exactly.
    if (array.dtype().kind(), array.dtype().itemsize()) == (b'f', 2) {
        array = array.call_method1("astype", ("float32",))?.cast_into()?;
    }
    let aligned: bool = array.getattr("flags")?.getattr("aligned")?.extract()?;
    let native = array.dtype().is_native_byteorder() != Some(false);
    if aligned && native {
        return Ok(array);
    }
    let dtype = array.dtype().call_method1("newbyteorder", ("=",))?;
    Ok(array.call_method1("astype", (dtype,))?.cast_into()?)
}

/// Whether a path was given instead of an array.
fn is_path(given: &Bound<PyAny>) -> PyResult<bool> {
    Ok(given.is_instance_of::<PyString>()
        || given.is_instance_of::<PyBytes>()
        || given.hasattr("__fspath__")?)
}

/// The values of an array, row by row; borrowed if they are contiguous, else copied.
fn values<'a, T: Element + Copy>(name: &str, array: &'a PyReadonlyArrayDyn<T>) -> PyResult<Cow<'a, [T]>> {
    // A slice follows memory order, which is row order only in C-contiguous arrays.
    if array.is_c_contiguous()
        && let Ok(slice) = array.as_slice()
    {
        return Ok(Cow::Borrowed(slice));
    }
    // A broadcast array may be far larger than its memory.
    let mut copy = Vec::new();
    let lacking = |_| {
        let gib = array.len() as f64 * size_of::<T>() as f64 / f64::from(1 << 30);
        PyMemoryError::new_err(format!(
            "{name}: cannot allocate a copy of {gib:.1} GiB; give a smaller image"
        ))
    };
    copy.try_reserve_exact(array.len()).map_err(lacking)?;
    copy.extend(array.as_array().iter().copied());
    Ok(copy.into())
}

/// An image in an array, kept alive and unchanged while it is read.
pub(crate) struct Image<'py> {
    name: &'static str,
    pixels: Pixels<'py>,
    /// Whether the number of bits was derived from the values instead of the type.
    by_values: bool,
    /// Where a masked array is masked.
    masked: Option<Plane<bool>>,
}

enum Pixels<'py> {
    Byte(PyReadonlyArrayDyn<'py, u8>),
    Word(PyReadonlyArrayDyn<'py, u16>),
    Float(PyReadonlyArrayDyn<'py, f32>),
    Double(PyReadonlyArrayDyn<'py, f64>),
}

impl<'py> Pixels<'py> {
    /// Converts integers of other types, as numpy arithmetic gives for images: to bytes if all values fit, else to words.
    fn by_values(name: &str, array: &Bound<'py, PyUntypedArray>) -> PyResult<Self> {
        let kind: char = array.dtype().getattr("kind")?.extract()?;
        if !"iu".contains(kind) {
            let kind = array.dtype().to_string();
            return Err(PyTypeError::new_err(format!(
                "{name}: give an array of integers, float16, float32 or float64, not {kind}; convert it with astype"
            )));
        }
        // Masked values may be anything.
        let array = if array.hasattr("filled")? {
            array.call_method1("filled", (0,))?
        } else {
            array.as_any().clone()
        };
        let keywords = PyDict::new(array.py());
        keywords.set_item("initial", 0)?;
        let [least, most] = ["min", "max"].map(|end| array.call_method(end, (), Some(&keywords)));
        let (least, most) = (least?, most?);
        let wrong = if least.lt(0)? {
            Some(least)
        } else {
            Some(most.clone()).filter(|_| most.gt(65535).is_ok_and(|v| v))
        };
        if let Some(value) = wrong {
            let kind = array.getattr("dtype")?.to_string();
            return Err(PyValueError::new_err(format!(
                "{name}: is {kind} and contains {value}; integers must be 0 to 255 or 0 to 65535: convert them, for example with \
                 {name}.astype(numpy.float32), or a masked array"
            )));
        }
        if most.gt(255)? { Self::word(&array) } else { converted(&array, "uint8").map(Self::Byte) }
    }

    fn word(array: &Bound<'py, PyAny>) -> PyResult<Self> {
        converted(array, "uint16").map(Self::Word)
    }
}

/// Converts numbers that fit to another type.
fn converted<'py, T: Element>(array: &Bound<'py, PyAny>, kind: &str) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    Ok(array.call_method1("astype", (kind,))?.cast_into::<PyArrayDyn<T>>()?.readonly())
}

/// The array for reading, if its elements have this type.
fn readonly<'py, T: Element>(array: &Bound<'py, PyUntypedArray>) -> Option<PyReadonlyArrayDyn<'py, T>> {
    array.as_any().cast::<PyArrayDyn<T>>().ok().map(|array| array.readonly())
}

impl<'py> Image<'py> {
    pub(crate) fn of(name: &'static str, given: &Bound<'py, PyAny>) -> PyResult<Self> {
        if given.is_none() {
            return Err(PyTypeError::new_err(format!(
                "{name}: is None, as OpenCV returns for a file that it cannot read; check the name of the file"
            )));
        }
        let array = array(name, given)?;
        let masked = masked(name, &array)?;
        let by_type = readonly(&array)
            .map(Pixels::Byte)
            .or_else(|| readonly(&array).map(Pixels::Word))
            .or_else(|| readonly(&array).map(Pixels::Float))
            .or_else(|| readonly(&array).map(Pixels::Double));
        let by_values = by_type.is_none();
        let pixels = by_type.map_or_else(|| Pixels::by_values(name, &array), Ok)?;
        Ok(Self { name, pixels, by_values, masked })
    }

    /// Both views. If one was converted by its values and the other has 16 bits, it gets 16 bits as well.
    pub(crate) fn both(left: &Bound<'py, PyAny>, right: &Bound<'py, PyAny>) -> PyResult<[Self; 2]> {
        let mut views = [Self::of("left", left)?, Self::of("right", right)?];
        if views.iter().any(|view| matches!(view.pixels, Pixels::Word(_))) {
            for view in &mut views {
                if let Pixels::Byte(bytes) = &view.pixels
                    && view.by_values
                {
                    view.pixels = Pixels::word(bytes.as_any())?;
                }
            }
        }
        Ok(views)
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
            [1..=4, height, width] if width > 4 => {
                return Err(PyValueError::new_err(format!(
                    "{name}: has the shape {}, with channels first: give (height, width, channels), for example \
                     numpy.moveaxis({name}, 0, -1), which has {height} rows of {width} pixels",
                    shown(shape)
                )));
            }
            [height, width, channels] => (height, width, channels),
            _ => {
                return Err(PyValueError::new_err(format!(
                    "{name}: give an array of shape (height, width) or (height, width, channels), not {}",
                    shown(shape)
                )));
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

impl Image<'_> {
    /// The array format of its rectified image: one channel or three, and 8 bits if both images have 8.
    pub(crate) fn stored(&self, other: &Self) -> Stored {
        let shape = match &self.pixels {
            Pixels::Byte(a) => a.shape(),
            Pixels::Word(a) => a.shape(),
            Pixels::Float(a) => a.shape(),
            Pixels::Double(a) => a.shape(),
        };
        let bytes = [self, other].iter().all(|image| matches!(image.pixels, Pixels::Byte(_)));
        Stored { channels: if matches!(shape, [_, _, channels] if *channels > 2) { 3 } else { 1 }, bytes }
    }
}

/// The pair of two images, without the pixels of a mask or a no-data value.
pub(crate) fn pair(
    left: &Image,
    right: &Image,
    mask: Option<&Bound<PyAny>>,
    no_data: Option<f64>,
) -> PyResult<Pair> {
    let [left, right] = rasters(left, right, mask, no_data)?;
    Pair::of_frames(left, right).map_err(exception)
}

/// The pair of two raw images, which may differ in size.
pub(crate) fn raw_pair(
    left: &Image,
    right: &Image,
    mask: Option<&Bound<PyAny>>,
    no_data: Option<f64>,
) -> PyResult<Pair> {
    let [left, right] = rasters(left, right, mask, no_data)?;
    Pair::of_raw_frames(left, right).map_err(exception)
}

fn rasters<'a>(
    left: &'a Image,
    right: &'a Image,
    mask: Option<&Bound<PyAny>>,
    no_data: Option<f64>,
) -> PyResult<[Raster<'a>; 2]> {
    let mask = mask.map(self::mask).transpose()?;
    let rasters = [left.raster()?, right.raster()?].map(|raster| match no_data {
        Some(value) => raster.without(value),
        None => Ok(raster),
    });
    let [left, right] = rasters;
    let left = match mask {
        Some(mask) => left.and_then(|left| left.masked_by(mask)),
        None => left,
    };
    left.and_then(|left| Ok([left, right?])).map_err(exception)
}

/// The array format of an image.
#[derive(Clone, Copy)]
pub(crate) struct Stored {
    channels: usize,
    bytes: bool,
}

impl Stored {
    /// Three channels, of 8 bits if `bytes`.
    pub(crate) fn colours(bytes: bool) -> Self {
        Self { channels: 3, bytes }
    }
}

/// The images of a pair as masked arrays. Images of more than 8 bits are scaled so that `match` reads the same levels from them.
pub(crate) fn images<'py>(
    py: Python<'py>,
    pair: &Pair,
    stored: [Stored; 2],
) -> PyResult<[Bound<'py, PyAny>; 2]> {
    let images = [pair.left(), pair.right()];
    let levels =
        images.iter().all(|image| image.pixels.data().iter().all(|pixel| pixel.iter().all(|v| v % 256 == 0)));
    let word = |v: u16| if levels { (v >> 8) * 257 } else { v };
    let [left, right] = [0, 1].map(|i| {
        let (image, Stored { channels, bytes }) = (images[i], stored[i]);
        if bytes {
            masked_array(py, image, channels, |v| (v >> 8) as u8)
        } else {
            masked_array(py, image, channels, word)
        }
    });
    Ok([left?, right?])
}

fn masked_array<'py, T: Element>(
    py: Python<'py>,
    image: &image::Image,
    channels: usize,
    value: impl Fn(u16) -> T,
) -> PyResult<Bound<'py, PyAny>> {
    let (width, height) = image.pixels.size();
    let values = image.pixels.data().iter().flat_map(|pixel| pixel[..channels].iter().map(|v| value(*v)));
    let masked = image.masked.data().iter().flat_map(|masked| std::iter::repeat_n(*masked, channels));
    let shape = if channels == 1 { vec![height, width] } else { vec![height, width, channels] };
    let values = values.collect::<Vec<_>>().into_pyarray(py).reshape(shape.clone())?;
    let masked = masked.collect::<Vec<_>>().into_pyarray(py).reshape(shape)?;
    py.import("numpy")?.getattr("ma")?.call_method1("masked_array", (values, masked))
}

/// An image as stored in its file: of shape (height, width) or (height, width, channels), a masked array if it has no-data pixels.
pub(crate) fn stored<'py>(py: Python<'py>, raster: &Raster) -> PyResult<Bound<'py, PyAny>> {
    let ((width, height), channels) = (raster.size(), raster.channels());
    let shape = if channels == 1 { vec![height, width] } else { vec![height, width, channels] };
    let values = match raster.samples() {
        Samples::Byte(v) => v.to_pyarray(py).reshape(shape.clone())?.into_any(),
        Samples::Word(v) => v.to_pyarray(py).reshape(shape.clone())?.into_any(),
        Samples::Float(v) => v.to_pyarray(py).reshape(shape.clone())?.into_any(),
        Samples::Double(v) => v.to_pyarray(py).reshape(shape.clone())?.into_any(),
    };
    let Some(no_data) = raster.no_data() else { return Ok(values) };
    let masked: Vec<bool> = no_data.iter().flat_map(|v| std::iter::repeat_n(*v, channels)).collect();
    let masked = masked.into_pyarray(py).reshape(shape)?;
    py.import("numpy")?.getattr("ma")?.call_method1("masked_array", (values, masked))
}

/// A map as an array of shape (height, width).
pub(crate) fn map<T: Element>(py: Python, plane: Plane<T>) -> PyResult<Bound<PyArray2<T>>> {
    let shape = [plane.height(), plane.width()];
    plane.into_data().into_pyarray(py).reshape(shape)
}

/// The matrices of both views as float64 arrays.
pub(crate) fn matrices<'py>(py: Python<'py>, both: &[Matrix; 2]) -> PyResult<Bound<'py, PyTuple>> {
    let matrix = |matrix: &Matrix| {
        let rows: Vec<Vec<f64>> = matrix.iter().map(|row| row.to_vec()).collect();
        PyArray2::from_vec2(py, &rows)
    };
    PyTuple::new(py, [matrix(&both[0])?, matrix(&both[1])?])
}

/// A disparity map; masked values become infinite.
pub(crate) fn disparities(name: &str, given: &Bound<PyAny>) -> PyResult<Plane<f32>> {
    let array = array(name, given)?;
    let masked = masked(name, &array)?;
    let plane = if let Ok(array) = array.as_any().cast::<PyArrayDyn<f32>>() {
        self::plane(name, &array.readonly())?
    } else if let Ok(array) = array.as_any().cast::<PyArrayDyn<f64>>() {
        self::plane(name, &array.readonly())?.map(|d| *d as f32)
    } else {
        let kind = array.dtype().to_string();
        return Err(PyTypeError::new_err(format!(
            "{name}: give an array of float16, float32 or float64, in pixels, not {kind}; divide integers by their scale"
        )));
    };
    let Some(masked) = masked else { return Ok(plane) };
    let (width, height) = plane.size();
    Ok(Plane::from_fn(width, height, |x, y| if masked[(x, y)] { f32::INFINITY } else { plane[(x, y)] }))
}

/// An 8-bit map.
pub(crate) fn bytes(name: &str, given: &Bound<PyAny>) -> PyResult<Plane<u8>> {
    let array = array(name, given)?;
    match array.as_any().cast::<PyArrayDyn<u8>>() {
        Ok(array) => plane(name, &array.readonly()),
        Err(_) => {
            let kind = array.dtype().to_string();
            Err(PyTypeError::new_err(format!("{name}: give an array of uint8, not {kind}")))
        }
    }
}

/// A visibility mask as in files: 255 where both views see a pixel.
pub(crate) fn visible(given: &Bound<PyAny>) -> PyResult<Plane<u8>> {
    const EXPECTED: &str = "mask: give an array of bool, or of uint8 with 255 where both views see the pixel";
    let array = array("mask", given)?;
    if let Ok(array) = array.as_any().cast::<PyArrayDyn<bool>>() {
        return Ok(plane("mask", &array.readonly())?.map(|seen| if *seen { 255 } else { 0 }));
    }
    let array = array.as_any().cast::<PyArrayDyn<u8>>().map_err(|_| PyTypeError::new_err(EXPECTED))?;
    let mask = plane("mask", &array.readonly())?;
    // A mask of zeros and ones would silently leave no pixel.
    if mask.data().iter().max() == Some(&1) {
        return Err(PyValueError::new_err(format!("{EXPECTED}; this one has at most 1")));
    }
    Ok(mask)
}

/// The values of an array, row by row, of shape (N,) or (N, `columns`). `expected` describes it in errors.
pub(crate) fn table<T: Element + Copy>(
    name: &str,
    given: &Bound<PyAny>,
    columns: Option<usize>,
    expected: &str,
) -> PyResult<Vec<T>> {
    let wrong = || PyTypeError::new_err(format!("{name}: give an array of {expected}"));
    let array = array(name, given)?;
    let array = array.as_any().cast::<PyArrayDyn<T>>().map_err(|_| wrong())?.readonly();
    match (array.shape(), columns) {
        ([_], None) => {}
        ([_, found], Some(columns)) if *found == columns => {}
        _ => return Err(PyValueError::new_err(format!("{name}: give an array of {expected}"))),
    }
    Ok(values(name, &array)?.into_owned())
}

/// Where a masked array is masked, in any channel; `None` for other arrays.
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
    flags(name, &mask).map(Some)
}

/// A mask of shape (height, width), set where the array is not 0.
pub(crate) fn mask(given: &Bound<PyAny>) -> PyResult<Plane<bool>> {
    let array = array("mask", given)?;
    let kind: char = array.dtype().getattr("kind")?.extract()?;
    if !"biuf".contains(kind) {
        return Err(PyTypeError::new_err(
            "mask: give an array of bool, or of numbers that are 0 for valid pixels",
        ));
    }
    flags("mask", &array.call_method1("astype", ("bool",))?)
}

fn flags(name: &str, mask: &Bound<PyAny>) -> PyResult<Plane<bool>> {
    plane(name, &mask.cast::<PyArrayDyn<bool>>()?.readonly())
}

fn plane<T: Element + Copy>(name: &str, array: &PyReadonlyArrayDyn<T>) -> PyResult<Plane<T>> {
    match *array.shape() {
        [height, width] => Ok(Plane::new(width, height, values(name, array)?.into_owned())),
        ref shape => {
            let squeezed = shape.iter().filter(|count| **count != 1).count() == 2;
            let remedy =
                if squeezed { format!("; numpy.squeeze({name}) has that shape") } else { String::new() };
            let shape = shown(shape);
            let reason = format!("{name}: give an array of shape (height, width), not {shape}{remedy}");
            Err(PyValueError::new_err(reason))
        }
    }
}

/// A shape as numpy prints it.
fn shown(shape: &[usize]) -> String {
    let counts: Vec<_> = shape.iter().map(ToString::to_string).collect();
    format!("({}{})", counts.join(", "), if counts.len() == 1 { "," } else { "" })
}

/// Width and height, given as `size`.
pub(crate) fn size(given: &Bound<PyAny>) -> PyResult<(usize, usize)> {
    let wrong = |error| {
        let reason = PyTypeError::new_err("size: give (width, height), two integers");
        exceptions::instead(given.py(), error, reason)
    };
    let [width, height]: [i64; 2] = given.extract().map_err(wrong)?;
    let pixels = |count: i64| usize::try_from(count).ok().filter(|count| *count > 0);
    let both = pixels(width).zip(pixels(height));
    both.ok_or_else(|| PyValueError::new_err("size: give (width, height), both above 0"))
}
