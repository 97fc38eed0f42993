//! Figures as SVG text or PNG: point sets before and after an estimate, residuals.

mod font;
mod moved;
mod raster;

use plotters::prelude::*;

use crate::error::LabError;
pub use moved::{ellipses, image_coordinates, of_estimate, panels, seen_from_above};

/// One panel: two sets of points in the plane.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Panel {
    /// Title above the panel.
    pub title: String,
    /// Moved points, drawn over the target.
    pub moved: Vec<[f64; 2]>,
    /// Target points.
    pub target: Vec<[f64; 2]>,
    /// Error ellipses of some moved points.
    pub ellipses: Vec<Ellipse>,
    /// Lines from one point to another: what is left between moved points and their partners.
    pub lines: Vec<[[f64; 2]; 2]>,
    /// Whether the panel has axes of its own; the others share theirs.
    pub own_axes: bool,
    /// What the moved points and the target are called in this panel.
    pub labels: Option<[String; 2]>,
}

/// Where a moved point may be: the covariance of theta, carried over to the point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ellipse {
    /// The moved point.
    pub centre: [f64; 2],
    /// Lower triangle L of the covariance L L' of the point: L_xx, L_yx, L_yy.
    pub root: [f64; 3],
}

impl Ellipse {
    /// Return points on the ellipse that holds 95 % of a normal distribution, its axes enlarged by a factor.
    pub fn outline(&self, factor: f64) -> Vec<[f64; 2]> {
        // The 95 % quantile of chi-square with two degrees of freedom is 5.991.
        let size = factor * 5.991_f64.sqrt();
        let [xx, yx, yy] = self.root.map(|entry| entry * size);
        let at = |k: u32| {
            let (sine, cosine) = (f64::from(k) * std::f64::consts::TAU / 48.0).sin_cos();
            [self.centre[0] + xx * cosine, self.centre[1] + yx * cosine + yy * sine]
        };
        (0..=48).map(at).collect()
    }

    /// Return the larger half width along the axes of the figure, not enlarged.
    fn half_width(&self) -> f64 {
        let [xx, yx, yy] = self.root;
        5.991_f64.sqrt() * xx.abs().max(yx.hypot(yy))
    }
}

/// Most points that are drawn of a set; a larger set is thinned evenly.
const MAX_DRAWN: usize = 400;
/// Width of a panel in pixels.
const PANEL: u32 = 420;
/// Height of the figure in pixels: with titles and labels taken off, the plotted area is a square.
const HEIGHT: u32 = PANEL + 37;
const MOVED: RGBColor = RGBColor(214, 90, 49);
const ELLIPSE: RGBColor = RGBColor(20, 20, 20);
/// Half width that the largest ellipse is enlarged to, at most, as a share of the figure.
const ELLIPSE_SHARE: f64 = 0.1;
const TARGET: RGBColor = RGBColor(44, 92, 138);

/// Return the number of 1, 2, 5, 10, 20, ... by which the ellipses of panels are enlarged to be seen; 1 where they are large.
///
/// ```
/// use cfpose_lab::plot::{Ellipse, Panel, enlargement};
/// let ellipse = Ellipse { centre: [0.0, 0.0], root: [0.001, 0.0, 0.001] };
/// let corners = vec![[-0.5, 0.0], [0.5, 0.0]];
/// let panel = Panel { moved: corners, ellipses: vec![ellipse], ..Panel::default() };
/// assert_eq!(enlargement(&[panel]), 20.0);
/// ```
pub fn enlargement(panels: &[Panel]) -> f64 {
    let largest = panels.iter().flat_map(|panel| &panel.ellipses).map(Ellipse::half_width).fold(0.0, f64::max);
    let room = bounds(panels).map_or(0.0, |ranges| {
        ELLIPSE_SHARE * ranges.iter().map(|(low, high)| high - low).fold(0.0, f64::max) / largest
    });
    let mut factor = 1.0;
    for next in (0..6).flat_map(|power| [1.0, 2.0, 5.0].map(|digit| digit * 10_f64.powi(power))) {
        if next <= room && room.is_finite() {
            factor = next;
        }
    }
    factor
}

