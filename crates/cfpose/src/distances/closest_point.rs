//! Trimmed closest point: the refinement of a fit whose noise is small against the shape.
//!
//! Exact without noise; with noise the nearest point is not the true one, and the estimate is biased: gate it by the
//! estimated noise (docs/method.md, *Refinement*).

use super::normals::Normals;
use super::{Mover, regions};
use crate::distances::neighbours::Neighbours;
use crate::geometry::linalg::{add_outer, invert, solve_normal, symmetrise};

/// Pairs of one region share the errors of the shape there: so many form one group of the sandwich covariance.
const GROUP: usize = 48;
/// Standard deviation of the shape between its points, relative to their distance.
const DISCRETISATION: f64 = 0.1;

/// Options of a refinement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Iterations at most.
    pub max_iterations: usize,
    /// Pairs farther than this many robust standard deviations (1.48 times the median distance) are left out.
    pub cut: f64,
    /// Share of the target points that may be used at most: 1, or the expected overlap.
    pub share: f64,
    /// Stop below this norm of a step.
    pub tolerance: f64,
    /// Use distances along normals where the neighbourhood has one.
    pub normals: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { max_iterations: 30, cut: 3.5, share: 1.0, tolerance: 1e-8, normals: true }
    }
}

/// A refined theta.
#[derive(Debug, Clone, PartialEq)]
pub struct ClosestPoint {
    /// Theta, ambient (nuisance parameters as they came).
    pub theta: Vec<f64>,
    /// Root mean square residual of the pairs used.
    pub rms: f64,
    /// Share of the target points used.
    pub share: f64,
    /// Covariance of the model's tangent coordinates, row by row, from the scatter of the residuals (sandwich).
    pub covariance: Vec<f64>,
    /// Iterations.
    pub iterations: usize,
    /// Whether the last step was below the tolerance.
    pub converged: bool,
    /// Root mean square residual before the first step.
    pub rms_before: f64,
    /// Residuals used in the last step.
    pub rows: usize,
}

impl ClosestPoint {
    /// Return the gain in log likelihood over the theta it began with: n log(rms before / rms after) for residuals of one unknown
    /// variance.
    pub fn gain(&self) -> f64 {
        self.rows as f64 * (self.rms_before / self.rms.max(f64::MIN_POSITIVE)).ln()
    }
}

/// One linearised system: sums over the pairs.
struct System {
    h: Vec<f64>,
    g: Vec<f64>,
    /// Score of each row and where it is, for the sandwich.
    scores: Vec<([f64; 3], Vec<f64>)>,
    square_sum: f64,
    rows: usize,
    pairs: usize,
}

/// Move theta until the target lies on the mapped source. `target` is in the feature space, not normalised.
pub(crate) fn refine(mover: &Mover<'_>, target: &[[f64; 3]], theta: &[f64], options: &Options) -> Option<ClosestPoint> {
    let tangent = mover.tangent();
    let mut theta = theta.to_vec();
    let mut normals = Normals::new(mover.len());
    let mut last = None;
    let (mut iterations, mut converged, mut rms_before) = (0, false, None);
    for iteration in 0..options.max_iterations {
        iterations = iteration + 1;
        let system = linearise(mover, target, &theta, &mut normals, options);
        if system.rows <= tangent {
            return None;
        }
        rms_before.get_or_insert((system.square_sum / system.rows as f64).sqrt());
        let mut step = solve_normal(tangent, &system.h, &system.g, 1e-9)?;
        let norm = cfpose_optim::manifold::norm(&step);
        // A linearisation is worth a fifth of a radian, or of the unit.
        if norm > 0.2 {
            step.iter_mut().for_each(|s| *s *= 0.2 / norm);
        }
        theta = mover.retract(&theta, &step);
        last = Some(system);
        converged = norm < options.tolerance;
        if converged {
            break;
        }
    }
    let system = last?;
    let inverse = invert(tangent, &system.h)?;
    // The shape is known at its points alone: between them it is uncertain by a share of their distance.
    let floor = (DISCRETISATION * super::spacing(&mover.map(&theta, false))).powi(2);
    let spread = sandwich(tangent, &inverse, &meat(tangent, system.scores));
    let covariance = spread.iter().zip(&inverse).map(|(s, i)| s + floor * i).collect();
    Some(ClosestPoint {
        theta,
        rms: (system.square_sum / system.rows as f64).sqrt(),
        share: system.pairs as f64 / target.len() as f64,
        covariance,
        iterations,
        converged,
        rms_before: rms_before.unwrap_or(f64::INFINITY),
        rows: system.rows,
    })
}

