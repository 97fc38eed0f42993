//! Which directions of theta the data determine: singular values of the Jacobian, and their null directions in words.

use faer::Mat;
use serde::Serialize;

use crate::geometry::free::columns;
use crate::geometry::theta::{BlockKind, Layout};

/// Relative singular value below which a direction is undetermined.
const UNDETERMINED: f64 = 1e-7;

/// Relative singular value below which a direction is weak.
const WEAK: f64 = 1e-4;

/// Rank and conditioning of a Jacobian whose columns were scaled to norm 1.
///
/// Scaling makes the numbers independent of the units of theta; columns below 1e-9 of the largest are left as zeros.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Conditioning {
    /// Number of unknowns.
    pub unknowns: usize,
    /// Number of directions that the data determine.
    pub rank: usize,
    /// Singular values of the scaled Jacobian, descending.
    pub singular_values: Vec<f64>,
    /// Ratio of the largest to the smallest singular value; infinite below full rank.
    pub condition: f64,
    /// Undetermined directions in words.
    pub undetermined: Vec<String>,
    /// Weakly determined directions in words.
    pub weak: Vec<String>,
}

impl Conditioning {
    /// Nothing is known: the solution is not usable.
    pub(crate) fn unknown(unknowns: usize) -> Self {
        let (singular_values, undetermined, weak) = (Vec::new(), Vec::new(), Vec::new());
        Self { unknowns, rank: 0, singular_values, condition: f64::INFINITY, undetermined, weak }
    }

    /// Return one sentence for each direction that the data leave open.
    pub fn warnings(&self) -> Vec<String> {
        let open = self.undetermined.iter().map(|words| format!("undetermined by these points and features: {words}"));
        let weak = self.weak.iter().map(|words| format!("weakly determined by these points and features: {words}"));
        open.chain(weak).collect()
    }
}

/// Examine a Jacobian (L x `unknowns`, row by row) of a layout with some free columns (`None` for all) at ambient theta.
///
/// Columns after the layout's own are nuisance parameters.
///
/// ```
/// use cfpose::statistics::conditioning::observe;
/// use cfpose::theta::Layout;
/// // Six unknowns; nothing reacts to the third rotation.
/// let mut jacobian = vec![0.0; 36];
/// for j in [0, 1, 3, 4, 5] {
///     jacobian[7 * j] = 1.0;
/// }
/// let layout = Layout::pose3();
/// let report = observe(&jacobian, 6, &layout, None, &layout.neutral());
/// assert_eq!((report.rank, report.undetermined), (5, vec!["rotation about z".to_string()]));
/// ```
pub fn observe(
    jacobian: &[f64],
    unknowns: usize,
    layout: &Layout,
    free: Option<&[usize]>,
    theta: &[f64],
) -> Conditioning {
    let mut report = Conditioning::unknown(unknowns);
    let rows = jacobian.len().checked_div(unknowns).unwrap_or(0);
    let norm = |j: usize| (0..rows).map(|i| jacobian[i * unknowns + j].powi(2)).sum::<f64>().sqrt();
    let norms: Vec<f64> = (0..unknowns).map(norm).collect();
    let largest = norms.iter().fold(0.0_f64, |a, b| a.max(*b));
    let scale: Vec<f64> = norms.iter().map(|n| if *n > 1e-9 * largest { n.recip() } else { 1.0 }).collect();
    let scaled = Mat::from_fn(rows.max(unknowns), unknowns, |i, j| {
        if i < rows && norms[j] > 1e-9 * largest { jacobian[i * unknowns + j] * scale[j] } else { 0.0 }
    });
    // Rows of zeros make the matrix at least square, so that V holds the whole null space.
    let Ok(svd) = scaled.thin_svd() else { return report };
    report.singular_values = (0..unknowns).map(|i| svd.S()[i]).collect();
    let top = report.singular_values.first().copied().unwrap_or(0.0);
    for i in 0..unknowns {
        let ratio = report.singular_values[i] / top;
        if ratio > WEAK {
            report.rank += 1;
            continue;
        }
        let direction: Vec<f64> = (0..unknowns).map(|j| svd.V()[(j, i)]).collect();
        let words = describe(&direction, &scale, layout, free, theta);
        if ratio > UNDETERMINED {
            report.rank += 1;
            report.weak.push(words);
        } else {
            report.undetermined.push(words);
        }
    }
    if report.rank == unknowns && unknowns > 0 {
        report.condition = top / report.singular_values[unknowns - 1];
    }
    report
}

