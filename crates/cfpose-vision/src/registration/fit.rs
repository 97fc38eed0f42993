//! The contour fit: search, weigh, step; again with a shorter search.

use std::sync::Arc;

use cfpose_optim::solvers::GaussNewton;
use cfpose_optim::{Control, Manifold, Solver, Stopping};

use super::edges::Field;
use super::mapper::Mapped;
use super::pattern::Pattern;
use super::predicted::{Blur, Drawn};
use super::problem::EdgeProblem;
use super::registrar::{Outlined, Registrar};
use super::sight::Sight;
use super::view::View;
use super::{bend, edges};

/// Fewest edges of a fit.
const FEWEST: usize = 12;

/// Residuals beyond this many standard deviations do not count (Tukey's biweight).
const TUKEY: f64 = 4.0;

/// Smallest scale of the residuals on the way and at the end, pixels.
const LEAST_SCALE: [f64; 2] = [0.15, 0.05];

/// Step at which a fit ends: tangent coordinates.
const REST: f64 = 1e-6;

/// Steps with edges that the mapped and blurred reference's were taken from.
const BLURRED_STEPS: usize = 3;

/// How far the search goes, pixels, and how often each distance is used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Schedule {
    /// Reaches, one after the other.
    pub reaches: &'static [f64],
    /// Steps at each reach.
    pub steps: usize,
    /// Steps at the last reach, at most.
    pub last: usize,
    /// Steps with edges that the blur's shift was taken from.
    pub unbent: usize,
}

impl Schedule {
    /// After a first pose by moments.
    pub const NEAR: Self = Self { reaches: &[8.0, 5.0, 3.0, 3.0], steps: 4, last: 12, unbent: 3 };
    /// From far away, or where parts are hidden.
    pub const FAR: Self =
        Self { reaches: &[40.0, 25.0, 15.0, 10.0, 7.0, 5.0, 4.0, 3.0], steps: 3, last: 12, unbent: 3 };
    /// After a first pose by the moments of greys, of which parts are hidden.
    pub const GREYS: Self = Self { reaches: &[25.0, 18.0, 12.0, 8.0, 5.0, 3.0, 3.0], steps: 3, last: 12, unbent: 3 };
    /// The same as `FAR` with few places, to see whether it leads anywhere.
    pub const SCREEN: Self = Self { steps: 2, last: 3, unbent: 0, ..Self::FAR };
    /// From another tilt that may fit as well.
    pub const TILT: Self = Self { reaches: &[6.0, 4.0, 3.0, 3.0], steps: 4, last: 12, unbent: 3 };
    /// From starts about a theta, to see whether they lead to a better one.
    pub const ABOUT: Self = Self { reaches: &[25.0, 12.0, 6.0, 3.0], steps: 2, last: 4, unbent: 0 };
    /// Where a fit stands that only the field changes under.
    pub const LAST: Self = Self { reaches: &[4.0, 3.0], steps: 3, last: 12, unbent: 3 };
    /// From the last frame's pose with few places, and then with all.
    pub const FOLLOW: Self = Self { reaches: &[20.0, 10.0, 5.0], steps: 1, last: 3, unbent: 0 };
    /// Where few places have led.
    pub const SETTLE: Self = Self { reaches: &[3.0], steps: 1, last: 2, unbent: 2 };
    /// From another tilt, with few places.
    pub const TILT_FOLLOWED: Self = Self { reaches: &[6.0, 3.0], steps: 2, last: 3, unbent: 0 };
    /// From the last frame's pose.
    pub const TRACK: Self = Self { reaches: &[20.0, 12.0, 8.0, 5.0, 3.0], steps: 3, last: 12, unbent: 3 };
}

/// Edges that a search found.
pub(super) struct Found {
    /// Signed distance along the normal, pixels; NaN where there is none.
    pub distances: Vec<f64>,
    /// Slope of the field there.
    pub slopes: Vec<f64>,
    /// Edges on the plane z = 1.
    pub edges: Vec<[f64; 2]>,
    /// Normals on the plane z = 1.
    pub normals: Vec<[f64; 2]>,
    /// Normals in pixels.
    pub across: Vec<[f64; 2]>,
    /// Mapped places in pixels.
    pub pixels: Vec<[f64; 2]>,
    /// Whether a place lies in the frame, in front of the camera and where nothing is known to hide it.
    pub visible: Vec<bool>,
}

