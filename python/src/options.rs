//! The options of the method.

use std::path::PathBuf;

use mrfgs::options::{DeviceChoice, Execution, GROUPS, Key, Method, PRESETS, Takes, mebibytes};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyInt, PyString};

use crate::exceptions::{self, exception};

/// The method: a preset or a file, overridden by options and a memory limit.
pub(crate) fn method(
    method: Option<&Bound<PyAny>>,
    options: Option<&Bound<PyAny>>,
    memory: Option<&Bound<PyAny>>,
) -> PyResult<Method> {
    let mut found = method.map_or_else(|| Ok(Method::default()), named)?;
    let mut changes = Vec::new();
    if let Some(options) = options {
        for (key, value) in dict("options", options)? {
            let key = name("options", &key)?;
            match value.cast::<PyDict>() {
                Ok(group) => {
                    for (inner, value) in group {
                        let inner = name(&format!("options[\"{key}\"]"), &inner)?;
                        changes.push((format!("{key}.{inner}"), as_written(&value)?));
                    }
                }
                Err(_) => changes.push((key, as_written(&value)?)),
            }
        }
    }
    found.set_all(changes.iter().map(|(key, value)| (&**key, &**value))).map_err(exception)?;
    if let Some(memory) = memory {
        let text = memory.extract::<String>().map_err(|error| {
            let reason = format!("memory: give a size, such as \"2GiB\", not {}", quoted(memory));
            exceptions::instead(memory.py(), error, PyTypeError::new_err(reason))
        })?;
        found.tiles.memory =
            mebibytes(&text).map_err(|expected| PyValueError::new_err(format!("memory: {expected}")))?;
    }
    Ok(found)
}

/// The preset of this name, or the preset "default" overridden by a file.
fn named(given: &Bound<PyAny>) -> PyResult<Method> {
    let path: PathBuf = given.extract().map_err(|error| {
        let reason = "method: give the name of a preset, or the path of a TOML file";
        exceptions::instead(given.py(), error, PyTypeError::new_err(reason))
    })?;
    if let Some(preset) = PRESETS.iter().find(|preset| path.as_os_str() == preset.name) {
        return Ok(preset.method());
    }
    if path.extension().is_none_or(|extension| extension != "toml") && !path.exists() {
        let names: Vec<_> = PRESETS.iter().map(|preset| preset.name).collect();
        return Err(PyValueError::new_err(format!(
            "method: {} is neither a preset nor a file; give one of {}, or the path of a TOML file",
            quoted(given),
            names.join(", ")
        )));
    }
    let mut method = Method::default();
    method.load(&path).map_err(exception)?;
    Ok(method)
}

/// Where a match runs.
pub(crate) fn execution(
    device: Option<&Bound<PyAny>>,
    threads: Option<&Bound<PyAny>>,
) -> PyResult<Execution> {
    let device = device.map_or(Ok(DeviceChoice::Auto), self::device)?;
    let threads = threads.map(self::threads).transpose()?;
    Ok(Execution { device, threads, ..Execution::default() })
}

/// The device of this name or index.
fn device(given: &Bound<PyAny>) -> PyResult<DeviceChoice> {
    if let Ok(name) = given.cast::<PyString>() {
        return Ok((&*name.to_cow()?).into());
    }
    whole(given)
        .filter(|index| *index >= 0)
        .map(|index| DeviceChoice::Named(index.to_string()))
        .ok_or_else(|| {
            PyTypeError::new_err(format!(
                "device: give \"auto\", \"cpu\", \"gpu\", or the index of a device or part of its name, not {}",
                quoted(given)
            ))
        })
}

/// The number of threads; the library checks its range.
fn threads(given: &Bound<PyAny>) -> PyResult<usize> {
    let most = Execution::MOST_THREADS;
    let expected = || format!("threads: give an integer from 1 to {most}, or None, not {}", quoted(given));
    let number = whole(given).ok_or_else(|| PyTypeError::new_err(expected()))?;
    usize::try_from(number).map_err(|_| PyValueError::new_err(expected()))
}

