//! Weights of the mapped point, given as data with the target: what a frame can show.

use cfpose::block::{DynMap, FactoredFacts, LiftedPoints, MapBlock, PreparedMap, Transform};
use cfpose::{Isa, Points};
use num_dual::HyperDual64;

use crate::camera::Camera;
use crate::raster::Raster;

/// Share of each place that a frame can show, from 0 to 1, over the pixels of a pinhole camera.
///
/// The weight of a source point p becomes w V(h(p, theta)). Both V and its gradient enter the means by the quotient rule, as the area
/// element does.
#[derive(Debug, Clone)]
pub struct Visibility {
    field: Raster,
    scale: [f64; 2],
    offset: [f64; 2],
}

impl Visibility {
    /// Make the visibility of a frame from its hidden pixels and its border, smoothed over 2 pixels so that it has a gradient. A camera with
    /// a lens is resampled to a pinhole camera: this is a weight, not an image.
    pub fn new(hidden: Option<&[bool]>, width: usize, height: usize, camera: Camera) -> Self {
        const BORDER: usize = 4;
        let inside = |x: usize, y: usize| {
            let clear = x >= BORDER && y >= BORDER && x + BORDER < width && y + BORDER < height;
            clear && !hidden.is_some_and(|hidden| hidden[y * width + x])
        };
        let seen = Raster::from_fn(width, height, |x, y| f32::from(u8::from(inside(x, y)))).gaussian(2.0);
        let k = camera.intrinsics();
        let field = if camera.lens() == crate::camera::Lens::None {
            seen
        } else {
            Raster::from_fn(width, height, |x, y| {
                let place = [(x as f64 - k.cx) / k.fx, (y as f64 - k.cy) / k.fy];
                let [u, v] = camera.pixel_of(place);
                seen.sample(u, v).unwrap_or(0.0) as f32
            })
        };
        Self { field, scale: [k.fx, k.fy], offset: [k.cx, k.cy] }
    }

    /// Return V at a pixel.
    pub fn at_pixel(&self, x: f64, y: f64) -> f64 {
        self.field.sample(x, y).unwrap_or(0.0)
    }

    /// Return V and its gradient at a place of the plane z = 1; 0 outside the frame.
    fn at(&self, place: [f64; 2]) -> [f64; 3] {
        let pixel = [0, 1].map(|d| place[d] * self.scale[d] + self.offset[d]);
        match self.field.slope(pixel[0], pixel[1]) {
            Some([value, dx, dy]) => [value, dx * self.scale[0], dy * self.scale[1]],
            None => [0.0; 3],
        }
    }
}

/// A map whose points count as far as they are seen.
pub(super) struct Seen {
    pub map: Box<dyn DynMap>,
    pub visibility: std::sync::Arc<Visibility>,
}

impl DynMap for Seen {
    fn point_dim(&self) -> usize {
        self.map.point_dim()
    }

    fn dim(&self) -> usize {
        self.map.dim()
    }

    fn factored(&self) -> Option<FactoredFacts> {
        None
    }

    fn attribute(&self) -> Option<&'static str> {
        self.map.attribute()
    }

    fn lift(&self, points: &Points) -> LiftedPoints {
        self.map.lift(points)
    }

    fn prepare(&self, theta: &[f64], basis: &[f64], tangent: usize) -> PreparedMap {
        self.map.prepare(theta, basis, tangent)
    }

    fn block(
        &self,
        isa: Isa,
        prepared: &PreparedMap,
        transform: &Transform,
        points: &LiftedPoints,
        start: usize,
        out: &mut MapBlock,
    ) {
        self.map.block(isa, prepared, transform, points, start, out);
        let (mean, matrix) = (transform.mean(), transform.matrix());
        let scale = [matrix[0][0], matrix[1][1]];
        let tangent = prepared.tangent;
        for k in 0..out.weight.0.len() {
            // The feature space is normalised by a mean and a scale along each axis: undone here.
            let place = [0, 1].map(|d| out.x[d].0[k] / scale[d] + mean[d]);
            let [seen, gx, gy] = self.visibility.at(place);
            for j in 0..tangent {
                // d (w V) = V dw + w (gradient of V) dx; dx comes times w.
                let (dx, dy) = (out.dx[j].0[k] / scale[0], out.dx[tangent + j].0[k] / scale[1]);
                let moved = if out.moving_weight { out.dweight[j].0[k] } else { 0.0 };
                out.dweight[j].0[k] = seen * moved + gx * dx + gy * dy;
                out.dx[j].0[k] *= seen;
                out.dx[tangent + j].0[k] *= seen;
            }
            out.weight.0[k] *= seen;
        }
        out.moving_weight = true;
        out.unit_weight = false;
    }

    fn hyper(&self, theta: &[HyperDual64], lifted: &[f64], out: &mut [HyperDual64]) -> HyperDual64 {
        let weight = self.map.hyper(theta, lifted, out);
        let [value, gx, gy] = self.visibility.at([out[0].re, out[1].re]);
        let (dx, dy) = (out[0] - out[0].re, out[1] - out[1].re);
        weight * (dx * gx + dy * gy + value)
    }
}
