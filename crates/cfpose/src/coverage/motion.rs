//! Words for directions of theta and for shapes.

use cfpose_kernel::points::Points;
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};

use crate::geometry::theta::{Layout, RotationForm};

/// A share of motion below this is not mentioned.
const SMALL: f64 = 1e-3;

/// Describe the shape of points: their dimension from the spread along principal axes.
pub(super) fn describe_shape(points: &Points) -> String {
    let dim = points.dim();
    let (values, vectors) = crate::geometry::linalg::symmetric_eigen(&points.covariance(), dim);
    let rank = values[..dim].iter().filter(|value| **value > 1e-12 * values[0] && values[0] > 0.0).count();
    match (dim, rank) {
        (_, 0) => "all at one place".to_string(),
        (3, 2) => format!("all in a plane with normal {}", vector(&vectors[2])),
        (2 | 3, 1) => format!("all on a line along {}", vector(&vectors[0][..dim])),
        _ => format!("spread in all {dim} dimension(s)"),
    }
}

/// Describe a velocity field v at places x: translation, rotation, scaling; nothing where it is none of these.
pub(super) fn describe(dim: usize, x: &[[f64; 3]], v: &[[f64; 3]]) -> Option<String> {
    let n = x.len() as f64;
    let mean = [0, 1, 2].map(|q| x.iter().map(|p| p[q]).sum::<f64>() / n);
    let spread = (x.iter().map(|p| (0..3).map(|q| (p[q] - mean[q]).powi(2)).sum::<f64>()).sum::<f64>() / n).sqrt();
    if spread <= 0.0 {
        return None;
    }
    // Unknown fields: translations, rotations about the mean, scaling about the mean.
    let planes: &[(usize, usize)] = match dim {
        1 => &[],
        2 => &[(0, 1)],
        _ => &[(1, 2), (2, 0), (0, 1)],
    };
    let num = dim + planes.len() + 1;
    let field = |p: &[f64; 3], index: usize| -> [f64; 3] {
        let y = [0, 1, 2].map(|q| (p[q] - mean[q]) / spread);
        let mut out = [0.0; 3];
        if index < dim {
            out[index] = 1.0;
        } else if let Some((a, b)) = planes.get(index - dim) {
            // Rotation from axis a to axis b.
            out[*a] = -y[*b];
            out[*b] = y[*a];
        } else {
            out = y;
        }
        out
    };
    let share = least_squares(x, v, num, &field)?;
    let translation = [0, 1, 2].map(|q| if q < dim { share[q] } else { 0.0 });
    let turns = &share[dim..dim + planes.len()];
    let scaling = share[num - 1];
    Some(words(dim, spread, &mean, &translation, turns, scaling))
}

/// Fit a velocity field as a combination of given fields; nothing where it does not fit.
fn least_squares(
    x: &[[f64; 3]],
    v: &[[f64; 3]],
    num: usize,
    field: &dyn Fn(&[f64; 3], usize) -> [f64; 3],
) -> Option<Vec<f64>> {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let (mut normal, mut right, mut square) = (Mat::<f64>::zeros(num, num), Mat::<f64>::zeros(num, 1), 0.0);
    for (place, velocity) in x.iter().zip(v) {
        for a in 0..num {
            for b in 0..num {
                normal[(a, b)] += dot(field(place, a), field(place, b));
            }
            right[(a, 0)] += dot(field(place, a), *velocity);
        }
        square += dot(*velocity, *velocity);
    }
    // A trace of damping chooses the smallest combination where points on a line leave a rotation open.
    for a in 0..num {
        normal[(a, a)] += 1e-12 * x.len() as f64;
    }
    let share = normal.llt(Side::Lower).ok()?.solve(&right);
    let fitted: f64 = x
        .iter()
        .zip(v)
        .map(|(place, velocity)| {
            let mut rest = *velocity;
            for a in 0..num {
                let part = field(place, a);
                for q in 0..3 {
                    rest[q] -= share[(a, 0)] * part[q];
                }
            }
            dot(rest, rest)
        })
        .sum();
    (fitted <= 1e-10 * square).then(|| (0..num).map(|a| share[(a, 0)]).collect())
}

