//! `[page]` of an experiment file: which cells a page of results pools.

use toml::{Table, Value};

use super::{Experiment, Reader};
use crate::error::LabError;

/// The table of an experiment in a page of results ([`crate::report::docs`]): cells that agree in the parameters below are pooled.
///
/// ```
/// use cfpose_lab::{Experiment, Lab};
/// let text = r#"
///     [page]
///     by = ["b_i"]
///     [[scenario]]
///     name = "planar-curve"
///     b_i = [0.1, 0.2]
///     b_p = [0.01, 0.02, 0.03]
///     [[method]]
///     name = "paper"
///     preset = "paper"
/// "#;
/// let experiment = Experiment::parse(&Lab::default(), text, "table.toml").unwrap();
/// assert_eq!(experiment.page.unwrap().by, ["b_i"]);
/// let error = Experiment::parse(&Lab::default(), &text.replace("[\"b_i\"]", "[\"b_j\"]"), "table.toml").unwrap_err();
/// assert!(error.to_string().contains("no scenario has a parameter `b_j`"));
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Page {
    /// Parameters that make rows, `scenario` among them.
    pub by: Vec<String>,
    /// Parameters that make columns; where there are none, the columns are what was measured.
    pub across: Vec<String>,
}

impl Page {
    /// Return the table that reads back as this one.
    pub(super) fn to_value(&self) -> Value {
        let list = |names: &[String]| Value::Array(names.iter().cloned().map(Value::String).collect());
        let mut table = Table::from_iter([("by".to_string(), list(&self.by))]);
        if !self.across.is_empty() {
            table.insert("across".to_string(), list(&self.across));
        }
        Value::Table(table)
    }

    /// Return the first name that no scenario of the experiment has.
    pub(super) fn unknown(&self, experiment: &Experiment) -> Option<&str> {
        let known = |name: &str| {
            let of = |grid: &super::Grid| grid.axes.iter().any(|(axis, _)| axis == name);
            name == "scenario" || experiment.scenarios.iter().any(of)
        };
        self.by.iter().chain(&self.across).map(String::as_str).find(|name| !known(name))
    }
}

impl Reader<'_> {
    /// Read `[page]`.
    pub(super) fn page(&self, table: &Table) -> Result<Option<Page>, LabError> {
        let place = "[page]";
        let table = match table.get("page") {
            None => return Ok(None),
            Some(Value::Table(table)) => table,
            Some(_) => return Err(self.value_error("top level", "`page`: write [page] and its keys below".to_string())),
        };
        self.known_keys(place, table, &["by", "across"])?;
        let names = |key: &str| {
            let wrong =
                || self.value_error(place, format!("`{key}`: expected a list of names of parameters in quotes"));
            let list = match table.get(key) {
                None => return Ok(Vec::new()),
                Some(value) => value.as_array().ok_or_else(wrong)?,
            };
            list.iter().map(|item| item.as_str().map(str::to_string).ok_or_else(wrong)).collect()
        };
        Ok(Some(Page { by: names("by")?, across: names("across")? }))
    }
}
