//! Trials that are looked at together: the cells of a scenario, or one of them, with the records of every method side by side.

use std::collections::BTreeMap;

use serde_json::{Map, Value};

use crate::config::Experiment;
use crate::plan::{Cell, Plan};
use crate::record::Record;
use crate::value::json_of;

/// One trial and what every method did in it.
#[derive(Debug, Clone)]
pub struct Problem<'a> {
    /// Index of the cell in the plan.
    pub cell: usize,
    /// One place for every method of the group; `None` where the record is missing.
    pub records: Vec<Option<&'a Record>>,
}

/// A success rate that was published elsewhere, for one cell and method.
#[derive(Debug, Clone, PartialEq)]
pub struct Quoted {
    /// Table that it stands in.
    pub table: String,
    /// Index of the cell in the plan.
    pub cell: usize,
    /// Index of the method in the group.
    pub method: usize,
    /// Success rate, a fraction.
    pub share: f64,
}

/// Paired trials of one scenario.
#[derive(Debug, Clone)]
pub struct Group<'a> {
    /// Name of the scenario.
    pub scenario: &'a str,
    /// The cell, as the parameters that differ between the scenario's cells; empty for all cells together.
    pub cell: String,
    /// Parameters of the cell, or those that all cells share.
    pub parameters: Map<String, Value>,
    /// Index in the plan and name of every cell of the group.
    pub cells: Vec<(usize, String)>,
    /// Success rates that the experiment quotes from elsewhere.
    pub published: Vec<Quoted>,
    /// Names of the methods.
    pub methods: Vec<&'a str>,
    /// Trials, by cell and repetition.
    pub problems: Vec<Problem<'a>>,
}

impl<'a> Group<'a> {
    /// Return the records of a method.
    pub fn of(&self, method: usize) -> impl Iterator<Item = &'a Record> + '_ {
        self.problems.iter().filter_map(move |problem| problem.records[method])
    }

    /// Return the place of a cell of the plan among the cells of the group.
    pub fn place(&self, cell: usize) -> Option<usize> {
        self.cells.binary_search_by_key(&cell, |(index, _)| *index).ok()
    }

    /// Return the records of two methods in the trials that both have.
    pub fn pairs(&self, first: usize, second: usize) -> impl Iterator<Item = (&'a Record, &'a Record)> + '_ {
        self.problems.iter().filter_map(move |problem| Some((problem.records[first]?, problem.records[second]?)))
    }

    /// Leave out methods without a record: those that the experiment names and no shard has computed yet.
    fn with_present_methods(mut self) -> Self {
        let present: Vec<usize> = (0..self.methods.len()).filter(|method| self.of(*method).next().is_some()).collect();
        if present.len() < self.methods.len() {
            self.methods = present.iter().map(|method| self.methods[*method]).collect();
            for problem in &mut self.problems {
                problem.records = present.iter().map(|method| problem.records[*method]).collect();
            }
        }
        self
    }

    /// Find what the experiment quotes about the cells and methods of the group.
    fn with_published(mut self, experiment: &Experiment, plan: &Plan) -> Self {
        for figure in &experiment.published {
            for (cell, _) in &self.cells {
                let parameters = &plan.cells[*cell].parameters;
                for (method, name) in self.methods.iter().enumerate() {
                    if figure.matches(parameters, name) {
                        let (table, share) = (figure.table.clone(), 0.01 * figure.success);
                        self.published.push(Quoted { table, cell: *cell, method, share });
                    }
                }
            }
        }
        self
    }

    /// Return all pairs of methods, the earlier one first.
    pub fn pairs_of_methods(&self) -> Vec<(usize, usize)> {
        let count = self.methods.len();
        (0..count).flat_map(|first| (first + 1..count).map(move |second| (first, second))).collect()
    }
}

/// Return the error that methods are compared by; infinite where there is no estimate.
pub fn error_of(record: &Record) -> f64 {
    record.error.filter(|error| record.usable && error.is_finite()).unwrap_or(f64::INFINITY)
}