impl Found {
    /// Move edges along their normals, pixels.
    fn move_by(&mut self, shifts: &[f64], view: &Sight) {
        for (i, shift) in shifts.iter().enumerate().filter(|(_, shift)| **shift != 0.0) {
            if self.distances[i].is_nan() {
                continue;
            }
            let distance = self.distances[i] + shift;
            let place = [0, 1].map(|d| self.pixels[i][d] + distance * self.across[i][d]);
            if let Some(edge) = view.camera.place_of(place) {
                (self.distances[i], self.edges[i]) = (distance, edge);
            }
        }
    }
}

/// A theta that the contour fits.
#[derive(Debug, Clone, PartialEq)]
pub struct ContourFit {
    /// Ambient theta.
    pub theta: Vec<f64>,
    /// Steps taken.
    pub steps: usize,
}

impl Registrar {
    /// Fit the contour from a theta; `None` where too few edges are found.
    ///
    /// Each step solves a least-squares problem of the distances along fixed normals, weighted by Tukey's biweight with the scale of the
    /// median (correspondence lines: M. Stoiber et al., "SRT3D", 2022, reduced to a plane).
    pub fn by_contour(&self, pattern: &Pattern, view: &View, theta: &[f64], schedule: Schedule) -> Option<ContourFit> {
        let outlined = self.outlined(pattern).ok()?;
        self.fit_outline(&outlined, view, theta, schedule)
    }

    pub(super) fn fit_outline(
        &self,
        outlined: &Outlined,
        view: &Sight,
        theta: &[f64],
        schedule: Schedule,
    ) -> Option<ContourFit> {
        let manifold: Arc<dyn Manifold> = self.manifold_at(theta);
        let mut theta = theta.to_vec();
        let mut steps = 0;
        let last = schedule.reaches.len() - 1;
        for (stage, reach) in schedule.reaches.iter().enumerate() {
            let (count, least) = match stage == last {
                true => (schedule.last, LEAST_SCALE[1]),
                false => (schedule.steps, LEAST_SCALE[0]),
            };
            for _ in 0..count {
                let found = self.search(outlined, view, &theta, *reach)?;
                let next = step(outlined, &manifold, &found, &theta, view.camera.focal(), least)?;
                let mut moved = vec![0.0; manifold.tangent()];
                manifold.local(&theta, &next, &mut moved);
                theta = next;
                steps += 1;
                if moved.iter().all(|d| d.abs() < REST) {
                    break;
                }
            }
        }
        // Once more with the edges where they would be without blur.
        for _ in 0..schedule.unbent {
            let mut found = self.search(outlined, view, &theta, 3.0)?;
            let shifts = bend::shifts(&found);
            found.move_by(&shifts, view);
            theta = step(outlined, &manifold, &found, &theta, view.camera.focal(), LEAST_SCALE[1])?;
        }
        theta.iter().all(|value| value.is_finite()).then_some(ContourFit { theta, steps })
    }

    /// Fit once more with the edges where they would be without the frame's blur: the search's distances on the mapped reference, blurred
    /// alike, are taken off. `None` where the blur is not found.
    pub(super) fn fit_blurred(
        &self,
        outlined: &Outlined,
        pattern: &Pattern,
        view: &View,
        theta: &[f64],
        deviation: f64,
    ) -> Option<ContourFit> {
        let manifold: Arc<dyn Manifold> = self.manifold_at(theta);
        let mut theta = theta.to_vec();
        let found = self.search(outlined, view, &theta, 3.0)?;
        let drawn = Drawn::new(self, pattern, view, &theta, &found.pixels)?;
        let blur = drawn.blur_of(view, &found, Blur::round((deviation * deviation - 0.6).max(0.0)))?;
        let shifts = drawn.shifts(outlined, &found, blur);
        for _ in 0..BLURRED_STEPS {
            let mut found = self.search(outlined, view, &theta, 3.0)?;
            found.move_by(&shifts, view);
            theta = step(outlined, &manifold, &found, &theta, view.camera.focal(), LEAST_SCALE[1])?;
        }
        theta.iter().all(|value| value.is_finite()).then_some(ContourFit { theta, steps: BLURRED_STEPS })
    }