/// Converts any integer type; `None` for other values.
fn whole(given: &Bound<PyAny>) -> Option<i64> {
    let is_number = !given.is_instance_of::<PyBool>()
        && (given.is_instance_of::<PyInt>() || given.hasattr("__index__").is_ok_and(|has| has));
    is_number.then(|| given.extract().unwrap_or(i64::MAX))
}

/// Converts the argument `argument` to a dict.
fn dict<'py>(argument: &str, given: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
    let py = given.py();
    if let Ok(dict) = given.cast::<PyDict>() {
        return Ok(dict.clone());
    }
    let dict = py.get_type::<PyDict>().call1((given,)).map_err(|error| {
        let kind = given.get_type();
        let kind = kind.name().map_or_else(|_| "that".into(), |name| name.to_string());
        let reason = format!("{argument}: give a dict, such as {{\"fill\": \"none\"}}, not {kind}");
        exceptions::instead(py, error, PyTypeError::new_err(reason))
    })?;
    Ok(dict.cast_into()?)
}

/// A key of the dict `argument`.
fn name(argument: &str, key: &Bound<PyAny>) -> PyResult<String> {
    let wrong = || {
        let reason = "keys must be names of options, such as \"fill\" (see mrfgs.options())";
        PyTypeError::new_err(format!("{argument}: {reason}, not {}", quoted(key)))
    };
    Ok(key.cast::<PyString>().map_err(|_| wrong())?.to_cow()?.into_owned())
}

/// A short one-line repr for messages.
fn quoted(given: &Bound<PyAny>) -> String {
    const MOST: usize = 60;
    let shown = given.repr().map_or_else(|_| "that".into(), |shown| shown.to_string());
    let line: String = shown.split_whitespace().collect::<Vec<_>>().join(" ");
    if line.chars().count() <= MOST { line } else { line.chars().take(MOST).chain("...".chars()).collect() }
}

/// The value of an option in the syntax of the command line.
fn as_written(value: &Bound<PyAny>) -> PyResult<String> {
    match value.extract::<bool>() {
        Ok(flag) => Ok(flag.to_string()),
        Err(_) => Ok(value.str()?.to_string()),
    }
}

/// Describes the options: a dict from each group to a dict from each key to a dict with
///
/// meaning: what it does,
/// takes: unit and range of its values,
/// words: its keywords with their meanings; empty if it has none,
/// source: the section of the paper that it comes from, or other work; "open" if the paper leaves the choice open,
/// and its value in each preset, under the preset's name.
#[pyfunction]
pub(crate) fn options(py: Python) -> PyResult<Bound<PyDict>> {
    let groups = PyDict::new(py);
    for group in GROUPS {
        let keys = PyDict::new(py);
        for key in group.keys {
            keys.set_item(key.name(), option(py, group.name, key)?)?;
        }
        groups.set_item(group.name, keys)?;
    }
    Ok(groups)
}

/// Lists the presets: a dict from each name to its purpose.
#[pyfunction]
pub(crate) fn presets(py: Python) -> PyResult<Bound<PyDict>> {
    let presets = PyDict::new(py);
    for preset in PRESETS {
        presets.set_item(preset.name, preset.about)?;
    }
    Ok(presets)
}

/// Describes an option.
fn option<'py>(py: Python<'py>, group: &str, key: &Key) -> PyResult<Bound<'py, PyDict>> {
    let (option, words) = (PyDict::new(py), PyDict::new(py));
    if let Takes::Words(all) = key.takes {
        for word in all {
            words.set_item(word.word, word.meaning)?;
        }
    }
    option.set_item("meaning", key.meaning)?;
    option.set_item("takes", key.to_string())?;
    option.set_item("words", words)?;
    option.set_item("source", key.source)?;
    for preset in PRESETS {
        match &preset.method().table()[group][key.name()] {
            toml::Value::Boolean(value) => option.set_item(preset.name, value)?,
            toml::Value::Integer(value) => option.set_item(preset.name, value)?,
            toml::Value::Float(value) => option.set_item(preset.name, value)?,
            value => option.set_item(preset.name, value.as_str())?,
        }
    }
    Ok(option)
}
