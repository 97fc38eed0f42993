//! Moments: with polynomial features of an affine model the points are needed only once.
//!
//! For x = A u + b every mean of a monomial of x is a polynomial in (A, b) whose coefficients are the moments of u. The moments are
//! summed in one pass (additive over shards, constant memory); then residual and Jacobian cost the same for any number of points.
//!
//! Moments that come in parts, from files or other machines, are gathered exactly ([`GatheredMoments`]): the same to the last bit in
//! any order.
//!
//! Numerics: u is centred and scaled to unit spread, and the recursion below never forms large powers of A.

use crate::author::Identity;
use crate::family::General;
use crate::family::polynomial::{Polynomial, Products};
use crate::map::{DynMap, Factored, LiftedPoints, Transform};
use crate::means::{Execution, Side, Sums};
use crate::points::Points;

mod bytes;
mod exact;
mod gathered;
mod mapped;
mod path;
mod recentred;
mod twofold;

pub use bytes::BytesError;
pub use gathered::{GatherError, GatheredMoments, MAX_DEGREE};
pub use mapped::mapped_means;
pub use path::MomentPath;

/// Return the family of all monomials up to a degree.
fn monomial_family(degree: usize) -> Polynomial {
    let rows = (0..=degree).map(|n| (0..=n).map(|k| f64::from(u8::from(k == n))).collect()).collect();
    Polynomial::new(rows, Products::Total)
}

/// List the exponents of all monomials up to a degree: by degree, then lexicographically, the constant first.
///
/// ```
/// use cfpose_kernel::moments::monomials;
/// assert_eq!(monomials(2, 1), [[0, 0, 0], [0, 1, 0], [1, 0, 0]]);
/// ```
pub fn monomials(dim: usize, degree: usize) -> Vec<[usize; 3]> {
    monomial_family(degree).exponents(dim).to_vec()
}

/// Moments sum w u^a / sum w of centred, scaled lifted points u = (lifted - centre) / scale.
///
/// ```
/// use cfpose_kernel::{Execution, Points, moments::Moments};
/// let cloud = Points::from_rows(&[[1.0, 0.0], [3.0, 2.0], [5.0, 1.0]]).unwrap();
/// let moments = Moments::of_points(&cloud, 4, &Execution::default());
/// let (first, second) = (cloud.select(&[0]).unwrap(), cloud.select(&[1, 2]).unwrap());
/// let mut merged = Moments::like(&moments, &first, &Execution::default());
/// merged.merge(&Moments::like(&moments, &second, &Execution::default()));
/// for (a, b) in merged.values().iter().zip(moments.values()) {
///     assert!((a - b).abs() < 1e-14);
/// }
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Moments {
    dim: usize,
    degree: usize,
    centre: [f64; 3],
    scale: f64,
    weight: f64,
    sums: Vec<f64>,
}

impl Moments {
    /// Sum the moments of a point set up to a degree, centred at its mean and scaled by its spread.
    pub fn of_points(points: &Points, degree: usize, execution: &Execution) -> Self {
        let columns = (0..points.dim()).map(|d| points.padded_column(d).to_vec()).collect();
        let lifted = LiftedPoints { len: points.len(), columns, weights: points.padded_weights().to_vec() };
        Self::of_lifted(&lifted, degree, execution)
    }

    /// Sum the moments of other points about the same centre and scale, so that both can be merged: one pass per shard.
    pub fn like(other: &Self, points: &Points, execution: &Execution) -> Self {
        let columns = (0..points.dim()).map(|d| points.padded_column(d).to_vec()).collect();
        let lifted = LiftedPoints { len: points.len(), columns, weights: points.padded_weights().to_vec() };
        Self::about(&lifted, other.degree, other.centre, other.scale, execution)
    }