/// Sum the outer products of the scores of each region: residuals of neighbours share the errors of normals and curvature,
/// and are no independent draws.
fn meat(n: usize, mut scores: Vec<([f64; 3], Vec<f64>)>) -> Vec<f64> {
    let mut products = vec![0.0; n * n];
    let depth = (scores.len() / GROUP).max(1).ilog2();
    regions(&mut scores, depth, &|score| score.0, &mut |group| {
        let mut sum = vec![0.0; n];
        group.iter().for_each(|(_, score)| sum.iter_mut().zip(score).for_each(|(a, b)| *a += b));
        add_outer(&mut products, &sum, 1.0);
    });
    symmetrise(n, &mut products);
    products
}

fn sandwich(n: usize, inverse: &[f64], scores: &[f64]) -> Vec<f64> {
    let product = |a: &[f64], b: &[f64]| -> Vec<f64> {
        let entry = |at: usize| (0..n).map(|k| a[at / n * n + k] * b[k * n + at % n]).sum();
        (0..n * n).map(entry).collect()
    };
    product(&product(inverse, scores), inverse)
}

fn linearise(
    mover: &Mover<'_>,
    target: &[[f64; 3]],
    theta: &[f64],
    normals: &mut Normals,
    options: &Options,
) -> System {
    let mapped = mover.map(theta, true);
    let tree = Neighbours::new(mapped.x.clone(), mapped.dim);
    let found: Vec<_> = target.iter().map(|q| tree.nearest(q)).collect();
    let mut sorted: Vec<f64> = found.iter().map(|n| n.squared).collect();
    sorted.sort_by(f64::total_cmp);
    let allowed = ((options.share * target.len() as f64) as usize).clamp(1, target.len());
    let median = sorted[allowed / 2];
    let limit = (options.cut * options.cut * 1.48 * 1.48 * median).min(sorted[allowed - 1]).max(f64::MIN_POSITIVE);
    let n = mapped.tangent;
    let mut system =
        System { h: vec![0.0; n * n], g: vec![0.0; n], scores: Vec::new(), square_sum: 0.0, rows: 0, pairs: 0 };
    let mut row = vec![0.0; n];
    for (q, neighbour) in target.iter().zip(&found).filter(|(_, neighbour)| neighbour.squared <= limit) {
        let k = neighbour.index;
        let difference: [f64; 3] = std::array::from_fn(|d| q[d] - mapped.x[k][d]);
        system.pairs += 1;
        let normal = if options.normals { normals.at(k, &tree, &mapped.x) } else { None };
        match normal {
            Some(normal) => {
                row.fill(0.0);
                for d in 0..mapped.dim {
                    row.iter_mut().zip(mapped.slope(k, d)).for_each(|(r, s)| *r += normal[d] * s);
                }
                let residual = (0..3).map(|d| normal[d] * difference[d]).sum();
                add_row(&mut system, &row, residual, mapped.x[k]);
            }
            None => {
                for d in 0..mapped.dim {
                    add_row(&mut system, mapped.slope(k, d), difference[d], mapped.x[k]);
                }
            }
        }
    }
    symmetrise(n, &mut system.h);
    system
}

fn add_row(system: &mut System, row: &[f64], residual: f64, place: [f64; 3]) {
    add_outer(&mut system.h, row, 1.0);
    system.scores.push((place, row.iter().map(|r| r * residual).collect()));
    system.g.iter_mut().zip(row).for_each(|(g, r)| *g += r * residual);
    system.square_sum += residual * residual;
    system.rows += 1;
}
