//! Filled shapes of an SVG file.

use std::str::FromStr;

use roxmltree::{Document, Node};
use svgtypes::{Color, Length, LengthUnit, PointsParser, SimplePathSegment, SimplifyingPathParser, Transform, ViewBox};

use super::Shape;

/// Deepest nesting of groups, and pieces into which a curve is cut.
const MAX_DEPTH: usize = 64;
const PIECES: u32 = 48;

/// What a shape inherits from the elements around it.
#[derive(Clone, Copy)]
struct Look {
    /// `None`: not filled.
    fill: Option<Color>,
    even_odd: bool,
    transform: Transform,
}

/// Read the filled shapes and the millimetres in a unit of the file, where it gives a size in a unit of length.
pub(super) fn read(text: &str) -> Result<(Vec<Shape>, Option<f64>), String> {
    let document =
        Document::parse(text).map_err(|error| format!("line {}: this is no XML: {error}", error.pos().row))?;
    let root = document.root_element();
    if root.tag_name().name() != "svg" {
        return Err(format!("the outermost element is <{}>, not <svg>", root.tag_name().name()));
    }
    let mut shapes = Vec::new();
    let look = Look { fill: Some(Color::black()), even_odd: false, transform: Transform::default() };
    visit(root, look, 0, &mut shapes)?;
    Ok((shapes, scale(root)))
}

/// Return the millimetres in a unit of the view box, or of the file where there is none.
fn scale(root: Node<'_, '_>) -> Option<f64> {
    let box_size = root.attribute("viewBox").and_then(|text| ViewBox::from_str(text).ok()).map(|b| [b.w, b.h]);
    ["width", "height"].iter().enumerate().find_map(|(d, name)| {
        let length = Length::from_str(root.attribute(*name)?).ok()?;
        let unit = match length.unit {
            LengthUnit::Mm => 1.0,
            LengthUnit::Cm => 10.0,
            LengthUnit::In => 25.4,
            LengthUnit::Pt => 25.4 / 72.0,
            LengthUnit::Pc => 25.4 / 6.0,
            _ => return None,
        };
        match box_size {
            Some(size) => Some(length.number * unit / size[d]),
            // Without a view box a unit is a pixel of CSS.
            None => Some(25.4 / 96.0),
        }
        .filter(|scale| scale.is_finite() && *scale > 0.0)
    })
}

fn visit(node: Node<'_, '_>, look: Look, depth: usize, shapes: &mut Vec<Shape>) -> Result<(), String> {
    if depth > MAX_DEPTH {
        return Err(format!("nested deeper than {MAX_DEPTH}"));
    }
    let wrong = |problem: &dyn std::fmt::Display| match node.attribute("id") {
        Some(id) => format!("<{} id={id:?}>: {problem}", node.tag_name().name()),
        None => format!("<{}>: {problem}", node.tag_name().name()),
    };
    let mut look = look;
    if let Some(text) = node.attribute("transform") {
        let own = Transform::from_str(text).map_err(|error| wrong(&error))?;
        look.transform = product(&look.transform, &own);
    }
    if let Some(value) = property(node, "fill") {
        look.fill = match value.as_str() {
            "none" | "transparent" => None,
            "inherit" | "currentColor" => look.fill,
            value if value.starts_with("url") => return Err(wrong(&"a fill by url is no one colour")),
            value => Some(Color::from_str(value).map_err(|error| wrong(&error))?),
        };
    }
    if let Some(rule) = property(node, "fill-rule") {
        look.even_odd = rule == "evenodd";
    }
    if property(node, "display").is_some_and(|value| value == "none") {
        return Ok(());
    }
    match node.tag_name().name() {
        "svg" | "g" | "a" => {
            for child in node.children().filter(Node::is_element) {
                visit(child, look, depth + 1, shapes)?;
            }
        }
        name @ ("path" | "polygon" | "polyline" | "rect" | "circle" | "ellipse") => {
            let Some(fill) = look.fill else { return Ok(()) };
            let mut rings = rings(node, name).map_err(|problem| wrong(&problem))?;
            let t = &look.transform;
            for p in rings.iter_mut().flatten() {
                *p = [t.a * p[0] + t.c * p[1] + t.e, t.b * p[0] + t.d * p[1] + t.f];
            }
            let luminance =
                0.2126 * f64::from(fill.red) + 0.7152 * f64::from(fill.green) + 0.0722 * f64::from(fill.blue);
            shapes.push(Shape { rings, dark: luminance < 127.5, even_odd: look.even_odd });
        }
        "use" | "image" | "text" => {
            return Err(wrong(&"this element is not read; turn it into paths before saving"));
        }
        // Definitions, titles, metadata: nothing is painted.
        _ => {}
    }
    Ok(())
}

