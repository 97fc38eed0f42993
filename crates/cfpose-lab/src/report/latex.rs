//! Tables for papers: LaTeX with the rules of the package booktabs.

use std::fmt::Write;

use crate::statistics::{Table, TableCell};

/// Return a table as a `tabular` environment between booktabs rules; the caption and its source stand in comments.
///
/// ```
/// use cfpose_lab::report::latex::tabular;
/// use cfpose_lab::statistics::{Table, TableCell};
/// let table = Table { columns: vec!["method", "success %"], rows: vec![vec![TableCell::Text("a_b".into()), TableCell::Share(0.5)]] };
/// let text = tabular("rates", "Wilson 1927", &table);
/// assert!(text.contains("\\toprule") && text.contains("a\\_b & 50.0 \\\\") && text.contains("success \\%"));
/// ```
pub fn tabular(summary: &str, source: &str, table: &Table) -> String {
    let is_text = |column: usize| table.rows.iter().all(|row| matches!(row[column], TableCell::Text(_)));
    let alignment: String = (0..table.columns.len()).map(|column| if is_text(column) { 'l' } else { 'r' }).collect();
    let line = |cells: Vec<String>| format!("{} \\\\\n", cells.join(" & "));
    let mut text = format!(
        "% {summary} ({source}). Needs \\usepackage{{booktabs}}.\n\\begin{{tabular}}{{{alignment}}}\n\\toprule\n"
    );
    text += &line(table.columns.iter().map(|column| escaped(column)).collect());
    text += "\\midrule\n";
    for row in &table.rows {
        text += &line(row.iter().map(cell).collect());
    }
    let _ = writeln!(text, "\\bottomrule\n\\end{{tabular}}");
    text
}

fn cell(cell: &TableCell) -> String {
    let text = cell.text();
    match cell {
        TableCell::Interval(_) | TableCell::ShareInterval(_) => {
            let ends: Vec<String> = text.split(" .. ").map(power).collect();
            format!("[{}]", ends.join(", "))
        }
        TableCell::Text(_) | TableCell::Count(_) => escaped(&text),
        _ if text == "-" => "--".to_string(),
        _ => power(&text),
    }
}

/// Write a number with an exponent as a power of ten.
fn power(number: &str) -> String {
    match number.split_once('e') {
        Some((digits, exponent)) => format!("${} \\cdot 10^{{{exponent}}}$", digits.replace("< ", "<")),
        None if number.starts_with('-') => format!("${number}$"),
        None => number.to_string(),
    }
}

fn escaped(text: &str) -> String {
    let mut safe = String::new();
    for c in text.chars() {
        match c {
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => safe.extend(['\\', c]),
            '\\' => safe.push_str("\\textbackslash{}"),
            '~' => safe.push_str("\\textasciitilde{}"),
            '^' => safe.push_str("\\textasciicircum{}"),
            _ => safe.push(c),
        }
    }
    safe
}
