//! Other thetas that the model implies of one: the mirrored tilt of a plane, and which of them is better.

use cfpose::{Points, Scene};

use super::fit::Schedule;
use super::mapper::as_model_takes;
use super::pattern::Pattern;
use super::quality::Quality;
use super::registrar::{Outlined, Registrar, Rival};
use super::sight::Sight;
use super::starts::Disturbed;
use super::view::View;

/// Two tilts are two where the tangent step between them is longer than this.
const SAME: f64 = 0.03;

/// How often a better tilt takes the place of the best one.
const BETTER: usize = 3;

impl Registrar {
    /// Fit the other thetas that the model implies; the best of all comes first, and the others are those that it implies.
    pub(super) fn tilts(
        &self,
        outlined: &Outlined,
        pattern: &Pattern,
        view: &View,
        mut theta: Vec<f64>,
        mut quality: Quality,
    ) -> (Vec<f64>, Quality, Vec<Rival>) {
        let mut rivals = self.rivals(outlined, pattern, view, &view.points[0], &theta, Schedule::TILT);
        for _ in 0..BETTER {
            let of = |rival: &Rival| self.quality_of(outlined, pattern, view, &rival.theta);
            let qualities: Vec<Quality> = rivals.iter().map(of).collect();
            // Edges that only one of two thetas has tell nothing in their ratio: the share of the contour decides where it differs.
            let better = rivals
                .iter()
                .zip(qualities)
                .find(|(rival, other)| other.beats(&quality) || (rival.ratio < 1.0 && !quality.beats(other)));
            let Some((better, of_better)) = better else { break };
            theta.clone_from(&better.theta);
            quality = of_better;
            rivals = self.rivals(outlined, pattern, view, &view.points[0], &theta, Schedule::TILT);
        }
        (theta, quality, rivals)
    }

    /// Fit the other thetas that the model implies of one; nearest in residual first.
    pub(super) fn rivals(
        &self,
        outlined: &Outlined,
        pattern: &Pattern,
        sight: &Sight,
        target: &Points,
        theta: &[f64],
        schedule: Schedule,
    ) -> Vec<Rival> {
        let takes = |points| as_model_takes(&self.model, points).ok();
        let (Some(source), Some(target)) = (takes(&pattern.points[0]), takes(target)) else { return Vec::new() };
        let findings = (self.model.examine)(&Scene { theta, source: &source, target: &target });
        let manifold = self.manifold_at(theta);
        let distance = |a: &[f64], b: &[f64]| {
            let mut step = vec![0.0; manifold.tangent()];
            manifold.local(a, b, &mut step);
            step.iter().map(|v| v * v).sum::<f64>().sqrt()
        };
        let own = self.distance_of(outlined, sight, theta, theta).max(1e-9);
        let mut found: Vec<Rival> = Vec::new();
        let add = |candidates: Vec<Vec<f64>>, found: &mut Vec<Rival>| {
            for candidate in &candidates {
                let candidate = self.held_at_start(candidate, theta);
                // A half turn shows the pattern's back, and no step along the contour turns it again.
                if !self.is_plausible(pattern, &candidate) {
                    continue;
                }
                let Some(fit) = self.fit_outline(outlined, sight, &candidate, schedule) else { continue };
                let known = std::iter::once(theta).chain(found.iter().map(|rival| rival.theta.as_slice()));
                let apart = known.into_iter().all(|other| distance(&fit.theta, other) > SAME);
                if apart && self.is_plausible(pattern, &fit.theta) {
                    let ratio = self.distance_of(outlined, sight, &fit.theta, theta) / own;
                    found.push(Rival { theta: fit.theta, ratio });
                }
            }
        };
        add(findings.candidates, &mut found);
        // Between the two tilts lies a theta at which a fit rests though it is no minimum: its mirrored tilt leads back to it.
        if found.is_empty() && schedule == Schedule::TILT {
            add(Disturbed::new(self, pattern, 0).tilted(theta), &mut found);
        }
        found.sort_by(|a, b| a.ratio.total_cmp(&b.ratio));
        found
    }

    /// Return the root mean square distance of the edges at a theta over the places that have one at another theta; at most 4 pixels each.
    fn distance_of(&self, outlined: &Outlined, view: &Sight, theta: &[f64], inliers_at: &[f64]) -> f64 {
        const MOST: f64 = 4.0;
        let (Some(there), Some(here)) =
            (self.search(outlined, view, inliers_at, 3.0), self.search(outlined, view, theta, MOST))
        else {
            return f64::INFINITY;
        };
        let (mut sum, mut count) = (0.0_f64, 0.0);
        let pairs = there.distances.iter().zip(here.distances.iter().zip(&here.visible));
        // A place that moves behind something or out of the frame has no edge to be far from.
        for (_, (b, _)) in pairs.filter(|(a, (_, visible))| a.abs() < 1.5 && **visible) {
            let distance = if b.is_nan() { MOST } else { b.clamp(-MOST, MOST) };
            sum += distance * distance;
            count += 1.0;
        }
        if count > 0.0 { (sum / count).sqrt() } else { f64::INFINITY }
    }
}
