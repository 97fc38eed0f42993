//! A figure as an SVG file for a paper: black axes on white, one colour a method, intervals drawn.

use std::fmt::Write;

use super::ticks::Ruler;
use super::{FieldMap, Figure, Point, Scale, Series, Style};

/// Colours that people with any colour vision tell apart (Okabe and Ito 2008), darkened where they are pale on white.
const COLOURS: [&str; 8] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#b58900", "#56b4e9", "#7b5ea7", "#444444"];

const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 360.0;
/// Left, right, top and bottom of the plotted area.
const AREA: [f64; 4] = [70.0, 545.0, 34.0, 300.0];
/// Width of one map of a basin.
const MAP: f64 = 240.0;

/// Draw a figure; returns the text of an SVG file.
///
/// ```
/// use cfpose_lab::figure::{Axis, Figure, Point, Scale, Series, Style, svg};
/// let point = |x, y: f64| Point { x, y, interval: Some([y - 0.1, y + 0.1]), note: String::new() };
/// let series = Series { methods: vec![0], label: "one".into(), style: Style::Line, points: vec![point(1.0, 0.2), point(9.0, 0.7)] };
/// let figure = Figure {
///     plot: "example", title: "a & b".into(), x: Axis::new("x", Scale::Log), y: Axis::new("y", Scale::Share),
///     series: vec![series], maps: Vec::new(), note: String::new(),
/// };
/// let text = svg(&figure);
/// assert!(text.starts_with("<svg") && text.contains("a &amp; b") && text.contains("<path"));
/// ```
pub fn svg(figure: &Figure) -> String {
    if figure.maps.is_empty() { curves(figure) } else { maps(figure) }
}

fn begin(width: f64, height: f64, title: &str) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
         font-family=\"Helvetica, Arial, sans-serif\" font-size=\"12\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n\
         <text x=\"{}\" y=\"18\" text-anchor=\"middle\" font-size=\"14\">{}</text>\n",
        0.5 * width,
        escaped(title)
    )
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// Scales of a figure: from values to places on the page.
struct Frame<'a> {
    x: Ruler<'a>,
    y: Ruler<'a>,
}

impl Frame<'_> {
    fn at(&self, x: f64, y: f64) -> (f64, f64) {
        let [left, right, top, bottom] = AREA;
        (left + self.x.place(x) * (right - left), bottom - self.y.place(y) * (bottom - top))
    }
}

fn curves(figure: &Figure) -> String {
    let points = || figure.series.iter().flat_map(|series| &series.points);
    let ends = |point: &Point| point.interval.map_or([point.y; 3], |[low, high]| [point.y, low, high]);
    let frame = Frame {
        x: Ruler::over(&figure.x, points().map(|point| point.x)),
        y: Ruler::over(&figure.y, points().flat_map(ends)),
    };
    let below = below(figure);
    let legend = 16.0 * figure.series.len().div_ceil(3) as f64;
    let mut text = begin(WIDTH, HEIGHT + below + legend, &figure.title);
    axes(&mut text, figure, &frame);
    for (index, series) in figure.series.iter().enumerate() {
        let colour = colour(series, index);
        let (x, y) = (AREA[0] + 165.0 * (index % 3) as f64, HEIGHT + below - 4.0 + 16.0 * (index / 3) as f64);
        let _ = writeln!(
            text,
            "<rect x=\"{x}\" y=\"{}\" width=\"14\" height=\"4\" fill=\"{colour}\"/><text x=\"{}\" y=\"{y}\">{}</text>",
            y - 6.0,
            x + 19.0,
            escaped(&series.label)
        );
        draw(&mut text, series, colour, &frame, shift(figure, index));
    }
    text + "</svg>\n"
}

/// Names that do not fit beside each other are written slanted.
fn is_slanted(figure: &Figure) -> bool {
    let names = &figure.x.names;
    let longest = names.iter().map(String::len).max().unwrap_or(0);
    figure.x.scale == Scale::Names && longest as f64 * 5.6 > (AREA[1] - AREA[0]) / names.len() as f64
}

/// Room that slanted names take below the axis.
fn below(figure: &Figure) -> f64 {
    let longest = figure.x.names.iter().map(String::len).max().unwrap_or(0);
    if is_slanted(figure) { (2.6 * longest as f64 - 16.0).clamp(0.0, 120.0) } else { 0.0 }
}

