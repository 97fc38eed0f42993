//! `cfpose docs`: write the reference pages and lists of docs/reference from the tables, or check that they agree.

use std::path::{Path, PathBuf};

use cfpose::entry::{BuildContext, NamedEntry};
use cfpose::theta::RotationForm;
use cfpose_lab::Lab;

use crate::args::DocsArgs;
use crate::failure::Failure;
use crate::output;

const BEGIN: &str = "<!-- generated from the tables by `cfpose docs`: do not edit -->";

/// Run the command.
///
/// # Errors
/// [`Failure`] when a file cannot be read or written, or differs under `--check`.
pub fn run(args: &DocsArgs, lab: &Lab) -> Result<(), Failure> {
    let mut differing = Vec::new();
    for (path, text) in pages(lab, &args.root)? {
        let current = std::fs::read_to_string(&path).unwrap_or_default();
        if current == text {
            continue;
        }
        differing.push(path.display().to_string());
        if !args.check {
            if let Some(folder) = path.parent() {
                std::fs::create_dir_all(folder).map_err(|error| cannot(&path, &error))?;
            }
            std::fs::write(&path, text).map_err(|error| cannot(&path, &error))?;
        }
    }
    match (args.check, differing.as_slice()) {
        (_, []) => Ok(()),
        (true, files) => {
            Err(Failure::input(format!("{} differ from the tables; run `cfpose docs` and commit", files.join(", "))))
        }
        (false, files) => {
            output::note(&format!("wrote {}", files.join(", ")));
            Ok(())
        }
    }
}

/// Say which file cannot be read or written.
fn cannot(path: &Path, error: &std::io::Error) -> Failure {
    Failure::input(format!("{}: {error}", path.display()))
}

/// Return every generated file with its text.
fn pages(lab: &Lab, root: &Path) -> Result<Vec<(PathBuf, String)>, Failure> {
    let registry = &lab.registry;
    let reference = root.join("docs/reference");
    let mut pages = Vec::new();
    for entry in &registry.models {
        let model = registry.model(entry.name, &BuildContext::default()).map_err(|e| Failure::input(e.to_string()))?;
        let mut theta = String::from("## theta\n\n| entry | unit |\n|---|---|\n");
        for block in model.layout.blocks() {
            theta += &format!("| {} ({}) | {} |\n", block.name, block.kind.list_len(RotationForm::Vector), block.unit);
        }
        let tangent = cfpose_optim::Manifold::tangent(model.layout.manifold());
        theta += &format!("\n{tangent} unknowns; feature space of {} dimension(s).\n", model.dim());
        pages.push((reference.join(format!("models/{}.md", entry.name)), page(*entry, entry.details, &theta)));
    }
    for entry in &registry.families {
        pages.push((reference.join(format!("families/{}.md", entry.name)), page(*entry, entry.details, "")));
    }
    pages.push((
        reference.join("README.md"),
        format!("# Reference\n\n{BEGIN}\n\n{}", lists(lab).trim_end().to_string() + "\n"),
    ));
    Ok(pages)
}

/// Write the page of one entry.
fn page<E: NamedEntry>(entry: &E, details: &str, extra: &str) -> String {
    let mut text =
        format!("# {}\n\n{BEGIN}\n\n{}.\n\n{details}\n\nSource: {}.\n", entry.name(), entry.summary(), entry.source());
    if !entry.parameters().is_empty() {
        text += "\n## Parameters\n\n| name | default | meaning |\n|---|---|---|\n";
        for spec in entry.parameters() {
            text += &format!("| `{}` | `{}` | {} |\n", spec.name, spec.default, spec.meaning.replace('|', "\\|"));
        }
    }
    if !extra.is_empty() {
        text += &format!("\n{extra}");
    }
    text
}

/// Write the lists of all tables.
fn lists(lab: &Lab) -> String {
    let registry = &lab.registry;
    let mut text = String::new();
    section(&mut text, "Models", &registry.models, Some("models"));
    section(&mut text, "Feature families", &registry.families, Some("families"));
    section(&mut text, "Solvers", &registry.solvers, None);
    section(&mut text, "Normalisers", &registry.normalisers, None);
    section(&mut text, "Weightings", &registry.weightings, None);
    section(&mut text, "Starts", &registry.starts, None);
    section(&mut text, "Scenarios", &lab.scenarios, None);
    text
}

fn section<E: NamedEntry>(text: &mut String, title: &str, table: &[&'static E], folder: Option<&str>) {
    *text += &format!("| {title} | |\n|---|---|\n");
    for entry in table {
        let name = match folder {
            Some(folder) => format!("[`{0}`]({folder}/{0}.md)", entry.name()),
            None => format!("`{}`", entry.name()),
        };
        *text += &format!("| {name} | {} |\n", entry.summary().replace('|', "\\|"));
    }
    text.push('\n');
}