/// Put a direction of the scaled tangent space into words, block by block; blocks with a share below a tenth are left out.
fn describe(direction: &[f64], scale: &[f64], layout: &Layout, free: Option<&[usize]>, theta: &[f64]) -> String {
    let all = columns(layout);
    let moving: Vec<usize> = (0..all.len()).filter(|j| free.is_none_or(|free| free.contains(j))).collect();
    let mut parts = Vec::new();
    let mut ambient = 0;
    for (block, description) in layout.blocks().iter().enumerate() {
        let size = description.kind.manifold().ambient();
        let of_block: Vec<usize> = (0..moving.len()).filter(|c| all[moving[*c]].block == block).collect();
        let share = of_block.iter().map(|c| direction[*c].powi(2)).sum::<f64>().sqrt();
        if share > 0.1 {
            let mut step = vec![0.0; description.kind.manifold().tangent()];
            of_block.iter().for_each(|c| step[all[moving[*c]].index] = direction[*c] * scale[*c]);
            parts.push(words(description.name, &description.kind, &step, &theta[ambient..ambient + size]));
        }
        ambient += size;
    }
    let nuisance = direction.iter().skip(moving.len()).map(|value| value * value).sum::<f64>().sqrt();
    if nuisance > 0.1 {
        parts.push("noise".to_string());
    }
    parts.join(" with ")
}

/// Describe a step of one block.
fn words(name: &str, kind: &BlockKind, step: &[f64], theta: &[f64]) -> String {
    match kind {
        BlockKind::Rotation => format!("{name} about {}", axis(step)),
        BlockKind::Direction(n) => {
            let manifold = kind.manifold();
            let mut basis = vec![0.0; n * step.len()];
            manifold.basis(theta, &mut basis);
            let moved: Vec<f64> =
                basis.chunks_exact(step.len()).map(|row| row.iter().zip(step).map(|(a, b)| a * b).sum()).collect();
            if *n <= 3 { format!("{name} towards {}", axis(&moved)) } else { entries(name, &moved) }
        }
        _ if step.len() == 1 => name.to_string(),
        _ if step.len() <= 3 => format!("{name} along {}", axis(step)),
        _ => entries(name, step),
    }
}

/// Name a direction of 2 or 3 coordinates: an axis where it is one to three digits, else its unit vector.
fn axis(direction: &[f64]) -> String {
    let norm = direction.iter().map(|value| value * value).sum::<f64>().sqrt();
    let mut unit: Vec<f64> = direction.iter().map(|value| value / norm).collect();
    if let Some(index) = unit.iter().position(|value| value.abs() > 0.999) {
        return ["x", "y", "z"].get(index).copied().unwrap_or("?").to_string();
    }
    // A direction has no sign: make the largest component positive.
    let largest = unit.iter().fold(0.0_f64, |a, b| if b.abs() > a.abs() + 1e-9 { *b } else { a });
    unit.iter_mut().for_each(|value| *value *= 1.0_f64.copysign(largest));
    let numbers: Vec<String> = unit.iter().map(|value| format!("{value:.2}")).collect();
    format!("({})", numbers.join(" "))
}

/// Name the entries of a long block that carry a direction, the largest first, at most four.
fn entries(name: &str, step: &[f64]) -> String {
    let norm = step.iter().map(|value| value * value).sum::<f64>().sqrt();
    let mut order: Vec<usize> = (0..step.len()).filter(|i| step[*i].abs() > 0.1 * norm).collect();
    order.sort_by(|a, b| step[*b].abs().total_cmp(&step[*a].abs()));
    let names: Vec<String> = order.iter().take(4).map(|i| (i + 1).to_string()).collect();
    let more = if order.len() > 4 { ", ..." } else { "" };
    format!("{name} entries {}{more}", names.join(", "))
}
