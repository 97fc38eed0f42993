//! `cfpose segment`: what the program sees of an image, before any registration.

use cfpose_vision::overlay::{draw_line, shares_to_png, to_png};
use cfpose_vision::{Raster, SegmentOptions, contours_of, guess_transfer, read_picture, segment};
use serde_json::json;

use crate::args::SegmentArgs;
use crate::commands::register::{filter_of, light_of, look};
use crate::failure::Failure;
use crate::output;

/// Colour of the contour.
const CONTOUR: [u8; 3] = [230, 30, 160];

/// Run the command.
///
/// # Errors
/// [`Failure`] for an image that cannot be read or shows no pattern, and for a folder that cannot be written.
pub fn run(args: &SegmentArgs) -> Result<(), Failure> {
    let picture = read_picture(&args.image)?;
    let options = SegmentOptions { find_others: !args.reference, ..look(&args.look) };
    let transfer = args.look.transfer.given().unwrap_or_else(|| guess_transfer(&[&picture], &options));
    let named = |problem: &dyn std::fmt::Display| Failure::input(format!("{}: {problem}", args.image.display()));
    let filter = filter_of(&args.look, &picture, transfer).map_err(|error| named(&error))?;
    let found = segment(&light_of(&picture, filter.as_ref(), transfer), &options).map_err(|error| named(&error))?;
    let contours = contours_of(&found.coverage, 0.5);
    let covered: f64 = found.coverage.values().iter().map(|v| f64::from(*v)).sum();
    let components: Vec<_> =
        found.components.iter().map(|c| json!({ "pixels": c.pixels, "bounds": c.bounds })).collect();
    let others = found.others.as_ref().map_or(0, |others| others.iter().filter(|other| **other).count());
    let value = json!({
        "image": args.image,
        "size": [picture.width(), picture.height()],
        "transfer": transfer.name(),
        "filter": filter.map(|filter| filter.0),
        "pattern": if found.dark { "dark" } else { "bright" },
        "level": found.level,
        "threshold": found.threshold,
        "noise": found.noise,
        "covered_pixels": covered,
        "hidden_pixels": others,
        "components": components,
        "contours": contours.iter().map(|c| json!({ "length": c.length(), "closed": c.closed })).collect::<Vec<_>>(),
    });
    if let Some(out) = &args.out {
        std::fs::create_dir_all(out).map_err(|error| Failure::input(format!("{}: {error}", out.display())))?;
        let write = |name: &str, bytes: Vec<u8>| {
            let path = out.join(name);
            std::fs::write(&path, bytes).map_err(|error| Failure::input(format!("{}: {error}", path.display())))
        };
        let image = |fault: cfpose_vision::Fault| named(&fault);
        write("coverage.png", shares_to_png(&found.coverage).map_err(image)?)?;
        let coverage = &found.coverage;
        let mask = Raster::from_fn(picture.width(), picture.height(), |x, y| coverage.at(x, y).round());
        write("mask.png", shares_to_png(&mask).map_err(image)?)?;
        let mut drawn = picture.to_rgb();
        contours.iter().for_each(|contour| draw_line(&mut drawn, &contour.places, 3.0, CONTOUR));
        write("contour.png", to_png(&drawn).map_err(image)?)?;
        let mut rows = String::from("x,y,w\n");
        for y in 0..coverage.height() {
            for (x, w) in coverage.row(y).iter().enumerate().filter(|(_, w)| **w > 0.0) {
                rows += &format!("{x},{y},{w}\n");
            }
        }
        write("coverage.csv", rows.into_bytes())?;
    }
    let rows = vec![
        vec!["pattern".into(), format!("{} on its background", if found.dark { "dark" } else { "bright" })],
        vec!["transfer".into(), transfer.name().into()],
        vec!["level".into(), format!("{:.4} of the background", found.level)],
        vec!["threshold".into(), format!("{:.4} of the background", found.threshold)],
        vec!["noise".into(), format!("{:.4} of the contrast", found.noise)],
        vec!["covered".into(), format!("{covered:.1} pixels in {} component(s)", found.components.len())],
        vec!["hidden".into(), format!("{others} pixels that are neither")],
    ];
    output::show(&output::table(&[], &rows), args.json.as_deref())?;
    output::write_json(&value, args.json.as_deref())
}
