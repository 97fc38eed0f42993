//! `cfpose list`: what can be chosen by name.

use cfpose::entry::{NamedEntry, ParameterSpec};
use cfpose_lab::Lab;
use serde::Serialize;

use crate::args::{ListArgs, ListKind};
use crate::failure::Failure;
use crate::output;

#[derive(Serialize)]
struct Line {
    name: &'static str,
    summary: String,
    parameters: Vec<Parameter>,
    source: &'static str,
}

#[derive(Serialize)]
struct Parameter {
    name: &'static str,
    default: &'static str,
    meaning: &'static str,
}

/// Run the command.
///
/// # Errors
/// [`Failure`] of the outputs only.
pub fn run(args: &ListArgs, lab: &Lab) -> Result<(), Failure> {
    let lines = lines(args.kind, lab);
    let json = args.json.as_deref();
    if !output::is_standard(json) {
        output::print(&table(&lines))?;
    }
    output::write_json(&lines, json)
}

fn lines(kind: ListKind, lab: &Lab) -> Vec<Line> {
    let registry = &lab.registry;
    match kind {
        ListKind::Models => of_table(&registry.models),
        ListKind::Families => of_table(&registry.families),
        ListKind::Solvers => of_table(&registry.solvers),
        ListKind::Normalisers => of_table(&registry.normalisers),
        ListKind::Weightings => of_table(&registry.weightings),
        ListKind::Starts => of_table(&registry.starts),
        ListKind::Scenarios => of_table(&lab.scenarios),
        ListKind::Objectives => of_table(cfpose_learn::objectives::ALL),
        ListKind::Curves => of_table(cfpose_lab::curves::ALL),
        ListKind::Presets => presets(),
        ListKind::Formats => formats(),
    }
}

fn of_table<E: NamedEntry>(table: &[&'static E]) -> Vec<Line> {
    let parameter = |spec: &ParameterSpec| Parameter { name: spec.name, default: spec.default, meaning: spec.meaning };
    let line = |entry: &&'static E| Line {
        name: entry.name(),
        summary: entry.summary().to_string(),
        parameters: entry.parameters().iter().map(parameter).collect(),
        source: entry.source(),
    };
    table.iter().map(line).collect()
}

/// Presets: name, summary, source.
const PRESETS: [(&str, &str, &str); 2] = [
    (
        "auto",
        "stages that the model chooses, a search where no start is given, statistics and a verdict",
        "docs/method.md",
    ),
    ("paper", "features trig18, weighting identity, normaliser paper, one start, one solve", "section IV.A"),
];

fn presets() -> Vec<Line> {
    let describe = |(name, summary, source): &(&'static str, &str, &'static str)| Line {
        name,
        summary: (*summary).to_string(),
        parameters: Vec::new(),
        source,
    };
    PRESETS.iter().map(describe).collect()
}

fn formats() -> Vec<Line> {
    let line = |format: &cfpose_vision::Format| Line {
        name: format.name,
        summary: format!(".{}: {}", format.extensions.join(" ."), format.summary),
        parameters: Vec::new(),
        source: "-",
    };
    cfpose_vision::FORMATS.iter().map(line).collect()
}

/// Write a row for each entry and one for each of its parameters.
fn table(lines: &[Line]) -> String {
    let mut rows = Vec::new();
    for line in lines {
        rows.push(vec![line.name.to_string(), line.summary.clone(), line.source.to_string()]);
        for parameter in &line.parameters {
            let text = format!("{}={}: {}", parameter.name, parameter.default, parameter.meaning);
            rows.push(vec![String::new(), format!("  {text}"), String::new()]);
        }
    }
    output::table(&["name", "summary", "source"], &rows)
}
