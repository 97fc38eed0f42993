//! The `[[method]]` tables of an experiment file.

use std::collections::BTreeMap;
use std::path::Path;

use cfpose::estimator::Pipeline;
use toml::{Table, Value};

use super::Reader;
use crate::error::LabError;
use crate::folder;
use crate::method::known::{Known, PriorFile};
use crate::method::{DEFAULT_PRESET, Method, SCENARIO_START, stages};

const METHOD_KEYS: &[&str] = &[
    "name",
    "preset",
    "model",
    "features",
    "normalise",
    "weighting",
    "solver",
    "pipeline",
    "start",
    "free",
    "bounds",
    "prior",
    "max_evaluations",
    "max_iterations",
    "external",
];

/// Keys of a method that may hold a list: one method for each value.
const METHOD_AXES: &[&str] = &["preset", "features", "weighting", "solver", "pipeline"];

impl Reader<'_> {
    pub(super) fn methods(&self, table: &Table) -> Result<Vec<Method>, LabError> {
        let mut methods: Vec<Method> = Vec::new();
        let mut single: Vec<(String, Table)> = Vec::new();
        for (place, table) in self.tables(table, "method")? {
            self.known_keys(&place, table, METHOD_KEYS)?;
            single.extend(expanded(table).into_iter().map(|table| (place.clone(), table)));
        }
        for (place, table) in &single {
            let method = self.method(place, table)?;
            if method.name.trim().is_empty() {
                return Err(self.value_error(place, "`name` is empty; results are told apart by it".to_string()));
            }
            if methods.iter().any(|other| other.name == method.name) {
                return Err(self.value_error(place, format!("the name `{}` is used twice", method.name)));
            }
            methods.push(method);
        }
        if methods.is_empty() {
            return Err(self.value_error("top level", "there is no [[method]]".to_string()));
        }
        Ok(methods)
    }

    fn method(&self, place: &str, table: &Table) -> Result<Method, LabError> {
        let text = |key| self.text(place, table, key);
        Ok(Method {
            name: text("name")?.ok_or_else(|| self.value_error(place, "the method has no `name`".to_string()))?,
            preset: text("preset")?.unwrap_or_else(|| DEFAULT_PRESET.to_string()),
            model: text("model")?,
            features: text("features")?,
            normalise: text("normalise")?,
            weighting: text("weighting")?,
            solver: text("solver")?,
            pipeline: self.pipeline(place, table)?,
            start: text("start")?.unwrap_or_else(|| SCENARIO_START.to_string()),
            known: Known {
                free: self.free(place, table)?,
                bounds: self.bounds(place, table)?,
                prior: self.prior(place, table)?,
            },
            max_evaluations: self.count(place, table, "max_evaluations", 1)?,
            max_iterations: self.count(place, table, "max_iterations", 1)?,
            external: self.flag(place, table, "external")?,
        })
    }

    /// Read a file that a method names, in the folder of the experiment, else a name from where the program runs.
    fn named(&self, name: &str) -> Result<(String, String), LabError> {
        let path = self.folder.join(Path::new(name));
        Ok((folder::read_text(&path)?, path.display().to_string()))
    }

    fn pipeline(&self, place: &str, table: &Table) -> Result<Option<Pipeline>, LabError> {
        let (text, file) = match table.get("pipeline") {
            None => return Ok(None),
            Some(Value::String(name)) => self.named(name)?,
            Some(Value::Table(table)) => {
                let read: Result<Pipeline, _> = Value::Table(table.clone()).try_into();
                let pipeline = read.map_err(|error| {
                    self.value_error(place, format!("`pipeline`: {}", error.message().replace('\n', " ")))
                })?;
                if pipeline.stages.is_empty() {
                    return Err(self.value_error(place, "`pipeline`: it has no stage".to_string()));
                }
                return Ok(Some(pipeline));
            }
            Some(other) => {
                let problem = format!("`pipeline` = {other}: expected the name of a file, or a table of stages");
                return Err(self.value_error(place, problem));
            }
        };
        stages::read(&text, &file).map(Some)
    }

    fn free(&self, place: &str, table: &Table) -> Result<Option<Vec<String>>, LabError> {
        let names = match table.get("free") {
            None => return Ok(None),
            Some(Value::Array(names)) => names.iter().map(|name| name.as_str().map(str::to_string)).collect(),
            Some(_) => None,
        };
        names.map(Some).ok_or_else(|| {
            self.value_error(place, "`free`: expected a list of names of parameters, such as [\"ry\", \"tx\"]".into())
        })
    }

    fn bounds(&self, place: &str, table: &Table) -> Result<BTreeMap<String, [f64; 2]>, LabError> {
        let wrong = || {
            let shape = "expected NAME = [LOW, HIGH] with numbers, angles in radians, -inf or inf where a side is open";
            self.value_error(place, format!("`bounds`: {shape}"))
        };
        let Some(bounds) = table.get("bounds") else { return Ok(BTreeMap::new()) };
        let number = |value: &Value| value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64));
        let one = |(name, value): (&String, &Value)| {
            let [low, high] = value.as_array().ok_or_else(wrong)?.as_slice() else { return Err(wrong()) };
            let (low, high) = (number(low).ok_or_else(wrong)?, number(high).ok_or_else(wrong)?);
            if low.is_nan() || high.is_nan() { Err(wrong()) } else { Ok((name.clone(), [low, high])) }
        };
        bounds.as_table().ok_or_else(wrong)?.iter().map(one).collect()
    }

    fn prior(&self, place: &str, table: &Table) -> Result<Option<PriorFile>, LabError> {
        match table.get("prior") {
            None => Ok(None),
            Some(Value::String(name)) => {
                let (text, file) = self.named(name)?;
                let read = PriorFile::read(&text);
                read.map(Some).map_err(|problem| self.value_error(place, format!("`prior`: {file}: {problem}")))
            }
            Some(other) => {
                let read: Result<PriorFile, _> = other.clone().try_into();
                read.map(Some).map_err(|error| {
                    let shape = "expected the name of a JSON file, or a table with `theta` and `covariance`";
                    self.value_error(place, format!("`prior`: {shape}: {}", error.message().replace('\n', " ")))
                })
            }
        }
    }
}

/// Return one method for each combination of the lists in a method's table, named `NAME: value, value`.
fn expanded(table: &Table) -> Vec<Table> {
    let mut all = vec![table.clone()];
    for key in METHOD_AXES {
        let Some(Value::Array(values)) = table.get(*key) else { continue };
        let with = |method: &Table, first: bool, value: &Value| {
            let mut method = method.clone();
            let name = method.get("name").and_then(Value::as_str).unwrap_or_default();
            let joint = if first { ": " } else { ", " };
            let name = format!("{name}{joint}{}", value.as_str().map_or_else(|| value.to_string(), str::to_string));
            method.insert("name".to_string(), Value::String(name));
            method.insert((*key).to_string(), value.clone());
            method
        };
        let first = !METHOD_AXES
            .iter()
            .take_while(|other| *other != key)
            .any(|k| matches!(table.get(*k), Some(Value::Array(_))));
        all = all.iter().flat_map(|method| values.iter().map(move |value| with(method, first, value))).collect();
    }
    all
}
