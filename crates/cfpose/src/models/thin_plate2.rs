//! 2D-to-2D: thin-plate splines with fixed control points.

use std::sync::Arc;

use cfpose_kernel::points::Points;
use cfpose_kernel::scalar::Scalar;
use faer::Mat;
use faer::linalg::solvers::Solve;

use super::shared::projective::area_of;
use super::shared::warp::{AREA, PlaneBasis, warp};
use crate::entry::{BuildContext, BuildError, ParameterSpec, Parameters};
use crate::geometry::linalg::symmetric_eigen_any;
use crate::model::ResidualRows;
use crate::model::{Basin, ModelEntry};

/// Cardinal splines: B_i is 1 at control point i, 0 at the others, and bends least.
#[derive(Clone)]
struct Cardinal {
    control: Vec<[f64; 2]>,
    /// Kernel and affine weights of each spline, (n + 3) x n row by row.
    weights: Arc<Vec<f64>>,
}

/// U(r) = r^2 log r of the squared distance.
fn kernel(square: f64) -> f64 {
    if square > 0.0 { 0.5 * square * square.ln() } else { 0.0 }
}

impl Cardinal {
    /// Solve [K P; P' 0] [w; a] = [I; 0], with P the rows (1, x, y); `None` when the control points lie on a line.
    fn new(control: Vec<[f64; 2]>) -> Option<Self> {
        let n = control.len();
        let affine = |i: usize, c: usize| [1.0, control[i][0], control[i][1]][c];
        let system = Mat::from_fn(n + 3, n + 3, |i, k| match (i < n, k < n) {
            (true, true) => kernel(square_distance(control[i], control[k])),
            (true, false) => affine(i, k - n),
            (false, true) => affine(k, i - n),
            (false, false) => 0.0,
        });
        let right = Mat::from_fn(n + 3, n, |i, k| f64::from(u8::from(i == k)));
        // Partial pivoting: faer 0.24's full pivoting gives NaN for the four corners of a unit square.
        let solution = system.partial_piv_lu().solve(&right);
        let weights: Vec<f64> = (0..n + 3).flat_map(|i| (0..n).map(move |k| (i, k))).map(|at| solution[at]).collect();
        let cardinal = Self { control, weights: Arc::new(weights) };
        // The system of collinear points is singular, and rounding hides it: the splines tell.
        let mut values = vec![0.0; n];
        let holds = (0..n).all(|i| {
            cardinal.values(cardinal.control[i], &mut values);
            values.iter().enumerate().all(|(k, value)| (value - f64::from(u8::from(i == k))).abs() < 1e-6)
        });
        holds.then_some(cardinal)
    }

    /// Combine the rows (kernel values, then 1, x, y or their derivatives) into the splines.
    fn combine(&self, rows: impl Iterator<Item = f64>, out: &mut [f64]) {
        let n = self.control.len();
        out.fill(0.0);
        for (row, factor) in rows.enumerate() {
            for (value, weight) in out.iter_mut().zip(&self.weights[row * n..(row + 1) * n]) {
                *value += factor * weight;
            }
        }
    }

    /// Return rows whose squared norm is the bending energy of a coordinate's coefficients, times `factor`.
    fn bending_rows(&self, factor: f64) -> Vec<Vec<f64>> {
        // The energy is v' E v with E the upper left n x n part of the inverse (up to 8 pi).
        let n = self.control.len();
        let (values, vectors) = symmetric_eigen_any(n, |i, k| self.weights[i * n + k]);
        let largest = values.first().copied().unwrap_or(0.0);
        let bending = values.iter().zip(vectors).filter(|(value, _)| **value > 1e-9 * largest);
        bending.map(|(value, vector)| vector.iter().map(|entry| (factor * value).sqrt() * entry).collect()).collect()
    }
}

fn square_distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2)
}

impl PlaneBasis for Cardinal {
    fn num_terms(&self) -> usize {
        self.control.len()
    }
    fn values(&self, p: [f64; 2], out: &mut [f64]) {
        let kernels = self.control.iter().map(|c| kernel(square_distance(p, *c)));
        self.combine(kernels.chain([1.0, p[0], p[1]]), out);
    }
    fn gradients(&self, p: [f64; 2], along_x: &mut [f64], along_y: &mut [f64]) {
        for (axis, out) in [(0, along_x), (1, along_y)] {
            // dU/dx = (x - c_x)(log r^2 + 1)
            let slopes = self.control.iter().map(|c| {
                let square = square_distance(p, *c);
                if square > 0.0 { (p[axis] - c[axis]) * (square.ln() + 1.0) } else { 0.0 }
            });
            let affine = if axis == 0 { [0.0, 1.0, 0.0] } else { [0.0, 0.0, 1.0] };
            self.combine(slopes.chain(affine), out);
        }
    }
    fn of_linear(&self, constant: f64, slopes: [f64; 2]) -> Vec<f64> {
        self.control.iter().map(|c| constant + slopes[0] * c[0] + slopes[1] * c[1]).collect()
    }
}

