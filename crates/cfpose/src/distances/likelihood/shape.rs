//! The shape between the source points: tangents and distances from the neighbours of each.

use cfpose_kernel::points::Points;

use super::super::Mapped;
use crate::distances::neighbours::Neighbours;
use crate::geometry::linalg::least_axis3;

/// Neighbours that a frame is fitted to, the point itself included.
const LIST: usize = 6;
/// More of them on a surface.
const LIST_3: usize = 9;
/// Tangential width of a kernel in distances to the neighbours: on a curve, on a surface.
const WIDTH: [f64; 2] = [0.6, 0.55];
/// Ratio of spreads up to which a direction is normal to the shape, and from which on it is tangential.
const NORMAL: [f64; 2] = [0.25, 0.6];

/// Neighbours of every source point, found once: a smooth map hardly changes them.
pub(super) struct Shape {
    lists: Vec<u32>,
    each: usize,
}

/// Tangential variances of the kernel of one source point: `along` an axis, `across` it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    pub axis: [f64; 3],
    pub along: f64,
    pub across: f64,
    /// Where the shape within the kernel lies on average, along the axis from the point: a bent shape leaves its tangent.
    pub bend: f64,
}

impl Shape {
    /// Find the neighbours of points; coordinates that do not vary are left out.
    pub fn new(source: &Points) -> Self {
        let varies = |column: &[f64]| column.iter().any(|x| *x != column[0]);
        let columns: Vec<&[f64]> =
            (0..source.dim()).map(|d| source.column(d)).filter(|column| varies(column)).collect();
        let dim = columns.len().min(3);
        let rows: Vec<[f64; 3]> = (0..source.len())
            .map(|k| std::array::from_fn(|d| columns.get(d).map_or(0.0, |column| column[k])))
            .collect();
        let each = if dim == 3 { LIST_3 } else { LIST }.min(source.len());
        let tree = Neighbours::new(rows, dim);
        let mut lists = Vec::with_capacity(each * source.len());
        for p in tree.rows() {
            lists.extend(tree.nearest_n(p, each).iter().map(|n| n.index as u32));
        }
        Self { lists, each }
    }

    fn list(&self, k: usize) -> &[u32] {
        &self.lists[k * self.each..(k + 1) * self.each]
    }

    /// Return the frames of mapped points.
    pub fn frames(&self, mapped: &Mapped) -> Vec<Frame> {
        let x = &mapped.x;
        let distance = |a: usize, b: usize| (0..3).map(|d| (x[a][d] - x[b][d]).powi(2)).sum::<f64>().sqrt();
        let spacing: Vec<f64> = (0..x.len())
            .map(|k| {
                let others = self.list(k).iter().map(|i| *i as usize).filter(|i| *i != k).take(2);
                let (sum, count) = others.fold((0.0, 0.0), |(sum, count), i| (sum + distance(k, i), count + 1.0));
                if count > 0.0 { sum / count } else { 0.0 }
            })
            .collect();
        let mut sorted = spacing.clone();
        sorted.sort_by(f64::total_cmp);
        let least = 0.3 * sorted[sorted.len() / 2];
        let width = WIDTH[usize::from(mapped.dim == 3)];
        (0..x.len()).map(|k| self.frame(k, mapped, (width * spacing[k].max(least)).powi(2))).collect()
    }

    /// Return the normal at a mapped point: the axis along which the shape is much thinner than across it; `None` where there is none.
    pub fn normal(&self, k: usize, mapped: &Mapped) -> Option<[f64; 3]> {
        let frame = self.straight(k, mapped, 1.0);
        (frame.along < 0.5 * frame.across).then_some(frame.axis)
    }

    /// Fit the frame of a point whose tangential variance is `square`.
    fn frame(&self, k: usize, mapped: &Mapped, square: f64) -> Frame {
        let frame = self.straight(k, mapped, square);
        // A curve in space bends in any direction across it, a line of numbers in none.
        let has_bend = mapped.dim > 1 && frame.across > 0.5 * square;
        Frame { bend: if has_bend { self.bend(k, mapped, &frame, square) } else { 0.0 }, ..frame }
    }

    /// Fit the frame without its bend.
    fn straight(&self, k: usize, mapped: &Mapped, square: f64) -> Frame {
        let list = self.list(k);
        let mut mean = [0.0; 3];
        list.iter().for_each(|i| (0..3).for_each(|d| mean[d] += mapped.x[*i as usize][d] / list.len() as f64));
        let mut c = [[0.0; 3]; 3];
        for i in list {
            let r: [f64; 3] = std::array::from_fn(|d| mapped.x[*i as usize][d] - mean[d]);
            (0..3).for_each(|a| (0..3).for_each(|b| c[a][b] += r[a] * r[b]));
        }
        match mapped.dim {
            2 => {
                let (half, difference) = (0.5 * (c[0][0] + c[1][1]), 0.5 * (c[0][0] - c[1][1]));
                let radius = difference.hypot(c[0][1]);
                let along = square * tangential((half - radius).max(0.0), half + radius);
                let axis = across_half_angle(difference, c[0][1], radius);
                Frame { axis, along, across: square, bend: 0.0 }
            }
            3 => {
                let (values, axis) = least_axis3(&c);
                let thin = tangential(values[1].max(0.0), values[0]);
                if thin < 0.5 {
                    // A curve in space: tangential along its own direction only.
                    let axis = main_axis(&c, values[1]);
                    return Frame { axis, along: square, across: square * thin, bend: 0.0 };
                }
                let along = square * tangential(values[2].max(0.0), values[1]);
                Frame { axis, along, across: square, bend: 0.0 }
            }
            _ => Frame { axis: [1.0, 0.0, 0.0], along: square, across: square, bend: 0.0 },
        }
    }

