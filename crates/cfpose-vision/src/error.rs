//! What can be wrong with a file: where, what, and what to do about it, in one line.

use std::fmt;
use std::path::{Path, PathBuf};

use cfpose::PointsError;

/// A file that cannot be read or written: which file, where in it, what is wrong and what to do, in one line.
#[derive(Debug, thiserror::Error)]
#[error("{}: {at}{fault}", path.display())]
pub struct FileError {
    /// The file as it was named.
    pub path: PathBuf,
    /// Where in the file.
    pub at: Place,
    /// What is wrong.
    pub fault: Fault,
}

/// Where in a file something is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// The file as a whole, or its header.
    Whole,
    /// A line of a text file, from 1.
    Line(usize),
    /// A row (point) of a binary file, from 1.
    Row(usize),
}

impl fmt::Display for Place {
    /// Write the place as a prefix of the message: nothing, `line 3: ` or `row 3: `.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Whole => Ok(()),
            Self::Line(line) => write!(f, "line {line}: "),
            Self::Row(row) => write!(f, "row {row}: "),
        }
    }
}

/// What a reader of bytes returns: a [`FileError`] before the file's name is known.
#[derive(Debug)]
pub struct Flaw {
    /// Where.
    pub at: Place,
    /// What is wrong.
    pub fault: Fault,
}

impl Flaw {
    /// Place a fault.
    pub fn new(at: Place, fault: Fault) -> Self {
        Self { at, fault }
    }

    /// Name the file.
    pub fn in_file(self, path: &Path) -> FileError {
        FileError { path: path.to_path_buf(), at: self.at, fault: self.fault }
    }
}

impl From<std::io::Error> for Fault {
    /// Take what the operating system said; a file that is not there has its own words.
    fn from(error: std::io::Error) -> Self {
        match error.kind() {
            std::io::ErrorKind::NotFound => Fault::Missing,
            _ => Fault::Io(error),
        }
    }
}

impl From<Fault> for Flaw {
    /// Place a fault at the whole file.
    fn from(fault: Fault) -> Self {
        Self { at: Place::Whole, fault }
    }
}

