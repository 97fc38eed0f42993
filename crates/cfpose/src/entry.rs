//! What a table of named entries is: `name[key=value,...]`, its look-up, and what an entry is built from.

use std::collections::BTreeMap;
use std::sync::Arc;

use cfpose_kernel::family::{Concatenated, DynFamily};
use cfpose_kernel::points::Points;
pub use cfpose_optim::entry::{EntryError, ParameterSpec, Parameters, parse_spec, require_one, suggest};

/// Contents of files by the name under which entries ask for them: the library opens no file.
pub type Files = BTreeMap<String, Arc<[u8]>>;

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
    /// Contents of files that the caller read (learned weights);
    /// [`Registry::family`](crate::registry::Registry::family) fills in its own.
    pub files: Option<&'a Files>,
    /// Families that an entry made from another family may name; [`Registry::family`](crate::registry::Registry::family)
    /// fills in its own.
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
    /// The code of an entry does what it must not: it panics, returns NaN, lies about its size.
    #[error("{kind} `{name}` is broken: {problem}")]
    Broken {
        /// `model`, `family`, ...
        kind: &'static str,
        /// Name of the entry.
        name: String,
        /// What it did.
        problem: String,
    },
}

/// Build a family from its parameters and the context.
pub type BuildFamily = fn(&Parameters, &BuildContext<'_>) -> Result<Box<dyn DynFamily>, BuildError>;

/// One line of the family table.
pub struct FamilyEntry {
    /// Name, kebab-case, equal to its file name.
    pub name: &'static str,
    /// One line for lists.
    pub summary: &'static str,
    /// Parameters with defaults.
    pub parameters: &'static [ParameterSpec],
    /// Paper equation or reference.
    pub source: &'static str,
    /// Markdown for the generated reference page: formula, order of the functions, when to use it.
    pub details: &'static str,
    /// Build the family.
    pub build: BuildFamily,
}

impl std::fmt::Debug for FamilyEntry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "FamilyEntry({})", self.name)
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
    require_one(kind, &name, table.iter().map(|entry| entry.name()))?;
    let entry = table.iter().find(|entry| entry.name() == name).ok_or_else(|| EntryError::UnknownName {
        kind,
        name: name.clone(),
        suggestions: suggest(&name, table.iter().map(|entry| entry.name())),
    })?;
    let parameters = Parameters::resolve(kind, &name, entry.parameters(), &given)?;
    Ok((entry, parameters))
}

/// Deepest nesting of brackets in a name.
const MAX_DEPTH: usize = 8;

/// Most basis functions of a family, or of a sum of families.
const MAX_BASIS: usize = 16_384;

/// Build a family, or a weighted concatenation `2*a + 0.5*b[key=value]`, from the families that the context names.
///
/// # Errors
/// [`BuildError`] for bad syntax, an unknown name, bad parameters, or data the family cannot use.
pub fn build_family(spec: &str, context: &BuildContext<'_>) -> Result<Box<dyn DynFamily>, BuildError> {
    let mut parts = Vec::new();
    for (weight, name) in split_sum(spec)? {
        let (entry, parameters) = find("family", context.families, name)?;
        let family = (entry.build)(&parameters, context)?;
        if context.dim > 0 && !family.supports(context.dim) {
            let problem = format!("the family does not exist in {} dimension(s)", context.dim);
            return Err(BuildError::Data { name: entry.name.to_string(), problem });
        }
        parts.push((weight, family));
    }
    let size = |dim| parts.iter().map(|(_, family)| family.num_basis(dim)).fold(0_usize, usize::saturating_add);
    if context.dim > 0 && size(context.dim) > MAX_BASIS {
        let problem =
            format!("{} basis functions are more than {MAX_BASIS}; choose a smaller family", size(context.dim));
        return Err(BuildError::Data { name: "features".to_string(), problem });
    }
    match <[(f64, Box<dyn DynFamily>); 1]>::try_from(parts) {
        Ok([(1.0, family)]) => Ok(family),
        Ok([part]) => Ok(Box::new(Concatenated::new(vec![part]))),
        Err(parts) => Ok(Box::new(Concatenated::new(parts))),
    }
}

/// Return the names of files that a family's name asks for, of its parts and of families inside its parameters too: every value
/// of a parameter `file` but `none`. Bad syntax names none; building says what is wrong with it.
///
/// ```
/// let files = cfpose::entry::files_of("hermite + 0.5*orthonormalised[basis=learned[file=a b.safetensors]]");
/// assert_eq!(files, ["a b.safetensors"]);
/// ```
pub fn files_of(spec: &str) -> Vec<String> {
    let mut found = Vec::new();
    for (_, name) in split_sum(spec).unwrap_or_default() {
        let Ok((_, given)) = parse_spec(name) else { continue };
        for (key, value) in given {
            match key.as_str() {
                "file" if value != "none" => found.push(value),
                _ if value.contains('[') => found.extend(files_of(&value)),
                _ => {}
            }
        }
    }
    found
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
