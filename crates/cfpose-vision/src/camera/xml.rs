//! OpenCV's XML files to values.

use roxmltree::{Document, Node};
use serde_json::{Map, Value};

/// Deepest nesting.
const MAX_DEPTH: usize = 16;

/// Read a storage of OpenCV.
pub(super) fn parse(text: &str) -> Result<Value, String> {
    let document =
        Document::parse(text).map_err(|error| format!("line {}: this is no XML: {error}", error.pos().row))?;
    let root = document.root_element();
    if root.tag_name().name() != "opencv_storage" {
        return Err(format!("the outermost element is <{}>, not <opencv_storage>", root.tag_name().name()));
    }
    value(root, 0)
}

/// Return elements as a map, other content as text.
fn value(node: Node<'_, '_>, depth: usize) -> Result<Value, String> {
    if depth > MAX_DEPTH {
        return Err(format!("nested deeper than {MAX_DEPTH}"));
    }
    let mut map = Map::new();
    for child in node.children().filter(Node::is_element) {
        let name = child.tag_name().name().to_string();
        // `_` is an element of a list, which no part of a camera is.
        if map.insert(name.clone(), value(child, depth + 1)?).is_some() && name != "_" {
            return Err(format!("{name:?} is given twice"));
        }
    }
    Ok(if map.is_empty() {
        Value::String(node.text().unwrap_or_default().trim().to_string())
    } else {
        Value::Object(map)
    })
}
