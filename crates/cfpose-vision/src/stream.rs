//! Points of a file part by part, in memory that does not depend on the size of the file.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use cfpose::Points;
use flate2::bufread::MultiGzDecoder;

use crate::bytes::STANDARD_INPUT;
use crate::error::{Fault, FileError, Flaw, Place};
use crate::formats::numpy::ArrayReader;
use crate::formats::text::RowReader;
use crate::options::ReadOptions;
use crate::read::{choose, read_points};

/// Points of a part.
const PART: usize = 1 << 16;

/// Longest line of text.
const MOST_LINE: u64 = 1 << 20;

/// Longest header of an array.
const MOST_HEADER: usize = 1 << 20;

/// Bytes of a row of an array, at most, and of what is read of it at once.
const MOST_ROW: usize = 1 << 22;

/// What was read part by part.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Streamed {
    /// Name of the format.
    pub format: &'static str,
    /// Rows that were skipped because they are not finite.
    pub skipped: usize,
    /// What a user should know about the reading, one line each.
    pub notes: Vec<String>,
    /// Whether the file was read part by part; else its format made it necessary to read it whole.
    pub in_parts: bool,
}

/// Read a point file and hand its points out in parts, in the order of the file.
///
/// Text (csv, txt, xyz, asc, tsv) and arrays of numpy in C order come in parts of 65536 points, also from pipes and gzip files, so that
/// memory is constant; files of other formats are read whole and come as one part. Attributes do not come with parts.
///
/// # Errors
/// [`FileError`] as of [`read_points`], and what `each` returns.
///
/// ```
/// use cfpose_vision::{FileError, ReadOptions, stream_points};
/// let path = std::env::temp_dir().join(format!("cfpose-stream-{}.csv", std::process::id()));
/// std::fs::write(&path, "x,y\n".to_string() + &"1,2\n".repeat(70_000))?;
/// let mut parts = Vec::new();
/// let read = stream_points(&path, &ReadOptions::default(), |points| {
///     parts.push(points.len());
///     Ok::<(), FileError>(())
/// })?;
/// assert!(read.in_parts);
/// assert_eq!(parts, [65_536, 4_464]);
/// # std::fs::remove_file(&path)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn stream_points<E: From<FileError>>(
    path: &Path,
    options: &ReadOptions,
    mut each: impl FnMut(&Points) -> Result<(), E>,
) -> Result<Streamed, E> {
    let format = choose(path, options).map_err(|fault| Flaw::from(fault).in_file(path))?;
    let mut used = None;
    let mut take = |points: &Points| {
        used = each(points).err();
        used.is_none()
    };
    let read = match format.name {
        "text" | "tsv" => open(path).map_err(Flaw::from).and_then(|bytes| text(bytes, options, &mut take).map(Some)),
        "npy" => open(path).map_err(Flaw::from).and_then(|bytes| array(bytes, options, &mut take)),
        _ => Ok(None),
    };
    let read = read.map_err(|flaw| flaw.in_file(path))?;
    let streamed = match read {
        Some((skipped, notes)) => Streamed { format: format.name, skipped, notes, in_parts: true },
        None => {
            let file = read_points(path, &ReadOptions { min_distinct: 1, ..options.clone() })?;
            take(&file.points);
            Streamed { format: file.format, skipped: file.skipped, notes: file.notes, in_parts: false }
        }
    };
    used.map_or(Ok(streamed), Err)
}

/// Rows that were skipped, and notes.
type Remarks = (usize, Vec<String>);

/// Open a file, a pipe or standard input, unpacked where it is a gzip file.
fn open(path: &Path) -> Result<Box<dyn BufRead>, Fault> {
    let mut bytes: Box<dyn BufRead> = match path.as_os_str() == STANDARD_INPUT {
        true => Box::new(BufReader::with_capacity(1 << 20, std::io::stdin())),
        false => {
            if std::fs::metadata(path)?.is_dir() {
                return Err(Fault::NotAFile);
            }
            Box::new(BufReader::with_capacity(1 << 20, File::open(path)?))
        }
    };
    let begin = bytes.fill_buf().map_err(Fault::Io)?;
    if begin.is_empty() {
        return Err(Fault::Empty);
    }
    match begin.starts_with(&[0x1f, 0x8b]) {
        true => Ok(Box::new(BufReader::with_capacity(1 << 20, MultiGzDecoder::new(bytes)))),
        false => Ok(bytes),
    }
}

