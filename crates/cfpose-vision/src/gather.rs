//! From rows of named columns to points.

use cfpose::{Attribute, Points};

use crate::columns::{Layout, list};
use crate::error::{Fault, Flaw, Place};
use crate::options::{Invalid, ReadOptions};

/// What a reader makes of the bytes of a file.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct PointTable {
    /// The points; normals, where the file has them, are their attribute `normal`.
    pub points: Points,
    /// Names of the coordinates, then `w` if the file has weights.
    pub columns: Vec<String>,
    /// Rows that were skipped because they are not finite.
    pub skipped: usize,
    /// What a reader should know about the reading, one line each.
    pub notes: Vec<String>,
}

/// Gathers rows into columns and checks every value where its place in the file is known.
pub(crate) struct Gather {
    layout: Layout,
    columns: Vec<Vec<f64>>,
    weights: Vec<f64>,
    normals: Vec<Vec<f64>>,
    invalid: Invalid,
    most: usize,
    organised: bool,
    skipped: usize,
    /// Points that were taken out already.
    drained: usize,
    notes: Vec<String>,
}

impl Gather {
    /// Start without rows; nothing is reserved, whatever a header says.
    pub(crate) fn new(layout: Layout, options: &ReadOptions) -> Self {
        Self {
            columns: vec![Vec::new(); layout.coordinates.len()],
            normals: vec![Vec::new(); layout.normal.len()],
            weights: Vec::new(),
            invalid: options.invalid,
            most: options.max_points.unwrap_or(usize::MAX),
            organised: false,
            skipped: 0,
            drained: 0,
            notes: Vec::new(),
            layout,
        }
    }

    /// State that the rows are a grid in which a point may be missing.
    pub(crate) fn organised(self, organised: bool) -> Self {
        Self { organised, ..self }
    }

    /// Return the number of rows so far, those that were skipped with them.
    pub(crate) fn rows(&self) -> usize {
        self.drained + self.columns[0].len() + self.skipped
    }

    /// Take memory for so many rows, which the file is known to hold, and for the padding of their last block.
    pub(crate) fn reserve(&mut self, rows: usize) {
        let padded = rows.next_multiple_of(64);
        self.columns.iter_mut().for_each(|column| column.reserve_exact(padded));
    }

    /// Say something that the reader should know.
    pub(crate) fn note(&mut self, note: String) {
        self.notes.push(note);
    }

    /// Append one row; `value` gives the number in a column (from 0, as in the file) under its name.
    #[inline]
    pub(crate) fn push(&mut self, at: Place, value: impl Fn(usize, &str) -> Result<f64, Fault>) -> Result<(), Flaw> {
        let fail = |fault| Flaw::new(at, fault);
        let mut row = [0.0; 3];
        for (slot, (index, name)) in row.iter_mut().zip(&self.layout.coordinates) {
            *slot = value(*index, name).map_err(fail)?;
        }
        let row = &row[..self.columns.len()];
        if !row.iter().all(|x| x.is_finite()) {
            return self.invalid(row).map_err(fail);
        }
        let mut weight = 1.0;
        if let Some((index, name)) = &self.layout.weight {
            weight = value(*index, name).map_err(fail)?;
            if !weight.is_finite() && self.invalid == Invalid::Skip {
                self.skipped += 1;
                return Ok(());
            }
            if !(weight.is_finite() && weight >= 0.0) {
                return Err(fail(Fault::Weight { column: name.clone(), value: weight }));
            }
        }
        if self.drained + self.columns[0].len() >= self.most {
            let advice = "raise --max-points or give a smaller file".to_string();
            return Err(fail(Fault::TooMany { found: None, limit: self.most, advice }));
        }
        for ((index, name), column) in self.layout.normal.iter().zip(&mut self.normals) {
            column.push(value(*index, name).map_err(fail)?);
        }
        if self.layout.weight.is_some() {
            self.weights.push(weight);
        }
        row.iter().zip(&mut self.columns).for_each(|(x, column)| column.push(*x));
        Ok(())
    }

    /// Skip or refuse a row that is not finite.
    fn invalid(&mut self, row: &[f64]) -> Result<(), Fault> {
        let missing = self.organised || row.iter().all(|x| x.is_nan());
        let refuse = match self.invalid {
            Invalid::Missing => !missing,
            Invalid::Skip => false,
            Invalid::Refuse => true,
        };
        let wrong = (0..row.len()).find(|k| !row[*k].is_finite()).filter(|_| refuse);
        if let Some(k) = wrong {
            return Err(Fault::NotFinite { column: self.layout.coordinates[k].1.clone(), value: row[k] });
        }
        self.skipped += 1;
        Ok(())
    }

    /// Take the rows so far out as points, if there are `least` of them; their normals are forgotten, and so are parts without any weight.
    pub(crate) fn drain(&mut self, least: usize) -> Result<Option<Points>, Flaw> {
        let held = self.columns[0].len();
        if held == 0 || held < least {
            return Ok(None);
        }
        self.drained += held;
        self.normals.iter_mut().for_each(Vec::clear);
        let (columns, weights) =
            (self.columns.iter_mut().map(std::mem::take).collect(), std::mem::take(&mut self.weights));
        let points = match self.layout.weight {
            None => Points::from_columns(columns),
            Some(_) if weights.iter().all(|w| *w == 0.0) => return Ok(None),
            Some(_) => Points::weighted(columns, weights),
        };
        Ok(Some(points.map_err(Fault::from)?))
    }

    /// End after all rows were taken out; returns how many were skipped, and what a reader should know.
    pub(crate) fn end(mut self) -> Result<(usize, Vec<String>), Flaw> {
        if self.drained == 0 {
            return Err(Fault::NoPoints.into());
        }
        self.say();
        Ok((self.skipped, self.notes))
    }

    /// Note what was left out.
    fn say(&mut self) {
        if self.skipped > 0 {
            let rows = self.rows();
            let how = if self.invalid == Invalid::Missing { "; --invalid refuse makes them an error" } else { "" };
            self.notes.push(format!("{} of {rows} rows have no finite coordinates and are skipped{how}", self.skipped));
        }
        if !self.layout.ignored.is_empty() {
            self.notes.push(format!("columns not read: {}", list(&self.layout.ignored)));
        }
    }

    /// Make points of the rows.
    pub(crate) fn finish(mut self) -> Result<PointTable, Flaw> {
        if self.columns[0].is_empty() {
            return Err(Fault::NoPoints.into());
        }
        self.say();
        let mut columns: Vec<String> = self.layout.coordinates.into_iter().map(|(_, name)| name).collect();
        let points = match self.layout.weight {
            None => Points::from_columns(self.columns),
            Some((_, name)) => {
                columns.push(name);
                Points::weighted(self.columns, self.weights)
            }
        };
        let mut points = points.map_err(Fault::from)?;
        if !self.normals.is_empty() {
            let normals = &self.normals;
            let usable = |k: usize| {
                normals.iter().all(|column| column[k].is_finite()) && normals.iter().any(|column| column[k] != 0.0)
            };
            let unusable = (0..points.len()).filter(|k| !usable(*k)).count();
            if unusable == 0 {
                points = points.with_attribute("normal", Attribute::Vector(self.normals)).map_err(Fault::from)?;
            } else {
                let len = points.len();
                self.notes.push(format!("normals are not read: {unusable} of {len} are zero or not finite"));
            }
        }
        Ok(PointTable { points, columns, skipped: self.skipped, notes: self.notes })
    }
}
