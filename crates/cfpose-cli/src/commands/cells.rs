//! `cfpose cells`: how well rendered images of known pose are registered, condition by condition.

use std::path::Path;

use cfpose_lab::rendered::{CELLS, RenderedRow, SEQUENCES, draw, measure, measure_sequence, summarise};
use cfpose_vision::overlay::to_png;
use serde_json::json;

use crate::args::CellsArgs;
use crate::failure::Failure;
use crate::output;

/// Run the command.
///
/// # Errors
/// [`Failure`] for the name of a cell that does not exist.
pub fn run(args: &CellsArgs) -> Result<(), Failure> {
    for name in &args.names {
        let names = CELLS.iter().map(|cell| cell.name).chain(SEQUENCES.iter().map(|sequence| sequence.name));
        let known: Vec<&str> = names.collect();
        if known.iter().all(|known| known != name) {
            return Err(Failure::usage(format!("there is no cell `{name}`; known are {}", known.join(", "))));
        }
    }
    if let Some(folder) = &args.export {
        return export(folder, args);
    }
    let chosen = CELLS.iter().filter(|cell| args.names.is_empty() || args.names.iter().any(|name| name == cell.name));
    let header = [
        "cell", "n", "<.1", "<.3", "<.5", "<1", "px", "deg", "pos %", "good", "ambig", "susp", "lost", "bad", "maha",
        "ms",
    ];
    let (mut table, mut all) = (Vec::new(), Vec::new());
    for cell in chosen {
        let rows = measure(cell, args.seed, args.trials);
        let s = summarise(&rows);
        let percent = |share: f64| format!("{:.0}", 100.0 * share);
        let mut line = vec![s.cell.to_string(), s.trials.to_string()];
        line.extend(s.below.iter().map(|share| percent(*share)));
        line.extend([format!("{:.4}", s.median_px), format!("{:.3}", s.median_angle_deg)]);
        line.push(format!("{:.4}", s.median_position_percent));
        line.extend(s.verdicts.iter().map(|share| percent(*share)));
        line.extend([s.wrong_but_good.to_string(), format!("{:.1}", s.mean_mahalanobis)]);
        line.push(format!("{:.0}", 1e3 * s.median_seconds));
        output::note(&line.join(" "));
        table.push(line);
        all.push((s, rows));
    }
    let json = args.json.as_deref();
    let mut tracked = Vec::new();
    for sequence in SEQUENCES.iter().filter(|s| args.names.is_empty() || args.names.iter().any(|name| name == s.name)) {
        tracked.extend(measure_sequence(sequence, args.seed));
    }
    let lines: Vec<Vec<String>> = tracked
        .iter()
        .map(|s| {
            let ms = |seconds: f64| format!("{:.1}", 1e3 * seconds);
            let px = |value: f64| format!("{value:.4}");
            let counts = [s.lost.to_string(), s.good.to_string(), s.followed.to_string()];
            [s.name.to_string()]
                .into_iter()
                .chain(counts)
                .chain([px(s.mean_px), px(s.max_px), ms(s.first_seconds), ms(s.median_seconds)])
                .collect()
        })
        .collect();
    if !lines.is_empty() {
        output::show(
            &output::table(&["sequence", "lost", "good", "followed", "mean px", "max px", "first ms", "ms"], &lines),
            json,
        )?;
    }
    if table.is_empty() {
        return output::write_json(&tracked, json);
    }
    output::show(&output::table(&header, &table), json)?;
    let value: Vec<_> =
        all.iter().map(|(summary, rows): &(_, Vec<RenderedRow>)| json!({ "summary": summary, "rows": rows })).collect();
    output::write_json(&json!({ "cells": value, "sequences": tracked }), json)
}

/// Write the images of all trials, and the truth about them.
fn export(folder: &Path, args: &CellsArgs) -> Result<(), Failure> {
    let named = |path: &Path, problem: &dyn std::fmt::Display| Failure::input(format!("{}: {problem}", path.display()));
    std::fs::create_dir_all(folder).map_err(|error| named(folder, &error))?;
    let mut truths = Vec::new();
    for cell in CELLS.iter().filter(|cell| args.names.is_empty() || args.names.iter().any(|name| name == cell.name)) {
        for number in 0..args.trials {
            let trial = draw(cell, args.seed, number);
            let name = format!("{}_{number:03}", cell.name);
            for (part, picture) in [("reference", &trial.reference), ("frame", &trial.frame)] {
                let path = folder.join(format!("{name}_{part}.png"));
                let bytes = to_png(&picture.to_rgb()).map_err(|fault| named(&path, &fault))?;
                std::fs::write(&path, bytes).map_err(|error| named(&path, &error))?;
            }
            let h = trial.homography;
            truths.push(json!({
                "name": name, "cell": cell.name, "transfer": cell.exposure.transfer.name(), "camera": [600, 600, 319.5, 239.5],
                "homography": [&h[..3], &h[3..6], &h[6..]], "theta": trial.truth, "test_points_px": trial.test_places,
            }));
        }
    }
    output::write_json(&truths, Some(&folder.join("truth.json")))
}