/// Put a translation of the mean, rotations about it and a scaling (all per unit of motion) into words.
fn words(dim: usize, spread: f64, mean: &[f64; 3], t: &[f64; 3], turns: &[f64], scaling: f64) -> String {
    let norm = |v: &[f64]| v.iter().map(|a| a * a).sum::<f64>().sqrt();
    let turning = norm(turns);
    let all = norm(&[norm(t), turning, scaling]);
    if scaling.abs() > SMALL * all {
        let centre: Vec<f64> = (0..dim).map(|q| mean[q] - t[q] / scaling * spread).collect();
        return match turning > SMALL * all {
            true => format!(
                "scaling with a rotation of {:.2} rad per unit, about {}",
                turning / scaling.abs(),
                vector(&mean[..dim])
            ),
            false => format!("scaling about {}", vector(&centre)),
        };
    }
    if turning <= SMALL * all {
        let unit: Vec<f64> = t[..dim].iter().map(|value| value / norm(t)).collect();
        return format!("translation along {}", vector(&unit));
    }
    if dim == 2 {
        // v = t + w k x (x - mean) / spread vanishes at mean + spread k x t / w.
        let centre = [mean[0] - spread * t[1] / turns[0], mean[1] + spread * t[0] / turns[0]];
        return format!("rotation about {}", vector(&centre));
    }
    let axis: Vec<f64> = turns.iter().map(|value| value / turning).collect();
    let along: f64 = (0..3).map(|q| axis[q] * t[q]).sum();
    let cross =
        |a: &[f64], b: &[f64]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let offset = cross(&axis, t);
    let centre: Vec<f64> = (0..3).map(|q| mean[q] + spread * offset[q] / turning).collect();
    let rotation = format!("rotation about the axis {} through {}", vector(&axis), vector(&centre));
    if along.abs() > SMALL * all {
        return format!("{rotation} with a translation of {:.3} along it per radian", along / turning * spread);
    }
    rotation
}

/// List the tangent coordinates of a direction by the names of their blocks.
pub(super) fn describe_coordinates(layout: &Layout, tangent: &[f64]) -> String {
    let largest = tangent.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
    let mut names = Vec::new();
    for block in layout.blocks() {
        let n = block.kind.manifold().tangent();
        names.extend((1..=n).map(|i| if n == 1 { block.name.to_string() } else { format!("{}_{i}", block.name) }));
    }
    let mut parts: Vec<(f64, &String)> = tangent.iter().copied().zip(&names).collect();
    parts.retain(|(value, _)| value.abs() > SMALL * largest);
    parts.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
    let text: Vec<String> = parts.iter().map(|(value, name)| format!("{:+.3} {name}", value / largest)).collect();
    format!(
        "change along {} (per-block tangent coordinates, form of the rotation: {:?})",
        text.join(" "),
        RotationForm::Vector
    )
}

/// Combine vectors that span a space to simple ones: each has a coordinate, positive, that no other has.
pub(super) fn simplify(vectors: &[Vec<f64>], metric: &Mat<f64>) -> Vec<Vec<f64>> {
    let m = metric.nrows();
    let unit: Vec<f64> = (0..m).map(|j| metric[(j, j)].sqrt()).collect();
    let mut rows: Vec<Vec<f64>> = vectors.to_vec();
    let motion = |row: &[f64]| -> f64 {
        let square: f64 = (0..m).map(|a| (0..m).map(|b| row[a] * metric[(a, b)] * row[b]).sum::<f64>()).sum();
        square.max(0.0).sqrt()
    };
    let mut pivots = vec![0; rows.len()];
    let mut r = 0;
    for j in 0..m {
        // The first coordinates first: rotations stand before translations.
        let size = |row: &Vec<f64>| row[j].abs() * unit[j];
        let best = (r..rows.len()).max_by(|a, b| size(&rows[*a]).total_cmp(&size(&rows[*b])));
        let Some(best) = best.filter(|best| size(&rows[*best]) > SMALL * motion(&rows[*best])) else { continue };
        rows.swap(r, best);
        pivots[r] = j;
        let lead = rows[r].clone();
        for (_, row) in rows.iter_mut().enumerate().filter(|(other, _)| *other != r) {
            let factor = row[j] / lead[j];
            row.iter_mut().zip(&lead).for_each(|(entry, value)| *entry -= factor * value);
        }
        r += 1;
    }
    for (row, pivot) in rows.iter_mut().zip(pivots) {
        let length = motion(row);
        let scale = if length > 0.0 { length.recip() } else { 1.0 }.copysign(row[pivot]);
        row.iter_mut().for_each(|entry| *entry *= scale);
    }
    rows
}

/// Write a vector with three decimals, without negative zeros.
fn vector(v: &[f64]) -> String {
    let parts: Vec<String> = v.iter().map(|value| format!("{:.3}", (value * 1e3).round() / 1e3 + 0.0)).collect();
    format!("({})", parts.join(", "))
}
