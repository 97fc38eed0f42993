//! Named entries of the tables: `name[key=value,...]`, typed parameters, and suggestions for a mistyped name.
//!
//! Models, families, solvers and scenarios are all looked up in the same way, so the mechanism lives at the bottom of
//! the house and knows nothing about any of them.

use std::any::Any;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

/// Describe one parameter of a table entry: what `cfpose list` and the generated reference pages print.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ParameterSpec {
    /// Key, kebab-case.
    pub name: &'static str,
    /// Default value, written as the user would write it.
    pub default: &'static str,
    /// Meaning, with unit and allowed values.
    pub meaning: &'static str,
}

/// Everything that can be wrong with a name or its parameters.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum EntryError {
    /// The name is in no table.
    #[error("unknown {kind} `{name}`{}; `cfpose list {}` shows all", suggestion_text(.suggestions), plural(.kind))]
    UnknownName {
        /// What was looked for: `model`, `family`, `solver`, ...
        kind: &'static str,
        /// What the user wrote.
        name: String,
        /// Nearest names, best first.
        suggestions: Vec<String>,
    },
    /// Several entries of a table have this name.
    #[error("{kind} `{name}` stands {count} times in the table; give each entry a name of its own")]
    DoubledName {
        /// Kind of the entry.
        kind: &'static str,
        /// The name.
        name: String,
        /// How many entries have it.
        count: usize,
    },
    /// The entry has no such parameter.
    #[error("{kind} `{name}` has no parameter `{key}`{}", suggestion_text(.suggestions))]
    UnknownParameter {
        /// Kind of the entry.
        kind: &'static str,
        /// Name of the entry.
        name: String,
        /// Key the user wrote.
        key: String,
        /// Keys the entry knows.
        suggestions: Vec<String>,
    },
    /// The value cannot be used.
    #[error("parameter `{key}` = `{value}`: {problem}")]
    BadValue {
        /// Key of the parameter.
        key: String,
        /// Value the user wrote.
        value: String,
        /// What is wrong and what to write instead.
        problem: String,
    },
    /// The text is not of the form `name[key=value,...]`.
    #[error("cannot read `{text}`: {problem}; write name or name[key=value,key=value]")]
    Syntax {
        /// What the user wrote.
        text: String,
        /// What is wrong.
        problem: String,
    },
}

/// Return the name of the table that `cfpose list` takes.
fn plural(kind: &str) -> String {
    kind.strip_suffix('y').map_or_else(|| format!("{kind}s"), |stem| format!("{stem}ies"))
}

fn suggestion_text(names: &[String]) -> String {
    match names {
        [] => String::new(),
        names => format!("; did you mean {}?", names.join(" or ")),
    }
}

/// Hold the parameters given for one entry, checked against its [`ParameterSpec`]s, with defaults filled in.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Parameters {
    values: BTreeMap<String, String>,
    table: Handed,
}

/// What the caller of a build function hands down; no part of what parameters are compared by.
#[derive(Clone, Default)]
struct Handed(Option<Arc<dyn Any + Send + Sync>>);

impl fmt::Debug for Handed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.0.is_some() { "a table" } else { "none" })
    }
}

impl PartialEq for Handed {
    fn eq(&self, _other: &Self) -> bool {
        true
    }
}

impl Eq for Handed {}

impl Parameters {
    /// Fill in the defaults of `specs` and overwrite them with `given`.
    ///
    /// # Errors
    /// [`EntryError::UnknownParameter`] for a key that `specs` does not hold.
    pub fn resolve(
        kind: &'static str,
        name: &str,
        specs: &[ParameterSpec],
        given: &[(String, String)],
    ) -> Result<Self, EntryError> {
        let mut values: BTreeMap<String, String> =
            specs.iter().map(|s| (s.name.to_string(), s.default.to_string())).collect();
        for (key, value) in given {
            if !values.contains_key(key) {
                return Err(EntryError::UnknownParameter {
                    kind,
                    name: name.to_string(),
                    key: key.clone(),
                    suggestions: specs.iter().map(|s| s.name.to_string()).collect(),
                });
            }
            values.insert(key.clone(), value.clone());
        }
        Ok(Self { values, table: Handed::default() })
    }