fn colour(series: &Series, index: usize) -> &'static str {
    COLOURS[series.methods.first().copied().unwrap_or(index) % COLOURS.len()]
}

/// Dots of several methods at one name stand beside each other.
fn shift(figure: &Figure, index: usize) -> f64 {
    let own = &figure.series[index];
    let shares = |other: &Series| own.points.iter().any(|p| other.points.iter().any(|q| p.x == q.x));
    let is_alone = figure.series.iter().enumerate().all(|(number, other)| number == index || !shares(other));
    if figure.x.scale != Scale::Names || is_alone {
        return 0.0;
    }
    let mut owners: Vec<&[usize]> = figure.series.iter().map(|series| series.methods.as_slice()).collect();
    owners.dedup();
    let place = owners.iter().position(|methods| *methods == own.methods).unwrap_or(0);
    (place as f64 + 0.5) / owners.len() as f64 * 0.7 - 0.35
}

fn axes(text: &mut String, figure: &Figure, frame: &Frame<'_>) {
    let [left, right, top, bottom] = AREA;
    for (value, label) in frame.x.marks() {
        let (x, _) = frame.at(value, frame.y.low);
        let _ = writeln!(text, "<path d=\"M{x:.1} {bottom}v5\" stroke=\"black\"/>");
        let slanted = is_slanted(figure);
        let (anchor, turn) =
            if slanted { ("end", format!(" transform=\"rotate(-25 {x:.1} 314)\"")) } else { ("middle", String::new()) };
        let _ = writeln!(
            text,
            "<text x=\"{x:.1}\" y=\"317\" text-anchor=\"{anchor}\" font-size=\"10\"{turn}>{}</text>",
            escaped(&label)
        );
    }
    for (value, label) in frame.y.marks() {
        let (_, y) = frame.at(frame.x.low, value);
        let _ = writeln!(
            text,
            "<path d=\"M{left} {y:.1}H{right}\" stroke=\"#dddddd\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\" font-size=\"10\">{label}</text>",
            left - 6.0,
            y + 3.5
        );
    }
    let _ = writeln!(text, "<path d=\"M{left} {top}V{bottom}H{right}\" fill=\"none\" stroke=\"black\"/>");
    if figure.x.scale != Scale::Names {
        let middle = 0.5 * (left + right);
        let _ =
            writeln!(text, "<text x=\"{middle}\" y=\"335\" text-anchor=\"middle\">{}</text>", escaped(&figure.x.label));
    }
    let y = 0.5 * (top + bottom);
    let _ = writeln!(
        text,
        "<text x=\"16\" y=\"{y}\" text-anchor=\"middle\" transform=\"rotate(-90 16 {y})\">{}</text>",
        escaped(&figure.y.label)
    );
}

fn draw(text: &mut String, series: &Series, colour: &str, frame: &Frame<'_>, shift: f64) {
    let shown: Vec<&Point> = series.points.iter().filter(|p| p.x.is_finite() && !p.y.is_nan()).collect();
    if matches!(series.style, Style::Line | Style::Steps) {
        let steps = series.style == Style::Steps;
        let ways: Vec<_> = shown.iter().map(|p| (p.x, p.y)).collect();
        let side = |end: usize| shown.iter().filter_map(move |p| Some((p.x, p.interval?[end]))).collect::<Vec<_>>();
        let (mut band, mut upper) = (path(&side(0), steps, frame), path_back(&side(1), steps, frame));
        if !upper.is_empty() {
            band.append(&mut upper);
            let _ = writeln!(text, "<path d=\"M{}Z\" fill=\"{colour}\" fill-opacity=\"0.15\"/>", joined(&band));
        }
        let _ = writeln!(
            text,
            "<path d=\"M{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.8\"/>",
            joined(&path(&ways, steps, frame))
        );
        return;
    }
    for point in shown {
        let (x, y) = frame.at(point.x + shift, point.y);
        if let Some([low, high]) = point.interval {
            let ((_, from), (_, to)) = (frame.at(point.x, low), frame.at(point.x, high));
            let _ = writeln!(
                text,
                "<path d=\"M{x:.1} {from:.1}V{to:.1}M{:.1} {from:.1}h6M{:.1} {to:.1}h6\" stroke=\"{colour}\" stroke-width=\"1.3\"/>",
                x - 3.0,
                x - 3.0
            );
        }
        let _ = match series.style {
            Style::Diamonds => writeln!(
                text,
                "<path d=\"M{x:.1} {:.1}l5 5l-5 5l-5 -5Z\" fill=\"white\" stroke=\"{colour}\" stroke-width=\"1.5\"/>",
                y - 5.0
            ),
            _ => writeln!(text, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.2\" fill=\"{colour}\"/>"),
        };
    }
}

