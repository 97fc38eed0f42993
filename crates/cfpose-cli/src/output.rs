//! Where results go: standard output, standard error, files; tables.

use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use comfy_table::{Table, presets};
use serde::Serialize;

use crate::failure::Failure;

/// Write text and a line end to standard output.
///
/// # Errors
/// What the operating system says; a closed pipe ends the program quietly.
pub fn print(text: &str) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes())?;
    out.write_all(b"\n")?;
    Ok(out.flush()?)
}

/// Write a line to standard error; nobody may be listening.
pub fn note(text: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}

/// Write the place and message of a panic to standard error, each of them once: every trial of a run may meet it.
pub fn panicked(text: &str) {
    static SEEN: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
    let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let place = line.split(": ").next().unwrap_or_default().to_string();
    let is_new = SEEN.lock().unwrap_or_else(PoisonError::into_inner).insert(place);
    if is_new {
        note(&format!("note: {line}"));
    }
}

/// Say whether JSON goes to standard output, which then carries nothing else.
pub fn is_standard(json: Option<&Path>) -> bool {
    json.is_some_and(|path| path == Path::new("-"))
}

/// Write a table: to standard output, or to standard error when that carries JSON.
///
/// # Errors
/// As [`print()`].
pub fn show(text: &str, json: Option<&Path>) -> Result<(), Failure> {
    if is_standard(json) {
        note(text);
        return Ok(());
    }
    print(text)
}

/// Write a value as one line of JSON to a file or to standard output; numbers that are not finite become null.
///
/// # Errors
/// What the operating system says, with the file's name.
pub fn write_json(value: &impl Serialize, json: Option<&Path>) -> Result<(), Failure> {
    let Some(path) = json else { return Ok(()) };
    let text = serde_json::to_string(value).map_err(Failure::input)?;
    if is_standard(json) { print(&text) } else { write_file(path, &(text + "\n")) }
}

/// Write a text file.
///
/// # Errors
/// What the operating system says, with the file's name.
pub fn write_file(path: &Path, text: &str) -> Result<(), Failure> {
    std::fs::write(path, text).map_err(|error| Failure::input(format!("{}: {error}", path.display())))
}

/// Refuse outputs that name an input or one another, before any work.
///
/// # Errors
/// Usage, with the name.
pub fn keep_apart(inputs: &[PathBuf], outputs: &[Option<&Path>]) -> Result<(), Failure> {
    let outputs: Vec<&Path> = outputs.iter().flatten().copied().filter(|path| !is_standard(Some(path))).collect();
    for (index, path) in outputs.iter().enumerate() {
        if outputs[..index].iter().any(|other| same_file(other, path)) {
            let name = path.display();
            return Err(Failure::usage(format!("two outputs go to {name}; give each a file of its own")));
        }
        if let Some(input) = inputs.iter().find(|input| same_file(input, path)) {
            let (output, input) = (path.display(), input.display());
            return Err(Failure::usage(format!(
                "the output {output} would overwrite {input}; give it a file of its own"
            )));
        }
    }
    Ok(())
}

/// Say whether two names lead to one regular file: also through links, and where the file does not exist yet.
pub fn same_file(a: &Path, b: &Path) -> bool {
    let whole = |path: &Path| -> Option<PathBuf> {
        if let Ok(path) = path.canonicalize() {
            return path.is_file().then_some(path);
        }
        let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
        Some(parent.canonicalize().ok()?.join(path.file_name()?))
    };
    match (whole(a), whole(b)) {
        (Some(a), Some(b)) => a == b || hard_link(&a, &b),
        _ => false,
    }
}

#[cfg(unix)]
fn hard_link(a: &Path, b: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let number = |path: &Path| path.metadata().ok().map(|data| (data.dev(), data.ino()));
    matches!((number(a), number(b)), (Some(a), Some(b)) if a == b)
}

#[cfg(not(unix))]
fn hard_link(_: &Path, _: &Path) -> bool {
    false
}

/// Check that a file can be written, without touching one that is there and without leaving a new one.
///
/// # Errors
/// What the operating system says, with the file's name.
pub fn check_writable(path: Option<&Path>) -> Result<(), Failure> {
    let Some(path) = path.filter(|path| !is_standard(Some(path))) else { return Ok(()) };
    let is_new = !path.exists();
    let opened = std::fs::OpenOptions::new().append(true).create(true).open(path);
    opened.map_err(|error| Failure::input(format!("{}: {error}", path.display())))?;
    if is_new {
        let _ = std::fs::remove_file(path);
    }
    Ok(())
}

/// Make a table of plain text, columns apart by blanks.
pub fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    if !header.is_empty() {
        table.set_header(header.iter().map(|name| (*name).to_string()));
    }
    for row in rows {
        table.add_row(row.clone());
    }
    let lines: Vec<String> =
        table.lines().map(|line| line.strip_prefix(" ").unwrap_or(&line).trim_end().to_string()).collect();
    lines.join("\n")
}

/// Write a number for people: 6 significant digits.
pub fn number(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 {
        "0".to_string()
    } else if (1e-3..1e5).contains(&size) {
        let digits = 5 - size.log10().floor() as i32;
        format!("{value:.*}", digits.max(0) as usize)
    } else {
        format!("{value:.4e}")
    }
}
