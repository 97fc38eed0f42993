//! Any basis, orthonormalised under a weight: the construction behind the paper's functions, for every family.

use std::sync::OnceLock;

use cfpose_kernel::family::{BasisRows, DynFamily, GradientTerm, Segment};
use cfpose_kernel::isa::Isa;
use cfpose_kernel::map::MapBlock;
use cfpose_kernel::points::Points;
use faer::{Mat, Side};
use gauss_quad::GaussHermite;
use num_dual::HyperDual64;

use crate::entry::FamilyEntry;
use crate::entry::{BuildContext, BuildError, ParameterSpec, build_family};
use crate::statistics::gram::{coefficient_matrix, feature_gram};

/// Directions of the basis whose share of the Gram matrix is below this are left out as dependent.
const RANK_TOLERANCE: f64 = 1e-10;

/// Under which distribution of points functions are orthonormal.
#[derive(Debug, Clone, PartialEq)]
pub enum Weight {
    /// p(x) = 2 / sqrt(2 pi) exp(-2 x^2) in each coordinate, by Gauss-Hermite quadrature (80, 64 and 32 nodes per coordinate
    /// in 1, 2 and 3 dimensions).
    Gaussian,
    /// The given points of the feature space with their weights.
    Empirical(Points),
}

/// What is orthonormal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Of {
    /// E f_i f_j = delta_ij.
    Values,
    /// E grad f_i . grad f_j = delta_ij; constant functions drop out.
    Gradients,
}

/// How the basis is combined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// f = Lambda^(-1/2) V' phi from K = V Lambda V': largest eigenvalue first; of each eigenvector the entry of largest
    /// magnitude (the first of equals) is positive.
    Eigen,
    /// Each function minus its projections on those before it, in the order of the basis; its own coefficient is positive.
    GramSchmidt,
}

/// A basis whose functions or gradients are made orthonormal, as one more coefficient matrix over it: points cost the same.
///
/// A separable basis is treated coordinate by coordinate, as the paper does, and stays separable; functions of different
/// coordinates are then not orthogonal to each other where their means do not vanish. [`Orthonormalised::joint`] changes
/// that. Functions that depend on those before them (relative share below 1e-10) are left out.
///
/// ```
/// use cfpose::families::orthonormalised::{Method, Of, Orthonormalised, Weight};
/// use cfpose::family::{DynFamily, Separable, SeparableFamily};
/// use cfpose::{Points, Scalar, statistics::gram::gram};
/// /// x and x^3: correlated.
/// struct Cubic;
/// impl SeparableFamily for Cubic {
///     fn num_basis(&self) -> usize { 2 }
///     #[inline(always)]
///     fn basis<S: Scalar>(&self, x: S, out: &mut [S]) {
///         out[0] = x;
///         out[1] = x * x * x;
///     }
/// }
/// let points = Points::from_rows(&[[-0.3], [0.1], [0.5], [0.8]]).unwrap();
/// let weight = Weight::Empirical(points.clone());
/// let family = Orthonormalised::new(Box::new(Separable(Cubic)), weight, Of::Gradients, Method::Eigen);
/// let report = gram(&family, &points);
/// assert!((report.gradients.condition - 1.0).abs() < 1e-9);
/// ```
pub struct Orthonormalised {
    inner: Box<dyn DynFamily>,
    weight: Weight,
    of: Of,
    method: Method,
    joint: bool,
    /// C of each dimension, computed when first asked for.
    matrices: [OnceLock<Vec<f64>>; 3],
}

impl Orthonormalised {
    /// Orthonormalise the features of any family.
    pub fn new(inner: Box<dyn DynFamily>, weight: Weight, of: Of, method: Method) -> Self {
        Self { inner, weight, of, method, joint: false, matrices: Default::default() }
    }

    /// Orthonormalise a separable basis over all coordinates together.
    #[must_use]
    pub fn joint(mut self) -> Self {
        self.joint = true;
        self.matrices = Default::default();
        self
    }

    /// Compute C for `dim` dimensions.
    fn matrix(&self, dim: usize) -> Vec<f64> {
        match self.inner.per_coordinate().filter(|_| !self.joint) {
            Some(num) => self.separable_matrix(dim, num),
            None => {
                let nodes = match &self.weight {
                    Weight::Gaussian => gaussian_nodes(dim),
                    Weight::Empirical(points) => points.clone(),
                };
                self.combine(&nodes).concat()
            }
        }
    }

    /// Combine the functions of each coordinate; features have the coordinate index fastest.
    fn separable_matrix(&self, dim: usize, num: usize) -> Vec<f64> {
        let single: Vec<Vec<Vec<f64>>> = match &self.weight {
            Weight::Gaussian => vec![self.combine(&gaussian_nodes(1)); dim],
            Weight::Empirical(points) => (0..dim)
                .map(|q| {
                    let column = vec![points.column(q).to_vec()];
                    // The points were valid, so their columns are.
                    let points = Points::weighted(column, points.weights().to_vec());
                    points.map_or_else(|_| Vec::new(), |points| self.combine(&points))
                })
                .collect(),
        };
        let mut full = Vec::new();
        for i in 0..single.iter().map(Vec::len).max().unwrap_or(0) {
            for (q, rows) in single.iter().enumerate() {
                if let Some(part) = rows.get(i) {
                    let mut row = vec![0.0; dim * num];
                    row[q * num..(q + 1) * num].copy_from_slice(part);
                    full.extend(row);
                }
            }
        }
        full
    }