/// Draw panels side by side, all with the same axes and equal units in x and y; returns the text of an SVG file.
///
/// ```
/// use cfpose_lab::plot::{Panel, overlay};
/// let panel = Panel { title: "before".into(), moved: vec![[0.0, 0.0]], target: vec![[1.0, 1.0]], ..Panel::default() };
/// let svg = overlay("two points", &[panel]).unwrap();
/// assert!(svg.starts_with("<svg") && svg.contains("before"));
/// ```
///
/// # Errors
/// [`LabError::Plot`] when there is nothing finite to draw.
pub fn overlay(title: &str, panels: &[Panel]) -> Result<String, LabError> {
    let failure = |problem: String| LabError::Plot { figure: title.to_string(), problem };
    let ranges = ranges(panels).ok_or_else(|| failure("there are no finite points".to_string()))?;
    let mut svg = String::new();
    draw(SVGBackend::with_string(&mut svg, size(panels)), title, panels, &ranges).map_err(failure)?;
    Ok(svg)
}

/// Draw panels as [`overlay`] does; returns the bytes of a PNG file.
///
/// ```
/// use cfpose_lab::plot::{Panel, overlay_png};
/// let panel = Panel { title: "before".into(), moved: vec![[0.0, 0.0]], target: vec![[1.0, 1.0]], ..Panel::default() };
/// assert!(overlay_png("two points", &[panel]).unwrap().starts_with(b"\x89PNG"));
/// ```
///
/// # Errors
/// As [`overlay`].
pub fn overlay_png(title: &str, panels: &[Panel]) -> Result<Vec<u8>, LabError> {
    let failure = |problem: String| LabError::Plot { figure: title.to_string(), problem };
    let ranges = ranges(panels).ok_or_else(|| failure("there are no finite points".to_string()))?;
    let mut raster = raster::Raster::new(size(panels));
    draw(&mut raster, title, panels, &ranges).map_err(failure)?;
    raster.png().map_err(failure)
}

/// Ranges of x and y.
type Ranges = [std::ops::Range<f64>; 2];

/// Return the ranges of every panel, of equal length in x and y; none without a finite point.
fn ranges(panels: &[Panel]) -> Option<Vec<Ranges>> {
    let square = |panels: &[Panel]| {
        let bounds = bounds(panels)?;
        let half = bounds.iter().map(|(low, high)| high - low).fold(1e-9, f64::max) * 0.55;
        Some(bounds.map(|(low, high)| (0.5 * (low + high) - half)..(0.5 * (low + high) + half)))
    };
    let shared: Vec<Panel> = panels.iter().filter(|panel| !panel.own_axes).cloned().collect();
    let all = square(&shared).or_else(|| square(panels))?;
    let own = |panel: &Panel| if panel.own_axes { square(std::slice::from_ref(panel)) } else { None };
    Some(panels.iter().map(|panel| own(panel).unwrap_or_else(|| all.clone())).collect())
}

fn size(panels: &[Panel]) -> (u32, u32) {
    (PANEL * u32::try_from(panels.len()).unwrap_or(1), HEIGHT)
}

/// Return the least and largest coordinates over all panels; none without a finite point.
fn bounds(panels: &[Panel]) -> Option<[(f64, f64); 2]> {
    let points = panels.iter().flat_map(|panel| panel.moved.iter().chain(&panel.target));
    let finite: Vec<&[f64; 2]> = points.filter(|p| p.iter().all(|x| x.is_finite())).collect();
    let range = |d: usize| {
        finite.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| (low.min(p[d]), high.max(p[d])))
    };
    (!finite.is_empty()).then(|| [range(0), range(1)])
}

