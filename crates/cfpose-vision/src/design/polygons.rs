//! Polygons in a text file: a corner a line, an empty line between polygons.

use super::Shape;
use crate::error::{Fault, Flaw, Place};

/// Read polygons; each of them is a shape of its own.
pub(super) fn read(text: &str) -> Result<Vec<Shape>, Flaw> {
    let (mut shapes, mut ring) = (Vec::new(), Vec::new());
    let mut finish = |ring: &mut Vec<[f64; 2]>, line: usize| {
        match ring.len() {
            0 => return Ok(()),
            1 | 2 => return Err(at(line, "a polygon of fewer than 3 corners ends here".into())),
            _ => shapes.push(Shape { rings: vec![std::mem::take(ring)], dark: true, even_odd: true }),
        }
        Ok(())
    };
    let mut last = 0;
    for (number, line) in text.lines().enumerate() {
        last = number + 1;
        let line = line.trim();
        if line.starts_with('#') {
            continue;
        }
        if line.is_empty() {
            finish(&mut ring, last)?;
            continue;
        }
        let fields: Vec<&str> = line.split([',', ';', ' ', '\t']).filter(|field| !field.is_empty()).collect();
        let numbers: Option<Vec<f64>> = fields.iter().map(|field| field.parse().ok()).collect();
        match numbers.as_deref() {
            Some([x, y]) => ring.push([*x, *y]),
            // A line of names before the first corner.
            None if ring.is_empty()
                && fields.len() == 2
                && fields.iter().all(|f| f.starts_with(char::is_alphabetic)) => {}
            _ => return Err(at(last, format!("{line:?} is no corner: two numbers, x and y, are expected"))),
        }
    }
    finish(&mut ring, last)?;
    Ok(shapes)
}

fn at(line: usize, what: String) -> Flaw {
    Flaw { at: Place::Line(line), fault: Fault::Design { what } }
}
