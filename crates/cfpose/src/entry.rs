//! Named tables and the registry that a program can extend.

pub use cfpose_optim::entry::{EntryError, ParameterSpec, Parameters, parse_spec, suggest};
use cfpose_optim::solver::{Solver, SolverEntry};

use crate::error::Error;
use crate::family::{Concatenated, DynFamily, FamilyEntry};
use crate::model::{Model, ModelEntry};
use crate::normalise::{Normaliser, NormaliserEntry};
use crate::points::Points;
use crate::start::{StartEntry, StartStrategy};
use crate::weighting::{Weighting, WeightingEntry};

/// What the library knows when it builds an entry: some entries depend on the data or on bytes that the caller read.
#[derive(Debug, Clone, Copy, Default)]
pub struct BuildContext<'a> {
    /// Dimension of the feature space, 0 while it is not known.
    pub dim: usize,
    /// Source points as given, where known: for models that depend on them (control points).
    pub source: Option<&'a Points>,
    /// Target points in the normalised feature space, where known.
    pub target: Option<&'a Points>,
    /// Seed for entries that draw random numbers.
    pub seed: u64,
    /// Bytes handed in by the caller (learned weights): the library opens no file.
    pub bytes: Option<&'a [u8]>,
    /// Families that an entry made from another family may name; [`Registry::family`] fills in its own.
    pub families: &'a [&'static FamilyEntry],
}

/// Why an entry could not be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BuildError {
    /// A name or parameter is wrong.
    #[error(transparent)]
    Entry(#[from] EntryError),
    /// The data do not allow it.
    #[error("{name}: {problem}")]
    Data {
        /// Name of the entry.
        name: String,
        /// What is missing.
        problem: String,
    },
}

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
}

impl Default for Registry {
    fn default() -> Self {
        Self {
            models: crate::models::ALL.to_vec(),
            families: crate::families::ALL.to_vec(),
            normalisers: crate::normalise::ALL.to_vec(),
            weightings: crate::weighting::ALL.to_vec(),
            starts: crate::start::ALL.to_vec(),
            solvers: cfpose_optim::solvers::ALL.to_vec(),
        }
    }
}

/// What every table line has.
pub trait NamedEntry {
    /// Return the name.
    fn name(&self) -> &'static str;
    /// Return the one-line summary.
    fn summary(&self) -> &'static str;
    /// Return the parameters.
    fn parameters(&self) -> &'static [ParameterSpec];
    /// Return the source.
    fn source(&self) -> &'static str;
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

/// Find an entry by `name[key=value,...]` and resolve its parameters.
///
/// # Errors
/// [`EntryError`] for bad syntax, an unknown name (with suggestions) or an unknown parameter.
pub fn find<'a, E: NamedEntry>(
    kind: &'static str,
    table: &[&'a E],
    spec: &str,
) -> Result<(&'a E, Parameters), EntryError> {
    let (name, given) = parse_spec(spec)?;
    let entry = table.iter().find(|entry| entry.name() == name).ok_or_else(|| EntryError::UnknownName {
        kind,
        name: name.clone(),
        suggestions: suggest(&name, table.iter().map(|entry| entry.name())),
    })?;
    let parameters = Parameters::resolve(kind, &name, entry.parameters(), &given)?;
    Ok((entry, parameters))
}

impl Registry {
    /// Build a model by name.
    ///
    /// # Errors
    /// [`Error::Build`] for an unknown name or bad parameters.
    pub fn model(&self, spec: &str, context: &BuildContext<'_>) -> Result<Model, Error> {
        let (entry, parameters) = find("model", &self.models, spec).map_err(BuildError::from)?;
        Ok((entry.build)(&parameters, context)?)
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
        Ok(build_family(spec, &BuildContext { families: &self.families, ..*context })?)
    }

    /// Build a normaliser by name.
    ///
    /// # Errors
    /// [`Error::Build`] for an unknown name or bad parameters.
    pub fn normaliser(&self, spec: &str) -> Result<Box<dyn Normaliser>, Error> {
        let (entry, parameters) = find("normaliser", &self.normalisers, spec).map_err(BuildError::from)?;
        Ok((entry.build)(&parameters).map_err(BuildError::from)?)
    }

