//! A printed design as a reference: shapes of an SVG file or polygons of a text file, in millimetres.

mod polygons;
mod svg;

use std::path::Path;

use crate::bytes::read_bytes;
use crate::camera::Camera;
use crate::error::{Fault, FileError, Flaw};
use crate::raster::Raster;
use crate::render::winding;

/// Most corners of a design, and most bytes of its file.
const MOST_CORNERS: usize = 400_000;
const MOST_BYTES: usize = 32 << 20;

/// Pixels along the longer side of a design that is drawn, and of the margin around it.
const DRAWN: f64 = 480.0;
const MARGIN: f64 = 24.0;

/// One shape of a design: closed rings and the side that they enclose.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// Corners, x to the right and y down, in the unit of the file.
    pub rings: Vec<Vec<[f64; 2]>>,
    /// Whether the shape is pattern; otherwise it is background painted over what is below it.
    pub dark: bool,
    /// Whether places that rings wind around twice are outside (SVG's `evenodd`).
    pub even_odd: bool,
}

/// Shapes in the order in which they are painted, in millimetres.
#[derive(Debug, Clone, PartialEq)]
pub struct Design {
    /// Shapes, later ones over earlier ones.
    pub shapes: Vec<Shape>,
    /// Least and largest x and y of the pattern.
    pub bounds: [[f64; 2]; 2],
}

/// Say whether a file is read as a design: by its extension, svg, csv, tsv or txt.
pub fn is_design(path: &Path) -> bool {
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    extension.is_some_and(|extension| ["svg", "csv", "tsv", "txt"].contains(&extension.as_str()))
}

/// Read a design. `size` is its larger extent in millimetres; without it an SVG file has to give its width or height in a unit of length,
/// and polygons are in millimetres.
///
/// SVG: filled `path`, `polygon`, `polyline`, `rect`, `circle` and `ellipse` with transforms; fills darker than the middle are
/// pattern, lighter ones background. Text: a corner x, y a line, an empty line between polygons.
///
/// # Errors
/// [`FileError`] for a file that cannot be read, holds no dark shape, or has no size.
pub fn read_design(path: &Path, size: Option<f64>) -> Result<Design, FileError> {
    let read = || -> Result<Design, Flaw> {
        let bytes = read_bytes(path)?;
        let wrong = |what: String| Fault::Design { what };
        if bytes.len() > MOST_BYTES {
            return Err(wrong(format!("{} bytes are more than the {MOST_BYTES} of a design", bytes.len())).into());
        }
        let text = std::str::from_utf8(&bytes).map_err(|_| wrong("this is no text".into()))?;
        let is_svg = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("svg"));
        let (shapes, scale) = if is_svg { svg::read(text).map_err(wrong)? } else { (polygons::read(text)?, Some(1.0)) };
        Ok(Design::new(shapes, scale, size).map_err(wrong)?)
    };
    read().map_err(|flaw| flaw.in_file(path))
}