    /// Hand down the table in which names inside the parameters are looked up, such as the solver of `multi-start[solver=...]`.
    #[must_use]
    pub fn with_table<T: Any + Send + Sync>(mut self, table: T) -> Self {
        self.table = Handed(Some(Arc::new(table)));
        self
    }

    /// Return the table that was handed down, `None` where there is none of this type.
    pub fn table<T: Any>(&self) -> Option<&T> {
        self.table.0.as_deref()?.downcast_ref()
    }

    /// Return the text of a parameter.
    ///
    /// # Panics
    /// When the entry's table line does not declare `key`: a mistake of the entry's author, caught by the conformance tests.
    pub fn text(&self, key: &str) -> &str {
        self.values.get(key).unwrap_or_else(|| panic!("parameter `{key}` is read but not declared in the table"))
    }

    /// Parse a parameter.
    ///
    /// # Errors
    /// [`EntryError::BadValue`] when the text is not of type `T`; `expected` says what would be.
    pub fn parse<T: std::str::FromStr>(&self, key: &str, expected: &str) -> Result<T, EntryError> {
        let text = self.text(key);
        text.parse().map_err(|_| self.bad(key, &format!("expected {expected}")))
    }

    /// Parse a number and check it against a predicate.
    ///
    /// # Errors
    /// [`EntryError::BadValue`] when it is not a number or `valid` rejects it.
    pub fn number(&self, key: &str, expected: &str, valid: impl Fn(f64) -> bool) -> Result<f64, EntryError> {
        let value: f64 = self.parse(key, expected)?;
        if valid(value) { Ok(value) } else { Err(self.bad(key, &format!("expected {expected}"))) }
    }

    /// Parse a count between `low` and `high`, both included.
    ///
    /// # Errors
    /// [`EntryError::BadValue`] when it is not a whole number of that range.
    pub fn count(&self, key: &str, low: usize, high: usize) -> Result<usize, EntryError> {
        let expected = format!("a whole number from {low} to {high}");
        let value: usize = self.parse(key, &expected)?;
        if (low..=high).contains(&value) { Ok(value) } else { Err(self.bad(key, &format!("expected {expected}"))) }
    }

    /// Choose one of the listed words.
    ///
    /// # Errors
    /// [`EntryError::BadValue`] when the text is none of them.
    pub fn choice<T: Copy>(&self, key: &str, choices: &[(&str, T)]) -> Result<T, EntryError> {
        let text = self.text(key);
        choices.iter().find(|(name, _)| *name == text).map(|(_, value)| *value).ok_or_else(|| {
            let names: Vec<&str> = choices.iter().map(|(name, _)| *name).collect();
            self.bad(key, &format!("expected one of {}", names.join(", ")))
        })
    }

    /// Build the error for a value that parses but does not make sense.
    pub fn bad(&self, key: &str, problem: &str) -> EntryError {
        EntryError::BadValue { key: key.to_string(), value: self.text(key).to_string(), problem: problem.to_string() }
    }
}

