//! Registration of trials, and what a cell comes to.

use std::time::Instant;

use cfpose::Registry;
use cfpose::homography::{apply, in_file_units};
use cfpose_optim::manifold::{multiply3, rotation_log};
use cfpose_vision::registration::{FrameVerdict, Pattern, Registrar, View};
use cfpose_vision::{SegmentOptions, segment};
use rayon::prelude::*;
use serde::Serialize;

use super::cells::{ALL, RenderedCell};
use super::scene::{RenderedTrial, draw};

/// One trial.
#[derive(Debug, Clone, Serialize)]
pub struct RenderedRow {
    /// Cell.
    pub cell: &'static str,
    /// Number of the trial.
    pub number: u64,
    /// Mean reprojection error over the test places, pixels; infinite where there is no theta.
    pub px: f64,
    /// Verdict.
    pub verdict: &'static str,
    /// Angle between the rotations, degrees.
    pub angle_deg: f64,
    /// Distance of the pattern's centres as a share of the distance, percent.
    pub position_percent: f64,
    /// Squared Mahalanobis distance of the error.
    pub mahalanobis: f64,
    /// Residual of the second tilt over that of the best; null where it is no minimum of its own.
    pub second_tilt_ratio: Option<f64>,
    /// Share of the visible contour with an edge.
    pub share: f64,
    /// Larger share of a region that the other explains.
    pub one_sided: f64,
    /// Median distance of the edges, pixels.
    pub median: f64,
    /// What led to the theta.
    pub by: &'static str,
    /// Starts tried.
    pub starts: usize,
    /// Share of the pattern that is hidden.
    pub hidden: f64,
    /// Wall-clock time of segmentation and registration of the frame.
    pub seconds: f64,
}

/// A cell in numbers.
#[derive(Debug, Clone, Serialize)]
pub struct RenderedSummary {
    /// Cell.
    pub cell: &'static str,
    /// Trials.
    pub trials: usize,
    /// Share below .1, .3, .5 and 1 pixel.
    pub below: [f64; 4],
    /// Median error, pixels.
    pub median_px: f64,
    /// Median angle, degrees.
    pub median_angle_deg: f64,
    /// Median position, percent of the distance.
    pub median_position_percent: f64,
    /// Share of verdicts good, ambiguous, suspect, lost.
    pub verdicts: [f64; 4],
    /// Trials that are `good` and off by more than 1 pixel.
    pub wrong_but_good: usize,
    /// Mean squared Mahalanobis distance of the trials below 1 pixel.
    pub mean_mahalanobis: f64,
    /// Median time of a frame, seconds.
    pub median_seconds: f64,
}

/// Register the trials of a cell, as many at once as the pool has threads.
pub fn measure(cell: &RenderedCell, seed: u64, trials: u64) -> Vec<RenderedRow> {
    (0..trials).into_par_iter().map(|number| measure_one(cell, seed, number)).collect()
}

/// Register one trial of a cell.
pub fn measure_one(cell: &RenderedCell, seed: u64, number: u64) -> RenderedRow {
    row(cell, &draw(cell, seed, number), number)
}

fn row(cell: &RenderedCell, trial: &RenderedTrial, number: u64) -> RenderedRow {
    let lost = RenderedRow {
        cell: cell.name,
        number,
        px: f64::INFINITY,
        verdict: FrameVerdict::Lost.name(),
        angle_deg: f64::NAN,
        position_percent: f64::NAN,
        mahalanobis: f64::NAN,
        second_tilt_ratio: None,
        share: 0.0,
        one_sided: 0.0,
        median: f64::NAN,
        by: "none",
        starts: 0,
        hidden: trial.hidden,
        seconds: f64::NAN,
    };
    let transfer = cell.exposure.transfer;
    let Ok(registrar) = Registrar::new(&Registry::default(), "plane-bearing", free_of(cell), None) else { return lost };
    let Ok(reference) = segment(&trial.reference.light(transfer), &SegmentOptions::default()) else { return lost };
    let Ok(pattern) = Pattern::new(&reference, trial.camera) else { return lost };
    let begun = Instant::now();
    let options = pattern.look(&SegmentOptions::default());
    let Ok(frame) = segment(&trial.frame.light(transfer), &options) else { return lost };
    let Ok(view) = View::new(&frame, trial.camera) else { return lost };
    let Some(found) = registrar.register(&pattern, &view, None, number) else { return lost };
    let seconds = begun.elapsed().as_secs_f64();
    let camera = trial.camera.intrinsics();
    let h = in_file_units(&registrar.homography(&found.theta), Some(&camera), Some(&camera));
    let px = h.map_or(f64::INFINITY, |h| mean_error(&h, trial));
    let (angle, position) = pose_error(&found.theta, &trial.truth);
    RenderedRow {
        px,
        verdict: found.verdict.name(),
        angle_deg: angle.to_degrees(),
        position_percent: 100.0 * position,
        mahalanobis: mahalanobis(&registrar, cell.free, &found.theta, &trial.truth, &found.covariance),
        second_tilt_ratio: found.rivals.first().map(|rival| rival.ratio),
        share: found.quality.share * found.quality.visible,
        one_sided: found.quality.one_sided(),
        median: found.quality.median,
        by: found.by,
        starts: found.starts,
        seconds,
        ..lost
    }
}