/// The bending energy of both coordinates as residual rows.
struct Bending {
    rows: Vec<Vec<f64>>,
}

impl ResidualRows for Bending {
    fn num_rows(&self) -> usize {
        2 * self.rows.len()
    }
    fn rows<S: Scalar>(&self, theta: &[S], out: &mut [S]) {
        let k = theta.len() / 2;
        for coordinate in 0..2 {
            for (i, row) in self.rows.iter().enumerate() {
                let mut sum = theta[0].constant(0.0);
                for (value, factor) in theta[coordinate * k..(coordinate + 1) * k].iter().zip(row) {
                    sum = sum + *value * *factor;
                }
                out[coordinate * self.rows.len() + i] = sum;
            }
        }
    }
}

/// Return a grid of side x side points over the bounding box of the source, x fastest.
fn grid(source: Option<&Points>, side: usize) -> Vec<[f64; 2]> {
    let range = |d: usize| match source {
        Some(points) if d < points.dim() => {
            let fold = |pick: fn(f64, f64) -> f64, from: f64| points.column(d).iter().fold(from, |a, b| pick(a, *b));
            (fold(f64::min, f64::INFINITY), fold(f64::max, f64::NEG_INFINITY))
        }
        _ => (-0.5, 0.5),
    };
    let at = |(low, high): (f64, f64), i: usize| low + (high - low) * i as f64 / (side - 1) as f64;
    (0..side * side).map(|i| [at(range(0), i % side), at(range(1), i / side)]).collect()
}

/// Return `count` source points, each farthest from those before it, the one farthest from the mean first.
fn farthest(source: &Points, count: usize) -> Vec<[f64; 2]> {
    let points: Vec<[f64; 2]> = (0..source.len()).map(|k| [source.point(k)[0], source.point(k)[1]]).collect();
    let mean = source.mean();
    let mut away: Vec<f64> = points.iter().map(|p| square_distance(*p, [mean[0], mean[1]])).collect();
    let mut chosen = Vec::new();
    while chosen.len() < count.min(points.len()) {
        let best = (0..points.len()).fold(0, |best, k| if away[k] > away[best] { k } else { best });
        let fresh = chosen.is_empty();
        chosen.push(points[best]);
        for (distance, p) in away.iter_mut().zip(&points) {
            let new = square_distance(*p, points[best]);
            *distance = if fresh { new } else { distance.min(new) };
        }
    }
    chosen
}

fn build_basis(parameters: &Parameters, context: &BuildContext<'_>) -> Result<Cardinal, BuildError> {
    let count = parameters.count("points", 0, 200)?;
    let control = match context.source {
        Some(source) if count > 0 => farthest(source, count.max(3)),
        _ => grid(context.source, parameters.count("grid", 2, 14)?),
    };
    Cardinal::new(control).ok_or_else(|| BuildError::Data {
        name: "thin-plate2".to_string(),
        problem: "the control points are equal or lie on a line; give source points with extent in both directions"
            .into(),
    })
}

pub(super) const ENTRY: ModelEntry = ModelEntry {
    name: "thin-plate2",
    summary: "2-D to 2-D thin-plate spline through control points",
    parameters: &[
        ParameterSpec {
            name: "grid",
            default: "3",
            meaning: "control points a side of a grid over the source's bounding box, 2 to 14",
        },
        ParameterSpec {
            name: "points",
            default: "0",
            meaning: "instead of the grid: number of source points, each farthest from those before, up to 200; 0: grid",
        },
        ParameterSpec {
            name: "bending",
            default: "0",
            meaning: "weight of the bending energy as extra residual rows; above 0 also where features are few",
        },
        AREA,
    ],
    source: "Bookstein 1989, kernel r^2 log r; Domokos, Nemeth and Kato 2012",
    details: "h(p, theta) = sum_i c_i B_i(p) with the cardinal splines of the control points, B_i = 1 at control point i and 0 at the others, in the span of r^2 log r and 1, x, y. theta: the images of the control points (target units), all x', then all y', grid points with x fastest. Affine maps need no bending. Degenerate when control points have no source points around them; folds (a negative area element) are reported. Needs a family of more functions than unknowns, 2 grid^2, or bending > 0. Converges from 0.1 (norm over all control points, shape of unit size); `whitened-affine` proposes starts.",
    build: |parameters, context| {
        let basis = build_basis(parameters, context)?;
        let bending = parameters.number("bending", "a number >= 0", |value| value >= 0.0 && value.is_finite())?;
        let features = match basis.num_terms() {
            0..=9 => "hermite[degree=6]",
            10..=14 => "hermite[degree=7]",
            _ => "hermite[degree=8]",
        };
        let rows = basis.bending_rows(bending);
        let mut model = warp(basis, area_of(parameters)?, Basin { features, distance: 0.1 });
        if bending > 0.0 {
            model.regulariser = Some(Arc::new(Bending { rows }));
        }
        Ok(model)
    },
};
