//! Nearest neighbours in 1, 2 or 3 dimensions.

use std::num::NonZero;

use kiddo::{ImmutableKdTree, SquaredEuclidean};

/// Squared distances up to so many times those of the neighbours found last are no loose bound.
const LOOSE: f64 = 6.0;

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

    /// Find the `count` nearest points: the nearest first, the farthest last, the others in any order. Lists of `known` with at least `count`
    /// points of the set (shorter ones say nothing) may lie near: nothing beyond the farthest of them is looked at. That is several times
    /// faster than [`Neighbours::nearest_n`] where they do. `found` takes the result and comes with that of a point nearby, or empty: it
    /// tells which bounds are too loose to be of use.
    pub fn nearest_n_beside(&self, p: &[f64; 3], count: usize, known: &[&[u32]], found: &mut Vec<Neighbour>) {
        let count = count.min(self.rows.len());
        if count == 0 {
            return found.clear();
        }
        let farthest =
            |list: &&[u32]| list.iter().map(|k| self.squared(&self.rows[*k as usize], p)).fold(0.0, f64::max);
        let full = known.iter().filter(|list| list.len() >= count);
        let bound = full.map(farthest).fold(f64::INFINITY, f64::min);
        // What was found last tells how far the points reach here: a bound far beyond lets too many in.
        let reach = found.last().map_or(0.0, |last| last.squared);
        found.clear();
        if bound <= LOOSE * reach {
            self.within(p, bound * (1.0 + 1e-9), found);
        }
        if found.len() < count {
            *found = self.nearest_n(p, count);
        } else {
            let by_distance =
                |a: &Neighbour, b: &Neighbour| a.squared.total_cmp(&b.squared).then(a.index.cmp(&b.index));
            found.select_nth_unstable_by(count - 1, by_distance);
            found.truncate(count);
            let nearest = (0..count - 1).min_by(|a, b| by_distance(&found[*a], &found[*b])).unwrap_or(0);
            found.swap(0, nearest);
        }
    }

    /// Add the points within a squared distance, in any order.
    fn within(&self, p: &[f64; 3], squared: f64, found: &mut Vec<Neighbour>) {
        match &self.tree {
            Tree::Plane(tree) => {
                let near = tree.query(&[p[0], p[1]]).within::<SquaredEuclidean<f64>>(squared).unsorted().execute();
                found.extend(near.into_iter().map(|n| Neighbour { index: n.item as usize, squared: n.distance }));
            }
            Tree::Space(tree) => {
                let near = tree.query(p).within::<SquaredEuclidean<f64>>(squared).unsorted().execute();
                found.extend(near.into_iter().map(|n| Neighbour { index: n.item as usize, squared: n.distance }));
            }
            Tree::Scan => {
                let all = self.rows.iter().enumerate();
                let all = all.map(|(index, row)| Neighbour { index, squared: self.squared(row, p) });
                found.extend(all.filter(|near| near.squared <= squared));
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
            // Beside the neighbours of other points: the same ones, the nearest first, the farthest last.
            let (mut found, mut before) = (tree.nearest_n(&queries[0], 7), Vec::new());
            tree.nearest_n_beside(&queries[0], 0, &[], &mut found);
            assert!(found.is_empty());
            for q in &queries {
                tree.nearest_n_beside(q, 7, &[&[3; 2], &before], &mut found);
                before = found.iter().map(|n| n.index as u32).collect();
                let mut expected: Vec<usize> = scan.nearest_n(q, 7).iter().map(|n| n.index).collect();
                let mut indices: Vec<usize> = found.iter().map(|n| n.index).collect();
                assert_eq!((indices[0], indices[6]), (expected[0], expected[6]));
                indices.sort_unstable();
                expected.sort_unstable();
                assert_eq!(indices, expected);
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
