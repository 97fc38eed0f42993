//! `.npy` and `.npz`: an array of numpy, N x 1..3, of N numbers, or structured.
//!
//! Read are integers of 1 to 8 bytes and floats of 2, 4 and 8, both byte orders, C and Fortran order, format versions 1
//! to 3; sides of length 1 do not count. A structured type is a row of named columns. Of an archive: its one array, or its
//! arrays of one column each where their names say which coordinates they are, or the one called points, xyz or vertices.
//! Source: numpy.lib.format.

mod header;
mod zip;

use std::borrow::Cow;

use cfpose::Points;

use crate::columns::{Layout, MOST_COLUMNS, list};
use crate::error::{Fault, Flaw, Place};
use crate::gather::{Gather, PointTable};
use crate::options::ReadOptions;
use crate::unpack::Unpacked;
use header::{Field, Header, MAGIC, TRANSPOSE};

/// Read an array.
pub(super) fn read(bytes: &[u8], options: &ReadOptions) -> Result<PointTable, Flaw> {
    table(&Array::parse(bytes)?, options, Vec::new())
}

/// Read an archive of arrays.
pub(super) fn read_archive(bytes: &[u8], options: &ReadOptions) -> Result<PointTable, Flaw> {
    let limit = Unpacked::of(bytes.len());
    let entries = zip::entries(bytes, limit.bytes)?;
    // Data that are stored as they are have the size of the file.
    let limit = match entries.iter().any(|entry| matches!(entry.bytes, Cow::Owned(_))) {
        true => limit,
        false => Unpacked { points: usize::MAX, ..limit },
    };
    let within = |table: PointTable| match table.points.len() > limit.points {
        true => Err(Fault::Unpacks { limit: limit.points, what: "points", advice: zip::STORE }.into()),
        false => Ok(table),
    };
    let arrays: Vec<(String, Array)> = entries
        .iter()
        .map(|entry| Ok((entry.name.trim_end_matches(".npy").to_string(), Array::parse(&entry.bytes)?)))
        .collect::<Result<_, Fault>>()?;
    if arrays.iter().any(|(_, array)| array.header.rows > limit.points as u64) {
        return Err(Fault::Unpacks { limit: limit.points, what: "points", advice: zip::STORE }.into());
    }
    let names: Vec<String> = arrays.iter().map(|(name, _)| name.clone()).collect();
    let [(_, only)] = &arrays[..] else { return several(&arrays, &names, options).and_then(within) };
    table(only, options, Vec::new()).and_then(within)
}

/// Make points of several arrays: columns, or one that is called points.
fn several(arrays: &[(String, Array)], names: &[String], options: &ReadOptions) -> Result<PointTable, Flaw> {
    let called = |name: &String| ["points", "xyz", "vertices", "positions"].contains(&name.to_lowercase().as_str());
    let points: Vec<usize> = (0..arrays.len()).filter(|k| called(&names[*k])).collect();
    if let [only] = points[..] {
        let note = format!("read is the array {} of {}", names[only], list(names));
        return table(&arrays[only].1, options, vec![note]);
    }
    let (columns, rest): (Vec<usize>, Vec<usize>) = (0..arrays.len()).partition(|k| arrays[*k].1.is_column());
    let columns: Vec<usize> = columns.into_iter().take(MOST_COLUMNS).collect();
    let of_columns: Vec<String> = columns.iter().map(|k| names[*k].clone()).collect();
    let layout = if columns.len() > 1 { Layout::by_name(&of_columns, options, |_| true).ok() } else { None };
    let Some(layout) = layout else {
        let what = format!("an archive of several arrays ({})", list(names));
        let advice = "save one array, or call it points, or save columns called x, y and z";
        return Err(Fault::Unsupported { what, advice }.into());
    };
    let array = |column: usize| &arrays[columns[column]].1;
    let rows = array(layout.coordinates[0].0).rows()?;
    for column in layout.read() {
        let found = array(column).rows()?;
        if found != rows {
            let what = format!("gives {} {found} rows, and {} {rows}", of_columns[column], layout.coordinates[0].1);
            return Err(Fault::Header { what }.into());
        }
    }
    let mut gather = Gather::new(layout, options);
    if !rest.is_empty() {
        let unread: Vec<String> = rest.iter().map(|k| names[*k].clone()).collect();
        gather.note(format!("arrays not read: {}", list(&unread)));
    }
    for row in 0..rows {
        gather.push(Place::Row(row + 1), |column, _| array(column).value(row, 0))?;
    }
    gather.finish()
}

/// Make points of one array.
fn table(array: &Array, options: &ReadOptions, notes: Vec<String>) -> Result<PointTable, Flaw> {
    let layout = layout(array, options)?;
    let rows = array.rows()?;
    let mut gather = Gather::new(layout, options);
    gather.reserve(rows.min(options.max_points.unwrap_or(rows)));
    notes.into_iter().for_each(|note| gather.note(note));
    for row in 0..rows {
        gather.push(Place::Row(row + 1), |column, _| array.value(row, column))?;
    }
    gather.finish()
}

/// Choose the columns of an array.
fn layout(array: &Array, options: &ReadOptions) -> Result<Layout, Flaw> {
    let header = &array.header;
    let columns = array.columns()?;
    Ok(match header.fields[0].name.is_empty() {
        true if columns > 3 && header.rows < 4 && options.columns.is_empty() => {
            return Err(header.refuse_shape(TRANSPOSE).into());
        }
        true if columns > 3 && options.columns.is_empty() && options.weight_column.is_none() => {
            return Err(header.refuse_shape("choose columns with --columns 1,2,3").into());
        }
        true => Layout::anonymous(columns, options, |_| true)?,
        false => {
            let names: Vec<String> = header.fields.iter().map(|field| field.name.clone()).collect();
            Layout::by_name(&names, options, |_| true)?
        }
    })
}

