//! Reading the two point files as the flags of reading say.

use std::path::Path;

use cfpose::Points;
use cfpose::distances::{density_weights, even_rows, one_per_cell};
use cfpose_vision::{Foreground, Invalid, PointFile, ReadOptions, format_named, format_of, read_points};

use crate::args::{InvalidRows, ProblemArgs, ReadingArgs, Side, Thin, Weights};
use crate::failure::Failure;

/// Points of a file that `--thin auto` leaves, about.
const ENOUGH: usize = 20_000;

/// Read a point file that an estimate can use.
///
/// # Errors
/// As [`read_points`].
pub fn read(path: &Path) -> Result<Points, Failure> {
    Ok(read_file(path, &ReadOptions::default())?.points)
}

fn read_file(path: &Path, options: &ReadOptions) -> Result<PointFile, Failure> {
    let file = read_points(path, options)?;
    check_size(&file.points).map_err(|problem| Failure::input(format!("{}: {problem}", path.display())))?;
    Ok(file)
}

/// Read source and target with the flags of reading.
pub(super) fn read_both(args: &ProblemArgs) -> Result<[PointFile; 2], Failure> {
    let paths = [args.source(), args.target()];
    if paths.iter().all(|path| path.as_os_str() == "-") {
        return Err(Failure::usage("--source and --target are both standard input; name a file for one of them"));
    }
    let reading = &args.reading;
    if let Some(name) = &reading.format {
        format_named(name).map_err(|fault| Failure::usage(format!("--format: {fault}")))?;
    }
    // The format is that of the files whose name tells none, else of both.
    let open = paths.map(|path| format_of(path).is_err());
    let options = |open_here: bool| ReadOptions {
        format: reading.format.clone().filter(|_| open_here || open == [false; 2]),
        ..read_options(reading)
    };
    let mut files = [read_file(paths[0], &options(open[0]))?, read_file(paths[1], &options(open[1]))?];
    let of_masks = [("--threshold", reading.threshold.is_some()), ("--foreground", reading.foreground.is_some())];
    if let Some((flag, _)) = of_masks.iter().find(|(_, given)| *given)
        && files.iter().all(|file| file.format != "mask")
    {
        return Err(Failure::usage(format!("{flag} has no effect, no file is an image; leave it out")));
    }
    for file in &mut files {
        prepare(file, reading).map_err(|problem| Failure::input(format!("{}: {problem}", file.path.display())))?;
    }
    Ok(files)
}

/// Thin and weigh the points of a file as the flags say.
fn prepare(file: &mut PointFile, reading: &ReadingArgs) -> Result<(), String> {
    let text = |problem: cfpose::PointsError| problem.to_string();
    let before = file.points.len();
    let rows = match reading.thin {
        None => None,
        Some(Thin::Cells(size)) => Some(one_per_cell(&file.points, size)?),
        Some(Thin::Auto) => even_rows(&file.points, ENOUGH),
    };
    if let Some(rows) = rows.filter(|rows| rows.len() < before) {
        file.points = file.points.select(&rows).map_err(text)?;
        file.notes.push(format!("--thin keeps {} of {before} points; rows in results count these", rows.len()));
    }
    match reading.weights {
        None | Some(Weights::File) => {}
        Some(Weights::Density) => file.points = density_weights(&file.points).map_err(text)?,
        Some(Weights::None) => file.points = file.points.clone().with_equal_weights(),
    }
    Ok(())
}

/// Return what the flags of reading say.
pub fn read_options(reading: &ReadingArgs) -> ReadOptions {
    ReadOptions {
        columns: reading.columns.clone(),
        weight_column: reading.weight_column.clone(),
        invalid: match reading.invalid {
            None => Invalid::Missing,
            Some(InvalidRows::Skip) => Invalid::Skip,
            Some(InvalidRows::Refuse) => Invalid::Refuse,
        },
        max_points: reading.max_points.map(|most| usize::try_from(most).unwrap_or(usize::MAX)),
        threshold: reading.threshold.unwrap_or_default(),
        foreground: match reading.foreground {
            None => Foreground::Auto,
            Some(Side::Dark) => Foreground::Dark,
            Some(Side::Bright) => Foreground::Bright,
        },
        ..ReadOptions::default()
    }
}

/// Largest coordinate, and smallest extent: squares and cubes of what lies beyond are infinite or 0.
const SIZES: [f64; 2] = [1e100, 1e-100];

/// Check that means and covariances of the points can be computed.
fn check_size(points: &Points) -> Result<(), String> {
    let [most, least] = SIZES;
    let (mut largest, mut extent) = (0.0_f64, 0.0_f64);
    for d in 0..points.dim() {
        let (low, high) =
            points.column(d).iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(*x), b.max(*x)));
        largest = largest.max(low.abs()).max(high.abs());
        extent = extent.max(high - low);
    }
    if largest > most {
        return Err(format!("a coordinate of size {largest:e} overflows when it is squared; rescale the file"));
    }
    if extent < least {
        return Err(format!("the points lie within {extent:e}, which underflows when it is squared; rescale the file"));
    }
    Ok(())
}
