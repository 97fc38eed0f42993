//! From rows of named columns to points.

use cfpose::Points;

use crate::error::{Fault, Flaw, Place, excerpt};

/// What a reader makes of the bytes of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct PointTable {
    /// The points.
    pub points: Points,
    /// Names of the coordinates, then `w` if the file has weights.
    pub columns: Vec<String>,
}

/// Which columns of a row are the coordinates and which the weight.
#[derive(Debug, Clone)]
pub(crate) struct Layout {
    coordinates: Vec<(usize, String)>,
    weight: Option<(usize, String)>,
}

impl Layout {
    /// Choose by name, without regard to case: `w` is the weight; with a column `x`, the coordinates are `x`, `y`, `z`
    /// wherever they stand, and all else is ignored; without one they are the columns in the order of the file.
    pub(crate) fn by_name(names: &[String]) -> Result<Self, Fault> {
        let lower: Vec<String> = names.iter().map(|name| name.trim().to_lowercase()).collect();
        let find = |wanted: &str| -> Result<Option<usize>, Fault> {
            let mut places = lower.iter().enumerate().filter(|(_, name)| *name == wanted).map(|(index, _)| index);
            match (places.next(), places.next()) {
                (Some(_), Some(_)) => Err(Fault::Header { what: format!("names {wanted} twice") }),
                (place, _) => Ok(place),
            }
        };
        let weight = find("w")?;
        let xyz = [find("x")?, find("y")?, find("z")?];
        if let [Some(_), None, Some(_)] = xyz {
            return Err(Fault::Header { what: "names x and z and no y".to_string() });
        }
        let chosen: Vec<usize> = if xyz[0].is_some() {
            xyz.into_iter().flatten().collect()
        } else {
            (0..names.len()).filter(|index| Some(*index) != weight).collect()
        };
        // Names appear in messages of one line.
        let named = |index: usize| (index, excerpt(names[index].trim()).escape_debug().to_string());
        Self::checked(chosen.into_iter().map(named).collect(), weight.map(named))
    }

    /// Choose by name as [`Layout::by_name`], and insist on a column `x`.
    pub(crate) fn by_xyz(names: &[String], what: &str) -> Result<Self, Fault> {
        if names.iter().any(|name| name.eq_ignore_ascii_case("x")) {
            Self::by_name(names)
        } else {
            Err(Fault::Header { what: format!("names no {what} x") })
        }
    }

    /// Take all columns of a file without names.
    pub(crate) fn anonymous(columns: usize) -> Result<Self, Fault> {
        let name = |index: usize| (index, ["x", "y", "z"].get(index).unwrap_or(&"").to_string());
        Self::checked((0..columns).map(name).collect(), None)
    }

    fn checked(coordinates: Vec<(usize, String)>, weight: Option<(usize, String)>) -> Result<Self, Fault> {
        match coordinates.len() {
            0 => Err(Fault::Header { what: "names a weight and no coordinate".to_string() }),
            1..=3 => Ok(Self { coordinates, weight }),
            found => Err(Fault::Dimension { found }),
        }
    }
}

/// Gathers rows into columns and checks every value where its place in the file is known.
pub(crate) struct Gather {
    layout: Layout,
    columns: Vec<Vec<f64>>,
    weights: Vec<f64>,
}

impl Gather {
    /// Start without rows; nothing is reserved, whatever a header says.
    pub(crate) fn new(layout: Layout) -> Self {
        Self { columns: vec![Vec::new(); layout.coordinates.len()], layout, weights: Vec::new() }
    }

    /// Return the number of rows so far.
    pub(crate) fn len(&self) -> usize {
        self.columns[0].len()
    }

    /// Append one row; `value` gives the number in a column (from 0, as in the file) under its name.
    pub(crate) fn push(&mut self, at: Place, value: impl Fn(usize, &str) -> Result<f64, Fault>) -> Result<(), Flaw> {
        let fail = |fault| Flaw::new(at, fault);
        for ((index, name), column) in self.layout.coordinates.iter().zip(&mut self.columns) {
            let value = value(*index, name).map_err(fail)?;
            if !value.is_finite() {
                return Err(fail(Fault::NotFinite { column: name.clone(), value }));
            }
            column.push(value);
        }
        if let Some((index, name)) = &self.layout.weight {
            let value = value(*index, name).map_err(fail)?;
            if !(value.is_finite() && value >= 0.0) {
                return Err(fail(Fault::Weight { column: name.clone(), value }));
            }
            self.weights.push(value);
        }
        Ok(())
    }

    /// Make points of the rows.
    pub(crate) fn finish(self) -> Result<PointTable, Flaw> {
        if self.columns[0].is_empty() {
            return Err(Fault::NoPoints.into());
        }
        let mut columns: Vec<String> = self.layout.coordinates.into_iter().map(|(_, name)| name).collect();
        let points = match self.layout.weight {
            None => Points::from_columns(self.columns),
            Some((_, name)) => {
                columns.push(name);
                Points::weighted(self.columns, self.weights)
            }
        };
        Ok(PointTable { points: points.map_err(Fault::from)?, columns })
    }
}