/// Read lines.
fn text(
    mut bytes: Box<dyn BufRead>,
    options: &ReadOptions,
    take: &mut dyn FnMut(&Points) -> bool,
) -> Result<Remarks, Flaw> {
    let begin = bytes.fill_buf().map_err(Fault::Io)?;
    if begin.starts_with(&[0xff, 0xfe]) || begin.starts_with(&[0xfe, 0xff]) {
        return Err(Fault::Unsupported { what: "UTF-16 text".into(), advice: "save the file as UTF-8" }.into());
    }
    if begin.starts_with(b"\xef\xbb\xbf") {
        bytes.consume(3);
    }
    let mut rows = RowReader::new(options);
    let (mut line, mut number) = (Vec::new(), 0);
    loop {
        line.clear();
        number += 1;
        bytes.by_ref().take(MOST_LINE).read_until(b'\n', &mut line).map_err(Fault::Io)?;
        if line.is_empty() {
            break;
        }
        let content = line.strip_suffix(b"\n").unwrap_or(&line);
        let content = content.strip_suffix(b"\r").unwrap_or(content);
        if content.contains(&b'\r') {
            return Err(Flaw::new(Place::Line(number), Fault::LoneReturn));
        }
        if line.len() as u64 == MOST_LINE {
            let what = format!("a line of more than {MOST_LINE} bytes");
            return Err(Flaw::new(Place::Line(number), Fault::Unsupported { what, advice: "write one point a line" }));
        }
        rows.push(number, &String::from_utf8_lossy(content))?;
        if let Some(points) = rows.drain(PART)?
            && !take(&points)
        {
            return Ok((0, Vec::new()));
        }
    }
    let (last, skipped, notes) = rows.end()?;
    if let Some(points) = last {
        take(&points);
    }
    Ok((skipped, notes))
}

/// Read an array; `None`, with nothing taken, where its rows are not consecutive.
fn array(
    mut bytes: Box<dyn BufRead>,
    options: &ReadOptions,
    take: &mut dyn FnMut(&Points) -> bool,
) -> Result<Option<Remarks>, Flaw> {
    // Magic, version, and the length of the header in two bytes or four.
    let mut head = vec![0; 12];
    let filled = fill(&mut bytes, &mut head)?;
    let (begin, length) = match head[..filled.min(12)] {
        [_, _, _, _, _, _, 2 | 3, _, a, b, c, d] => (12, u32::from_le_bytes([a, b, c, d]) as usize),
        _ => (10, usize::from(u16::from_le_bytes([head[8], head[9]]))),
    };
    let whole = begin + length.min(MOST_HEADER);
    let known = filled.min(whole);
    let mut rest = head.split_off(known);
    rest.truncate(filled - known);
    head.resize(whole, 0);
    let read = fill(&mut bytes, &mut head[known..])?;
    head.truncate(known + read);
    let Some(mut rows) = ArrayReader::new(&head, options)? else { return Ok(None) };
    let mut bytes = rest.as_slice().chain(bytes);
    // What a header says of the size of a row is a claim.
    if rows.stride() > MOST_ROW {
        let what = format!("a row of {} bytes", rows.stride());
        return Err(Fault::Unsupported { what, advice: "save the coordinates alone, one row a point" }.into());
    }
    let mut data = vec![0; rows.stride() * PART.min(MOST_ROW / rows.stride())];
    while rows.left() > 0 {
        let wanted = data.len().min(usize::try_from(rows.left()).unwrap_or(usize::MAX).saturating_mul(rows.stride()));
        let filled = fill(&mut bytes, &mut data[..wanted])?;
        let held = filled - filled % rows.stride();
        if let Some(points) = rows.rows(&data[..held])?
            && !take(&points)
        {
            return Ok(Some((0, Vec::new())));
        }
        if filled < wanted {
            break;
        }
    }
    let trailing = std::io::copy(&mut bytes, &mut std::io::sink()).map_err(Fault::Io)?;
    rows.end(usize::try_from(trailing).unwrap_or(usize::MAX)).map(Some)
}

/// Read until a buffer is full or nothing is left; returns how much was read.
fn fill(bytes: &mut impl Read, buffer: &mut [u8]) -> Result<usize, Fault> {
    let mut filled = 0;
    while filled < buffer.len() {
        match bytes.read(&mut buffer[filled..]) {
            Ok(0) => break,
            Ok(read) => filled += read,
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            Err(error) => return Err(Fault::Io(error)),
        }
    }
    Ok(filled)
}
