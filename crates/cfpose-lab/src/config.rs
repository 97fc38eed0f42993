//! The experiment file: seed, trials, scenarios with grids, methods.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use cfpose::entry::{EntryError, Parameters, find, parse_spec, suggest};
use toml::{Table, Value};

use crate::cell::Cell;
use crate::error::LabError;
use crate::folder;
use crate::lab::Lab;
use crate::method::Method;
use crate::scenario::problems::NO_MODEL;
use crate::seed::fnv1a;
use crate::value::{canonical, text_of, toml_of};

/// An experiment, resolved: every scenario's parameters are filled in, all names are checked.
///
/// ```
/// use cfpose_lab::{Experiment, Lab};
/// let text = r#"
///     seed = 1
///     trials = 100
///     [[scenario]]
///     name = "planar-curve"
///     b_i = [0.1, 0.2]                # a list is a grid axis
///     b_p = [0.01, 0.02, 0.03]
///     [[method]]
///     name = "paper"
///     preset = "paper"
/// "#;
/// let experiment = Experiment::parse(&Lab::default(), text, "table.toml").unwrap();
/// assert_eq!(experiment.cells().len(), 6);
/// let error = Experiment::parse(&Lab::default(), &text.replace("b_p", "b_q"), "table.toml").unwrap_err();
/// assert!(error.to_string().contains("has no parameter `b_q`"));
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Experiment {
    /// Seed of all data.
    pub seed: u64,
    /// Trials of each cell, where the scenario says nothing else.
    pub trials: usize,
    /// Wall-clock limit of each solve in seconds, a safety: rows of trials that took so long are flagged `timed_out`.
    pub deadline_secs: Option<f64>,
    /// Scenarios with their grids.
    pub scenarios: Vec<Grid>,
    /// Methods.
    pub methods: Vec<Method>,
    /// Printed figures to show beside ours.
    pub published: Vec<Published>,
    /// The pooled table of a page of results.
    pub page: Option<Page>,
    /// Folder of the file, where scenarios look for files that they name; no part of the experiment's identity.
    pub folder: PathBuf,
}

/// One `[[scenario]]`: all parameters of the entry in the table's order, each with its values.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// Name of the scenario.
    pub name: String,
    /// Trials of each cell, if not the experiment's.
    pub trials: Option<usize>,
    /// (parameter, values as canonical text).
    pub axes: Vec<(String, Vec<String>)>,
}

/// A figure printed elsewhere: success of one cell.
#[derive(Debug, Clone, PartialEq)]
pub struct Published {
    /// Title of the table it stands in.
    pub table: String,
    /// Method it belongs to.
    pub method: String,
    /// Success, percent.
    pub success: f64,
    /// Parameters that single out the cell, canonical text.
    pub parameters: BTreeMap<String, String>,
}

mod methods;
mod page;

pub use page::Page;

const TOP_KEYS: &[&str] = &["seed", "trials", "deadline_secs", "scenario", "method", "published", "page"];
/// Largest number of cells: beyond it a grid is a mistake.
const MAX_CELLS: usize = 1_000_000;

impl Experiment {
    /// Read an experiment file.
    ///
    /// # Errors
    /// [`LabError`] naming file, place and mistake; unknown keys and names come with suggestions.
    pub fn load(lab: &Lab, path: &Path) -> Result<Self, LabError> {
        let folder = path.parent().unwrap_or(Path::new(""));
        Self::read(lab, &folder::read_text(path)?, &path.display().to_string(), folder)
    }

    /// Read an experiment from text; `file` names it in errors, files that it names are looked up in the folder of the program.
    ///
    /// # Errors
    /// As [`Experiment::load`].
    pub fn parse(lab: &Lab, text: &str, file: &str) -> Result<Self, LabError> {
        Self::read(lab, text, file, Path::new(""))
    }

    fn read(lab: &Lab, text: &str, file: &str, folder: &Path) -> Result<Self, LabError> {
        let table: Table = toml::from_str(text).map_err(|error| LabError::Toml {
            file: file.to_string(),
            line: error.span().map_or(1, |span| text[..span.start.min(text.len())].matches('\n').count() + 1),
            problem: error.message().replace('\n', " "),
        })?;
        let reader = Reader { lab, file, folder };
        let place = "top level";
        reader.known_keys(place, &table, TOP_KEYS)?;
        let methods = reader.methods(&table)?;
        let experiment = Self {
            seed: reader.count(place, &table, "seed", 0)?.unwrap_or(0) as u64,
            trials: reader.count(place, &table, "trials", 1)?.unwrap_or(100),
            deadline_secs: reader.deadline(&table)?,
            scenarios: reader.scenarios(&table)?,
            published: reader.published(&table, &methods)?,
            page: reader.page(&table)?,
            methods,
            folder: folder.to_path_buf(),
        };
        reader.check(&experiment)?;
        Ok(experiment)
    }

