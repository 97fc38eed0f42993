//! `.csv`, `.tsv`, `.txt`, `.xyz`, `.asc`, `.pts`: one row a line.
//!
//! The first row of numbers says how the file is written: split at semicolons if it has one, else at commas, else at tabs
//! and blanks; blanks around a separator do not count, nor does a separator at the end of a line without a column behind it. Decimals have a point, or
//! throughout the file a comma (between semicolons, tabs, blanks or in quotes). `#` starts a comment, `//` and `%` at the
//! beginning of a line too. The first row is a header if none of its fields is a number; so is the comment line before the
//! first row if it names just as many columns and all of them are known names (as numpy's `savetxt` and CloudCompare write
//! their headers). A first row of one whole number before rows of several is their number. Rows without names have 1 to 3
//! columns; in a `.pts` file intensity and colour may follow.

mod dialect;

use cfpose::Points;

use crate::columns::{Layout, is_header};
use crate::cursor::Lines;
use crate::error::{Fault, Flaw, Place};
use crate::gather::{Gather, PointTable};
use crate::lines::with_line_feeds;
use crate::options::ReadOptions;
use crate::rows::{column_names, rows};
use dialect::{Dialect, split_header};

/// Read text with one row a line.
pub(super) fn read(bytes: &[u8], options: &ReadOptions) -> Result<PointTable, Flaw> {
    read_rows(bytes, options, false)
}

/// Read text of x, y, z, and what may follow them, after the number of rows.
pub(super) fn read_pts(bytes: &[u8], options: &ReadOptions) -> Result<PointTable, Flaw> {
    read_rows(bytes, options, true)
}

fn read_rows(bytes: &[u8], options: &ReadOptions, pts: bool) -> Result<PointTable, Flaw> {
    let bytes = with_line_feeds(bytes)?;
    let mut rows = RowReader { pts, ..RowReader::new(options) };
    for (line, text) in Lines::new(&bytes) {
        rows.push(line, &text)?;
    }
    rows.table()?.finish()
}

/// Reads one line after the other; the rows so far may be taken out.
pub(crate) struct RowReader<'a> {
    head: Head,
    table: Option<Table>,
    options: &'a ReadOptions,
    pts: bool,
}

impl<'a> RowReader<'a> {
    /// Begin above the first line.
    pub(crate) fn new(options: &'a ReadOptions) -> Self {
        Self { head: Head::default(), table: None, options, pts: false }
    }

    /// Read a line without its end; lines count from 1.
    pub(crate) fn push(&mut self, line: usize, text: &str) -> Result<(), Flaw> {
        let (content, remark) = uncomment(text);
        if content.trim().is_empty() {
            if self.table.is_none() && !remark.trim().is_empty() {
                self.head.comment = Some(remark.to_string());
            }
            return Ok(());
        }
        match &mut self.table {
            Some(table) => table.push(line, content),
            None if self.head.takes(line, content)? => Ok(()),
            None => self.begin(line, content),
        }
    }

    fn begin(&mut self, line: usize, content: &str) -> Result<(), Flaw> {
        let mut first = self.head.table(line, content, self.options, self.pts)?;
        first.push(line, content)?;
        self.table = Some(first);
        Ok(())
    }

    /// Take the rows so far out, if there are so many.
    pub(crate) fn drain(&mut self, least: usize) -> Result<Option<Points>, Flaw> {
        self.table.as_mut().map_or(Ok(None), |table| table.gather.drain(least))
    }

    /// Return the table after the last line.
    fn table(mut self) -> Result<Table, Flaw> {
        if self.table.is_none()
            && let Some((line, number)) = self.head.number.take()
        {
            // One row of one number is a point.
            self.begin(line, &number.to_string())?;
        }
        self.table.ok_or_else(|| Fault::NoPoints.into())
    }

    /// End after the last line: the points that were not taken out yet, how many rows were skipped, notes.
    pub(crate) fn end(self) -> Result<(Option<Points>, usize, Vec<String>), Flaw> {
        let mut table = self.table()?;
        table.check_claim()?;
        let last = table.gather.drain(1)?;
        let (skipped, notes) = table.gather.end()?;
        Ok((last, skipped, notes))
    }
}

/// Split a line into what counts and the comment.
fn uncomment(text: &str) -> (&str, &str) {
    for mark in ["//", "%"] {
        if let Some(remark) = text.trim_start().strip_prefix(mark) {
            return ("", remark);
        }
    }
    text.split_once('#').unwrap_or((text, ""))
}

/// What stands above the first row.
#[derive(Default)]
struct Head {
    /// The last comment line.
    comment: Option<String>,
    /// Names of the columns.
    names: Option<Vec<String>>,
    /// A line with one whole number, and its line.
    number: Option<(usize, u64)>,
}