/// Split `name[key=value,...]` into the name and its given parameters; a value may itself be such a text.
///
/// # Errors
/// [`EntryError::Syntax`] when brackets do not match, a name is empty or a parameter has no `=`.
///
/// ```
/// use cfpose_optim::entry::parse_spec;
/// let (name, given) = parse_spec("hermite[degree=3, kind=total]").unwrap();
/// assert_eq!(name, "hermite");
/// assert_eq!(given[1], ("kind".to_string(), "total".to_string()));
/// let (_, given) = parse_spec("multi-start[solver=levenberg-marquardt[damping=nielsen,accept=0.1],starts=9]").unwrap();
/// assert_eq!(given[0].1, "levenberg-marquardt[damping=nielsen,accept=0.1]");
/// assert!(parse_spec("hermite[degree]").is_err());
/// ```
pub fn parse_spec(text: &str) -> Result<(String, Vec<(String, String)>), EntryError> {
    let syntax = |problem: &str| EntryError::Syntax { text: text.to_string(), problem: problem.to_string() };
    let text_trimmed = text.trim();
    let (name, inside) = match text_trimmed.split_once('[') {
        None => (text_trimmed, None),
        Some((name, rest)) => {
            (name.trim(), Some(rest.strip_suffix(']').ok_or_else(|| syntax("the bracket is not closed at the end"))?))
        }
    };
    if name.is_empty() {
        return Err(syntax("the name is empty"));
    }
    if deepest(text_trimmed) > MAX_DEPTH {
        return Err(syntax(&format!("brackets are nested more than {MAX_DEPTH} deep")));
    }
    if name.contains(']') {
        return Err(syntax("the brackets do not match"));
    }
    let mut given = Vec::new();
    let parts = split_outside_brackets(inside.unwrap_or("")).ok_or_else(|| syntax("the brackets do not match"))?;
    for part in parts.into_iter().map(str::trim).filter(|p| !p.is_empty()) {
        let (key, value) = part.split_once('=').ok_or_else(|| syntax("a parameter has no `=`"))?;
        given.push((key.trim().to_string(), value.trim().to_string()));
    }
    Ok((name.to_string(), given))
}

/// Deepest nesting of brackets: entries made from entries are built by recursion.
const MAX_DEPTH: usize = 8;

/// Return how deep brackets are nested.
fn deepest(text: &str) -> usize {
    let mut depth = 0_usize;
    let depths = text.chars().map(|c| {
        match c {
            '[' => depth += 1,
            ']' => depth = depth.saturating_sub(1),
            _ => {}
        }
        depth
    });
    depths.max().unwrap_or(0)
}

/// Refuse a name that several entries of a table have.
///
/// # Errors
/// [`EntryError::DoubledName`].
pub fn require_one<'a>(kind: &'static str, name: &str, names: impl Iterator<Item = &'a str>) -> Result<(), EntryError> {
    match names.filter(|known| *known == name).count() {
        0 | 1 => Ok(()),
        count => Err(EntryError::DoubledName { kind, name: name.to_string(), count }),
    }
}

/// Split at the commas that stand outside brackets; nothing when brackets do not match.
fn split_outside_brackets(text: &str) -> Option<Vec<&str>> {
    let (mut parts, mut depth, mut begin) = (Vec::new(), 0_usize, 0);
    for (i, c) in text.char_indices() {
        match c {
            '[' => depth += 1,
            ']' => depth = depth.checked_sub(1)?,
            ',' if depth == 0 => {
                parts.push(&text[begin..i]);
                begin = i + 1;
            }
            _ => {}
        }
    }
    parts.push(&text[begin..]);
    (depth == 0).then_some(parts)
}

/// Return up to three known names near `name`, best first, for error messages.
///
/// ```
/// use cfpose_optim::entry::suggest;
/// assert_eq!(suggest("trig81", ["trig18", "hermite"].into_iter()), vec!["trig18".to_string()]);
/// ```
pub fn suggest<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> Vec<String> {
    let limit = name.chars().count().max(3) / 2;
    let mut ranked: Vec<(usize, &str)> = known
        .map(|candidate| {
            let part = !name.is_empty() && (candidate.starts_with(name) || name.starts_with(candidate));
            (if part { 1 } else { edit_distance(name, candidate) }, candidate)
        })
        .filter(|(distance, _)| *distance <= limit)
        .collect();
    ranked.sort();
    ranked.into_iter().take(3).map(|(_, candidate)| candidate.to_string()).collect()
}

/// Levenshtein distance with transpositions counted as two edits.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, ca) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, cb) in b.iter().enumerate() {
            let substitute = diagonal + usize::from(ca != *cb);
            diagonal = row[j + 1];
            row[j + 1] = substitute.min(row[j] + 1).min(row[j + 1] + 1);
        }
    }
    row[b.len()]
}
