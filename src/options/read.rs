//! Reads a [`Method`] from TOML, and sets single keys.

use std::collections::HashMap;
use std::path::Path;

use serde::Deserialize;
use toml::Spanned;
use toml::de::{DeTable, DeValue, ValueDeserializer};

use super::row::{Group, Key, Takes, Value};
use super::{GROUPS, Method};
use crate::error::{Error, OptionError, ReadError, Result};
use crate::text;
use crate::text::one_line;

/// The limit for a config file, which usually has a few dozen lines.
const MAX_CONFIG_BYTES: u64 = 1 << 20;

/// A key, as written, with its new value.
type Change = (String, toml::Value);
/// A key with an invalid value or name, as written, and the reason.
type Misfit = (String, OptionError);

impl Method {
    /// Sets `key` to `value`, both as a user writes them (`levels` or `graph.levels`, `4`).
    ///
    /// # Errors
    /// [`Error::Option`] naming the key when there is no such key or the value does not fit it.
    pub fn set(&mut self, key: &str, value: &str) -> Result<()> {
        self.set_all([(key, value)])
    }

    /// Sets each key to its value; of repeated keys the last one counts. Constraints between keys are checked
    /// at the end, so that their order does not matter.
    ///
    /// # Errors
    /// The errors of [`Method::set`].
    pub fn set_all<'a>(&mut self, pairs: impl IntoIterator<Item = (&'a str, &'a str)>) -> Result<()> {
        // Bare words (`matching=sad`) are strings; everything else is TOML already.
        let value = |text: &str| match format!("value = {text}").parse::<toml::Table>() {
            Ok(mut table) if table.len() == 1 => table.remove("value"),
            _ => None,
        };
        let changes =
            pairs.into_iter().map(|(key, text)| (key.to_owned(), value(text).unwrap_or_else(|| text.into())));
        *self = self.merged(changes).map_err(|(key, cause)| Error::option(one_line(&key), cause))?;
        Ok(())
    }

    /// Sets every key in the TOML file `path`, with or without the heading of its group.
    ///
    /// # Errors
    /// [`Error::Read`] when the file cannot be read, is not TOML, or holds an invalid key or value; it names
    /// the line.
    pub fn load(&mut self, path: &Path) -> Result<()> {
        let text = String::from_utf8(text::read(path, MAX_CONFIG_BYTES, "config file")?)
            .map_err(|_| Error::read(path, "is no text; give a TOML file"))?;
        let line = |at: usize| 1 + text[..at.min(text.len())].matches('\n').count();
        let broken = |e: toml::de::Error| {
            let place = e.span().map(|span| format!("line {}: ", line(span.start)));
            Error::read(path, format!("{}{}", place.unwrap_or_default(), one_line(e.message())))
        };
        let misfit = |line: Option<usize>, key: &str, cause: OptionError| {
            Error::read(path, ReadError::Option { line, key: one_line(key), cause })
        };

        let mut changes = Vec::new();
        // The line of each key, by its name.
        let mut lines = HashMap::new();
        for (key, at, value) in entries(DeTable::parse(&text).map_err(broken)?.into_inner()) {
            let value = toml::Value::deserialize(ValueDeserializer::from(value)).map_err(broken)?;
            let name = find(&key).map_or_else(|_| key.clone(), |(_, found)| found.name());
            if let Some(first) = lines.insert(name, line(at)) {
                return Err(misfit(Some(line(at)), &key, OptionError::Repeated { line: first }));
            }
            changes.push((key, value));
        }
        *self = self.merged(changes).map_err(|(key, cause)| {
            let name = find(&key).map_or_else(|_| key.clone(), |(_, found)| found.name());
            misfit(lines.get(&name).copied(), &key, cause)
        })?;
        Ok(())
    }

    /// This method with the keys of `changes` replaced.
    fn merged(&self, changes: impl IntoIterator<Item = Change>) -> Result<Self, Misfit> {
        let mut table = self.table();
        for (name, value) in changes {
            let stored = find(&name).and_then(|(group, key)| Ok((group, key, checked(key, value)?)));
            let (group, key, value) = stored.map_err(|cause| (name, cause))?;
            table[group.name][key.name()] = value;
        }
        // Every value was checked by itself.
        let method: Self = table.try_into().expect("values that their keys take");
        method.check()?;
        Ok(method)
    }
}

