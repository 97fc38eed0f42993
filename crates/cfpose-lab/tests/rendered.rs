//! Registration of rendered images of known pose: a few trials of the conditions that `cfpose cells` measures on hundreds.

use cfpose_lab::rendered::{CELLS, RenderedRow, SEQUENCES, measure, measure_one, measure_sequence, summarise};

/// A seed that no figure of the documentation was made with.
const SEED: u64 = 9001;

fn rows(name: &str, trials: u64) -> Vec<RenderedRow> {
    let cell = CELLS.iter().find(|cell| cell.name == name).unwrap();
    measure(cell, SEED, trials)
}

#[test]
fn complete_patterns_are_found_to_hundredths_of_a_pixel() {
    for (name, each, median) in
        [("clean45", 0.1, 0.02), ("noise12", 0.3, 0.1), ("defocus3", 0.3, 0.1), ("light40", 0.3, 0.1)]
    {
        let rows = rows(name, 4);
        let summary = summarise(&rows);
        assert!(rows.iter().all(|row| row.px < each), "{name}: {rows:?}");
        assert!(summary.median_px < median, "{name}: {summary:?}");
        assert!(summary.verdicts[0] >= 0.75, "{name}: {summary:?}");
    }
}

#[test]
fn hidden_parts_are_survived_or_said() {
    for name in ["cut20", "grey20", "out", "clutter20"] {
        let rows = rows(name, 3);
        let found = rows.iter().filter(|row| row.px < 0.5).count();
        assert!(found >= 2, "{name}: {rows:?}");
        assert!(rows.iter().all(|row| row.verdict != "good" || row.px < 1.0), "{name}: {rows:?}");
    }
}

#[test]
fn scattered_occluders_on_a_pattern_of_four_greys_are_told_apart() {
    for name in ["greys20", "greys30"] {
        let rows = rows(name, 4);
        assert!(rows.iter().all(|row| row.px < 0.3 && row.verdict == "good" && row.by == "greys"), "{name}: {rows:?}");
    }
}

#[test]
fn poses_that_were_lost_or_wrong_stay_found() {
    // An occluder on more than half of the frame's border was taken for the background, another one for a gradient of the light; fits
    // rested half way between the two tilts, and beside the pattern (1.4 pixels off, and `good`).
    let cases = [("grey20", 1301, 50), ("grey20", 2601, 85), ("radius72", 71, 9), ("radius72", 2601, 76)];
    for (name, seed, number) in cases.into_iter().chain([("grey20", 2601, 4), ("cut30", 2601, 83)]) {
        let cell = CELLS.iter().find(|cell| cell.name == name).unwrap();
        let row = measure_one(cell, seed, number);
        assert!(row.px < 0.1 && row.verdict == "good", "{row:?}");
    }
}

#[test]
fn a_pattern_seen_as_a_whole_is_found_in_any_turn_and_tilt() {
    // Number 21 of the first seed was not found by disturbed starts.
    let cell = CELLS.iter().find(|cell| cell.name == "anywhere").unwrap();
    let found = [(2601, 21), (SEED, 0), (SEED, 1), (SEED, 2)].map(|(seed, number)| measure_one(cell, seed, number));
    assert!(found.iter().all(|row| row.px < 0.1 && row.verdict == "good"), "{found:?}");
}

#[test]
fn three_and_four_degrees_of_freedom_stay_what_they_are() {
    for name in ["wheels", "level"] {
        let rows = rows(name, 3);
        assert!(rows.iter().all(|row| row.px < 0.05 && row.verdict == "good"), "{name}: {rows:?}");
    }
}

#[test]
fn a_row_depends_on_seed_and_number_alone() {
    let cell = CELLS.iter().find(|cell| cell.name == "clean25").unwrap();
    let (once, more) = (measure(cell, SEED, 1), measure(cell, SEED, 2));
    assert_eq!(once[0].px.to_bits(), more[0].px.to_bits());
}

#[test]
fn a_sequence_is_followed_behind_a_bar() {
    let sequence = SEQUENCES.iter().find(|sequence| sequence.name == "track-bar").unwrap();
    let summary = measure_sequence(sequence, SEED).unwrap();
    assert_eq!(summary.lost, 0, "{summary:?}");
    assert!(summary.mean_px < 0.05, "{summary:?}");
}
