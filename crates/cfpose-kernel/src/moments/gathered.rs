//! Moments of points that come in parts: exact sums about a stated centre, the same whatever the order and the parts.
//!
//! Every term w (x - c)^a is computed to about 2^-100 of itself, point by point and alike on every instruction set, and the terms
//! are added without rounding: sums over parts add up to the sums over the whole, to the last bit.

use pulp::{Simd, WithSimd};

use super::Moments;
use super::exact::ExactSum;
use super::monomial_family;
use super::recentred::recentred;
use super::twofold::Twofold;
use crate::means::Execution;
use crate::points::{BLOCK, Points};

/// Largest degree of gathered moments: twice that of the families.
pub const MAX_DEGREE: usize = 16;

/// Terms stay below this, so that two doubles hold each of them.
const LARGEST_TERM: f64 = 1e280;

/// Points of one task of a thread.
const TASK: usize = 1 << 15;

/// Why moments cannot be gathered or merged.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GatherError {
    /// The number of coordinates is not that of the moments.
    #[error("the points have {found} coordinates, those before had {expected}")]
    Dimension {
        /// Coordinates of the moments.
        expected: usize,
        /// Coordinates found.
        found: usize,
    },
    /// A power of a coordinate is too large for a double.
    #[error("row {row}: the coordinate {value:e} from the centre overflows at degree {degree}; rescale the points")]
    Overflow {
        /// Row, from 1, over all points gathered.
        row: u64,
        /// Largest distance of a coordinate from the centre.
        value: f64,
        /// Degree of the moments.
        degree: usize,
    },
    /// Two sets of sums are about different things.
    #[error("{what} differ: {first} here, {second} there")]
    Differ {
        /// What differs.
        what: &'static str,
        /// Of the one.
        first: String,
        /// Of the other.
        second: String,
    },
    /// More points than can be counted.
    #[error("more than 2^63 points")]
    TooMany,
}

/// Sums of w (x - c)^a over points, all exponents up to a degree, exact and therefore free of any order.
///
/// ```
/// use cfpose_kernel::{Execution, Points, moments::GatheredMoments};
/// let cloud = Points::from_rows(&[[0.1, 0.7], [0.3, 0.2], [0.5, -0.4]]).unwrap();
/// let about = |rows: &[usize]| {
///     let mut sums = GatheredMoments::new(2, 6, [0.2, 0.0, 0.0], "hermite[degree=3]");
///     sums.add(&cloud.select(rows).unwrap(), &Execution::default()).unwrap();
///     sums
/// };
/// let mut merged = about(&[2]);
/// merged.merge(&about(&[0, 1])).unwrap();
/// assert_eq!(merged.to_bytes(), about(&[0, 1, 2]).to_bytes());
/// assert!((merged.moments().mean()[0] - 0.3).abs() < 1e-15);
/// ```
#[derive(Debug, Clone)]
pub struct GatheredMoments {
    pub(super) dim: usize,
    pub(super) degree: usize,
    pub(super) centre: [f64; 3],
    pub(super) label: String,
    pub(super) count: u64,
    /// sum w^2, for the number of equally weighted points with the same variance of a mean.
    pub(super) squares: ExactSum,
    /// By degree, then lexicographically, as [`Moments::values`].
    pub(super) sums: Vec<ExactSum>,
}

impl GatheredMoments {
    /// Begin without points: `dim` coordinates (1 to 3), exponents up to `degree` (at most [`MAX_DEGREE`]), about `centre`; `label`
    /// says what the sums are for.
    ///
    /// # Panics
    /// When a number is outside these ranges or the centre is not finite.
    pub fn new(dim: usize, degree: usize, centre: [f64; 3], label: &str) -> Self {
        assert!((1..=3).contains(&dim) && degree <= MAX_DEGREE, "moments of {dim} coordinates to degree {degree}");
        assert!(centre.iter().all(|x| x.is_finite()), "the centre {centre:?} is not finite");
        // -0 and 0 are one centre.
        let centre = std::array::from_fn(|d| if d < dim { centre[d] + 0.0 } else { 0.0 });
        let sums = vec![ExactSum::ZERO; num_moments(dim, degree)];
        Self { dim, degree, centre, label: label.to_string(), count: 0, squares: ExactSum::ZERO, sums }
    }

    /// Add the moments of points; the sums are the same at any number of threads.
    ///
    /// # Errors
    /// [`GatherError`] for another dimension and coordinates whose powers overflow; nothing is added then.
    pub fn add(&mut self, points: &Points, execution: &Execution) -> Result<(), GatherError> {
        if points.dim() != self.dim {
            return Err(GatherError::Dimension { expected: self.dim, found: points.dim() });
        }
        self.check_size(points)?;
        let count = self.count.checked_add(points.len() as u64).filter(|count| *count <= i64::MAX as u64);
        self.count = count.ok_or(GatherError::TooMany)?;
        let (dim, degree, centre) = (self.dim, self.degree, self.centre);
        let family = monomial_family(degree);
        let parents = family.parents(dim);
        let tasks: Vec<usize> = (0..points.padded_len()).step_by(TASK).collect();
        let gather = |start: &usize| {
            let mut part = Self::new(dim, degree, centre, "");
            let end = (start + TASK).min(points.padded_len());
            for block in (*start..end).step_by(BLOCK) {
                let number = BLOCK.min(points.len().saturating_sub(block));
                execution.isa.run(Block { part: &mut part, points, block, number, parents });
            }
            part
        };
        match execution.pool.as_ref().filter(|_| tasks.len() > 1) {
            None => tasks.iter().for_each(|start| self.absorb(&gather(start))),
            Some(pool) => {
                use rayon::prelude::*;
                // Exact sums: whoever comes first.
                let parts: Vec<Self> = pool.install(|| tasks.par_iter().map(gather).collect());
                parts.iter().for_each(|part| self.absorb(part));
            }
        }
        Ok(())
    }