    pub(crate) fn of_lifted(points: &LiftedPoints, degree: usize, execution: &Execution) -> Self {
        let dim = points.columns.len();
        let first = Self::about(points, 2.min(degree), [0.0; 3], 1.0, execution);
        // Centre and scale need a few digits only; the moments about them are exact whatever they are.
        let values = first.values();
        let family = monomial_family(first.degree);
        let at = |e: [usize; 3]| family.exponents(dim).iter().position(|other| *other == e).map_or(0.0, |i| values[i]);
        let unit = |k: usize, n: usize| std::array::from_fn(|q| if q == k { n } else { 0 });
        let mut centre = [0.0; 3];
        let mut spread = 0.0_f64;
        for (k, entry) in centre.iter_mut().enumerate().take(dim) {
            *entry = at(unit(k, 1));
            spread += (at(unit(k, 2)) - *entry * *entry).max(0.0);
        }
        let scale = (spread / dim as f64).sqrt();
        Self::about(points, degree, centre, if scale > 0.0 && scale.is_finite() { scale } else { 1.0 }, execution)
    }

    fn about(points: &LiftedPoints, degree: usize, centre: [f64; 3], scale: f64, execution: &Execution) -> Self {
        let dim = points.columns.len();
        let inverse = 1.0 / scale;
        let matrix = std::array::from_fn(|i| std::array::from_fn(|j| if i == j { inverse } else { 0.0 }));
        let family = General(monomial_family(degree));
        let map: Box<dyn DynMap> = match dim {
            1 => Box::new(Factored::<_, 1, 1, 1>::new(Identity)),
            2 => Box::new(Factored::<_, 2, 2, 2>::new(Identity)),
            _ => Box::new(Factored::<_, 3, 3, 3>::new(Identity)),
        };
        let prepared = map.prepare(&[0.0], &[], 0);
        let transform = Transform::new(centre, matrix);
        let Sums { weight, value, .. } =
            Side { map: map.as_ref(), prepared, transform: &transform, points, family: &family, closure: None }
                .sums(execution);
        Self { dim, degree, centre, scale, weight, sums: value }
    }

    /// Add the moments of other points.
    ///
    /// # Panics
    /// When centre, scale, degree or dimension differ: make both with [`Moments::like`].
    pub fn merge(&mut self, other: &Self) {
        assert!(
            (self.dim, self.degree, self.centre, self.scale) == (other.dim, other.degree, other.centre, other.scale),
            "moments about different centres cannot be added; make them with Moments::like"
        );
        self.weight += other.weight;
        self.sums.iter_mut().zip(&other.sums).for_each(|(a, b)| *a += b);
    }

    /// Return the moments (means), ordered by degree, then lexicographically.
    pub fn values(&self) -> Vec<f64> {
        self.sums.iter().map(|sum| sum / self.weight).collect()
    }

    /// Return the moments up to a lower degree.
    #[must_use]
    pub fn up_to(&self, degree: usize) -> Self {
        let degree = degree.min(self.degree);
        let sums = self.sums[..gathered::num_moments(self.dim, degree)].to_vec();
        Self { degree, sums, ..self.clone() }
    }

    /// Return the number of coordinates.
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// Return the largest degree.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// Return the total weight.
    pub fn weight(&self) -> f64 {
        self.weight
    }

    /// Return the weighted mean of the points, missing coordinates as 0; the centre below degree 1.
    pub fn mean(&self) -> [f64; 3] {
        std::array::from_fn(|k| self.centre[k] + self.scale * self.value_at(&[k]))
    }

    /// Return the weighted covariance (divided by the total weight), zeros for missing coordinates and below degree 2.
    pub fn covariance(&self) -> [[f64; 3]; 3] {
        let entry = |i, j| self.scale.powi(2) * (self.value_at(&[i, j]) - self.value_at(&[i]) * self.value_at(&[j]));
        std::array::from_fn(|i| std::array::from_fn(|j| if i < self.dim && j < self.dim { entry(i, j) } else { 0.0 }))
    }

    /// Return the mean of a product of coordinates, 0 where it is not there.
    fn value_at(&self, factors: &[usize]) -> f64 {
        let mut exponent = [0; 3];
        factors.iter().for_each(|k| exponent[*k] += 1);
        let family = monomial_family(self.degree);
        let place = family.exponents(self.dim).iter().position(|other| *other == exponent);
        place.map_or(0.0, |i| self.sums[i] / self.weight)
    }
}