impl Design {
    /// Make a design of shapes; `scale` are millimetres in a unit of theirs where that is known, `size` the larger extent in millimetres.
    fn new(mut shapes: Vec<Shape>, scale: Option<f64>, size: Option<f64>) -> Result<Self, String> {
        let corners = || shapes.iter().flat_map(|shape| shape.rings.iter().flatten().map(|p| (*p, shape.dark)));
        let count = corners().count();
        if count > MOST_CORNERS {
            return Err(format!("{count} corners are more than the {MOST_CORNERS} of a design"));
        }
        if !corners().all(|(p, _)| p.iter().all(|v| v.abs() < 1e12)) {
            return Err("a corner is no finite number".into());
        }
        let extent = |d: usize| {
            let dark = corners().filter(|(_, dark)| *dark);
            dark.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], (p, _)| [a.min(p[d]), b.max(p[d])])
        };
        let bounds = [extent(0), extent(1)];
        let largest = bounds.iter().map(|[low, high]| high - low).fold(0.0, f64::max);
        let least = bounds.iter().map(|[low, high]| high - low).fold(f64::INFINITY, f64::min);
        if !(least > 0.0 && least.is_finite() && largest < 1000.0 * least) {
            return Err("no dark shape has an area".into());
        }
        let scale = match (size, scale) {
            (Some(size), _) => size / largest,
            (None, Some(scale)) => scale,
            (None, None) => return Err("the file gives its width in no unit of length".into()),
        };
        shapes.iter_mut().flat_map(|shape| &mut shape.rings).flatten().flatten().for_each(|v| *v *= scale);
        Ok(Self { shapes, bounds: bounds.map(|range| range.map(|v| v * scale)) })
    }

    /// Return the larger of width and height, millimetres.
    pub fn extent(&self) -> f64 {
        self.bounds.iter().map(|[low, high]| high - low).fold(0.0, f64::max)
    }

    /// Return the middle of the pattern's bounds, millimetres.
    pub fn centre(&self) -> [f64; 2] {
        self.bounds.map(|[low, high]| 0.5 * (low + high))
    }

    /// Draw the share of pattern in each pixel, and return it with the camera that sees it so from `distance` millimetres in front of
    /// the design's centre.
    pub fn draw(&self, distance: f64) -> Option<(Raster, Camera)> {
        let scale = DRAWN / self.extent();
        let sides = self.bounds.map(|[low, high]| ((high - low) * scale + 2.0 * MARGIN).ceil() as usize);
        let centre = self.centre();
        let middle = sides.map(|side| (side as f64 - 1.0) / 2.0);
        let to_pixel = |p: &[f64; 2]| [0, 1].map(|d| (p[d] - centre[d]) * scale + middle[d]);
        let mut drawn = Raster::filled(sides[0], sides[1], 0.0);
        for shape in &self.shapes {
            let rings: Vec<Vec<[f64; 2]>> =
                shape.rings.iter().map(|ring| ring.iter().map(to_pixel).collect()).collect();
            let ink = if shape.dark { 1.0 } else { 0.0 };
            let cover = winding(&rings, shape.even_odd, sides[0], sides[1]);
            drawn.values_mut().iter_mut().zip(cover.values()).for_each(|(v, share)| *v += share * (ink - *v));
        }
        let focal = scale * distance;
        Some((drawn, Camera::new(focal, focal, middle[0], middle[1])?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_keep_their_place_and_size() {
        let text = r##"<svg xmlns="http://www.w3.org/2000/svg" width="40mm" viewBox="0 0 80 60">
            <rect width="80" height="60" fill="white"/>
            <g transform="translate(10 10)" fill="#102030">
              <path d="M0,0 h40 v20 h-40 z M10,5 h10 v10 h-10 z" fill-rule="evenodd"/>
              <circle cx="10" cy="30" r="8" style="fill: black; stroke: none"/>
              <polygon points="30,25 40,25 40,38" fill="none"/>
            </g></svg>"##;
        let (shapes, scale) = svg::read(text).unwrap();
        let design = Design::new(shapes, scale, None).unwrap();
        // Half a millimetre a unit: the path from 10 to 50 and 10 to 30 units, the circle down to 48.
        let near = |a: f64, b: f64| assert!((a - b).abs() < 0.01, "{a} {b}");
        near(design.bounds[0][0], 5.0 + 0.5 * 0.0);
        near(design.bounds[0][1], 25.0);
        near(design.bounds[1][1], 24.0);
        let (drawn, camera) = design.draw(100.0).unwrap();
        let area: f64 = drawn.values().iter().map(|v| f64::from(*v)).sum();
        let unit = camera.focal() / 100.0;
        let expected = (20.0 * 10.0 - 5.0 * 5.0 + std::f64::consts::PI * 16.0) * unit * unit;
        assert!((area / expected - 1.0).abs() < 2e-3, "{area} {expected}");
    }

    #[test]
    fn polygons_are_separated_by_empty_lines_and_errors_name_the_line() {
        let shapes =
            polygons::read("# two squares\nx,y\n0,0\n10,0\n10,10\n0,10\n\n10 10\n20 10\n20 20\n10 20\n").unwrap();
        let design = Design::new(shapes, Some(1.0), Some(40.0)).unwrap();
        assert_eq!((design.shapes.len(), design.bounds), (2, [[0.0, 40.0], [0.0, 40.0]]));
        assert_eq!(polygons::read("0,0\n1,0\n1,x\n").unwrap_err().at, crate::Place::Line(3));
        assert!(Design::new(Vec::new(), Some(1.0), None).is_err());
        assert!(svg::read("<svg><path d='M0 0 L1'/></svg>").is_err());
        // No length unit: the size has to be given.
        let (shapes, scale) = svg::read("<svg width='80'><rect width='3' height='4'/></svg>").unwrap();
        assert!(Design::new(shapes.clone(), scale, None).is_err() && Design::new(shapes, scale, Some(4.0)).is_ok());
    }
}