    /// Refuse coordinates whose powers a double does not hold.
    fn check_size(&self, points: &Points) -> Result<(), GatherError> {
        let largest_weight = points.weights().iter().fold(1.0_f64, |most, w| most.max(*w));
        let bound = (LARGEST_TERM / largest_weight.powi(2)).powf((self.degree.max(1) as f64).recip());
        for d in 0..self.dim {
            let far = |x: &f64| (x - self.centre[d]).abs() > bound;
            if let Some(k) = points.column(d).iter().position(far) {
                let (row, value) = (self.count + k as u64 + 1, (points.column(d)[k] - self.centre[d]).abs());
                return Err(GatherError::Overflow { row, value, degree: self.degree });
            }
        }
        Ok(())
    }

    fn absorb(&mut self, part: &Self) {
        self.squares.merge(&part.squares);
        self.sums.iter_mut().zip(&part.sums).for_each(|(sum, more)| sum.merge(more));
    }

    /// Add the sums over other points about the same centre.
    ///
    /// # Errors
    /// [`GatherError::Differ`] when dimension, degree, centre or label differ.
    pub fn merge(&mut self, other: &Self) -> Result<(), GatherError> {
        let differ = |what, first: String, second: String| Err(GatherError::Differ { what, first, second });
        if self.dim != other.dim {
            return differ("the coordinates", self.dim.to_string(), other.dim.to_string());
        }
        if self.degree != other.degree {
            return differ("the degrees", self.degree.to_string(), other.degree.to_string());
        }
        if self.centre.map(f64::to_bits) != other.centre.map(f64::to_bits) {
            let text = |sums: &Self| sums.centre()[..sums.dim].iter().map(f64::to_string).collect::<Vec<_>>().join(",");
            return differ("the centres", text(self), text(other));
        }
        if self.label != other.label {
            return differ("the feature families", self.label.clone(), other.label.clone());
        }
        let count = self.count.checked_add(other.count).filter(|count| *count <= i64::MAX as u64);
        self.count = count.ok_or(GatherError::TooMany)?;
        self.absorb(other);
        Ok(())
    }

    /// Return the moments about the mean of the points, scaled by their spread: what sums over all points at once give.
    ///
    /// The sums are moved there in two doubles a number: where the centre is r spreads away, moments of degree n lose about r^n 1e-31,
    /// which is nothing at degree 3 for the coordinates of a map, and leaves 7 digits at degree 6 for r = 10^4.
    pub fn moments(&self) -> Moments {
        recentred(self)
    }

    /// Return the number of coordinates.
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// Return the largest degree of the sums.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// Return the centre, missing coordinates as 0.
    pub fn centre(&self) -> [f64; 3] {
        self.centre
    }

    /// Return what the sums are for.
    pub fn label(&self) -> &str {
        &self.label
    }

    /// Return the number of points.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Return sum w.
    pub fn weight(&self) -> f64 {
        self.sums[0].value()
    }

    /// Return (sum w)^2 / sum w^2, the number of equally weighted points with the same variance of a mean.
    pub fn effective(&self) -> f64 {
        self.weight().powi(2) / self.squares.value()
    }
}

/// Return the number of monomials up to a degree.
pub(super) fn num_moments(dim: usize, degree: usize) -> usize {
    (1..=dim).fold(1, |product, k| product * (degree + k) / k)
}

/// The terms of one block of points, added to the sums.
struct Block<'a> {
    part: &'a mut GatheredMoments,
    points: &'a Points,
    block: usize,
    number: usize,
    parents: &'a [(usize, usize)],
}

/// A number for each point of a block.
type Column = [Twofold; BLOCK];

impl WithSimd for Block<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { part, points, block, number, parents } = self;
        let zero = [Twofold::of(0.0); BLOCK];
        let mut places = [zero; 3];
        for d in 0..part.dim {
            let (column, centre) = (&points.padded_column(d)[block..block + BLOCK], -part.centre[d]);
            for k in 0..BLOCK {
                places[d][k] = Twofold::sum(column[k], centre);
            }
        }
        let weights = &points.padded_weights()[block..block + BLOCK];
        for w in &weights[..number] {
            let square = Twofold::product(*w, *w);
            part.squares.add(square.high);
            part.squares.add(square.low);
        }
        let mut terms: Vec<Column> = Vec::with_capacity(parents.len());
        for (i, (parent, q)) in parents.iter().enumerate() {
            let mut term = zero;
            for k in 0..BLOCK {
                term[k] = if i == 0 { Twofold::of(weights[k]) } else { terms[*parent][k].times(places[*q][k]) };
            }
            let sum = &mut part.sums[i];
            for value in &term[..number] {
                sum.add(value.high);
                if value.low != 0.0 {
                    sum.add(value.low);
                }
            }
            terms.push(term);
        }
    }
}