/// Sort records into groups: for every scenario first all its cells together (where there are several), then each cell.
///
/// Records of trials that are not in the plan are left out. Cells without a record are left out too.
pub fn groups<'a>(experiment: &Experiment, plan: &'a Plan, records: &'a [Record]) -> Vec<Group<'a>> {
    let by_cell = problems(plan, records);
    let mut groups = Vec::new();
    for (scenario, cells) in scenarios(plan) {
        let varying = varying(plan, &cells);
        let named: Vec<(usize, String)> =
            cells.into_iter().map(|cell| (cell, name_of(&plan.cells[cell], &varying))).collect();
        let mut make = |cell: String, parameters: Map<String, Value>, cells: &[(usize, String)]| {
            let problems = cells.iter().flat_map(|(cell, _)| by_cell[*cell].iter().cloned()).collect();
            let methods = plan.methods.iter().map(String::as_str).collect();
            let (cells, published) = (cells.to_vec(), Vec::new());
            let group = Group { scenario, cell, parameters, cells, published, methods, problems };
            groups.push(group.with_present_methods().with_published(experiment, plan));
        };
        if named.len() > 1 {
            let mut shared = parameters(&plan.cells[named[0].0]);
            shared.retain(|key, _| !varying.contains(&key.as_str()));
            make(String::new(), shared, &named);
        }
        for cell in &named {
            make(cell.1.clone(), parameters(&plan.cells[cell.0]), std::slice::from_ref(cell));
        }
    }
    groups.retain(|group| !group.problems.is_empty());
    groups
}

/// Name a cell by the parameters in which it differs from its neighbours.
fn name_of(cell: &Cell, varying: &[&str]) -> String {
    let word = |key: &&str| format!("{key} = {}", cell.parameter(key).unwrap_or_default());
    if varying.is_empty() { "all trials".to_string() } else { varying.iter().map(word).collect::<Vec<_>>().join(", ") }
}

fn parameters(cell: &Cell) -> Map<String, Value> {
    cell.parameters.iter().map(|(key, text)| (key.clone(), json_of(text))).collect()
}

/// Return the trials of every cell, by repetition.
fn problems<'a>(plan: &Plan, records: &'a [Record]) -> Vec<Vec<Problem<'a>>> {
    let methods: BTreeMap<&str, usize> = plan.methods.iter().enumerate().map(|(m, name)| (name.as_str(), m)).collect();
    let mut by_key: BTreeMap<u64, Vec<Option<&Record>>> = BTreeMap::new();
    for record in records {
        let (Ok(key), Some(method)) = (u64::from_str_radix(&record.key, 16), methods.get(record.method.as_str()))
        else {
            continue;
        };
        by_key.entry(key).or_insert_with(|| vec![None; plan.methods.len()])[*method] = Some(record);
    }
    let mut by_cell = vec![Vec::new(); plan.cells.len()];
    for trial in &plan.trials {
        if let Some(records) = by_key.remove(&trial.key) {
            by_cell[trial.cell].push(Problem { cell: trial.cell, records });
        }
    }
    by_cell
}

/// Return every scenario with its cells, in the order of the plan.
fn scenarios(plan: &Plan) -> Vec<(&str, Vec<usize>)> {
    let mut scenarios: Vec<(&str, Vec<usize>)> = Vec::new();
    for (index, cell) in plan.cells.iter().enumerate() {
        match scenarios.iter_mut().find(|(name, _)| *name == cell.scenario) {
            Some((_, cells)) => cells.push(index),
            None => scenarios.push((&cell.scenario, vec![index])),
        }
    }
    scenarios
}

/// Return the parameters in which cells differ.
fn varying<'a>(plan: &'a Plan, cells: &[usize]) -> Vec<&'a str> {
    let first = &plan.cells[cells[0]];
    let names = first.parameters.iter().map(|(key, _)| key.as_str());
    names.filter(|key| cells.iter().any(|cell| plan.cells[*cell].parameter(key) != first.parameter(key))).collect()
}
