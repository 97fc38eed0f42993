//! Point files, and silhouettes as point files, to [`cfpose::Points`] and back; pose files; camera files, pixels.
//!
//! [`read_points`] chooses the reader by the file's extension from the table [`FORMATS`]; [`write_points`] the writer.
//! Adding a format takes one file in `formats/` and one line of that table.
//!
//! What holds for every reader:
//!
//! * Any content gives points or a [`FileError`] of one line: file, line or row, what is wrong, what to do. Nothing panics.
//! * A header is a claim. Nothing is allocated for what it says: a file that claims 10^15 points and holds ten fails at
//!   once, and memory is bounded by a small multiple of the file's size.
//! * A row whose coordinates are all NaN is a missing point, skipped and counted; in an organised cloud so is every row
//!   that is not finite. Elsewhere values that are not finite are bad input; [`Invalid`] chooses otherwise.
//! * Columns are found by their names (`x [m]`, `pos_y`, `Points:1`, easting and northing), never by position against
//!   them; names that say nothing are refused until [`ReadOptions::columns`] says which are meant.
//! * A column or property named `w` is the weight of the point; nx, ny, nz are its attribute `normal`.
//! * A file that contradicts itself is refused: bytes after the last point, elements, format lines or counts given twice,
//!   values outside their type, a carriage return alone among other line ends.
//! * Compressed files (`.gz`, `.npz`, compressed pcd, images) have limits on what they unpack to, so that reading takes at
//!   most 64 MiB and 40 times the file's size, of an image 32 bytes a pixel instead.
//!
//! The readers are written here rather than taken from the crates that exist for the formats, because those cannot keep
//! these promises: `ply-rs-bw` 4 stores elements without properties as often as the header claims, and two properties
//! of one name as one (every later binary row is then shifted); `npyz` 0.9 multiplies the claimed shape
//! without a check and parses the header by unbounded recursion; `csv` 1.4 has one separator a file and blanks are not
//! one. The tests read what `ply-rs-bw` and `npyz` write.
//!
//! ```
//! use cfpose_vision::{ReadOptions, read_points, write_points};
//! let path = std::env::temp_dir().join(format!("cfpose-doc-{}.csv", std::process::id()));
//! std::fs::write(&path, "x, y, w\n0, 1, 1\n2, 3, 0.5\n")?;
//! let file = read_points(&path, &ReadOptions::default())?;
//! assert_eq!((file.points.len(), file.points.dim(), file.format), (2, 2, "text"));
//! assert_eq!(file.points.weights(), [1.0, 0.5]);
//! write_points(&path, &file.points)?;
//! assert_eq!(read_points(&path, &ReadOptions::default())?.points, file.points);
//!
//! std::fs::write(&path, "0 1\n2\n")?;
//! let error = read_points(&path, &ReadOptions::default()).unwrap_err().to_string();
//! assert!(error.ends_with(".csv: line 2: 1 column, but the rows above have 2; give every row the same number of columns"));
//! # std::fs::remove_file(&path)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod bytes;
mod camera;
mod columns;
mod contours;
mod cursor;
mod design;
mod error;
pub mod formats;
mod fuzz;
mod gather;
mod light;
mod lines;
mod lookup;
mod mesh;
mod options;
pub mod overlay;
mod picture;
mod poses;
mod raster;
mod read;
pub mod registration;
mod render;
mod rows;
mod scalar;
mod segment;
mod stream;
mod triangles;
mod unpack;
mod words;
mod write;

pub use camera::{Camera, Lens, read_camera};
pub use contours::{Contour, contours_of};
pub use design::{Design, Shape, is_design, read_design};
pub use error::{Fault, FileError, Flaw, Place};
pub use formats::{FORMATS, Format};
pub use fuzz::fuzz_one;
pub use gather::PointTable;
pub use light::guess_transfer;
pub use lookup::{format_named, format_of};
pub use mesh::{Mesh, read_mesh};
pub use options::{Foreground, Invalid, MASK_POINTS, ReadOptions, Threshold};
pub use picture::{Filter, Hue, HueError, Picture, Transfer, read_picture};
pub use poses::{PoseFormat, StampedPose, read_poses};
pub use raster::Raster;
pub use read::{PointFile, read_points};
pub use render::{Exposure, Patch, coverage, render};
pub use segment::{Component, SegmentError, SegmentOptions, Segmentation, segment};
pub use stream::{Streamed, stream_points};
pub use write::write_points;