    /// Return the rows of C over the inner basis in the dimension of the nodes.
    fn combine(&self, nodes: &Points) -> Vec<Vec<f64>> {
        let grams = feature_gram(self.inner.as_ref(), nodes);
        let gram = match self.of {
            Of::Values => grams.values,
            Of::Gradients => grams.gradients,
        };
        let rows = match self.method {
            Method::Eigen => eigen_rows(&gram),
            Method::GramSchmidt => gram_schmidt_rows(&gram),
        };
        match coefficient_matrix(self.inner.as_ref(), nodes.dim()) {
            None => rows,
            Some(c) => rows
                .iter()
                .map(|row| (0..c.ncols()).map(|j| row.iter().enumerate().map(|(i, r)| r * c[(i, j)]).sum()).collect())
                .collect(),
        }
    }
}

/// Return Gauss-Hermite nodes of the weight p as weighted points.
fn gaussian_nodes(dim: usize) -> Points {
    let count = match dim {
        1 => const { std::num::NonZeroUsize::new(80).unwrap() },
        2 => const { std::num::NonZeroUsize::new(64).unwrap() },
        _ => const { std::num::NonZeroUsize::new(32).unwrap() },
    };
    let rule = GaussHermite::new(count);
    // p(x) = 2 / sqrt(2 pi) exp(-2 x^2) is exp(-t^2) / sqrt(pi) at x = t / sqrt(2).
    let nodes: Vec<(f64, f64)> = rule.iter().map(|(t, w)| (t * 0.5_f64.sqrt(), *w)).collect();
    let n = nodes.len();
    let total = n.pow(dim as u32);
    let digit = |index: usize, q: usize| (index / n.pow(q as u32)) % n;
    let columns = (0..dim).map(|q| (0..total).map(|index| nodes[digit(index, q)].0).collect()).collect();
    let weights = (0..total).map(|index| (0..dim).map(|q| nodes[digit(index, q)].1).product()).collect();
    match Points::weighted(columns, weights) {
        Ok(points) => points,
        Err(error) => unreachable!("quadrature nodes are finite and have positive weights: {error}"),
    }
}

/// Rows of Lambda^(-1/2) V', largest eigenvalue first, entry of largest magnitude positive.
fn eigen_rows(gram: &Mat<f64>) -> Vec<Vec<f64>> {
    let n = gram.nrows();
    let Ok(eigen) = gram.self_adjoint_eigen(Side::Lower) else { return Vec::new() };
    let largest = if n > 0 { eigen.S()[n - 1] } else { 0.0 };
    let mut rows = Vec::new();
    for column in (0..n).rev() {
        let value = eigen.S()[column];
        if !(largest > 0.0 && value > RANK_TOLERANCE * largest) {
            break;
        }
        let vector: Vec<f64> = (0..n).map(|i| eigen.U()[(i, column)]).collect();
        let top = vector.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
        // Entries equal up to rounding: the first decides, on every machine.
        let leading = vector.iter().find(|entry| entry.abs() >= top * (1.0 - 1e-9)).copied().unwrap_or(1.0);
        let scale = 1.0_f64.copysign(leading) / value.sqrt();
        rows.push(vector.iter().map(|entry| entry * scale).collect());
    }
    rows
}

/// Modified Gram-Schmidt in the inner product a' K b, each function twice for accuracy.
fn gram_schmidt_rows(gram: &Mat<f64>) -> Vec<Vec<f64>> {
    let n = gram.nrows();
    let times = |v: &[f64]| -> Vec<f64> { (0..n).map(|i| (0..n).map(|j| gram[(i, j)] * v[j]).sum()).collect() };
    let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(x, y)| x * y).sum() };
    let mut rows: Vec<Vec<f64>> = Vec::new();
    // K times each row, kept beside it.
    let mut images: Vec<Vec<f64>> = Vec::new();
    for i in 0..n {
        let mut v = vec![0.0; n];
        v[i] = 1.0;
        for _ in 0..2 {
            for (row, image) in rows.iter().zip(&images) {
                let share = dot(image, &v);
                v.iter_mut().zip(row).for_each(|(entry, r)| *entry -= share * r);
            }
        }
        let image = times(&v);
        let square = dot(&v, &image);
        if !(square > RANK_TOLERANCE * gram[(i, i)] && square > 0.0) {
            continue;
        }
        let scale = square.sqrt().recip();
        rows.push(v.iter().map(|entry| entry * scale).collect());
        images.push(image.iter().map(|entry| entry * scale).collect());
    }
    rows
}