/// What is wrong with a file and what to do about it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Fault {
    /// There is no such file.
    #[error("there is no such file; check the name and the folder")]
    Missing,
    /// Nothing says which format it is.
    #[error("nothing names the format of this input; give --format csv, or another of {known}")]
    NoFormat {
        /// All known extensions.
        known: String,
    },
    /// The path is a folder or a device.
    #[error("this is not a file of points but a folder or a device; name a regular file")]
    NotAFile,
    /// The operating system refused.
    #[error("{0}")]
    Io(std::io::Error),
    /// No format has this extension.
    #[error("no format has the extension {found:?}{}; known are {known}", suggest(.suggestion))]
    Extension {
        /// The extension found, without the dot; empty where there is none.
        found: String,
        /// The known extension nearest to it, if one is near.
        suggestion: Option<&'static str>,
        /// All known extensions.
        known: String,
    },
    /// The format can be read but not written, or not for these points.
    #[error("{what}; write {advice} instead")]
    Unwritable {
        /// What cannot be written.
        what: String,
        /// Which extension can.
        advice: &'static str,
    },
    /// The file has no bytes.
    #[error("the file is empty; a point file has one row a point")]
    Empty,
    /// The file has content and no point.
    #[error("the file holds no points; give one row a point")]
    NoPoints,
    /// A field is not a number.
    #[error("{column} is {text:?}, not a number{hint}")]
    NotANumber {
        /// Name of the column.
        column: String,
        /// What stands there, cut to a readable length.
        text: String,
        /// What to do, starting with "; ".
        hint: &'static str,
    },
    /// A coordinate is NaN or infinite.
    #[error("{column} is {value}, not a finite number; remove or repair this row")]
    NotFinite {
        /// Name of the column.
        column: String,
        /// The value.
        value: f64,
    },
    /// A weight is negative or not finite.
    #[error("weight {column} is {value}; weights are finite and not negative")]
    Weight {
        /// Name of the column.
        column: String,
        /// The value.
        value: f64,
    },
    /// A row has another number of columns than the rows before it, or than the header names.
    #[error("{}, but the {than} {expected}; give every row the same number of columns", plural(*.found, "column"))]
    Columns {
        /// Columns of this row.
        found: usize,
        /// Columns expected.
        expected: usize,
        /// What says so.
        than: &'static str,
    },
    /// The rows have too many columns.
    #[error("{}; points have 1, 2 or 3 columns and, if a header names it, a column w of weights{}", plural(*.found, "column"), choose(.columns))]
    Dimension {
        /// Columns of coordinates found.
        found: usize,
        /// Columns that hold numbers, as they are named on the command line.
        columns: Option<String>,
    },
    /// The names of the columns do not say which are the coordinates.
    #[error("the columns {names} do not say which are coordinates{}", choose(.columns))]
    Unnamed {
        /// The names.
        names: String,
        /// Columns that hold numbers, as they are named on the command line.
        columns: Option<String>,
    },
    /// Columns u, v and w.
    #[error(
        "u, v and w are three coordinates, or two and a weight; say which with --columns u,v,w or --columns u,v --weight-column w"
    )]
    ThirdOrWeight,
    /// A column that was asked for is not there.
    #[error("there is no column {wanted:?}; {known}")]
    NoColumn {
        /// The column that was asked for.
        wanted: String,
        /// What there is.
        known: String,
    },
    /// A column was asked for twice.
    #[error("the column {wanted:?} is chosen twice; name each column once")]
    ColumnTwice {
        /// The column.
        wanted: String,
    },
    /// Decimal points and decimal commas in one file.
    #[error("{column} is {text:?}, but numbers above have decimal commas; write decimals with a point")]
    Decimal {
        /// Name of the column.
        column: String,
        /// What stands there, cut to a readable length.
        text: String,
    },
    /// A number does not fit the type that the header gives it.
    #[error(
        "{column} is {text}, which the type {kind} of the header cannot hold; write the file again with a type that can"
    )]
    OutsideType {
        /// Name of the column.
        column: String,
        /// What stands there, cut to a readable length.
        text: String,
        /// The type.
        kind: &'static str,
    },
    /// A carriage return alone among other line ends.
    #[error("a carriage return stands alone among other line ends; save the file with one kind of line end")]
    LoneReturn,
    /// Bytes after the last point.
    #[error("{} after the last point; remove what does not belong to the file or write it again", plural(*.found, "byte"))]
    Trailing {
        /// How many.
        found: usize,
    },
    /// More points than were asked for at most.
    #[error("more than {limit} points{}; {advice}", .found.map_or_else(String::new, |found| format!(" ({found})")))]
    TooMany {
        /// Number of points, where it is known.
        found: Option<usize>,
        /// The limit.
        limit: usize,
        /// What to do.
        advice: String,
    },
    /// A compressed file that unpacks to too much.
    #[error("it unpacks to more than {limit} {what}; {advice}")]
    Unpacks {
        /// The limit.
        limit: usize,
        /// What is counted.
        what: &'static str,
        /// What to do.
        advice: &'static str,
    },
    /// Compressed data are damaged.
    #[error("the compressed data are damaged: {what}; write the file again")]
    Packed {
        /// What is wrong.
        what: String,
    },
    /// The header contradicts the format.
    #[error("the header {what}; write the file again with a tool that knows the format")]
    Header {
        /// What is wrong with it, as a verb phrase.
        what: String,
    },
    /// The header promises more than follows.
    #[error("the header claims {claimed} {what}, the file holds {held}; it is truncated or its header is wrong")]
    Claims {
        /// What is counted.
        what: String,
        /// The number in the header, as it stands there.
        claimed: String,
        /// What the file holds: a number, or "at most" one.
        held: String,
    },
    /// The header promises less than follows.
    #[error(
        "the header claims {claimed} {what}, but more follow; write the number that the file holds into the header"
    )]
    Extra {
        /// What is counted.
        what: String,
        /// The number in the header.
        claimed: String,
    },
    /// A face of a mesh is not one.
    #[error("{what}; write the mesh again")]
    Face {
        /// What is wrong.
        what: String,
    },
    /// The format allows it, this reader does not.
    #[error("{what} is not supported; {advice}")]
    Unsupported {
        /// The feature.
        what: String,
        /// What to do.
        advice: &'static str,
    },
    /// An image has no pixel on the chosen side of the threshold.
    #[error(
        "no pixel is foreground, that is {side} grey {threshold}; choose the other side with --foreground {other} or another threshold with --threshold"
    )]
    NoForeground {
        /// The side of the threshold.
        side: &'static str,
        /// The threshold.
        threshold: u8,
        /// Name of the other side.
        other: &'static str,
    },
    /// The image cannot be decoded.
    #[error("the image cannot be decoded: {0}; save it again as PNG")]
    Image(String),
    /// The content is no pose.
    #[error("{what}; give 4x4, 3x4, TUM or KITTI rows, or JSON")]
    Pose {
        /// What is wrong.
        what: String,
    },
    /// The content is no design.
    #[error("{what}; give filled shapes of an SVG file with its width in mm, or corners x, y a line with --size")]
    Design {
        /// What is wrong.
        what: String,
    },
    /// The content is no camera.
    #[error("{what}; give OpenCV (yaml, xml), ROS camera_info, Kalibr, or JSON with fx, fy, cx, cy")]
    Camera {
        /// What is wrong.
        what: String,
    },
    /// One of several cameras has to be chosen.
    #[error("{what}; write FILE{}", if .names.is_empty() { String::new() } else { format!("#{names}") })]
    CameraChoice {
        /// What is wrong.
        what: String,
        /// Names of the cameras, each but the first after `#`.
        names: String,
    },
    /// The points themselves are not usable.
    #[error("{0}")]
    Points(#[from] PointsError),
}

fn suggest(suggestion: &Option<&'static str>) -> String {
    suggestion.map_or_else(String::new, |name| format!(" (did you mean {name:?}?)"))
}

fn choose(columns: &Option<String>) -> String {
    columns.as_ref().map_or_else(String::new, |columns| format!("; choose them with --columns {columns}"))
}

fn plural(number: usize, noun: &str) -> String {
    if number == 1 { format!("1 {noun}") } else { format!("{number} {noun}s") }
}

/// Quote what stands in a file, cut to 40 characters and without what would break the line.
pub(crate) fn excerpt(text: &str) -> String {
    let mut short: String = text.chars().take(40).collect();
    if short.len() < text.len() {
        short.push_str("...");
    }
    short
}

/// Say on one line what a library reports on several.
pub(crate) fn one_line(text: &str) -> String {
    let line: Vec<&str> = text.split_whitespace().collect();
    line.join(" ").chars().take(200).collect()
}
