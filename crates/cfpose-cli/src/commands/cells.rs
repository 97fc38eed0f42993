//! `cfpose cells`: how well rendered images of known pose are registered, condition by condition.

use cfpose_lab::rendered::{CELLS, RenderedRow, measure, summarise};
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
        if CELLS.iter().all(|cell| cell.name != name) {
            let known: Vec<&str> = CELLS.iter().map(|cell| cell.name).collect();
            return Err(Failure::usage(format!("there is no cell `{name}`; known are {}", known.join(", "))));
        }
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
    output::show(&output::table(&header, &table), json)?;
    let value: Vec<_> =
        all.iter().map(|(summary, rows): &(_, Vec<RenderedRow>)| json!({ "summary": summary, "rows": rows })).collect();
    output::write_json(&value, json)
}
