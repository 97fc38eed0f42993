//! What is summed for the Jacobian, and how the Jacobian follows from it once the points are done.
//!
//! Two facts about a pair save work per point, each as data: a family may be closed under differentiation (its gradients are
//! combinations of its own values), and a map without projection has dx/dtheta_j = T (dA_j u + db_j), the same combination of the
//! columns (u, 1) of every point.

use crate::family::{DynFamily, GradientTerm};
use crate::map::{DynMap, PreparedMap, Transform};
use crate::means::{RawSums, Sums};

/// The gradients of a family that is closed under differentiation.
pub struct Closure {
    terms: Vec<GradientTerm>,
    /// Functions that gradients need: the first ones.
    rows: usize,
}

impl Closure {
    /// Ask a family for its gradients; `None` where it is not closed under differentiation.
    pub fn of(family: &dyn DynFamily, dim: usize) -> Option<Self> {
        let terms = family.gradient_terms(dim)?;
        let rows = terms.iter().map(|term| term.of + 1).max().unwrap_or(0);
        Some(Self { terms, rows })
    }
}

/// Which products of rows and columns are summed over the points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Products {
    /// Gradients times dx/dtheta: the Jacobian itself.
    Direct,
    /// Values times all rows dx_q/dtheta_j, column q * tangent + j.
    Closed { rows: usize, columns: usize },
    /// Values (closed) or gradients times the lifted columns of the points; the column of ones is summed by itself.
    Lifted { rows: usize, columns: usize, closed: bool },
}

impl Products {
    /// Choose for a map and a family.
    pub fn choose(map: &dyn DynMap, tangent: usize, family: &dyn DynFamily, closure: Option<&Closure>) -> Self {
        let dim = map.dim();
        if tangent == 0 {
            return Products::Direct;
        }
        let plain = |facts: &crate::map::FactoredFacts| {
            facts.identity_projection && !facts.has_density && facts.rows == dim && facts.lift_len <= tangent
        };
        match (map.factored().filter(plain), closure) {
            (Some(facts), closure) => {
                let gradients = || family.segments(dim).iter().map(|segment| segment.num_gradient_rows(dim)).sum();
                let rows = closure.map_or_else(gradients, |closure| closure.rows);
                Products::Lifted { rows, columns: facts.lift_len, closed: closure.is_some() }
            }
            (None, Some(closure)) => Products::Closed { rows: closure.rows, columns: dim * tangent },
            (None, None) => Products::Direct,
        }
    }

    /// Say whether values take the place of gradients.
    pub fn is_closed(self) -> bool {
        matches!(self, Products::Closed { .. } | Products::Lifted { closed: true, .. })
    }

    /// Say whether the points' own columns take the place of the map's derivatives.
    pub fn use_lifted(self) -> bool {
        matches!(self, Products::Lifted { .. })
    }

    /// Return the number of columns.
    pub fn columns(self) -> usize {
        match self {
            Products::Direct => 0,
            Products::Closed { columns, .. } | Products::Lifted { columns, .. } => columns,
        }
    }

    /// Return the number of products.
    pub fn len(self) -> usize {
        match self {
            Products::Direct => 0,
            Products::Closed { rows, columns } | Products::Lifted { rows, columns, .. } => rows * columns,
        }
    }

    /// Return the number of gradient rows that are summed by themselves.
    pub fn num_ones(self) -> usize {
        match self {
            Products::Lifted { rows, closed: false, .. } => rows,
            _ => 0,
        }
    }
}

/// The way from sums of products to the Jacobian.
pub(super) struct Contraction {
    products: Products,
    dim: usize,
    tangent: usize,
    /// d(T A)_qk / dtheta_j and d(T b)_q / dtheta_j at (q * (columns + 1) + k) * tangent + j, for lifted columns.
    slopes: Vec<f64>,
}

impl Contraction {
    /// Prepare; takes the derivatives out of `prepared` where the points' own columns serve.
    pub fn new(products: Products, prepared: &mut PreparedMap, transform: &Transform, dim: usize) -> Self {
        let tangent = prepared.tangent;
        let mut slopes = Vec::new();
        if products.use_lifted() {
            let (width, matrix) = (products.columns(), transform.matrix());
            slopes = vec![0.0; dim * (width + 1) * tangent];
            for j in 0..tangent {
                for r in 0..dim {
                    for k in 0..=width {
                        let at = (j * dim + r) * width + k;
                        let value = if k < width { prepared.da[at] } else { prepared.db[j * dim + r] };
                        for q in 0..dim {
                            slopes[(q * (width + 1) + k) * tangent + j] += matrix[q][r] * value;
                        }
                    }
                }
            }
            prepared.tangent = 0;
        }
        Self { products, dim, tangent, slopes }
    }

    /// Contract the sums of all points.
    pub fn apply(&self, raw: RawSums, family: &dyn DynFamily, closure: Option<&Closure>) -> Sums {
        let RawSums { mut sums, products, ones } = raw;
        let (m, dim) = (self.tangent, self.dim);
        match (self.products, closure) {
            (Products::Closed { columns, .. }, Some(closure)) => {
                for term in &closure.terms {
                    let from = &products[term.of * columns + term.q * m..][..m];
                    add(&mut sums.jacobian[term.function * m..][..m], term.factor, from);
                }
            }
            (Products::Lifted { rows, columns, closed: true }, Some(closure)) => {
                // Sums of each value times dx_q/dtheta first: functions share them.
                let mut moved = vec![0.0; rows * dim * m];
                for j in 0..rows {
                    for q in 0..dim {
                        let out = &mut moved[(j * dim + q) * m..][..m];
                        self.moved(q, &products[j * columns..(j + 1) * columns], sums.value[j], out);
                    }
                }
                for term in &closure.terms {
                    let from = &moved[(term.of * dim + term.q) * m..][..m];
                    add(&mut sums.jacobian[term.function * m..][..m], term.factor, from);
                }
            }
            (Products::Lifted { columns, .. }, _) => {
                for (row, (function, q)) in gradient_rows(family, dim).into_iter().enumerate() {
                    let out = &mut sums.jacobian[function * m..][..m];
                    self.moved(q, &products[row * columns..(row + 1) * columns], ones[row], out);
                }
            }
            _ => {}
        }
        sums
    }

    /// Add the sums of one row times dx_q/dtheta to `out`.
    fn moved(&self, q: usize, products: &[f64], one: f64, out: &mut [f64]) {
        let m = self.tangent;
        let slopes = &self.slopes[q * (products.len() + 1) * m..(q + 1) * (products.len() + 1) * m];
        for (k, factor) in products.iter().chain(std::iter::once(&one)).enumerate() {
            add(out, *factor, &slopes[k * m..(k + 1) * m]);
        }
    }
}

/// out += factor * row.
fn add(out: &mut [f64], factor: f64, row: &[f64]) {
    for (value, entry) in out.iter_mut().zip(row) {
        *value += factor * entry;
    }
}

/// List the function and the coordinate of each gradient row of a family.
fn gradient_rows(family: &dyn DynFamily, dim: usize) -> Vec<(usize, usize)> {
    let (mut rows, mut first) = (Vec::new(), 0);
    for segment in family.segments(dim) {
        for i in 0..segment.num_basis {
            match segment.per_coordinate {
                Some(num) => rows.push((first + i, i / num)),
                None => rows.extend((0..dim).map(|q| (first + i, q))),
            }
        }
        first += segment.num_basis;
    }
    rows
}