/// Reads an array in C order part by part.
pub(crate) struct ArrayReader {
    header: Header,
    gather: Gather,
    row: u64,
}

impl ArrayReader {
    /// Take the header, without data; `None` where rows are not consecutive.
    pub(crate) fn new(head: &[u8], options: &ReadOptions) -> Result<Option<Self>, Flaw> {
        let array = Array::parse(head)?;
        let layout = layout(&array, options)?;
        if array.header.fortran && array.header.columns > 1 {
            return Ok(None);
        }
        Ok(Some(Self { header: array.header, gather: Gather::new(layout, options), row: 0 }))
    }

    /// Return the bytes of a row.
    pub(crate) fn stride(&self) -> usize {
        self.header.item.max(1).saturating_mul(self.header.columns)
    }

    /// Return the number of rows that are still to come.
    pub(crate) fn left(&self) -> u64 {
        self.header.rows - self.row
    }

    /// Read whole rows, at most as many as are to come, and take them out as points.
    pub(crate) fn rows(&mut self, data: &[u8]) -> Result<Option<Points>, Flaw> {
        let count = data.len() / self.stride();
        let header = Header { rows: count as u64, fortran: false, ..self.header.clone() };
        let array = Array { header, data };
        for row in 0..count {
            let at = Place::Row(usize::try_from(self.row).unwrap_or(usize::MAX).saturating_add(row + 1));
            self.gather.push(at, |column, _| array.value(row, column))?;
        }
        self.row += count as u64;
        self.gather.drain(1)
    }

    /// End after the last row.
    pub(crate) fn end(self, trailing: usize) -> Result<(usize, Vec<String>), Flaw> {
        if self.row < self.header.rows {
            let (claimed, held) = (self.header.rows.to_string(), self.row.to_string());
            return Err(Fault::Claims { what: "rows".into(), claimed, held }.into());
        }
        match trailing {
            0 => self.gather.end(),
            found => Err(Fault::Trailing { found }.into()),
        }
    }
}

/// An array and its data.
struct Array<'a> {
    header: Header,
    data: &'a [u8],
}

impl<'a> Array<'a> {
    fn parse(bytes: &'a [u8]) -> Result<Self, Fault> {
        let (header, data) = header::parse(bytes)?;
        Ok(Self { header, data })
    }

    /// Say whether the array is one column of plain numbers.
    fn is_column(&self) -> bool {
        self.header.columns == 1 && self.header.fields[0].name.is_empty()
    }

    /// Return the number of columns: the named numbers of a row of one item, or its items.
    fn columns(&self) -> Result<usize, Fault> {
        match (self.header.fields.len(), self.header.columns) {
            (fields, 1) => Ok(fields),
            (1, columns) if self.header.fields[0].name.is_empty() => Ok(columns),
            _ => Err(self.header.refuse_shape("save an array of one structured item a row")),
        }
    }

    /// Return the number of rows, which are all the data that follow the header.
    fn rows(&self) -> Result<usize, Fault> {
        let stride = self.header.item.max(1).saturating_mul(self.header.columns);
        let (claimed, held) = (self.header.rows, (self.data.len() / stride) as u64);
        let rest = self.data.len() % stride;
        // Compared as u64: a claimed number of rows need not fit the machine.
        if claimed > held {
            return Err(Fault::Claims { what: "rows".into(), claimed: claimed.to_string(), held: held.to_string() });
        }
        if claimed < held {
            return Err(Fault::Extra { what: "rows".into(), claimed: claimed.to_string() });
        }
        if rest > 0 { Err(Fault::Trailing { found: rest }) } else { Ok(claimed as usize) }
    }

    /// Decode a number.
    fn value(&self, row: usize, column: usize) -> Result<f64, Fault> {
        let header = &self.header;
        let (item, field): (usize, &Field) = match header.fields.len() {
            1 if header.fortran => (column * header.rows as usize + row, &header.fields[0]),
            1 => (row * header.columns + column, &header.fields[0]),
            _ => (row, &header.fields[column]),
        };
        let bytes = self.data.get(item * header.item + field.offset..);
        let decoded = bytes.and_then(|bytes| field.scalar.decode(bytes, field.big_endian));
        decoded.ok_or_else(|| Fault::Header { what: "names a number of unknown width".into() })
    }
}

/// Write an N x dim array of little-endian doubles in C order, for points without weights.
pub(super) fn write(points: &Points) -> Result<Vec<u8>, Fault> {
    if !points.is_uniform() {
        return Err(Fault::Unwritable { what: "an npy array has no name for weights".into(), advice: "csv or ply" });
    }
    let dict = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}, {}), }}", points.len(), points.dim());
    // Magic, version, length and text end, with a line feed, at a multiple of 64 bytes.
    let length = (10 + dict.len() + 1).next_multiple_of(64) - 10;
    let mut bytes = [MAGIC, &[1, 0], &(length as u16).to_le_bytes()].concat();
    bytes.extend_from_slice(format!("{dict:<width$}\n", width = length - 1).as_bytes());
    for k in 0..points.len() {
        bytes.extend(points.point(k)[..points.dim()].iter().flat_map(|value| value.to_le_bytes()));
    }
    Ok(bytes)
}
