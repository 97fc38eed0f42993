//! Which frames there are, and when they were taken.

use std::io::BufRead;
use std::path::{Path, PathBuf};

use crate::failure::Failure;

/// Extensions of images.
const EXTENSIONS: [&str; 3] = ["png", "jpg", "jpeg"];

/// Return the files that the arguments name: images, folders of images (sorted by name), and `-` for names on standard input.
///
/// # Errors
/// Input, for a folder that cannot be read or holds no image.
pub(super) fn list(given: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let mut all = Vec::new();
    for path in given {
        if path.as_os_str() == "-" {
            for line in std::io::stdin().lock().lines() {
                let line = line.map_err(|error| Failure::input(format!("standard input: {error}")))?;
                all.extend((!line.trim().is_empty()).then(|| PathBuf::from(line.trim())));
            }
        } else if path.is_dir() {
            let named = |problem: &dyn std::fmt::Display| Failure::input(format!("{}: {problem}", path.display()));
            let entries = std::fs::read_dir(path).map_err(|error| named(&error))?;
            let mut inside: Vec<PathBuf> =
                entries.filter_map(|entry| Some(entry.ok()?.path())).filter(|path| is_image(path)).collect();
            if inside.is_empty() {
                return Err(named(&"the folder holds no PNG or JPEG file"));
            }
            inside.sort();
            all.extend(inside);
        } else {
            all.push(path.clone());
        }
    }
    if all.is_empty() { Err(Failure::input("standard input names no frame; give one name a line")) } else { Ok(all) }
}

fn is_image(path: &Path) -> bool {
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    extension.is_some_and(|extension| EXTENSIONS.contains(&extension.as_str()))
}

/// Return the time of every frame: its number over the frames a second, else its name where all names are rising numbers, else its number.
pub(super) fn times(names: &[PathBuf], fps: Option<f64>) -> Vec<f64> {
    let numbers = (0..names.len()).map(|k| k as f64);
    if let Some(fps) = fps {
        return numbers.map(|k| k / fps).collect();
    }
    let stem = |path: &PathBuf| path.file_stem()?.to_str()?.parse::<f64>().ok().filter(|time| time.is_finite());
    let stamps: Option<Vec<f64>> = names.iter().map(stem).collect();
    match stamps.filter(|stamps| stamps.len() > 1 && stamps.windows(2).all(|pair| pair[0] < pair[1])) {
        Some(stamps) => stamps,
        None => numbers.collect(),
    }
}
