//! YAML to values: what calibration programs write, nothing that grows when it is read.

use saphyr_parser::{Event, Parser, ScalarStyle};
use serde_json::{Map, Number, Value};

/// Deepest nesting.
const MAX_DEPTH: usize = 16;

/// A list or a map that is not closed yet.
enum Open {
    List(Vec<Value>),
    /// The map, and a key that waits for its value.
    Map(Map<String, Value>, Option<String>),
}

/// Read the first document; an error names the line where it can.
pub(super) fn parse(text: &str) -> Result<Value, String> {
    // OpenCV's first line is no directive of YAML.
    let text = match text.strip_prefix("%YAML:1.0") {
        Some(rest) => format!("# {rest}"),
        None => text.to_string(),
    };
    let mut open: Vec<Open> = Vec::new();
    for event in Parser::new_from_str(&text) {
        let (event, span) = event.map_err(|error| {
            let line = error.marker().line();
            format!("line {line}: this is no YAML: {}", error.info())
        })?;
        let line = span.start.line();
        let value = match event {
            Event::Alias(_) => return Err(format!("line {line}: aliases are not read; write the value out")),
            Event::SequenceStart(..) => {
                open.push(Open::List(Vec::new()));
                None
            }
            Event::MappingStart(..) => {
                open.push(Open::Map(Map::new(), None));
                None
            }
            Event::SequenceEnd | Event::MappingEnd => match open.pop() {
                Some(Open::List(list)) => Some(Value::Array(list)),
                Some(Open::Map(map, _)) => Some(Value::Object(map)),
                None => None,
            },
            Event::Scalar(text, style, ..) => Some(scalar(&text, style)),
            _ => None,
        };
        if open.len() > MAX_DEPTH {
            return Err(format!("line {line}: nested deeper than {MAX_DEPTH}"));
        }
        let Some(value) = value else { continue };
        match open.last_mut() {
            None => return Ok(value),
            Some(Open::List(list)) => list.push(value),
            Some(Open::Map(map, key)) => match key.take() {
                None => *key = Some(text_of(&value).ok_or_else(|| format!("line {line}: a key is no word"))?),
                Some(name) => {
                    if map.insert(name.clone(), value).is_some() {
                        return Err(format!("line {line}: {name:?} is given twice"));
                    }
                }
            },
        }
    }
    Err("there is nothing in it".to_string())
}

/// Read a plain scalar as a number where it is one.
fn scalar(text: &str, style: ScalarStyle) -> Value {
    let number = if style == ScalarStyle::Plain { text.parse().ok().and_then(Number::from_f64) } else { None };
    number.map_or_else(|| Value::String(text.to_string()), Value::Number)
}

fn text_of(value: &Value) -> Option<String> {
    match value {
        Value::String(text) => Some(text.clone()),
        Value::Number(number) => Some(number.to_string()),
        _ => None,
    }
}