/// Return the columns that move, `None` for all.
fn free_of(cell: &RenderedCell) -> Option<Vec<usize>> {
    (cell.free.len() < ALL.len()).then(|| cell.free.to_vec())
}

fn mean_error(h: &[f64; 9], trial: &RenderedTrial) -> f64 {
    let distance = |p: &[f64; 2]| {
        let (a, b) = (apply(h, *p), apply(&trial.homography, *p));
        (a[0] - b[0]).hypot(a[1] - b[1])
    };
    let mean = trial.test_places.iter().map(distance).sum::<f64>() / trial.test_places.len() as f64;
    if mean.is_finite() { mean } else { f64::INFINITY }
}

/// Return the angle between two poses and the distance of their images of (0, 0, 1) as a share of the depth.
fn pose_error(a: &[f64], b: &[f64]) -> (f64, f64) {
    let transposed = [0, 3, 6, 1, 4, 7, 2, 5, 8].map(|k: usize| a[k]);
    let turn = rotation_log(&multiply3(&transposed, &b[..9]));
    let centre = |t: &[f64]| [0, 1, 2].map(|i: usize| t[3 * i + 2] + t[9 + i]);
    let (p, q) = (centre(a), centre(b));
    let norm = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    (norm(turn), norm([p[0] - q[0], p[1] - q[1], p[2] - q[2]]) / norm(q))
}

/// Return the squared Mahalanobis distance of the truth from an estimate, by the eigenvectors of the covariance.
fn mahalanobis(registrar: &Registrar, free: &[usize], theta: &[f64], truth: &[f64], covariance: &[f64]) -> f64 {
    use cfpose_optim::Manifold;
    let manifold = registrar.model().layout.manifold();
    let mut step = vec![0.0; manifold.tangent()];
    manifold.local(theta, truth, &mut step);
    let step: Vec<f64> = free.iter().map(|column| step[*column]).collect();
    let m = step.len();
    let Some((values, vectors)) = cfpose_optim::linear::symmetric_eigen(m, covariance) else { return f64::NAN };
    (0..m)
        .map(|k| {
            let along: f64 = (0..m).map(|i| vectors[i * m + k] * step[i]).sum();
            along * along / values[k].max(1e-300)
        })
        .sum()
}

/// Summarise the rows of a cell.
pub fn summarise(rows: &[RenderedRow]) -> RenderedSummary {
    let count = rows.len().max(1) as f64;
    let below = |limit: f64| rows.iter().filter(|row| row.px < limit).count() as f64 / count;
    let verdict =
        |verdict: FrameVerdict| rows.iter().filter(|row| row.verdict == verdict.name()).count() as f64 / count;
    let right: Vec<f64> = rows.iter().filter(|row| row.px < 1.0).map(|row| row.mahalanobis).collect();
    RenderedSummary {
        cell: rows.first().map_or("", |row| row.cell),
        trials: rows.len(),
        below: [0.1, 0.3, 0.5, 1.0].map(below),
        median_px: median(rows.iter().map(|row| row.px)),
        median_angle_deg: median(rows.iter().map(|row| row.angle_deg)),
        median_position_percent: median(rows.iter().map(|row| row.position_percent)),
        verdicts: [FrameVerdict::Good, FrameVerdict::Ambiguous, FrameVerdict::Suspect, FrameVerdict::Lost].map(verdict),
        wrong_but_good: rows.iter().filter(|row| row.verdict == "good" && row.px > 1.0).count(),
        mean_mahalanobis: right.iter().sum::<f64>() / right.len().max(1) as f64,
        median_seconds: median(rows.iter().map(|row| row.seconds)),
    }
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}