/// `value` as `key` stores it, or why it is invalid.
fn checked(key: &Key, value: toml::Value) -> Result<toml::Value, OptionError> {
    use toml::Value::{Boolean, Float, Integer, String};
    let value = match (key.takes, value) {
        // Whole numbers are valid for real keys.
        (Takes::Real { .. }, Integer(v)) => Float(v as f64),
        (_, value) => value,
    };
    let plain = match &value {
        Boolean(_) => Value::Switch,
        String(word) => Value::Word(word),
        Integer(v) => Value::Whole(*v),
        Float(v) => Value::Real(*v),
        _ => Value::Other,
    };
    key.check(plain, || value.to_string())?;
    Ok(value)
}

/// Every key with its group, in order.
fn keys() -> impl Iterator<Item = (&'static Group, &'static Key)> {
    GROUPS.iter().flat_map(|group| group.keys.iter().map(move |key| (group, key)))
}

/// The entries of a file in order: keys, with the group in front if there is one, places and values.
fn entries(table: DeTable) -> Vec<(String, usize, Spanned<DeValue>)> {
    let mut entries = Vec::new();
    for (key, value) in table {
        let is_group = GROUPS.iter().any(|group| group.name == *key.get_ref());
        let (at, span) = (key.span().start, value.span());
        match value.into_inner() {
            DeValue::Table(inner) if is_group => entries.extend(inner.into_iter().map(|(inner, value)| {
                (format!("{}.{}", key.get_ref(), inner.get_ref()), inner.span().start, value)
            })),
            value => entries.push((key.into_inner().into_owned(), at, Spanned::new(span, value))),
        }
    }
    entries.sort_by_key(|(_, at, _)| *at);
    entries
}

