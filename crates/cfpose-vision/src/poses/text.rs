//! Rows of numbers, and which of them a header says are the pose.

use cfpose::Pose;

use super::{StampedPose, empty, flaw, of_matrix, of_tum};
use crate::error::{Flaw, Place};
use crate::words::words;

/// Read rows of numbers; the header, else the length of the first row, chooses the form.
pub(super) fn parse_text(text: &str) -> Result<Vec<StampedPose>, Flaw> {
    let mut rows: Vec<(usize, Vec<f64>)> = Vec::new();
    let (mut comment, mut header): (&str, Option<Vec<&str>>) = ("", None);
    for (index, line) in text.lines().enumerate() {
        let (content, remark) = line.split_once('#').unwrap_or((line, ""));
        if rows.is_empty() && !remark.trim().is_empty() {
            comment = remark;
        }
        if rows.is_empty() && header.is_none() && content.contains(char::is_alphabetic) {
            let names = names_of(content);
            if Order::of(&names) != Ok(None) {
                header = Some(names);
                continue;
            }
        }
        let row = numbers(content).map_err(|what| flaw(Place::Line(index + 1), what))?;
        if !row.is_empty() {
            rows.push((index + 1, row));
        }
    }
    let Some((first_line, first)) = rows.first() else { return Err(empty()) };
    let width = first.len();
    if let Some((line, row)) = rows.iter().find(|(_, row)| row.len() != width) {
        return Err(flaw(Place::Line(*line), format!("{} numbers, but the rows above have {width}", row.len())));
    }
    let order = match header {
        Some(names) if names.len() != width => {
            let what = format!("{width} numbers, but the header names {}", names.len());
            return Err(flaw(Place::Line(*first_line), what));
        }
        Some(names) => Order::of(&names),
        // Words of a comment may stand before the names.
        None => {
            let names = names_of(comment);
            names.len().checked_sub(width).map_or(Ok(None), |from| Order::of(&names[from..]))
        }
    };
    let order = order.map_err(|what| flaw(Place::Line(*first_line), what))?;
    let height = match width {
        _ if order.is_some() => 1,
        4 if rows.len() == 3 => 3,
        4 => 4,
        8 | 12 | 16 => 1,
        _ => return Err(flaw(Place::Line(rows[0].0), format!("{width} numbers in a row are no pose"))),
    };
    if !rows.len().is_multiple_of(height) {
        let what = format!("{} rows of 4 numbers are not a whole number of 4x4 matrices", rows.len());
        return Err(flaw(Place::Whole, what));
    }
    let read = |block: &[(usize, Vec<f64>)]| {
        let values: Vec<f64> = block.iter().flat_map(|(_, row)| row).copied().collect();
        let pose = match (&order, width) {
            (Some(order), _) => order.pose(&values),
            (None, 8) => of_tum(&values),
            (None, _) => of_matrix(&values).map(|pose| (None, pose)),
        };
        let (time, pose) = pose.map_err(|what| flaw(Place::Line(block[0].0), what))?;
        Ok(StampedPose { time, pose })
    };
    rows.chunks(height).map(read).collect()
}

/// Read the numbers of a row.
fn numbers(content: &str) -> Result<Vec<f64>, String> {
    let fields = content.split(|c: char| c == ',' || c == ';' || c.is_whitespace()).filter(|f| !f.is_empty());
    let finite = |field: &str| {
        let value = field.parse::<f64>().ok().filter(|value| value.is_finite());
        value.ok_or_else(|| format!("{:?} is no finite number", crate::error::excerpt(field)))
    };
    fields.map(finite).collect()
}

/// Split a header at its commas or semicolons, else at blanks.
fn names_of(header: &str) -> Vec<&str> {
    let most = crate::columns::MOST_COLUMNS;
    match [',', ';'].into_iter().find(|separator| header.contains(*separator)) {
        Some(separator) => header.split(separator).map(str::trim).take(most).collect(),
        None => header.split_whitespace().take(most).collect(),
    }
}

/// In which columns of a row the pose stands.
#[derive(Debug, Clone, PartialEq)]
struct Order {
    time: Option<usize>,
    translation: [usize; 3],
    /// x, y, z, w.
    quaternion: [usize; 4],
}

impl Order {
    /// Find the columns by their names; `None` where none is of a quaternion.
    fn of(names: &[&str]) -> Result<Option<Self>, String> {
        let (mut time, mut translation, mut quaternion) = (None, [None; 3], [None; 4]);
        for (column, name) in names.iter().enumerate() {
            let words = words(name);
            let has = |list: &[&str]| words.iter().any(|word| list.contains(&word.as_str()));
            let last = words.last().map(String::as_str).unwrap_or_default();
            let (of_quaternion, letter) = match last {
                "qx" | "qy" | "qz" | "qw" => (true, &last[1..]),
                "tx" | "ty" | "tz" | "px" | "py" | "pz" => (false, &last[1..]),
                _ => (has(&["q", "quat", "quaternion", "orientation", "rotation", "rot"]), last),
            };
            let axis = ["x", "y", "z", "w"].iter().position(|axis| *axis == letter);
            let place = words.len() == 1 || has(&["t", "p", "pos", "position", "translation", "trans", "location"]);
            let slot = match axis {
                Some(axis) if of_quaternion => &mut quaternion[axis],
                Some(axis @ 0..3) if place => &mut translation[axis],
                None if has(&["time", "timestamp", "stamp", "secs", "sec"]) || *name == "t" => &mut time,
                _ => continue,
            };
            if slot.replace(column).is_some() {
                return Err(format!("the header names {:?} twice", crate::error::excerpt(name)));
            }
        }
        if quaternion == [None; 4] {
            return Ok(None);
        }
        match (translation, quaternion) {
            ([Some(a), Some(b), Some(c)], [Some(x), Some(y), Some(z), Some(w)]) => {
                Ok(Some(Self { time, translation: [a, b, c], quaternion: [x, y, z, w] }))
            }
            _ => Err("the header names only a part of x y z qx qy qz qw".to_string()),
        }
    }

    /// Read a row.
    fn pose(&self, row: &[f64]) -> Result<(Option<f64>, Pose), String> {
        let mut tum = vec![self.time.map_or(0.0, |column| row[column])];
        tum.extend(self.translation.iter().chain(&self.quaternion).map(|column| row[*column]));
        let (_, pose) = of_tum(&tum)?;
        Ok((self.time.map(|column| row[column]), pose))
    }
}