    /// Build a weighting by name.
    ///
    /// # Errors
    /// [`Error::Build`] for an unknown name or bad parameters.
    pub fn weighting(&self, spec: &str) -> Result<Box<dyn Weighting>, Error> {
        let (entry, parameters) = find("weighting", &self.weightings, spec).map_err(BuildError::from)?;
        Ok((entry.build)(&parameters).map_err(BuildError::from)?)
    }

    /// Build a start strategy by name.
    ///
    /// # Errors
    /// [`Error::Build`] for an unknown name or bad parameters.
    pub fn start(&self, spec: &str) -> Result<Box<dyn StartStrategy>, Error> {
        let (entry, parameters) = find("start", &self.starts, spec).map_err(BuildError::from)?;
        Ok((entry.build)(&parameters).map_err(BuildError::from)?)
    }

    /// Build a solver by name; solvers that its parameters name come from this registry too.
    ///
    /// # Errors
    /// [`Error::Build`] for an unknown name or bad parameters.
    pub fn solver(&self, spec: &str) -> Result<Box<dyn Solver>, Error> {
        Ok(cfpose_optim::solvers::build_from(&self.solvers, spec).map_err(BuildError::from)?)
    }
}

/// Deepest nesting of brackets in a name.
const MAX_DEPTH: usize = 8;

/// Build a family, or a weighted concatenation `2*a + 0.5*b[key=value]`, from the families of the context (the library's own
/// where it names none).
///
/// # Errors
/// [`BuildError`] for bad syntax, an unknown name, bad parameters, or data the family cannot use.
pub fn build_family(spec: &str, context: &BuildContext<'_>) -> Result<Box<dyn DynFamily>, BuildError> {
    let table = if context.families.is_empty() { crate::families::ALL } else { context.families };
    let mut parts = Vec::new();
    for (weight, name) in split_sum(spec)? {
        let (entry, parameters) = find("family", table, name)?;
        let family = (entry.build)(&parameters, context)?;
        if context.dim > 0 && !family.supports(context.dim) {
            let problem = format!("the family does not exist in {} dimension(s)", context.dim);
            return Err(BuildError::Data { name: entry.name.to_string(), problem });
        }
        parts.push((weight, family));
    }
    match <[(f64, Box<dyn DynFamily>); 1]>::try_from(parts) {
        Ok([(1.0, family)]) => Ok(family),
        Ok([part]) => Ok(Box::new(Concatenated::new(vec![part]))),
        Err(parts) => Ok(Box::new(Concatenated::new(parts))),
    }
}

/// Split `2*a + b[key=value]` at the plus signs outside brackets into weights and names.
fn split_sum(text: &str) -> Result<Vec<(f64, &str)>, EntryError> {
    let syntax = |problem: String| EntryError::Syntax { text: text.to_string(), problem };
    let (mut terms, mut depth, mut begin) = (Vec::new(), 0_usize, 0);
    for (i, c) in text.char_indices() {
        match c {
            '[' => depth += 1,
            ']' => depth = depth.saturating_sub(1),
            // The sign in the exponent of a weight, `1e+3*a`, is none between terms.
            '+' if depth == 0 && !is_exponent(&text[begin..i]) => {
                terms.push(&text[begin..i]);
                begin = i + 1;
            }
            _ => {}
        }
        if depth > MAX_DEPTH {
            return Err(syntax(format!("brackets are nested more than {MAX_DEPTH} deep")));
        }
    }
    terms.push(&text[begin..]);
    let mut parts = Vec::new();
    for term in &terms {
        if term.trim().is_empty() && terms.len() > 1 {
            return Err(syntax("a family is missing beside `+`".to_string()));
        }
        let head = term.split('[').next().unwrap_or(term);
        let (weight, name) = match head.split_once('*') {
            None => (1.0, *term),
            Some((weight, _)) => {
                let number: f64 = weight
                    .trim()
                    .parse()
                    .map_err(|_| syntax(format!("the weight `{}` before `*` is not a number", weight.trim())))?;
                (number, &term[weight.len() + 1..])
            }
        };
        if !(weight > 0.0 && weight.is_finite()) {
            return Err(syntax(format!("the weight {weight} is not a positive number")));
        }
        parts.push((weight, name));
    }
    Ok(parts)
}

/// Say whether a term so far is a number up to and including the `e` of its exponent.
fn is_exponent(term: &str) -> bool {
    let mantissa = term.trim().strip_suffix(['e', 'E']);
    mantissa.is_some_and(|m| m.starts_with(|c: char| c.is_ascii_digit() || c == '.') && m.parse::<f64>().is_ok())
}