/// The key called `name`, with or without its group in front.
fn find(name: &str) -> Result<(&'static Group, &'static Key), OptionError> {
    let (group, key) = name.split_once('.').map_or((None, name), |(group, key)| (Some(group), key));
    match keys().find(|(_, found)| found.name() == key) {
        Some((found, _)) if group.is_some_and(|group| group != found.name) => {
            Err(OptionError::InGroup { key: format!("{}.{key}", found.name) })
        }
        Some(found) => Ok(found),
        None => Err(match GROUPS.iter().find(|group| group.name == name) {
            Some(group) => OptionError::IsGroup { keys: group.keys.iter().map(Key::name).collect() },
            None => OptionError::Unknown,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::super::{LeftRightCheck, MatchingCost, PRESETS};
    use super::*;

    #[test]
    fn values_are_written_as_in_toml_or_bare() {
        let mut method = Method::default();
        method.set("matching", "sad").unwrap();
        method.set("matching", "\"sad\"").unwrap();
        method.set("messages.temperature", "2").unwrap();
        method.set("left-right-check", "off").unwrap();
        method.set_all([("levels", "3"), ("graph.levels", "4")]).unwrap();
        let mut expected = Method::default();
        expected.cost.matching = MatchingCost::Sad;
        expected.messages.temperature = 2.0;
        expected.refinement.left_right_check = LeftRightCheck::Off;
        expected.graph.levels = 4;
        assert_eq!(method, expected);
    }

    #[test]
    fn constraints_between_keys_are_checked_at_the_end() {
        for order in [[0, 1], [1, 0]] {
            let pairs = [("matching", "ad-census"), ("cost.outside-cost", "0.5")];
            let mut method = Method::paper();
            method.set_all(order.map(|i| pairs[i])).unwrap();
            assert_eq!((method.cost.matching, method.cost.outside_cost), (MatchingCost::AdCensus, 0.5));
        }
        let error = Method::paper().set("matching", "ad-census").unwrap_err().to_string();
        assert_eq!(error, "outside-cost: 10 is outside 0 to 1.625");
    }

    #[test]
    fn errors_name_the_key_and_its_values() {
        for (key, value, words) in [
            ("colour", "red", "colour: there is no such key"),
            ("graph.colour", "red", "graph.colour: there is no such key"),
            ("graph.sad-window", "7", "graph.sad-window: there is no such key; it is `cost.sad-window`"),
            ("cost", "sad", "cost: is a group and takes no value; set one of its keys: matching, sad-window"),
            ("pyramid", "ncc", "pyramid: expected low-pass | minimum, not \"ncc\""),
            ("cost.pyramid", "1", "cost.pyramid: expected low-pass | minimum, not 1"),
            ("sub-pixel", "1", "sub-pixel: expected true | false, not 1"),
            ("levels", "2.5", "levels: expected levels, 1 to 16, not 2.5"),
            ("levels", "-1", "levels: -1 is outside 1 to 16"),
            ("levels", "", "levels: expected levels, 1 to 16, not \"\""),
            ("levels", "17", "levels: 17 is outside 1 to 16"),
            ("levels", "3\nmatching = \"sad\"", "levels: expected"),
            ("temperature", "nan", "temperature: NaN is outside 0.001 to 1000000"),
            ("median-window", "4", "median-window: 4 is not odd; take 3 or 5"),
            ("speckle-size", "-1", "speckle-size: -1 is outside 0 to 4294967295"),
            ("two\nlines\u{1b}[2J", "4", "two lines [2J: there is no such key"),
            (&"keys".repeat(99), "4", &format!("{}...: there is no such key", "keys".repeat(40))),
        ] {
            let mut method = Method::default();
            let error = method.set(key, value).unwrap_err().to_string();
            assert!(error.starts_with(words) && !error.contains('\n'), "{error}");
            assert_eq!(method, Method::default(), "{key}={value} changes nothing");
        }
    }

    #[test]
    fn files_have_groups_or_bare_keys() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("method.toml");
        for text in [
            "levels = 3\nmatching = \"census\"",
            "graph.levels = 3\ncost.matching = \"census\"",
            "levels = 3\n[cost]\nmatching = \"census\"",
            "graph = { levels = 3 }\n[cost]\nmatching = \"census\"",
            "\"graph.levels\" = 3\n\"cost.matching\" = \"census\"",
        ] {
            std::fs::write(&path, text).unwrap();
            let mut method = Method::default();
            method.load(&path).unwrap();
            assert_eq!((method.graph.levels, method.cost.matching), (3, MatchingCost::Census), "{text}");
        }
    }

    #[test]
    fn errors_in_a_file_name_the_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("method.toml");
        for (text, words) in [
            ("levels = 3\nmatching sad\n", "method.toml: line 2: "),
            ("levels = 3\nlevels = 3\n", "method.toml: line 2: duplicate key"),
            ("# levels\n\nlevels = 99", "method.toml: line 3: levels: 99 is outside 1 to 16"),
            ("\n[graph]\nlevels = 99", "method.toml: line 3: graph.levels: 99 is outside 1 to 16"),
            ("\ngraph = { levels = 99 }", "method.toml: line 2: graph.levels: 99 is outside 1 to 16"),
            (
                "[graph]\nmatching = \"sad\"",
                "line 2: graph.matching: there is no such key; it is `cost.matching`",
            ),
            ("levels = 3\n\n[graph]\nlevels = 4", "line 4: graph.levels: is set in line 1 already; keep one"),
            ("[levels]\nx = 1", "method.toml: line 1: levels: expected levels, 1 to 16, not"),
            ("matching = \"sad", "method.toml: line 1: "),
            (
                "cost = \"sad\"",
                "method.toml: line 1: cost: is a group and takes no value; set one of its keys",
            ),
            ("\nsad_window = 3", "method.toml: line 2: sad_window: there is no such key"),
            ("\nlevels = 9223372036854775808", "method.toml: line 2: "),
            ("\noutside-cost = 20", "method.toml: line 2: outside-cost: 20 is outside 0 to 1.625"),
        ] {
            std::fs::write(&path, text).unwrap();
            let error = Method::default().load(&path).unwrap_err().to_string();
            assert!(error.contains(words) && !error.contains('\n'), "{error}");
        }
        let error = Method::default().load(&folder.path().join("none.toml")).unwrap_err().to_string();
        assert!(error.contains("none.toml: there is no such file"), "{error}");
    }

    #[test]
    fn every_preset_survives_a_round_trip_through_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("method.toml");
        for preset in PRESETS {
            let preset = preset.method();
            std::fs::write(&path, preset.table().to_string()).unwrap();
            for other in PRESETS {
                let mut method = other.method();
                method.load(&path).unwrap();
                assert_eq!(method, preset);
            }
        }
    }
}
