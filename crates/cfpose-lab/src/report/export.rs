//! Files for papers and pages: SVG figures, LaTeX tables, a section of Markdown.

use std::path::{Path, PathBuf};

use super::latex::tabular;
use crate::error::LabError;
use crate::figure::svg;
use crate::folder::{make_folder, write_whole};
use crate::group::Group;
use crate::{plots, statistics};

/// Return a group's place in names of files: its scenario, and its cell where it is one of several.
fn stem(group: &Group<'_>) -> String {
    let text = format!("{} {}", group.scenario, if group.cell.is_empty() { "all" } else { &group.cell });
    let mut stem = String::new();
    for c in text.chars() {
        match c {
            'a'..='z' | 'A'..='Z' | '0'..='9' | '.' | '_' => stem.push(c),
            _ if !stem.ends_with('-') => stem.push('-'),
            _ => {}
        }
    }
    stem.truncate(120);
    stem.trim_matches('-').to_string()
}

/// Write every plot of every group as `GROUP--PLOT.svg`; returns the files.
pub(crate) fn write_svg(groups: &[Group<'_>], folder: &Path) -> Result<Vec<PathBuf>, LabError> {
    make_folder(folder)?;
    let mut files = Vec::new();
    for (number, group) in groups.iter().enumerate() {
        for entry in plots::ALL {
            let Some(figure) = (entry.draw)(group) else { continue };
            let path = folder.join(format!("{number:03}-{}--{}.svg", stem(group), entry.name));
            write_whole(&path, &svg(&figure.thinned(400)))?;
            files.push(path);
        }
    }
    Ok(files)
}

/// Write every statistic of every group as `GROUP--STATISTIC.tex`; returns the files.
pub(crate) fn write_latex(groups: &[Group<'_>], folder: &Path) -> Result<Vec<PathBuf>, LabError> {
    make_folder(folder)?;
    let mut files = Vec::new();
    for (number, group) in groups.iter().enumerate() {
        for entry in statistics::ALL {
            let Some(table) = (entry.compute)(group) else { continue };
            let path = folder.join(format!("{number:03}-{}--{}.tex", stem(group), entry.name));
            write_whole(&path, &tabular(entry.summary, entry.source, &table))?;
            files.push(path);
        }
    }
    Ok(files)
}