    /// Set the number of trials of every cell.
    #[must_use]
    pub fn with_trials(mut self, trials: usize) -> Self {
        self.trials = trials;
        self.scenarios.iter_mut().for_each(|grid| grid.trials = None);
        self
    }

    /// Return all cells in the order of the file, the last parameter fastest; a cell that comes twice counts once, with
    /// the larger number of trials.
    pub fn cells(&self) -> Vec<Cell> {
        let mut cells: Vec<Cell> = Vec::new();
        let mut seen: BTreeMap<String, usize> = BTreeMap::new();
        for grid in &self.scenarios {
            let trials = grid.trials.unwrap_or(self.trials);
            let mut combinations: Vec<Vec<(String, String)>> = vec![Vec::new()];
            for (key, values) in &grid.axes {
                combinations = combinations
                    .iter()
                    .flat_map(|left| {
                        values.iter().map(|value| {
                            let mut longer = left.clone();
                            longer.push((key.clone(), value.clone()));
                            longer
                        })
                    })
                    .collect();
            }
            for parameters in combinations {
                let cell = Cell { scenario: grid.name.clone(), parameters, trials };
                match seen.get(&cell.label()) {
                    Some(index) => cells[*index].trials = cells[*index].trials.max(trials),
                    None => {
                        seen.insert(cell.label(), cells.len());
                        cells.push(cell);
                    }
                }
            }
        }
        cells
    }

    /// Write the resolved experiment as a file that reads back as the same experiment.
    pub fn to_toml(&self) -> String {
        let mut table = Table::new();
        table.insert("seed".into(), Value::Integer(self.seed.cast_signed()));
        table.insert("trials".into(), Value::Integer(self.trials as i64));
        if let Some(deadline) = self.deadline_secs {
            table.insert("deadline_secs".into(), Value::Float(deadline));
        }
        table.insert("scenario".into(), Value::Array(self.scenarios.iter().map(Grid::to_value).collect()));
        // A method holds texts, counts and tables of them, which TOML can always write.
        let methods = self.methods.iter().filter_map(|method| Value::try_from(method).ok()).collect();
        table.insert("method".into(), Value::Array(methods));
        if !self.published.is_empty() {
            table.insert("published".into(), Value::Array(self.published.iter().map(Published::to_value).collect()));
        }
        if let Some(page) = &self.page {
            table.insert("page".into(), page.to_value());
        }
        table.to_string()
    }

    /// Return the fingerprint: 16 hexadecimal digits of [`fnv1a`] over the resolved file.
    pub fn fingerprint(&self) -> String {
        format!("{:016x}", fnv1a(self.to_toml().as_bytes()))
    }
}

impl Grid {
    fn to_value(&self) -> Value {
        let mut table = Table::new();
        table.insert("name".into(), Value::String(self.name.clone()));
        if let Some(trials) = self.trials {
            table.insert("trials".into(), Value::Integer(trials as i64));
        }
        for (key, values) in &self.axes {
            let value = match values.as_slice() {
                [one] => toml_of(one),
                many => Value::Array(many.iter().map(|v| toml_of(v)).collect()),
            };
            table.insert(key.clone(), value);
        }
        Value::Table(table)
    }
}

impl Published {
    fn to_value(&self) -> Value {
        let mut table: Table = self.parameters.iter().map(|(key, text)| (key.clone(), toml_of(text))).collect();
        table.insert("table".into(), Value::String(self.table.clone()));
        table.insert("method".into(), Value::String(self.method.clone()));
        table.insert("success".into(), Value::Float(self.success));
        Value::Table(table)
    }

    /// Say whether the figure belongs to a cell and method.
    pub fn matches(&self, parameters: &[(String, String)], method: &str) -> bool {
        self.method == method
            && self.parameters.iter().all(|(key, value)| parameters.iter().any(|(k, v)| k == key && v == value))
    }
}

