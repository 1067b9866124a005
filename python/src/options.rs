//! The options of the method.

use mrfgs::options::{GROUPS, Key, Method, PRESETS, Takes};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::exceptions::exception;

/// The method: a preset, and what replaces some of its keys.
pub(crate) fn method(preset: &str, options: Option<&Bound<PyDict>>) -> PyResult<Method> {
    let mut changes = Vec::new();
    for (key, value) in options.into_iter().flatten() {
        let key: String = key.extract()?;
        match value.cast::<PyDict>() {
            Ok(group) => {
                for (inner, value) in group {
                    changes.push((format!("{key}.{}", inner.extract::<String>()?), as_written(&value)?));
                }
            }
            Err(_) => changes.push((key, as_written(&value)?)),
        }
    }
    let mut method = Method::preset(preset).map_err(exception)?;
    method.set_all(changes.iter().map(|(key, value)| (&**key, &**value))).map_err(exception)?;
    Ok(method)
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
