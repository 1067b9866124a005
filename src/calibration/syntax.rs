//! Parses YAML, JSON, XML and INI in the dialects of calibration programs.

use std::fmt;
use std::path::Path;

use roxmltree::{Document, ParsingOptions};
use saphyr_parser::{Event, Parser};

use serde::de::{self, Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};

use super::node::{MAX_DEPTH, MAX_ENTRIES, Node};
use crate::text::{one_line, quoted};

/// Whether a text is certainly YAML: by its start, by the name of its file, or by a typical entry of calibrations.
pub(super) fn is_yaml(path: &Path, text: &str) -> bool {
    const STEMS: [&str; 13] = [
        "K1",
        "D1",
        "M1",
        "K_0",
        "P0",
        "P_rect",
        "cam0",
        "camera_matrix",
        "image_width",
        "image_size",
        "imageSize",
        "T_BS",
        "Camera",
    ];
    let extension = path.extension().and_then(|end| end.to_str()).unwrap_or_default().to_lowercase();
    let entry = |line: &str| line.contains(':') && STEMS.iter().any(|stem| line.starts_with(stem));
    text.starts_with("%YAML")
        || text.starts_with("---")
        || ["yml", "yaml"].contains(&extension.as_str())
        || text.lines().any(entry)
}

/// Whether a text begins like XML.
pub(super) fn is_xml(text: &str) -> bool {
    text[1..].starts_with(|c: char| c.is_alphabetic() || ['?', '!', '_'].contains(&c))
}

/// Whether a text begins like an object of JSON.
pub(super) fn is_json(text: &str) -> bool {
    text[1..].trim_start().starts_with(['"', '}'])
}

/// A YAML file of one document, or of several equal ones as `rostopic echo` prints them. The error is one line.
pub(super) fn yaml(text: &str) -> Result<Node, String> {
    let mut all = documents(text)?.into_iter();
    let Some(first) = all.next() else { return Err("is no YAML with entries; is it a calibration?".into()) };
    // The header of a message has a time stamp.
    let entries = |node: &Node| match node {
        Node::Map(entries) => entries.iter().filter(|(name, _)| name != "header").cloned().collect(),
        other => vec![(String::new(), other.clone())],
    };
    let empty = |node: &Node| *node == Node::Scalar(String::new()) || *node == Node::Scalar("~".into());
    if all.any(|other| !empty(&other) && entries(&other) != entries(&first)) {
        return Err("has several documents (---) that differ; keep one".into());
    }
    Ok(first)
}

fn documents(text: &str) -> Result<Vec<Node>, String> {
    // OpenCV's form of the directive is not valid YAML.
    let rest = text.strip_prefix("%YAML:1.0").unwrap_or(text);
    // OpenCV writes no blank before a list.
    let rest = &rest.replace(":[", ": [");
    // The open groups, each with the key of its next value.
    let mut open: Vec<(Node, Option<String>)> = Vec::new();
    let mut found: Vec<Node> = Vec::new();
    for event in Parser::new_from_str(rest) {
        let (event, span) = event.map_err(|e| format!("is no YAML: {}", one_line(&e.to_string())))?;
        let at = || format!("line {}", span.start.line());
        let done = match event {
            Event::Scalar(text, ..) => match open.last_mut() {
                Some((Node::Map(entries), key @ None)) => {
                    if entries.len() == MAX_ENTRIES {
                        return Err(format!("{}: has too many entries for a calibration", at()));
                    }
                    if entries.iter().any(|(name, _)| *name == text) {
                        return Err(format!("{}: {} is there twice; keep one", at(), quoted(&text)));
                    }
                    *key = Some(text.into_owned());
                    continue;
                }
                _ => Node::Scalar(text.into_owned()),
            },
            Event::SequenceStart(..) | Event::MappingStart(..) => {
                if open.len() == MAX_DEPTH {
                    return Err(format!("{}: has too many levels for a calibration", at()));
                }
                if let Some((Node::Map(_), None)) = open.last() {
                    return Err(format!("{}: expected a name, found a group", at()));
                }
                let list = matches!(event, Event::SequenceStart(..));
                open.push((if list { Node::List(Vec::new()) } else { Node::Map(Vec::new()) }, None));
                continue;
            }
            Event::SequenceEnd | Event::MappingEnd => match open.pop() {
                Some((node, _)) => node,
                None => continue,
            },
            Event::Alias(_) => return Err(format!("{}: expected a value, found a reference", at())),
            _ => continue,
        };
        match open.last_mut() {
            None => found.push(done),
            Some((Node::List(nodes), _)) => nodes.push(done),
            Some((Node::Map(entries), key)) => entries.extend(key.take().map(|key| (key, done))),
            Some((Node::Scalar(_), _)) => {}
        }
    }
    Ok(found)
}

/// A JSON file. The error is one line.
pub(super) fn json(text: &str) -> Result<Node, String> {
    let root = serde_json::from_str::<Json>(text);
    root.map(|Json(node)| node).map_err(|e| format!("is no JSON: {}", one_line(&e.to_string())))
}

