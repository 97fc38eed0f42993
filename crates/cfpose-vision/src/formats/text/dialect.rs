//! How a row of text falls into numbers.

use std::cell::Cell;

use crate::columns::MOST_COLUMNS;
use crate::error::{Fault, excerpt};
use crate::options::Invalid;
use crate::rows::number;

/// What stands between the fields of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Separator {
    /// One character, with blanks around it.
    At(char),
    /// Blanks and tabs.
    Blanks,
}

/// How decimals are written in the numbers so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Decimals {
    Open,
    Point,
    Comma,
}

/// How the rows of one file are written.
#[derive(Debug)]
pub(super) struct Dialect {
    separator: Separator,
    decimals: Cell<Decimals>,
    missing: bool,
}

impl Dialect {
    /// Find out from the first row of numbers, where a header names so many columns.
    ///
    /// A semicolon separates. A comma does where what stands between commas are numbers; between tabs or blanks that
    /// are numbers with it, it is a decimal comma.
    pub(super) fn of_row(content: &str, named: Option<usize>, invalid: Invalid) -> Self {
        let numbers = |separator: Separator| {
            let fields = without_end(split(content, separator), named);
            fields.len() > 1 && fields.iter().all(|field| decimal(field).is_some())
        };
        let tabs = named.is_some_and(|named| {
            content.contains('\t') && without_end(split(content, Separator::At('\t')), Some(named)).len() == named
        });
        let separator = if content.contains(';') {
            Separator::At(';')
        } else if content.contains(',') {
            let plain =
                without_end(split(content, Separator::At(',')), named).iter().all(|field| field.parse::<f64>().is_ok());
            match plain {
                true => Separator::At(','),
                false if tabs && named != Some(without_end(split(content, Separator::At(',')), named).len()) => {
                    Separator::At('\t')
                }
                false if content.contains('\t') && numbers(Separator::At('\t')) => Separator::At('\t'),
                false if numbers(Separator::Blanks) => Separator::Blanks,
                false => Separator::At(','),
            }
        } else if tabs {
            Separator::At('\t')
        } else {
            Separator::Blanks
        };
        Self { separator, decimals: Cell::new(Decimals::Open), missing: invalid == Invalid::Skip }
    }

    /// Split a row, in which a header or the rows above lead to expect so many fields.
    pub(super) fn split<'a>(&self, content: &'a str, expected: Option<usize>) -> Vec<&'a str> {
        without_end(split(content, self.separator), expected)
    }

    /// Read one field: a number with a decimal point, or throughout the file with a decimal comma.
    pub(super) fn number(&self, field: &str, column: &str) -> Result<f64, Fault> {
        if let Ok(value) = field.parse() {
            if self.decimals.get() != Decimals::Point && field.contains('.') {
                if self.decimals.get() == Decimals::Comma {
                    return Err(Fault::Decimal { column: column.to_string(), text: excerpt(field) });
                }
                self.decimals.set(Decimals::Point);
            }
            return Ok(value);
        }
        if self.missing && ["", "na", "n/a", "null", "none", "-"].contains(&field.to_lowercase().as_str()) {
            return Ok(f64::NAN);
        }
        match decimal(field) {
            Some(value) if self.decimals.get() != Decimals::Point => {
                self.decimals.set(Decimals::Comma);
                Ok(value)
            }
            _ => number(field, column),
        }
    }
}

/// Read a number with a decimal point or one decimal comma.
fn decimal(field: &str) -> Option<f64> {
    field.parse().ok().or_else(|| {
        let (whole, fraction) = field.split_once(',')?;
        // "1," and ",5" are fields and separators; "1,234.5" and "1,234,567" hold separators of thousands.
        let plain = whole.ends_with(|c: char| c.is_ascii_digit()) && fraction.starts_with(|c: char| c.is_ascii_digit());
        let comma_only = plain && !field.contains('.') && !fraction.contains(',');
        comma_only.then(|| format!("{whole}.{fraction}").parse().ok()).flatten()
    })
}

/// Split a header; a unit in brackets belongs to the name before it.
pub(super) fn split_header(content: &str) -> Vec<String> {
    let separator = [';', ',', '\t'].into_iter().find(|separator| content.contains(*separator));
    let mut names: Vec<String> = Vec::new();
    for field in without_end(split(content, separator.map_or(Separator::Blanks, Separator::At)), None) {
        match names.last_mut().filter(|_| separator.is_none() && field.starts_with(['[', '('])) {
            Some(name) => *name = format!("{name} {field}"),
            None => names.push(field.to_string()),
        }
    }
    // Columns set apart by several tabs.
    if separator == Some('\t') && names.iter().any(String::is_empty) {
        return content.split_whitespace().map(|name| unquoted(name).to_string()).collect();
    }
    names
}

/// Leave out the empty field behind a separator at the end of a line, where there is one field more than expected or
/// nothing is expected.
fn without_end(mut fields: Vec<&str>, expected: Option<usize>) -> Vec<&str> {
    let more = expected.is_none_or(|expected| fields.len() == expected + 1);
    if more && fields.len() > 1 && fields.last().is_some_and(|field| field.is_empty()) {
        fields.pop();
    }
    fields
}

/// Split a line into fields without the blanks and quotes around them.
fn split(content: &str, separator: Separator) -> Vec<&str> {
    // Of a longer line only so many are needed to refuse it.
    let most = MOST_COLUMNS + 1;
    let Separator::At(separator) = separator else {
        return content.split_whitespace().take(most).map(unquoted).collect();
    };
    let content = content.trim_matches(|c: char| c != separator && c.is_whitespace());
    if !content.contains('"') {
        return content.split(separator).take(most).map(str::trim).collect();
    }
    let (mut quoted, mut fields) = (false, Vec::new());
    let mut parts = content.split(|c: char| {
        quoted ^= c == '"';
        !quoted && c == separator
    });
    while let Some(part) = parts.next().filter(|_| fields.len() < most) {
        fields.push(unquoted(part.trim()));
    }
    fields
}

fn unquoted(field: &str) -> &str {
    field.strip_prefix('"').and_then(|field| field.strip_suffix('"')).unwrap_or(field).trim()
}
