//! Nearest neighbours in 1, 2 or 3 dimensions.

use std::num::NonZero;

use kiddo::{ImmutableKdTree, SquaredEuclidean};

/// A neighbour: its index (from 0) and the squared distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Neighbour {
    pub index: usize,
    pub squared: f64,
}

/// A search structure over points; coordinates from `dim` on are ignored.
pub(crate) struct Neighbours {
    rows: Vec<[f64; 3]>,
    dim: usize,
    tree: Tree,
}

/// A tree of the points' own dimension: one with a constant coordinate cannot split along it.
enum Tree {
    Plane(Box<ImmutableKdTree<f64, 2>>),
    Space(Box<ImmutableKdTree<f64, 3>>),
    /// On a line, and for degenerate sets that the tree refuses (very many equal points): slow and always right.
    Scan,
}

impl Neighbours {
    /// Build over `rows`, which must not be empty.
    pub fn new(rows: Vec<[f64; 3]>, dim: usize) -> Self {
        let tree = match dim {
            2 => {
                let flat: Vec<[f64; 2]> = rows.iter().map(|row| [row[0], row[1]]).collect();
                ImmutableKdTree::new_from_slice(&flat).map_or(Tree::Scan, |tree| Tree::Plane(Box::new(tree)))
            }
            3 => ImmutableKdTree::new_from_slice(&rows).map_or(Tree::Scan, |tree| Tree::Space(Box::new(tree))),
            _ => Tree::Scan,
        };
        Self { rows, dim, tree }
    }

    /// Return the points.
    pub fn rows(&self) -> &[[f64; 3]] {
        &self.rows
    }

    /// Return the number of coordinates that count.
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// Return the nearest point.
    pub fn nearest(&self, p: &[f64; 3]) -> Neighbour {
        match &self.tree {
            Tree::Plane(tree) => {
                let found = tree.query(&[p[0], p[1]]).nearest_one::<SquaredEuclidean<f64>>().execute();
                Neighbour { index: found.item as usize, squared: found.distance }
            }
            Tree::Space(tree) => {
                let found = tree.query(p).nearest_one::<SquaredEuclidean<f64>>().execute();
                Neighbour { index: found.item as usize, squared: found.distance }
            }
            Tree::Scan => {
                let mut best = Neighbour { index: 0, squared: f64::INFINITY };
                for (index, row) in self.rows.iter().enumerate() {
                    let squared = self.squared(row, p);
                    if squared < best.squared {
                        best = Neighbour { index, squared };
                    }
                }
                best
            }
        }
    }

    /// Return the `count` nearest points (fewer where there are fewer), nearest first.
    pub fn nearest_n(&self, p: &[f64; 3], count: usize) -> Vec<Neighbour> {
        let Some(count) = NonZero::new(count.min(self.rows.len())) else { return Vec::new() };
        match &self.tree {
            Tree::Plane(tree) => {
                let found = tree.query(&[p[0], p[1]]).nearest_n::<SquaredEuclidean<f64>>(count).execute();
                found.into_iter().map(|n| Neighbour { index: n.item as usize, squared: n.distance }).collect()
            }
            Tree::Space(tree) => {
                let found = tree.query(p).nearest_n::<SquaredEuclidean<f64>>(count).execute();
                found.into_iter().map(|n| Neighbour { index: n.item as usize, squared: n.distance }).collect()
            }
            Tree::Scan => {
                let each = self.rows.iter().enumerate();
                let mut all: Vec<Neighbour> =
                    each.map(|(index, row)| Neighbour { index, squared: self.squared(row, p) }).collect();
                all.sort_by(|a, b| a.squared.total_cmp(&b.squared));
                all.truncate(count.get());
                all
            }
        }
    }

    /// Return the median distance of a point to its nearest other point; of many points 500 are asked.
    pub fn spacing(&self) -> f64 {
        let all = self.nearest_distances();
        all[all.len() / 2]
    }

    /// Return the distances of up to 500 points to their nearest other point, ascending.
    fn nearest_distances(&self) -> Vec<f64> {
        let step = self.rows.len().div_ceil(500);
        // The nearest is the point itself, or its double.
        let of = |p: &[f64; 3]| self.nearest_n(p, 2).get(1).map_or(0.0, |n| n.squared.sqrt());
        let mut all: Vec<f64> = self.rows.iter().step_by(step).map(of).collect();
        all.sort_by(f64::total_cmp);
        all
    }

    fn squared(&self, a: &[f64; 3], b: &[f64; 3]) -> f64 {
        (0..self.dim).map(|d| (a[d] - b[d]).powi(2)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trees_agree_with_the_scan() {
        let mut state = 1_u64;
        let mut draw = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        for dim in 1..=3 {
            let mut rows: Vec<[f64; 3]> =
                (0..300).map(|_| std::array::from_fn(|d| if d < dim { draw() } else { 0.0 })).collect();
            let queries = rows.split_off(200);
            let tree = Neighbours::new(rows.clone(), dim);
            let scan = Neighbours { rows, dim, tree: Tree::Scan };
            for q in &queries {
                assert_eq!(tree.nearest(q).index, scan.nearest(q).index);
                let (a, b) = (tree.nearest_n(q, 7), scan.nearest_n(q, 7));
                let indices = |found: &[Neighbour]| found.iter().map(|n| n.index).collect::<Vec<_>>();
                assert_eq!(indices(&a), indices(&b));
            }
        }
    }

    #[test]
    fn many_equal_points_are_no_problem() {
        let rows = vec![[1.0, 2.0, 0.0]; 5000];
        let tree = Neighbours::new(rows, 2);
        assert!(tree.nearest(&[1.0, 3.0, 0.0]).squared - 1.0 < 1e-12);
        assert_eq!(tree.nearest_n(&[1.0, 3.0, 0.0], 3).len(), 3);
    }
}