impl DynFamily for Orthonormalised {
    fn supports(&self, dim: usize) -> bool {
        let weighted = match &self.weight {
            Weight::Gaussian => true,
            Weight::Empirical(points) => points.dim() == dim,
        };
        weighted && self.inner.supports(dim)
    }

    fn num_basis(&self, dim: usize) -> usize {
        self.inner.num_basis(dim)
    }

    fn per_coordinate(&self) -> Option<usize> {
        self.inner.per_coordinate()
    }

    fn segments(&self, dim: usize) -> Vec<Segment> {
        self.inner.segments(dim)
    }

    fn coefficients(&self, dim: usize) -> Option<Vec<f64>> {
        Some(self.matrices[dim - 1].get_or_init(|| self.matrix(dim)).clone())
    }

    fn monomials(&self, dim: usize) -> Option<&[[usize; 3]]> {
        self.inner.monomials(dim)
    }

    fn gradient_terms(&self, dim: usize) -> Option<Vec<GradientTerm>> {
        self.inner.gradient_terms(dim)
    }

    fn block(&self, isa: Isa, points: &MapBlock, out: BasisRows<'_>) {
        self.inner.block(isa, points, out);
    }

    fn values(&self, x: &[f64], out: &mut [f64]) {
        self.inner.values(x, out);
    }

    fn hyper(&self, x: &[HyperDual64], out: &mut [HyperDual64]) {
        self.inner.hyper(x, out);
    }

    fn blur_hyper(&self, dim: usize, covariance: &[HyperDual64], means: &mut [HyperDual64]) -> bool {
        self.inner.blur_hyper(dim, covariance, means)
    }
}

/// Most functions of a basis: their products take seconds then.
const MAX_BASIS: usize = 512;

pub(super) const ENTRY: FamilyEntry = FamilyEntry {
    name: "orthonormalised",
    summary: "any family, its values or gradients made orthonormal under the paper's weight or the target points",
    parameters: &[
        ParameterSpec {
            name: "basis",
            default: "trig",
            meaning: "trig (the basis of trig18), or any family with its own parameters",
        },
        ParameterSpec {
            name: "weight",
            default: "gaussian",
            meaning: "gaussian: p(x) = 2 / sqrt(2 pi) exp(-2 x^2); empirical: the normalised target points",
        },
        ParameterSpec { name: "of", default: "values", meaning: "values or gradients" },
        ParameterSpec { name: "method", default: "eigen", meaning: "eigen or gram-schmidt" },
        ParameterSpec {
            name: "coordinates",
            default: "apart",
            meaning: "of a separable basis: apart (each coordinate by itself, as the paper) or joint",
        },
    ],
    source: "section IV.A, the construction behind the printed functions; erratum: it orthonormalises values, not gradients",
    details: "K = E[phi phi'] (or of gradients) for the functions phi of `basis`; `eigen`: f = Lambda^(-1/2) V' phi with K = V Lambda V', largest eigenvalue first, the entry of largest magnitude of each eigenvector positive; `gram-schmidt`: in the order of the basis, own coefficient positive. Dependent functions are left out. Costs the same per point as `basis`, whose blur it keeps. `orthonormalised` by itself gives `trig18` with all digits, up to signs.",
    build: |parameters, context| {
        let weight = parameters.choice("weight", &[("gaussian", false), ("empirical", true)])?;
        let of = parameters.choice("of", &[("values", Of::Values), ("gradients", Of::Gradients)])?;
        let methods = [("eigen", Method::Eigen), ("gram-schmidt", Method::GramSchmidt)];
        let method = parameters.choice("method", &methods)?;
        let joint = parameters.choice("coordinates", &[("apart", false), ("joint", true)])?;
        let data = |problem: &str| BuildError::Data { name: "orthonormalised".into(), problem: problem.into() };
        let weight = match (weight, context.target) {
            (false, _) => Weight::Gaussian,
            (true, Some(points)) => Weight::Empirical(points.clone()),
            (true, None) => return Err(data("weight=empirical needs the target points")),
        };
        let mut families = context.families.to_vec();
        families.push(&super::shared::trig::ENTRY);
        let inner = build_family(parameters.text("basis"), &BuildContext { families: &families, ..*context })?;
        let apart = inner.per_coordinate().filter(|_| !joint);
        let size = if context.dim > 0 { apart.unwrap_or(inner.num_basis(context.dim)) } else { 0 };
        if size > MAX_BASIS {
            let problem = format!(
                "the basis has {size} functions, and at most {MAX_BASIS} can be orthonormalised; choose a smaller one"
            );
            return Err(data(&problem));
        }
        let mut family = Orthonormalised::new(inner, weight, of, method);
        family.joint = joint;
        if context.dim > 0 && family.supports(context.dim) && family.num_features(context.dim) == 0 {
            return Err(data("the basis vanishes under this weight; choose another"));
        }
        Ok(Box::new(family))
    },
};