fn path(points: &[(f64, f64)], steps: bool, frame: &Frame<'_>) -> Vec<(f64, f64)> {
    let mut way: Vec<(f64, f64)> = Vec::new();
    for (x, y) in points {
        let next = frame.at(*x, *y);
        if let (true, Some(last)) = (steps, way.last().copied()) {
            way.push((next.0, last.1));
        }
        way.push(next);
    }
    way
}

fn path_back(points: &[(f64, f64)], steps: bool, frame: &Frame<'_>) -> Vec<(f64, f64)> {
    path(points, steps, frame).into_iter().rev().collect()
}

fn joined(way: &[(f64, f64)]) -> String {
    way.iter().map(|(x, y)| format!("{x:.1} {y:.1}")).collect::<Vec<_>>().join("L")
}

fn maps(figure: &Figure) -> String {
    let columns = figure.maps.len().min(3);
    let rows = figure.maps.len().div_ceil(3);
    let mut text = begin(columns as f64 * MAP + 20.0, rows as f64 * (MAP + 40.0) + 40.0, &figure.title);
    for (index, map) in figure.maps.iter().enumerate() {
        let corner = (10.0 + MAP * (index % 3) as f64, 30.0 + (MAP + 40.0) * (index / 3) as f64);
        one_map(&mut text, figure, map, corner);
    }
    text + "</svg>\n"
}

fn one_map(text: &mut String, figure: &Figure, map: &FieldMap, (left, top): (f64, f64)) {
    let side = MAP - 50.0;
    let size = side / map.fields as f64;
    let (left, top) = (left + 40.0, top + 20.0);
    let _ = writeln!(
        text,
        "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
        left + 0.5 * side,
        top - 6.0,
        escaped(&map.label)
    );
    for (place, (hits, trials)) in map.counts.iter().enumerate().filter(|(_, (_, trials))| *trials > 0) {
        let (x, y) = ((place % map.fields) as f64, (place / map.fields) as f64);
        let share = *hits as f64 / *trials as f64;
        // From orange (never) through white to blue (always).
        let mix = |from: f64, to: f64| (from + (to - from) * (2.0 * share - 1.0).abs()).round();
        let end = if share > 0.5 { [0.0, 114.0, 178.0] } else { [213.0, 94.0, 0.0] };
        let [red, green, blue] = end.map(|channel| mix(245.0, channel));
        let _ = writeln!(
            text,
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{size:.1}\" height=\"{size:.1}\" fill=\"rgb({red},{green},{blue})\"/>",
            left + x * size,
            top + side - (y + 1.0) * size
        );
    }
    let _ = writeln!(
        text,
        "<rect x=\"{left}\" y=\"{top}\" width=\"{side}\" height=\"{side}\" fill=\"none\" stroke=\"black\"/>"
    );
    let (bottom, middle) = (top + side, left + 0.5 * side);
    let ends = [super::ticks::plain(map.half[0]), super::ticks::plain(map.half[1])];
    let _ = writeln!(
        text,
        "<g font-size=\"10\"><text x=\"{left}\" y=\"{0}\">-{1}</text><text x=\"{2}\" y=\"{0}\" text-anchor=\"end\">{1}</text>\
         <text x=\"{middle}\" y=\"{9}\" text-anchor=\"middle\">{3}</text>\
         <text x=\"{4}\" y=\"{bottom}\" text-anchor=\"end\">-{5}</text><text x=\"{4}\" y=\"{6}\" text-anchor=\"end\">{5}</text>\
         <text x=\"{4}\" y=\"{7}\" text-anchor=\"end\">{8}</text></g>",
        bottom + 12.0,
        ends[0],
        left + side,
        escaped(&figure.x.label),
        left - 4.0,
        ends[1],
        top + 8.0,
        top + 0.5 * side,
        escaped(&figure.y.label),
        bottom + 25.0
    );
}
