//! Normals of a point set, from the neighbours of each point.

use crate::distances::neighbours::Neighbours;

/// Neighbours that a normal is fitted to, the point itself included.
const NORMAL_NEIGHBOURS: usize = 8;
/// A neighbourhood is a curve or a surface, and has a normal, when its least spread is below this share of its largest.
const FLAT: f64 = 0.25;

/// Neighbour lists of mapped source points, looked up once: a smooth map hardly changes them.
pub(crate) struct Normals {
    lists: Vec<Option<Vec<usize>>>,
}

impl Normals {
    /// Make lists for so many points.
    pub fn new(len: usize) -> Self {
        Self { lists: vec![None; len] }
    }

    /// Return the unit normal at source point `k`, where its neighbourhood is flat.
    pub fn at(&mut self, k: usize, tree: &Neighbours, x: &[[f64; 3]]) -> Option<[f64; 3]> {
        let look_up = || tree.nearest_n(&x[k], NORMAL_NEIGHBOURS).iter().map(|n| n.index).collect();
        let list = self.lists[k].get_or_insert_with(look_up);
        least_axis(list.iter().map(|i| &x[*i]), tree.dim())
    }
}

/// Return the unit normal of a region in the plane or in space, where it is flat.
pub(super) fn least_axis<'a>(region: impl Iterator<Item = &'a [f64; 3]> + Clone, dim: usize) -> Option<[f64; 3]> {
    let count = region.clone().count() as f64;
    let mut mean = [0.0; 3];
    for x in region.clone() {
        (0..3).for_each(|d| mean[d] += x[d] / count);
    }
    let mut covariance = [[0.0; 3]; 3];
    for x in region {
        let r: [f64; 3] = std::array::from_fn(|d| x[d] - mean[d]);
        for a in 0..dim {
            for b in 0..dim {
                covariance[a][b] += r[a] * r[b];
            }
        }
    }
    if dim == 2 { normal2(&covariance) } else { normal3(&covariance) }
}

/// Return the axis of least spread of a plane neighbourhood, in closed form.
fn normal2(c: &[[f64; 3]; 3]) -> Option<[f64; 3]> {
    let (half, difference) = (0.5 * (c[0][0] + c[1][1]), 0.5 * (c[0][0] - c[1][1]));
    let radius = difference.hypot(c[0][1]);
    if radius <= 0.0 || half - radius > FLAT * FLAT * (half + radius) {
        return None;
    }
    // The axis of largest spread lies at half the angle of (difference, c_01).
    let angle = 0.5 * c[0][1].atan2(difference);
    Some([-angle.sin(), angle.cos(), 0.0])
}

/// Return the axis of least spread of a spatial neighbourhood, `None` for one that is no surface.
fn normal3(c: &[[f64; 3]; 3]) -> Option<[f64; 3]> {
    let (values, axis) = crate::geometry::linalg::least_axis3(c);
    // On a curve in space every direction across it is a normal: distances to points serve there.
    let surface = values[2] <= FLAT * FLAT * values[1] && values[1] > 1e-12 * values[0];
    surface.then_some(axis)
}