/// Reads the parts of an experiment file and says where a mistake stands.
struct Reader<'a> {
    lab: &'a Lab,
    file: &'a str,
    /// Where files that methods name are looked up.
    folder: &'a Path,
}

impl Reader<'_> {
    fn value_error(&self, place: &str, problem: String) -> LabError {
        LabError::Value { file: self.file.to_string(), place: place.to_string(), problem }
    }

    fn known_keys(&self, place: &str, table: &Table, known: &[&str]) -> Result<(), LabError> {
        for key in table.keys() {
            if !known.contains(&key.as_str()) {
                let mut suggestions = suggest(key, known.iter().copied());
                if suggestions.is_empty() {
                    suggestions = known.iter().map(|name| (*name).to_string()).collect();
                }
                let (file, place) = (self.file.to_string(), place.to_string());
                return Err(LabError::UnknownKey { file, place, key: key.clone(), suggestions });
            }
        }
        Ok(())
    }

    fn count(&self, place: &str, table: &Table, key: &str, least: i64) -> Result<Option<usize>, LabError> {
        match table.get(key) {
            None => Ok(None),
            Some(Value::Integer(value)) if *value >= least => Ok(Some(*value as usize)),
            Some(other) => {
                Err(self.value_error(place, format!("`{key}` = {other}: expected a whole number >= {least}")))
            }
        }
    }

    fn text(&self, place: &str, table: &Table, key: &str) -> Result<Option<String>, LabError> {
        match table.get(key) {
            None => Ok(None),
            Some(Value::String(text)) => Ok(Some(text.clone())),
            Some(other) => Err(self.value_error(place, format!("`{key}` = {other}: expected a text in quotes"))),
        }
    }

    fn flag(&self, place: &str, table: &Table, key: &str) -> Result<bool, LabError> {
        match table.get(key) {
            None => Ok(false),
            Some(Value::Boolean(value)) => Ok(*value),
            Some(other) => Err(self.value_error(place, format!("`{key}` = {other}: expected true or false"))),
        }
    }

    fn deadline(&self, table: &Table) -> Result<Option<f64>, LabError> {
        let seconds = match table.get("deadline_secs") {
            None => return Ok(None),
            Some(Value::Float(value)) => *value,
            Some(Value::Integer(value)) => *value as f64,
            Some(_) => f64::NAN,
        };
        if seconds > 0.0 && seconds <= 1e9 {
            return Ok(Some(seconds));
        }
        Err(self.value_error("top level", "`deadline_secs`: expected seconds above 0, at most 1e9".to_string()))
    }

    /// Return the tables of `[[key]]`, each with its place in words.
    fn tables<'t>(&self, table: &'t Table, key: &str) -> Result<Vec<(String, &'t Table)>, LabError> {
        let wrong = || self.value_error("top level", format!("`{key}`: write [[{key}]] above each of them"));
        let Some(value) = table.get(key) else { return Ok(Vec::new()) };
        let items = value.as_array().ok_or_else(wrong)?;
        let numbered = items.iter().enumerate();
        numbered.map(|(i, item)| Ok((format!("[[{key}]] {}", i + 1), item.as_table().ok_or_else(wrong)?))).collect()
    }

    fn scenarios(&self, table: &Table) -> Result<Vec<Grid>, LabError> {
        let tables = self.tables(table, "scenario")?;
        if tables.is_empty() {
            return Err(self.value_error("top level", "there is no [[scenario]]".to_string()));
        }
        tables.iter().map(|(place, table)| self.grid(place, table)).collect()
    }

    fn grid(&self, place: &str, table: &Table) -> Result<Grid, LabError> {
        let name = self
            .text(place, table, "name")?
            .ok_or_else(|| self.value_error(place, "the scenario has no `name`".to_string()))?;
        let entry_error = |problem: EntryError| LabError::Entry {
            file: self.file.to_string(),
            place: place.to_string(),
            problem: Box::new(problem),
        };
        let (entry, _) = find("scenario", &self.lab.scenarios, &name).map_err(entry_error)?;
        let (_, in_name) = parse_spec(&name).map_err(entry_error)?;
        let mut given: BTreeMap<&str, Vec<String>> = BTreeMap::new();
        for (key, value) in &in_name {
            if table.contains_key(key) || given.insert(key, vec![canonical(value)]).is_some() {
                let problem = format!("`{key}` is given twice: in `name` = \"{name}\" and again; keep one of them");
                return Err(self.value_error(place, problem));
            }
        }
        for (key, value) in table.iter().filter(|(key, _)| !["name", "trials"].contains(&key.as_str())) {
            let values = match value {
                Value::Array(items) if items.is_empty() => Err("the list is empty".to_string()),
                Value::Array(items) => items.iter().map(text_of).collect(),
                single => text_of(single).map(|text| vec![text]),
            };
            let values = values.map_err(|problem| self.value_error(place, format!("`{key}`: {problem}")))?;
            given.insert(key, values);
        }
        // Checks the keys, with suggestions.
        let first: Vec<(String, String)> = given.iter().map(|(k, v)| ((*k).to_string(), v[0].clone())).collect();
        Parameters::resolve("scenario", entry.name, entry.parameters, &first).map_err(entry_error)?;
        let axes = entry.parameters.iter().map(|spec| {
            let values = given.remove(spec.name).unwrap_or_else(|| vec![canonical(spec.default)]);
            (spec.name.to_string(), values)
        });
        let grid =
            Grid { name: entry.name.to_string(), trials: self.count(place, table, "trials", 1)?, axes: axes.collect() };
        let cells = grid.axes.iter().try_fold(1_usize, |product, (_, values)| product.checked_mul(values.len()));
        if cells.is_none_or(|cells| cells > MAX_CELLS) {
            return Err(self.value_error(place, format!("the grid has more than {MAX_CELLS} cells")));
        }
        Ok(grid)
    }

    fn published(&self, table: &Table, methods: &[Method]) -> Result<Vec<Published>, LabError> {
        let read = |(place, table): (String, &Table)| {
            let missing = |key: &str| self.value_error(&place, format!("`{key}` is missing"));
            let success = match table.get("success") {
                Some(Value::Integer(value)) => *value as f64,
                Some(Value::Float(value)) => *value,
                _ => return Err(missing("success")),
            };
            let method = self.text(&place, table, "method")?.unwrap_or_else(|| methods[0].name.clone());
            let title = self.text(&place, table, "table")?.ok_or_else(|| missing("table"))?;
            let cell_keys = table.iter().filter(|(key, _)| !["success", "method", "table"].contains(&key.as_str()));
            let parameters = cell_keys.map(|(key, value)| {
                let text = text_of(value).map_err(|p| self.value_error(&place, format!("`{key}`: {p}")))?;
                Ok((key.clone(), text))
            });
            Ok(Published { table: title, method, success, parameters: parameters.collect::<Result<_, LabError>>()? })
        };
        self.tables(table, "published")?.into_iter().map(read).collect()
    }

    /// Build every scenario and every method once, so that mistakes show before the first trial.
    fn check(&self, experiment: &Experiment) -> Result<(), LabError> {
        let mut models: Vec<String> = Vec::new();
        for cell in experiment.cells() {
            let scenario = cell.build(self.lab).map_err(|problem| LabError::Entry {
                file: self.file.to_string(),
                place: format!("scenario {}", cell.label()),
                problem: Box::new(problem),
            })?;
            if !models.iter().any(|model| model == scenario.model()) {
                models.push(scenario.model().to_string());
            }
        }
        for method in experiment.methods.iter().filter(|method| !method.external) {
            for model in &models {
                let checked = match model.as_str() {
                    NO_MODEL => method.check_solver(&self.lab.registry),
                    model => method.check(&self.lab.registry, model).map(|_| ()),
                };
                checked.map_err(|problem| LabError::Estimator {
                    file: self.file.to_string(),
                    place: format!("method `{}`", method.name),
                    problem: Box::new(problem),
                })?;
            }
        }
        if let Some(name) = experiment.page.as_ref().and_then(|page| page.unknown(experiment)) {
            let known = experiment.scenarios.iter().flat_map(|grid| grid.axes.iter().map(|(axis, _)| axis.as_str()));
            let hint = match suggest(name, known).first() {
                Some(near) => format!("did you mean `{near}`?"),
                None => "`cfpose list scenarios` shows them".to_string(),
            };
            return Err(self.value_error("[page]", format!("no scenario has a parameter `{name}`; {hint}")));
        }
        let cells = experiment.cells();
        for published in &experiment.published {
            if !cells.iter().any(|cell| published.matches(&cell.parameters, &published.method)) {
                let problem = format!("the figure {} of `{}` belongs to no cell", published.success, published.table);
                return Err(self.value_error("published", problem));
            }
        }
        Ok(())
    }
}
