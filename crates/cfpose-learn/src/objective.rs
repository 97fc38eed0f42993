//! What an author of an objective writes, and its erased form with derivatives by automatic differentiation.

use cfpose::entry::{EntryError, NamedEntry, ParameterSpec, Parameters};
use num_dual::{Derivative, DualNumCopy, DualSVec64};

use crate::normal::{Normal, Shape};

/// Derivatives that one pass of automatic differentiation takes.
const SEEDS: usize = 14;

/// A number that says how bad features are at one state; its mean over states is minimised.
///
/// Write it over any number type: the derivative comes from dual numbers.
pub trait Objective: Send + Sync + 'static {
    /// Return the value at a state.
    fn value<D: DualNumCopy<Primitive = f64>>(&self, state: &Normal<'_, D>) -> D;

    /// Return the number of perturbations of the target that a state has to hold.
    fn perturbations(&self) -> Perturbations {
        Perturbations::default()
    }
}

/// How often the target of a state is perturbed, in each way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Perturbations {
    /// Random halves of the target points: the sampling error of the means.
    pub halves: usize,
    /// Single points far out: the direction in which an outlier pulls the means.
    pub outliers: usize,
    /// The part of the target on one side of a plane: thinning in one place.
    pub cuts: usize,
}

impl Perturbations {
    /// Return the total number.
    pub fn count(self) -> usize {
        self.halves + self.outliers + self.cuts
    }

    /// Return what serves both.
    #[must_use]
    pub fn max(self, other: Self) -> Self {
        Self {
            halves: self.halves.max(other.halves),
            outliers: self.outliers.max(other.outliers),
            cuts: self.cuts.max(other.cuts),
        }
    }
}

/// An objective, erased.
pub trait DynObjective: Send + Sync {
    /// Return the value at a state.
    fn value(&self, shape: Shape, products: &[f64], delta: &[f64]) -> f64;

    /// Return the value, and add `factor` times its derivatives by the products to `slopes`.
    fn slopes(&self, shape: Shape, products: &[f64], delta: &[f64], factor: f64, slopes: &mut [f64]) -> f64;

    /// As [`Objective::perturbations`].
    fn perturbations(&self) -> Perturbations;
}

impl<O: Objective> DynObjective for O {
    fn value(&self, shape: Shape, products: &[f64], delta: &[f64]) -> f64 {
        Objective::value(self, &Normal::new(shape, products, delta))
    }

    fn slopes(&self, shape: Shape, products: &[f64], delta: &[f64], factor: f64, slopes: &mut [f64]) -> f64 {
        let mut duals: Vec<DualSVec64<SEEDS>> = products.iter().map(|p| DualSVec64::from(*p)).collect();
        let mut value = 0.0;
        for first in (0..products.len()).step_by(SEEDS) {
            let count = SEEDS.min(products.len() - first);
            for (seed, dual) in duals[first..first + count].iter_mut().enumerate() {
                dual.eps = Derivative::some(nalgebra::SVector::from_fn(|i, _| f64::from(u8::from(i == seed))));
            }
            let result = Objective::value(self, &Normal::new(shape, &duals, delta));
            value = result.re;
            if let Some(eps) = result.eps.0 {
                slopes[first..first + count].iter_mut().zip(eps.iter()).for_each(|(sum, eps)| *sum += factor * eps);
            }
            duals[first..first + count].iter_mut().for_each(|dual| dual.eps = Derivative::none());
        }
        value
    }

    fn perturbations(&self) -> Perturbations {
        Objective::perturbations(self)
    }
}

/// One line of the table of objectives.
pub struct ObjectiveEntry {
    /// Name, kebab-case, equal to its file name.
    pub name: &'static str,
    /// One line for lists.
    pub summary: &'static str,
    /// Parameters with defaults.
    pub parameters: &'static [ParameterSpec],
    /// Reference.
    pub source: &'static str,
    /// Build the objective.
    pub build: fn(&Parameters) -> Result<Box<dyn DynObjective>, EntryError>,
}

impl NamedEntry for ObjectiveEntry {
    fn name(&self) -> &'static str {
        self.name
    }
    fn summary(&self) -> &'static str {
        self.summary
    }
    fn parameters(&self) -> &'static [ParameterSpec] {
        self.parameters
    }
    fn source(&self) -> &'static str {
        self.source
    }
}