    /// Return how far the middle of a kernel of tangential variance `square` lies from its point along the normal: the height of the
    /// neighbours over the tangent, which grows by the square of the distance along it, at the kernel's mean square. Where the
    /// neighbourhood has no normal (`along` is tangential, too) there is no bend.
    ///
    /// The axis is the normal at the middle c of the neighbours, so the heights over the point's own tangent, -kappa r^2 / 2, are seen as
    /// -kappa r^2 / 2 + kappa c.r; their sum is -kappa / 2 (sum r^2 - 2 c.sum r).
    fn bend(&self, k: usize, mapped: &Mapped, frame: &Frame, square: f64) -> f64 {
        let axis = &frame.axis;
        let (mut height, mut squares, mut sum) = (0.0, 0.0, [0.0; 3]);
        for i in self.list(k) {
            let v: [f64; 3] = std::array::from_fn(|d| mapped.x[*i as usize][d] - mapped.x[k][d]);
            let on: f64 = (0..3).map(|d| axis[d] * v[d]).sum();
            height += on;
            squares += v.iter().map(|v| v * v).sum::<f64>() - on * on;
            (0..3).for_each(|d| sum[d] += v[d] - on * axis[d]);
        }
        let one_sided = sum.iter().map(|s| s * s).sum::<f64>() / self.each as f64;
        // At an edge the neighbours lie on one side and tell less about the bend.
        let lever = (squares - 2.0 * one_sided).max(0.5 * squares);
        if lever <= 0.0 {
            return 0.0;
        }
        (1.0 - frame.along / square) * height / lever * square * (mapped.dim as f64 - 1.0)
    }

    /// Say around which points the target has less than `share` of its even mass: `even` times the weight. Summed over neighbours of
    /// neighbours: a random sample leaves small gaps everywhere.
    pub fn below(&self, mass: &[f64], weights: &[f64], even: f64, share: f64) -> Vec<bool> {
        let around = |values: &[f64]| -> Vec<f64> {
            (0..values.len()).map(|k| self.list(k).iter().map(|i| values[*i as usize]).sum()).collect()
        };
        let (here, expected) = (around(&around(mass)), around(&around(weights)));
        here.iter().zip(&expected).map(|(here, expected)| *here < share * even * expected).collect()
    }

    /// Lower the weights of points around which there is more than their capacity: so many even shares and Poisson deviations.
    pub fn prices(&self, mass: &[f64], weights: &[f64], even: f64, capacity: [f64; 2], log_weights: &mut [f64]) {
        for k in 0..mass.len() {
            let nearest = &self.list(k)[..3.min(self.each)];
            let (mut here, mut expected) = (0.0, 0.0);
            for i in nearest {
                here += mass[*i as usize];
                expected += even * weights[*i as usize];
            }
            let most = capacity[0] * expected + capacity[1] * expected.sqrt();
            if here > most {
                log_weights[k] += (most / here).ln();
            }
        }
    }
}

/// Return how far a direction of squared spread `small` is tangential beside one of squared spread `large`: 0 to 1.
fn tangential(small: f64, large: f64) -> f64 {
    if large <= 0.0 {
        return 1.0;
    }
    (((small / large).sqrt() - NORMAL[0]) / (NORMAL[1] - NORMAL[0])).clamp(0.0, 1.0)
}

/// Return the axis of least spread in the plane, across the one that lies at half the angle of (difference, mixed), whose length is `radius`.
fn across_half_angle(difference: f64, mixed: f64, radius: f64) -> [f64; 3] {
    if radius <= 0.0 {
        return [0.0, 1.0, 0.0];
    }
    // The larger of cosine and sine by its square, the other by their product: no digits are lost.
    let larger = (0.5 * (1.0 + difference.abs() / radius)).sqrt();
    let other = 0.5 * mixed / (radius * larger);
    let (cos, sin) = if difference >= 0.0 { (larger, other) } else { (other.abs(), larger.copysign(mixed)) };
    [-sin, cos, 0.0]
}

/// Return the axis of largest spread of a neighbourhood whose other spreads are about `second`: the largest column of C - second I.
fn main_axis(c: &[[f64; 3]; 3], second: f64) -> [f64; 3] {
    let column = |j: usize| -> [f64; 3] { std::array::from_fn(|i| c[i][j] - if i == j { second } else { 0.0 }) };
    let longest = (0..3).map(column).max_by(|a, b| norm(a).total_cmp(&norm(b))).unwrap_or([1.0, 0.0, 0.0]);
    let length = norm(&longest);
    if length > 0.0 { longest.map(|x| x / length) } else { [1.0, 0.0, 0.0] }
}

fn norm(v: &[f64; 3]) -> f64 {
    cfpose_optim::manifold::norm3(v)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_angles_are_those_of_the_arc_tangent() {
        for k in 0..=720 {
            let (mixed, difference) = (f64::from(k) * std::f64::consts::PI / 360.0).sin_cos();
            let (sin, cos) = (0.5 * mixed.atan2(difference)).sin_cos();
            let axis = across_half_angle(difference, mixed, difference.hypot(mixed));
            // An axis has no sign.
            assert!(
                (axis[0] * cos + axis[1] * sin).abs() < 1e-15 && (axis[1] * cos - axis[0] * sin).abs() > 0.999,
                "{k}"
            );
        }
        assert_eq!(across_half_angle(0.0, 0.0, 0.0), [0.0, 1.0, 0.0]);
    }
}