/// Return a property of the style or, without it, the attribute.
fn property(node: Node<'_, '_>, name: &str) -> Option<String> {
    let style = node.attribute("style").unwrap_or("");
    let declared = style.split(';').filter_map(|pair| pair.split_once(':')).find(|(key, _)| key.trim() == name);
    declared.map(|(_, value)| value).or_else(|| node.attribute(name)).map(|value| value.trim().to_string())
}

/// Return a b: b first.
fn product(a: &Transform, b: &Transform) -> Transform {
    Transform::new(
        a.a * b.a + a.c * b.b,
        a.b * b.a + a.d * b.b,
        a.a * b.c + a.c * b.d,
        a.b * b.c + a.d * b.d,
        a.a * b.e + a.c * b.f + a.e,
        a.b * b.e + a.d * b.f + a.f,
    )
}

fn rings(node: Node<'_, '_>, name: &str) -> Result<Vec<Vec<[f64; 2]>>, String> {
    let number = |name: &str| -> Result<f64, String> {
        let text = node.attribute(name).unwrap_or("0").trim().trim_end_matches("px");
        text.parse().map_err(|_| format!("{name}={text:?} is no number"))
    };
    Ok(match name {
        "path" => flatten(node.attribute("d").unwrap_or(""))?,
        "rect" => {
            let [x, y, w, h] = [number("x")?, number("y")?, number("width")?, number("height")?];
            vec![vec![[x, y], [x + w, y], [x + w, y + h], [x, y + h]]]
        }
        "circle" => vec![oval([number("cx")?, number("cy")?], [number("r")?, number("r")?])],
        "ellipse" => vec![oval([number("cx")?, number("cy")?], [number("rx")?, number("ry")?])],
        _ => vec![PointsParser::from(node.attribute("points").unwrap_or("")).map(|(x, y)| [x, y]).collect()],
    })
}

fn oval(centre: [f64; 2], radii: [f64; 2]) -> Vec<[f64; 2]> {
    let count = 8 * PIECES;
    (0..count)
        .map(|k| (f64::from(k) / f64::from(count) * std::f64::consts::TAU).sin_cos())
        .map(|(sine, cosine)| [centre[0] + radii[0] * cosine, centre[1] + radii[1] * sine])
        .collect()
}

/// Cut the curves of a path into lines.
fn flatten(data: &str) -> Result<Vec<Vec<[f64; 2]>>, String> {
    let mut rings: Vec<Vec<[f64; 2]>> = Vec::new();
    let mut at = [0.0, 0.0];
    for segment in SimplifyingPathParser::from(data) {
        let segment = segment.map_err(|error| error.to_string())?;
        let begin = at;
        let mut curve = |points: &dyn Fn(f64) -> [f64; 2]| {
            if let Some(ring) = rings.last_mut() {
                ring.extend((1..=PIECES).map(|k| points(f64::from(k) / f64::from(PIECES))));
            }
        };
        match segment {
            SimplePathSegment::MoveTo { x, y } => {
                at = [x, y];
                rings.push(vec![at]);
            }
            SimplePathSegment::LineTo { x, y } => {
                at = [x, y];
                rings.last_mut().ok_or("a path begins without a move")?.push(at);
            }
            SimplePathSegment::Quadratic { x1, y1, x, y } => {
                at = [x, y];
                curve(&|t| bezier(&[begin, [x1, y1], [x, y]], t));
            }
            SimplePathSegment::CurveTo { x1, y1, x2, y2, x, y } => {
                at = [x, y];
                curve(&|t| bezier(&[begin, [x1, y1], [x2, y2], [x, y]], t));
            }
            SimplePathSegment::ClosePath => {
                at = rings.last().and_then(|ring| ring.first().copied()).unwrap_or(at);
            }
        }
    }
    rings.retain(|ring| ring.len() > 2);
    Ok(rings)
}

/// Return the place of a Bezier curve at t by de Casteljau's rule.
fn bezier(points: &[[f64; 2]], t: f64) -> [f64; 2] {
    let mut row = points.to_vec();
    while row.len() > 1 {
        row = row.windows(2).map(|pair| [0, 1].map(|d| pair[0][d] + t * (pair[1][d] - pair[0][d]))).collect();
    }
    row[0]
}
