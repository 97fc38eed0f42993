//! `cfpose status`, `merge` and `report`: what a run left in its folder.

use std::path::Path;

use cfpose_lab::{Lab, Merged};
use serde_json::json;

use crate::args::{FolderArgs, ReportArgs};
use crate::failure::Failure;
use crate::output;

/// Count what is there of a run.
///
/// # Errors
/// [`Failure`] of the folder.
pub fn status(args: &FolderArgs, lab: &Lab) -> Result<(), Failure> {
    output::keep_apart(&cfpose_lab::folder::own_files(&args.folder)?, &[args.json.as_deref()])?;
    let status = cfpose_lab::status(lab, &args.folder)?;
    let complete = status.records == status.expected;
    let rows: Vec<Vec<String>> = status
        .cells
        .iter()
        .map(|(label, found, expected)| vec![label.clone(), format!("{found} of {expected}")])
        .collect();
    let text = format!(
        "{}\n{} of {} records, {} without a usable estimate, {} file(s), instruction set {}",
        output::table(&["cell", "records"], &rows),
        status.records,
        status.expected,
        status.unusable,
        status.files.len(),
        status.isa.as_deref().unwrap_or("-"),
    );
    let cell = |(label, found, expected): &(String, usize, usize)| json!({ "cell": label, "records": found, "expected": expected });
    let value = json!({
        "experiment": status.experiment,
        "isa": status.isa,
        "records": status.records,
        "expected": status.expected,
        "complete": complete,
        "unusable": status.unusable,
        "cells": status.cells.iter().map(cell).collect::<Vec<_>>(),
        "files": status.files.iter().map(|(path, count)| json!({ "file": path, "records": count })).collect::<Vec<_>>(),
    });
    output::show(&text, args.json.as_deref())?;
    output::write_json(&value, args.json.as_deref())
}

/// Turn records into tables.
///
/// # Errors
/// [`Failure`] of the folder.
pub fn merge(args: &FolderArgs, lab: &Lab) -> Result<(), Failure> {
    output::keep_apart(&cfpose_lab::folder::own_files(&args.folder)?, &[args.json.as_deref()])?;
    let merged = cfpose_lab::merge(lab, &args.folder)?;
    output::show(&counted(&args.folder, &merged), args.json.as_deref())?;
    output::write_json(&merged.rows, args.json.as_deref())
}

/// Turn records into tables and print them; write figures and tables for papers and pages where they are asked for.
///
/// # Errors
/// [`Failure`] of the folder or of a file that is written.
pub fn report(args: &ReportArgs, lab: &Lab) -> Result<(), Failure> {
    output::keep_apart(&cfpose_lab::folder::own_files(&args.folder)?, &[args.json.as_deref(), args.docs.as_deref()])?;
    let merged = cfpose_lab::merge(lab, &args.folder)?;
    let mut text = cfpose_lab::merge::tables(&merged.experiment, &merged.rows) + &merged.conditions;
    let files = cfpose_lab::merge::export(lab, &args.folder, args.svg.as_deref(), args.latex.as_deref())?;
    if !files.is_empty() {
        let folders = [&args.svg, &args.latex].into_iter().flatten().map(|path| path.display().to_string());
        text += &format!("\n{} files in {}", files.len(), folders.collect::<Vec<_>>().join(", "));
    }
    if let Some(page) = &args.docs {
        cfpose_lab::merge::document(lab, &args.folder, page)?;
        text += &format!("\nresults of this run in {}", page.display());
    }
    output::show(&format!("{text}\n{}", counted(&args.folder, &merged)), args.json.as_deref())?;
    output::write_json(&merged.rows, args.json.as_deref())
}

fn counted(folder: &Path, merged: &Merged) -> String {
    let page = folder.join("report.html");
    format!("{} of {} records in the tables; look at {}", merged.records, merged.expected, page.display())
}