impl Head {
    /// Take a line that is a header, a line of units below it, or the number of rows; say whether it was one.
    fn takes(&mut self, line: usize, content: &str) -> Result<bool, Flaw> {
        let is_number = content.trim().bytes().all(|byte| byte.is_ascii_digit());
        if is_number && self.number.is_none() && self.names.as_ref().is_none_or(|names| names.len() > 1) {
            self.number = content.trim().parse().ok().map(|number| (line, number));
            return Ok(self.number.is_some());
        }
        let fields = split_header(content);
        match &self.names {
            None if is_names(&fields) && self.number.is_none() => self.names = Some(fields),
            Some(names) if names.len() == fields.len() && is_units(&fields) => {}
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// Choose the columns at the first row of numbers.
    fn table(&mut self, line: usize, content: &str, options: &ReadOptions, pts: bool) -> Result<Table, Flaw> {
        let fail = |fault| Flaw::new(Place::Line(line), fault);
        let dialect = Dialect::of_row(content, self.names.as_ref().map(Vec::len), options.invalid);
        let fields = dialect.split(content, self.names.as_ref().map(Vec::len));
        if self.names.is_none()
            && let Some(comment) = &self.comment
        {
            let names = split_header(comment);
            let known: Vec<&str> = names.iter().map(String::as_str).collect();
            self.names = (names.len() == fields.len() && is_header(&known)).then_some(names);
        }
        let numeric = |index: usize| fields.get(index).is_some_and(|field| dialect.number(field, "").is_ok());
        let layout = match &self.names {
            None if pts => Layout::first_three(fields.len(), options),
            None => Layout::anonymous(fields.len(), options, numeric),
            Some(names) if names.len() != fields.len() => {
                Err(Fault::Columns { found: fields.len(), expected: names.len(), than: "header names" })
            }
            Some(names) => Layout::by_name(names, options, numeric),
        };
        let gather = Gather::new(layout.map_err(fail)?, options);
        let mut table = Table { gather, dialect, columns: fields.len(), claimed: None };
        // A whole number alone counts the rows below it, or is the first of rows with one column.
        match self.number.take() {
            Some((_, number)) if fields.len() > 1 => table.claimed = Some(number),
            Some((line, number)) => table.push(line, &number.to_string())?,
            None => {}
        }
        Ok(table)
    }
}

/// The rows of a file.
struct Table {
    gather: Gather,
    dialect: Dialect,
    columns: usize,
    claimed: Option<u64>,
}

impl Table {
    fn push(&mut self, line: usize, content: &str) -> Result<(), Flaw> {
        let at = Place::Line(line);
        let fields = self.dialect.split(content, Some(self.columns));
        if fields.len() != self.columns {
            let fault = Fault::Columns { found: fields.len(), expected: self.columns, than: "rows above have" };
            return Err(Flaw::new(at, fault));
        }
        if self.claimed.is_some_and(|claimed| self.gather.rows() as u64 >= claimed) {
            return Err(Flaw::new(at, self.extra()));
        }
        let Self { gather, dialect, .. } = self;
        gather.push(at, |index, name| dialect.number(fields[index], name))
    }

    fn extra(&self) -> Fault {
        let claimed = self.claimed.unwrap_or_default().to_string();
        Fault::Extra { what: "rows".into(), claimed }
    }

    fn check_claim(&self) -> Result<(), Flaw> {
        let held = self.gather.rows() as u64;
        match self.claimed.filter(|claimed| *claimed != held) {
            Some(claimed) => {
                let (claimed, held) = (claimed.to_string(), held.to_string());
                Err(Fault::Claims { what: "rows".into(), claimed, held }.into())
            }
            None => Ok(()),
        }
    }

    fn finish(self) -> Result<PointTable, Flaw> {
        self.check_claim()?;
        self.gather.finish()
    }
}

/// Say whether fields are the names of a header: none is a number, and one is a name; or, as data frames are written whose
/// columns have no names, they are an empty field and 0, 1, ..
fn is_names(fields: &[String]) -> bool {
    let is_name = |field: &String| field.chars().any(char::is_alphabetic) && field.parse::<f64>().is_err();
    let counted = |(k, field): (usize, &String)| field.parse() == Ok(k);
    let frame = fields.len() > 1 && fields[0].is_empty() && fields[1..].iter().enumerate().all(counted);
    frame || fields.iter().any(is_name) && fields.iter().all(|field| is_name(field) || field.is_empty())
}

/// Say whether fields are units of length, not all of them empty.
fn is_units(fields: &[String]) -> bool {
    const UNITS: [&str; 13] =
        ["m", "mm", "cm", "km", "um", "ft", "in", "px", "pixels", "metre", "meter", "metres", "meters"];
    let plain = |field: &String| field.trim_matches(|c: char| !c.is_alphanumeric()).to_lowercase();
    let fields: Vec<String> = fields.iter().map(plain).collect();
    fields.iter().all(|f| f.is_empty() || UNITS.contains(&f.as_str())) && fields.iter().any(|f| !f.is_empty())
}

/// Write a header and one row a line, with commas.
pub(super) fn write(points: &Points) -> Result<Vec<u8>, Fault> {
    Ok(format!("{}\n{}", column_names(points).join(","), rows(points, ",", "")).into_bytes())
}

/// Write a header and one row a line, with tabs.
pub(super) fn write_tsv(points: &Points) -> Result<Vec<u8>, Fault> {
    Ok(format!("{}\n{}", column_names(points).join("\t"), rows(points, "\t", "")).into_bytes())
}

/// Write the number of rows and the rows, for points of dimension 3 without weights.
pub(super) fn write_pts(points: &Points) -> Result<Vec<u8>, Fault> {
    if points.dim() != 3 || !points.is_uniform() {
        let what = "a pts file holds points of dimension 3 without weights".to_string();
        return Err(Fault::Unwritable { what, advice: "csv or ply" });
    }
    Ok(format!("{}\n{}", points.len(), rows(points, " ", "")).into_bytes())
}
