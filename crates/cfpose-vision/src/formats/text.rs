//! `.csv`, `.txt`, `.xyz`: one row a line.
//!
//! A line is split at semicolons if it has one, else at commas, else at tabs and blanks; blanks around a separator and
//! one separator at the end of a line do not count. `#` starts a comment. The first row is a header if none of its
//! fields is a number; so is the comment line before the first row if it names just as many columns, all of them x, y,
//! z or w (as numpy's `savetxt` writes its headers).

use cfpose::Points;

use crate::cursor::Lines;
use crate::error::{Fault, Flaw, Place};
use crate::gather::{Gather, Layout, PointTable};
use crate::options::ReadOptions;
use crate::rows::{column_names, number, rows};

/// Read text with one row a line.
pub(super) fn read(bytes: &[u8], _options: &ReadOptions) -> Result<PointTable, Flaw> {
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Err(Fault::Unsupported { what: "UTF-16 text".into(), advice: "save the file as UTF-8" }.into());
    }
    let mut comment = Vec::new();
    let mut header: Option<Vec<String>> = None;
    let mut gather: Option<(Gather, usize)> = None;
    for (line, text) in Lines::new(bytes) {
        let (content, remark) = text.split_once('#').map_or((&*text, None), |(a, b)| (a, Some(b)));
        let fields = split(content);
        if fields.is_empty() {
            comment = remark.map(split).unwrap_or_default().into_iter().map(str::to_string).collect();
            continue;
        }
        if gather.is_none() && header.is_none() && fields.iter().all(|field| is_name(field)) {
            header = Some(fields.iter().map(|field| field.to_string()).collect());
            continue;
        }
        let at = Place::Line(line);
        let fail = |fault| Flaw::new(at, fault);
        let (gather, expected) = match &mut gather {
            Some(found) => found,
            None => {
                if header.is_none() && comment.len() == fields.len() && comment.iter().all(|name| is_axis(name)) {
                    header = Some(std::mem::take(&mut comment));
                }
                let layout = first_layout(header.as_deref(), &fields).map_err(fail)?;
                gather.insert((Gather::new(layout), fields.len()))
            }
        };
        if fields.len() != *expected {
            let than = "rows above have";
            return Err(fail(Fault::Columns { found: fields.len(), expected: *expected, than }));
        }
        gather.push(at, |index, name| number(fields[index], name))?;
    }
    gather.map_or_else(|| Err(Fault::NoPoints.into()), |(gather, _)| gather.finish())
}

/// Choose the columns at the first row of numbers.
fn first_layout(header: Option<&[String]>, fields: &[&str]) -> Result<Layout, Fault> {
    match header {
        None => Layout::anonymous(fields.len()),
        Some(names) if names.len() != fields.len() => {
            Err(Fault::Columns { found: fields.len(), expected: names.len(), than: "header names" })
        }
        Some(names) => Layout::by_name(names),
    }
}

/// Split a line into fields without the blanks and quotes around them.
fn split(content: &str) -> Vec<&str> {
    let Some(separator) = [';', ','].into_iter().find(|separator| content.contains(*separator)) else {
        return content.split_whitespace().map(unquoted).collect();
    };
    let content = content.trim();
    let content = content.strip_suffix(separator).unwrap_or(content);
    content.split(separator).map(|field| unquoted(field.trim())).collect()
}

fn unquoted(field: &str) -> &str {
    field.strip_prefix('"').and_then(|field| field.strip_suffix('"')).unwrap_or(field).trim()
}

/// Say whether a field can be a name in a header; an empty field is neither a name nor a number.
fn is_name(field: &str) -> bool {
    field.chars().any(char::is_alphabetic) && field.parse::<f64>().is_err()
}

fn is_axis(name: &str) -> bool {
    ["x", "y", "z", "w"].iter().any(|axis| name.eq_ignore_ascii_case(axis))
}

/// Write a header and one row a line, with commas.
pub(super) fn write(points: &Points) -> Result<Vec<u8>, Fault> {
    Ok(format!("{}\n{}", column_names(points).join(","), rows(points, ",", "")).into_bytes())
}
