//! The registry: all tables of the library in one place, for a program to choose from and to extend.

mod guard;

use cfpose_kernel::family::DynFamily;
use cfpose_optim::solver::{Solver, SolverEntry};

use crate::entry::{BuildContext, BuildError, FamilyEntry, Files, NamedEntry, ParameterSpec, build_family, find};
use crate::error::Error;
use crate::model::{Model, ModelEntry};
use crate::problem::normalise::{Normaliser, NormaliserEntry};
use crate::start::{StartEntry, StartStrategy};
use crate::statistics::weighting::{Weighting, WeightingEntry};

/// All named entries a program can choose from. [`Registry::default`] holds the library's tables; push your own.
///
/// ```
/// use cfpose::{BuildContext, Registry};
/// let registry = Registry::default();
/// let model = registry.model("rigid3", &BuildContext::default()).unwrap();
/// assert_eq!(model.dim(), 3);
/// let error = registry.model("rigid33", &BuildContext::default()).err().unwrap();
/// assert!(error.to_string().contains("did you mean rigid3"));
/// ```
#[derive(Clone)]
pub struct Registry {
    /// Transformation models.
    pub models: Vec<&'static ModelEntry>,
    /// Feature families.
    pub families: Vec<&'static FamilyEntry>,
    /// Normalisers.
    pub normalisers: Vec<&'static NormaliserEntry>,
    /// Weightings.
    pub weightings: Vec<&'static WeightingEntry>,
    /// Start strategies.
    pub starts: Vec<&'static StartEntry>,
    /// Solvers.
    pub solvers: Vec<&'static SolverEntry>,
    /// Contents of files that entries name, such as `learned[file=...]`, by those names.
    pub files: Files,
}

impl Default for Registry {
    fn default() -> Self {
        Self {
            models: crate::models::ALL.to_vec(),
            families: crate::families::ALL.to_vec(),
            normalisers: crate::problem::normalise::ALL.to_vec(),
            weightings: crate::statistics::weighting::ALL.to_vec(),
            starts: crate::start::ALL.to_vec(),
            solvers: cfpose_optim::solvers::ALL.to_vec(),
            files: Files::new(),
        }
    }
}

macro_rules! named_entry {
    ($($entry:ty),*) => {$(
        impl NamedEntry for $entry {
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
    )*};
}
named_entry!(ModelEntry, FamilyEntry, NormaliserEntry, WeightingEntry, StartEntry, SolverEntry);

impl Registry {
    /// Build a model by name.
    ///
    /// # Errors
    /// [`Error::Build`] for an unknown name or bad parameters, and for a model of your own that contradicts itself or panics.
    pub fn model(&self, spec: &str, context: &BuildContext<'_>) -> Result<Model, Error> {
        let (entry, parameters) = find("model", &self.models, spec).map_err(BuildError::from)?;
        let model = guard::build("model", entry.name, || (entry.build)(&parameters, context))?;
        if !guard::ships(crate::models::ALL, entry) {
            guard::model(entry.name, &model)?;
        }
        Ok(model)
    }

    /// Build a feature family by name, or a weighted concatenation of several.
    ///
    /// ```
    /// use cfpose::{BuildContext, Registry};
    /// let context = BuildContext { dim: 2, ..BuildContext::default() };
    /// let family = Registry::default().family("2*hermite[degree=2] + 0.5*fourier[k=1]", &context).unwrap();
    /// assert_eq!(family.num_features(2), 5 + 4);
    /// ```
    ///
    /// # Errors
    /// [`Error::Build`] for an unknown name, bad parameters, or data the family cannot use.
    pub fn family(&self, spec: &str, context: &BuildContext<'_>) -> Result<Box<dyn DynFamily>, Error> {
        let context = BuildContext { families: &self.families, files: context.files.or(Some(&self.files)), ..*context };
        let family = guard::build("family", spec, || build_family(spec, &context))?;
        let own = self.families.iter().filter(|entry| !guard::ships(crate::families::ALL, entry));
        if context.dim > 0 && own.into_iter().any(|entry| spec.contains(entry.name)) {
            guard::family(spec, family.as_ref(), context.dim)?;
        }
        Ok(family)
    }

    /// Build a normaliser by name.
    ///
    /// # Errors
    /// [`Error::Build`] for an unknown name or bad parameters.
    pub fn normaliser(&self, spec: &str) -> Result<Box<dyn Normaliser>, Error> {
        let (entry, parameters) = find("normaliser", &self.normalisers, spec).map_err(BuildError::from)?;
        Ok(guard::build("normaliser", entry.name, || (entry.build)(&parameters).map_err(BuildError::from))?)
    }

    /// Build a weighting by name.
    ///
    /// # Errors
    /// [`Error::Build`] for an unknown name or bad parameters.
    pub fn weighting(&self, spec: &str) -> Result<Box<dyn Weighting>, Error> {
        let (entry, parameters) = find("weighting", &self.weightings, spec).map_err(BuildError::from)?;
        Ok(guard::build("weighting", entry.name, || (entry.build)(&parameters).map_err(BuildError::from))?)
    }

    /// Build a start strategy by name.
    ///
    /// # Errors
    /// [`Error::Build`] for an unknown name or bad parameters.
    pub fn start(&self, spec: &str) -> Result<Box<dyn StartStrategy>, Error> {
        let (entry, parameters) = find("start", &self.starts, spec).map_err(BuildError::from)?;
        let start = guard::build("start", entry.name, || (entry.build)(&parameters).map_err(BuildError::from))?;
        Ok(Box::new(guard::WatchedStart { start, own: !guard::ships(crate::start::ALL, entry) }))
    }

    /// Build a solver by name; solvers that its parameters name come from this registry too.
    ///
    /// A panic in the solver or in the code of a problem that it solves is caught and becomes
    /// [`SolveError::Broken`](cfpose_optim::SolveError::Broken), and so is what a solver returns that is no outcome.
    ///
    /// # Errors
    /// [`Error::Build`] for an unknown name or bad parameters.
    pub fn solver(&self, spec: &str) -> Result<Box<dyn Solver>, Error> {
        let build = || cfpose_optim::solvers::build_from(&self.solvers, spec).map_err(BuildError::from);
        let solver = guard::build("solver", spec, build)?;
        let name = solver.name();
        let own = !self.solvers.iter().any(|e| e.name == name && guard::ships(cfpose_optim::solvers::ALL, e));
        Ok(Box::new(guard::Watched { solver, own }))
    }
}