struct Json(Node);

impl<'de> Deserialize<'de> for Json {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(JsonVisitor)
    }
}

struct JsonVisitor;

impl<'de> Visitor<'de> for JsonVisitor {
    type Value = Json;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a value")
    }

    fn visit_str<E>(self, text: &str) -> Result<Json, E> {
        Ok(Json(Node::Scalar(text.into())))
    }

    fn visit_bool<E>(self, value: bool) -> Result<Json, E> {
        Ok(Json(Node::Scalar(value.to_string())))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Json, E> {
        Ok(Json(Node::Scalar(value.to_string())))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Json, E> {
        Ok(Json(Node::Scalar(value.to_string())))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Json, E> {
        // As few digits as identify the number.
        Ok(Json(Node::Scalar(format!("{value:?}"))))
    }

    fn visit_unit<E>(self) -> Result<Json, E> {
        Ok(Json(Node::Scalar(String::new())))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Json, A::Error> {
        let mut nodes = Vec::new();
        while let Some(Json(node)) = items.next_element()? {
            nodes.push(node);
        }
        Ok(Json(Node::List(nodes)))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut items: A) -> Result<Json, A::Error> {
        let mut entries: Vec<(String, Node)> = Vec::new();
        while let Some((name, Json(node))) = items.next_entry::<String, Json>()? {
            if entries.len() == MAX_ENTRIES {
                return Err(de::Error::custom("has too many entries for a calibration"));
            }
            if entries.iter().any(|(other, _)| *other == name) {
                return Err(de::Error::custom(format_args!("{} is there twice; keep one", quoted(&name))));
            }
            entries.push((name, node));
        }
        Ok(Json(Node::Map(entries)))
    }
}

/// Whether a text begins with a section such as `[LEFT_CAM_HD]`.
pub(super) fn is_ini(text: &str) -> bool {
    let first = text.lines().next().unwrap_or_default().trim();
    let name = first.strip_prefix('[').and_then(|line| line.strip_suffix(']')).unwrap_or_default();
    name.starts_with(char::is_alphabetic) && name.chars().all(|c| c.is_alphanumeric() || c == '_')
}

/// An INI file: sections are groups of entries. The error is one line.
pub(super) fn ini(text: &str) -> Result<Node, String> {
    let mut sections: Vec<(String, Node)> = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let line = line.split(['#', ';']).next().unwrap_or_default().trim();
        let wrong = |reason: &str| Err(format!("line {}: {reason}", i + 1));
        if let Some(name) = line.strip_prefix('[').and_then(|line| line.strip_suffix(']')) {
            if sections.iter().any(|(other, _)| other == name) {
                return wrong(&format!("{} is there twice; keep one", quoted(name)));
            }
            sections.push((name.into(), Node::Map(Vec::new())));
        } else if let Some((name, value)) = line.split_once('=') {
            let Some((_, Node::Map(entries))) = sections.last_mut() else {
                return wrong("expected a section such as [STEREO]");
            };
            if entries.iter().any(|(other, _)| other == name.trim()) {
                return wrong(&format!("{} is there twice; keep one", quoted(name.trim())));
            }
            entries.push((name.trim().into(), Node::Scalar(value.trim().into())));
        }
        if sections.len() > MAX_ENTRIES
            || matches!(sections.last(), Some((_, Node::Map(e))) if e.len() > MAX_ENTRIES)
        {
            return wrong("has too many entries for a calibration");
        }
    }
    Ok(Node::Map(sections))
}

/// An XML file: elements are entries, and elements named `_` make a list. The error is one line.
pub(super) fn xml(text: &str) -> Result<Node, String> {
    // The parser bounds the nesting.
    let options = ParsingOptions { nodes_limit: 100_000, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options)
        .map_err(|e| format!("is no XML: {}", one_line(&e.to_string())))?;
    element(document.root_element(), 0)
}

fn element(node: roxmltree::Node, depth: usize) -> Result<Node, String> {
    if depth > MAX_DEPTH {
        return Err("has too many levels for a calibration".into());
    }
    let mut entries: Vec<(String, Node)> = Vec::new();
    for child in node.children().filter(roxmltree::Node::is_element) {
        if entries.len() == MAX_ENTRIES {
            return Err("has too many entries for a calibration".into());
        }
        let name = child.tag_name().name();
        if name != "_" && entries.iter().any(|(other, _)| other == name) {
            return Err(format!("{} is there twice; keep one", quoted(name)));
        }
        entries.push((name.to_owned(), element(child, depth + 1)?));
    }
    Ok(match entries.first() {
        None => Node::Scalar(node.text().unwrap_or_default().trim().to_owned()),
        Some((name, _)) if name == "_" => Node::List(entries.into_iter().map(|(_, node)| node).collect()),
        Some(_) => Node::Map(entries),
    })
}