    /// Search the edges of a contour at a theta.
    pub(super) fn search(&self, outlined: &Outlined, view: &Sight, theta: &[f64], reach: f64) -> Option<Found> {
        let places: Mapped = outlined.places.at(theta, None);
        let next: Mapped = outlined.ahead.at(theta, None);
        let count = places.x.len();
        let (w, h) = (view.field.width() as f64, view.field.height() as f64);
        let mut found = Found {
            distances: vec![f64::NAN; count],
            slopes: vec![f64::NAN; count],
            edges: vec![[0.0; 2]; count],
            normals: vec![[0.0; 2]; count],
            across: vec![[0.0; 2]; count],
            pixels: vec![[f64::NAN; 2]; count],
            visible: vec![false; count],
        };
        for i in 0..count {
            if !places.ahead[i] {
                continue;
            }
            let (a, b) = (places.x[i], next.x[i]);
            let along = [b[0] - a[0], b[1] - a[1]];
            let size = along[0].hypot(along[1]);
            if !(size > 0.0 && size.is_finite()) {
                continue;
            }
            let normal = [along[1] / size, -along[0] / size];
            let pixel = view.camera.pixel_of(a);
            let tip = view.camera.pixel_of([a[0] + 1e-3 * normal[0], a[1] + 1e-3 * normal[1]]);
            let across = [tip[0] - pixel[0], tip[1] - pixel[1]];
            let length = across[0].hypot(across[1]).max(1e-300);
            let across = across.map(|v| v / length);
            (found.normals[i], found.across[i], found.pixels[i]) = (normal, across, pixel);
            let inside = pixel[0] > 2.0 && pixel[1] > 2.0 && pixel[0] < w - 3.0 && pixel[1] < h - 3.0;
            found.visible[i] = inside && view.field.sample(pixel[0], pixel[1]).is_some_and(|v| !v.is_nan());
            let Some(edge) = edges::nearest(&view.field, pixel, across, reach, outlined.levels[i]) else { continue };
            let place = [pixel[0] + edge.distance * across[0], pixel[1] + edge.distance * across[1]];
            let Some(seen) = view.camera.place_of(place) else { continue };
            (found.distances[i], found.slopes[i], found.edges[i]) = (edge.distance, edge.slope, seen);
        }
        Some(found)
    }
}

/// Take one step of the reweighted fit.
fn step(
    outlined: &Outlined,
    manifold: &Arc<dyn Manifold>,
    found: &Found,
    theta: &[f64],
    focal: f64,
    least: f64,
) -> Option<Vec<f64>> {
    let mut sizes: Vec<f32> = found.distances.iter().filter(|d| !d.is_nan()).map(|d| d.abs() as f32).collect();
    if sizes.len() < FEWEST.max(manifold.tangent() + 2) {
        return None;
    }
    let scale = (1.4826 * f64::from(crate::segment::median(&mut sizes)?)).max(least);
    let weight = |d: f64| if d.is_nan() { 0.0 } else { (1.0 - (d / (TUKEY * scale)).powi(2)).max(0.0) };
    let problem = EdgeProblem {
        mapper: &outlined.places,
        manifold: Arc::clone(manifold),
        edges: found.edges.clone(),
        normals: found.normals.clone(),
        // The square root of Tukey's (1 - u^2)^2.
        factors: found.distances.iter().map(|d| weight(*d) * focal).collect(),
    };
    let stopping = Stopping { max_iterations: 1, max_evaluations: 6, ..Stopping::default() };
    let mut control = Control { stopping, ..Control::default() };
    let outcome = GaussNewton::default().solve(&problem, theta, &mut control).ok()?;
    outcome.theta.iter().all(|v| v.is_finite()).then_some(outcome.theta)
}
