//! YAML and XML, as calibration programs write them.

use roxmltree::{Document, ParsingOptions};
use saphyr_parser::{Event, Parser};

use super::node::{MAX_DEPTH, MAX_ENTRIES, Node};
use crate::text::{one_line, quoted};

/// The first document of a YAML file. The error is one line.
pub(super) fn yaml(text: &str) -> Result<Node, String> {
    // OpenCV's own form of the directive, which is no YAML.
    let rest = text.strip_prefix("%YAML:1.0").unwrap_or(text);
    // Groups that are open, each with the key that its next value has.
    let mut open: Vec<(Node, Option<String>)> = Vec::new();
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
            None => return Ok(done),
            Some((Node::List(nodes), _)) => nodes.push(done),
            Some((Node::Map(entries), key)) => entries.extend(key.take().map(|key| (key, done))),
            Some((Node::Scalar(_), _)) => {}
        }
    }
    Err("is no YAML with entries; is it a calibration?".into())
}

/// An XML file: elements are entries, and elements called `_` a list. The error is one line.
pub(super) fn xml(text: &str) -> Result<Node, String> {
    // Nesting is bounded before anything goes down it.
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
