//! Figures as SVG text: point sets before and after an estimate.

use cfpose::{Estimator, Points};
use plotters::prelude::*;

use crate::error::LabError;

/// One panel: two sets of points in the plane.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Title above the panel.
    pub title: String,
    /// Moved points, drawn over the target.
    pub moved: Vec<[f64; 2]>,
    /// Target points.
    pub target: Vec<[f64; 2]>,
}

/// Most points that are drawn of a set; a larger set is thinned evenly.
const MAX_DRAWN: usize = 400;
/// Width of a panel in pixels.
const PANEL: u32 = 420;
/// Height of the figure in pixels: with titles and labels taken off, the plotted area is a square.
const HEIGHT: u32 = PANEL + 37;
const MOVED: RGBColor = RGBColor(214, 90, 49);
const TARGET: RGBColor = RGBColor(44, 92, 138);

/// Return the image coordinates (x / z, y / z) of points in 3-D, points at depth <= 0 left out; the first two coordinates
/// of points in the plane.
pub fn image_coordinates(points: &Points) -> Vec<[f64; 2]> {
    let all = (0..points.len()).map(|k| points.point(k));
    if points.dim() < 3 {
        return all.map(|[x, y, _]| [x, y]).collect();
    }
    all.filter(|p| p[2] > 0.0).map(|[x, y, z]| [x / z, y / z]).collect()
}

/// Return the first two coordinates: points in 3-D seen along z.
pub fn seen_from_above(points: &Points) -> Vec<[f64; 2]> {
    (0..points.len()).map(|k| points.point(k)).map(|[x, y, _]| [x, y]).collect()
}

/// Make one panel per theta (ambient): where the model puts the source, over the target.
///
/// Motions of points in 3-D are seen along z, models that project (to rays, to an image) in the image plane.
///
/// # Errors
/// [`PointsError`] when a mapped point is not finite.
pub fn panels(estimator: &Estimator, thetas: &[(&str, &[f64])]) -> Result<Vec<Panel>, cfpose::Error> {
    let projects = !estimator.model().source.factored().is_some_and(|facts| facts.identity_projection);
    let flat = if projects { image_coordinates } else { seen_from_above };
    let panel = |(title, theta): &(&str, &[f64])| {
        let (moved, target) = estimator.mapped(theta)?;
        Ok(Panel { title: (*title).to_string(), moved: flat(&moved), target: flat(&target) })
    };
    thetas.iter().map(panel).collect()
}

/// Draw panels side by side, all with the same axes and equal units in x and y; returns the text of an SVG file.
///
/// ```
/// use cfpose_lab::plot::{Panel, overlay};
/// let panel = Panel { title: "before".into(), moved: vec![[0.0, 0.0]], target: vec![[1.0, 1.0]] };
/// let svg = overlay("two points", &[panel]).unwrap();
/// assert!(svg.starts_with("<svg") && svg.contains("before"));
/// ```
///
/// # Errors
/// [`LabError::Plot`] when there is nothing finite to draw.
pub fn overlay(title: &str, panels: &[Panel]) -> Result<String, LabError> {
    let failure = |problem: String| LabError::Plot { figure: title.to_string(), problem };
    let points = || panels.iter().flat_map(|panel| panel.moved.iter().chain(&panel.target));
    let finite = || points().filter(|p| p.iter().all(|x| x.is_finite()));
    if finite().next().is_none() {
        return Err(failure("there are no finite points".to_string()));
    }
    let bounds = [0, 1]
        .map(|d| finite().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| (low.min(p[d]), high.max(p[d]))));
    let half = bounds.iter().map(|(low, high)| high - low).fold(1e-9, f64::max) * 0.55;
    let ranges = bounds.map(|(low, high)| (0.5 * (low + high) - half)..(0.5 * (low + high) + half));
    let mut svg = String::new();
    draw(&mut svg, title, panels, &ranges).map_err(failure)?;
    Ok(svg)
}

fn draw(svg: &mut String, title: &str, panels: &[Panel], ranges: &[std::ops::Range<f64>; 2]) -> Result<(), String> {
    let width = PANEL * u32::try_from(panels.len()).unwrap_or(1);
    let area = SVGBackend::with_string(svg, (width, HEIGHT)).into_drawing_area();
    let text = |e: DrawingAreaErrorKind<std::io::Error>| e.to_string();
    area.fill(&WHITE).map_err(text)?;
    let area = area.titled(title, ("sans-serif", 20)).map_err(text)?;
    for (panel, place) in panels.iter().zip(area.split_evenly((1, panels.len()))) {
        let mut chart = ChartBuilder::on(&place)
            .caption(&panel.title, ("sans-serif", 15))
            .margin(8)
            .x_label_area_size(24)
            .y_label_area_size(36)
            .build_cartesian_2d(ranges[0].clone(), ranges[1].clone())
            .map_err(text)?;
        chart.configure_mesh().x_labels(5).y_labels(5).light_line_style(WHITE).draw().map_err(text)?;
        for (label, set, colour, radius) in [("target", &panel.target, TARGET, 3), ("moved", &panel.moved, MOVED, 1)] {
            let dots = thinned(set).map(|p| Circle::new((p[0], p[1]), radius, colour.mix(0.7).filled()));
            chart
                .draw_series(dots)
                .map_err(text)?
                .label(label)
                .legend(move |(x, y)| Circle::new((x + 8, y), 4, colour.filled()));
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
        let panel = |title: &str| Panel { title: title.to_string(), moved: vec![[0.5, 0.5]], target: corners.clone() };
        let svg = overlay("square", &[panel("left"), panel("right")]).unwrap();
        let drawn = circles(&svg, "3");
        assert_eq!(drawn.len(), 6);
        let (right, up) = (drawn[1][0] - drawn[0][0], drawn[0][1] - drawn[2][1]);
        assert!(right > 250.0 && (right - up).abs() <= 1.0, "{right} {up}");
        assert!((drawn[3][0] - drawn[0][0] - f64::from(PANEL)).abs() <= 1.0 && drawn[3][1] == drawn[0][1]);
        assert!(overlay("nothing", &[]).is_err());
    }
}
