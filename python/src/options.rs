//! The options of the method.

use std::path::PathBuf;

use mrfgs::options::{DeviceChoice, Execution, GROUPS, Key, Method, PRESETS, Takes, mebibytes};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyInt, PyString};

use crate::exceptions::{self, exception};

/// The method: a preset or a file, what replaces some of its keys, and the memory.
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

/// The preset with a name, or the preset "default" with the keys of a file in the place of its own.
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
            "method: there is no preset {}, and no such file; give one of {}, or the path of a TOML file",
            quoted(given),
            names.join(", ")
        )));
    }
    let mut method = Method::default();
    method.load(&path).map_err(exception)?;
    Ok(method)
}

/// Where and how a match runs.
pub(crate) fn execution(
    device: Option<&Bound<PyAny>>,
    threads: Option<&Bound<PyAny>>,
) -> PyResult<Execution> {
    let device = device.map_or(Ok(DeviceChoice::Auto), self::device)?;
    let threads = threads.map(self::threads).transpose()?;
    Ok(Execution { device, threads, ..Execution::default() })
}

/// The device with a name or an index.
fn device(given: &Bound<PyAny>) -> PyResult<DeviceChoice> {
    if let Ok(name) = given.cast::<PyString>() {
        return Ok((&*name.to_cow()?).into());
    }
    whole(given)
        .filter(|index| *index >= 0)
        .map(|index| DeviceChoice::Named(index.to_string()))
        .ok_or_else(|| {
            PyTypeError::new_err(format!(
                "device: give \"auto\", \"cpu\", \"gpu\", or the index of a device or a part of its name, not {}",
                quoted(given)
            ))
        })
}

/// The number of threads; the library refuses those that there may not be.
fn threads(given: &Bound<PyAny>) -> PyResult<usize> {
    let most = Execution::MOST_THREADS;
    let expected = || format!("threads: give a whole number, 1 to {most}, or None, not {}", quoted(given));
    let number = whole(given).ok_or_else(|| PyTypeError::new_err(expected()))?;
    usize::try_from(number).map_err(|_| PyValueError::new_err(expected()))
}

/// A whole number, of any type that is one.
fn whole(given: &Bound<PyAny>) -> Option<i64> {
    let is_number = !given.is_instance_of::<PyBool>()
        && (given.is_instance_of::<PyInt>() || given.hasattr("__index__").is_ok_and(|has| has));
    is_number.then(|| given.extract().unwrap_or(i64::MAX))
}

/// What is given as a dict, for `argument`.
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
        let reason = "the keys are names of options, which mrfgs.options() describes, such as \"fill\"";
        PyTypeError::new_err(format!("{argument}: {reason}, not {}", quoted(key)))
    };
    Ok(key.cast::<PyString>().map_err(|_| wrong())?.to_cow()?.into_owned())
}

/// What is given, as messages show it: in one short line.
fn quoted(given: &Bound<PyAny>) -> String {
    const MOST: usize = 60;
    let shown = given.repr().map_or_else(|_| "that".into(), |shown| shown.to_string());
    let line: String = shown.split_whitespace().collect::<Vec<_>>().join(" ");
    if line.chars().count() <= MOST { line } else { line.chars().take(MOST).chain("...".chars()).collect() }
}

/// The value of an option as the command line writes it.
fn as_written(value: &Bound<PyAny>) -> PyResult<String> {
    match value.extract::<bool>() {
        Ok(flag) => Ok(flag.to_string()),
        Err(_) => Ok(value.str()?.to_string()),
    }
}

/// Describes the options: a dict from each group to a dict from each of its keys to a dict with
///
/// meaning: what it does,
/// takes: the unit and the range of its values,
/// words: the words that it takes, with what each means; empty where it takes no words,
/// source: the section of the paper that it comes from, or other work; "open" where the paper leaves the choice open,
/// and, by the name of each preset, its value in that preset.
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

/// Lists the presets: a dict from the name of each to what it is for.
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