fn draw<B: DrawingBackend>(backend: B, title: &str, panels: &[Panel], ranges: &[Ranges]) -> Result<(), String> {
    let area = backend.into_drawing_area();
    let text = |e: DrawingAreaErrorKind<B::ErrorType>| e.to_string();
    area.fill(&WHITE).map_err(text)?;
    let area = area.titled(title, ("sans-serif", 20)).map_err(text)?;
    for ((panel, place), ranges) in panels.iter().zip(area.split_evenly((1, panels.len()))).zip(ranges) {
        let mut chart = ChartBuilder::on(&place)
            .caption(&panel.title, ("sans-serif", 15))
            .margin(8)
            .x_label_area_size(24)
            .y_label_area_size(36)
            .build_cartesian_2d(ranges[0].clone(), ranges[1].clone())
            .map_err(text)?;
        chart.configure_mesh().x_labels(5).y_labels(5).light_line_style(WHITE).draw().map_err(text)?;
        let lines = thinned_lines(&panel.lines);
        let lines =
            lines.map(|[from, to]| PathElement::new(vec![(from[0], from[1]), (to[0], to[1])], ELLIPSE.mix(0.4)));
        chart.draw_series(lines).map_err(text)?;
        let [moved, target] = panel.labels.clone().unwrap_or(["moved".to_string(), "target".to_string()]);
        for (label, set, colour, radius) in [(target, &panel.target, TARGET, 3), (moved, &panel.moved, MOVED, 1)] {
            let dots = thinned(set).map(|p| Circle::new((p[0], p[1]), radius, colour.mix(0.7).filled()));
            chart
                .draw_series(dots)
                .map_err(text)?
                .label(label)
                .legend(move |(x, y)| Circle::new((x + 8, y), 4, colour.filled()));
        }
        if !panel.ellipses.is_empty() {
            let factor = enlargement(panels);
            let outlines = panel.ellipses.iter().map(|ellipse| {
                let outline = ellipse.outline(factor).into_iter().map(|p| (p[0], p[1]));
                PathElement::new(outline.collect::<Vec<_>>(), ELLIPSE.stroke_width(2))
            });
            let label = if factor > 1.0 { format!("95 %, x {factor}") } else { "95 %".to_string() };
            chart
                .draw_series(outlines)
                .map_err(text)?
                .label(label)
                .legend(|(x, y)| PathElement::new(vec![(x, y), (x + 16, y)], ELLIPSE.stroke_width(2)));
        }
        chart
            .configure_series_labels()
            .background_style(WHITE.mix(0.8))
            .position(SeriesLabelPosition::LowerRight)
            .draw()
            .map_err(text)?;
    }
    area.present().map_err(text)
}

fn thinned_lines(lines: &[[[f64; 2]; 2]]) -> impl Iterator<Item = &[[f64; 2]; 2]> {
    let finite = |line: &&[[f64; 2]; 2]| line.as_flattened().iter().all(|x| x.is_finite());
    lines.iter().step_by(lines.len().div_ceil(MAX_DRAWN).max(1)).filter(finite)
}

fn thinned(points: &[[f64; 2]]) -> impl Iterator<Item = &[f64; 2]> {
    points.iter().step_by(points.len().div_ceil(MAX_DRAWN).max(1)).filter(|p| p.iter().all(|x| x.is_finite()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Read (cx, cy) of all circles of the given radius.
    fn circles(svg: &str, radius: &str) -> Vec<[f64; 2]> {
        let value = |tag: &str, name: &str| {
            let rest = tag.split_once(&format!(" {name}=\"")).map(|(_, rest)| rest).unwrap();
            rest.split_once('"').map(|(value, _)| value.to_string()).unwrap()
        };
        svg.split("<circle")
            .skip(1)
            .filter(|tag| value(tag, "r") == radius)
            .map(|tag| ["cx", "cy"].map(|name| value(tag, name).parse().unwrap()))
            .collect()
    }

    #[test]
    fn units_are_equal_in_x_and_y_and_panels_share_their_axes() {
        let corners = vec![[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [f64::NAN, 0.0]];
        let panel = |title: &str| Panel {
            title: title.to_string(),
            moved: vec![[0.5, 0.5]],
            target: corners.clone(),
            ..Panel::default()
        };
        let svg = overlay("square", &[panel("left"), panel("right")]).unwrap();
        let drawn = circles(&svg, "3");
        assert_eq!(drawn.len(), 6);
        let (right, up) = (drawn[1][0] - drawn[0][0], drawn[0][1] - drawn[2][1]);
        assert!(right > 250.0 && (right - up).abs() <= 1.0, "{right} {up}");
        assert!((drawn[3][0] - drawn[0][0] - f64::from(PANEL)).abs() <= 1.0 && drawn[3][1] == drawn[0][1]);
        assert!(overlay("nothing", &[]).is_err());
    }
}
