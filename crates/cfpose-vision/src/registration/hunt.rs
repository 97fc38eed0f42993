//! The order in which thetas are tried, and when one is accepted.

use super::fit::Schedule;
use super::pattern::Pattern;
use super::quality::Quality;
use super::registrar::{Outlined, Registrar, Rival};
use super::sight::Sight;
use super::starts::Disturbed;
use super::view::View;

/// Disturbed starts of the moments.
const MOMENT_STARTS: usize = 12;

/// Disturbed starts of the contour, with few places of it.
const CONTOUR_STARTS: usize = 1000;

/// Share of these places with an edge from which the whole contour is fitted.
const PROMISING: f64 = 0.4;

/// Share of the blur by which regions differ along the boundary, and the blur of a sharp image, pixels.
const BLURRED: f64 = 0.25;
const SHARP: f64 = 0.9;

/// Share of the contour with an edge from which a given start has led to the pattern.
const NEAR_START: f64 = 0.6;

/// Disturbed starts about a theta whose edges are farther than they should be.
const IMPROVED_STARTS: usize = 24;

/// Pixels by which blur and noise may move edges where a part of the contour is enough.
const UNSHARP: f64 = 0.2;

/// The state of a search for a theta.
pub(super) struct Hunt<'a> {
    pub registrar: &'a Registrar,
    pub outlined: &'a Outlined,
    pub pattern: &'a Pattern,
    pub view: &'a View,
    /// Theta, how well it explains the frame, and what led to it.
    pub best: Option<(Vec<f64>, Quality, &'static str)>,
    /// Starts that were tried.
    pub starts: usize,
}

/// Say whether a theta explains a frame: the whole contour and both regions, or a part of the contour and one region wholly.
pub(super) fn accepts(pattern: &Pattern, view: &Sight, quality: &Quality) -> bool {
    // Of normal distances the median is .67 deviations; blur bends edges, and hidden parts end in corners.
    let unsharp = 0.02 * quality.blur.powi(2) + 0.9 * quality.expected;
    let crisp = |more: f64| quality.median < more + unsharp;
    // Edges that may be so far off tell nothing where a part of the contour is missing: a wrong pose had two thirds of it.
    let in_part = |more: f64| unsharp < UNSHARP && crisp(more);
    if view.field.is_greys() {
        return accepts_greys(quality, crisp(0.04), in_part(0.02));
    }
    // Noise of the coverage near the boundary makes regions differ.
    let boundary = pattern.outline.spacing * pattern.outline.places.len() as f64;
    // So does blur, which the mapped reference does not have.
    let blurred = BLURRED * (quality.blur - SHARP).max(0.0) * boundary / pattern.area;
    let both = quality.frame_explained.min(quality.reference_explained);
    let complete = quality.share > 0.93 && both > 0.975 - blurred;
    let slack = view.noise * 2.0 * boundary / pattern.area;
    let partly = quality.share > 0.45 && quality.one_sided() > 0.9972 - slack;
    // Half of the contour and more on all sides of the pattern, between small things that hide the rest.
    let scattered = quality.share * quality.visible > 0.5 && quality.gap < 0.2 && quality.one_sided() > 0.96;
    // Nearly the whole contour, and nothing of the pattern missing, whatever else the frame shows.
    let whole = quality.share * quality.visible > 0.9 && quality.reference_explained > 0.95 && quality.gap < 0.05;
    (whole && crisp(0.06)) || (complete && crisp(0.04)) || ((partly || scattered) && in_part(0.01))
}

/// Say whether steps between greys are explained: half of them, on all sides and of all kinds, or nearly all where edges are blurred.
fn accepts_greys(quality: &Quality, crisp: bool, sharp: bool) -> bool {
    let share = quality.share * quality.visible;
    let all_kinds = |least: f64| quality.weakest > least && quality.gap < 0.25 && quality.one_sided() > 0.5;
    (sharp && share > 0.45 && all_kinds(0.25)) || (crisp && share > 0.85 && all_kinds(0.5))
}

impl<'a> Hunt<'a> {
    /// Begin with nothing.
    pub fn new(registrar: &'a Registrar, outlined: &'a Outlined, pattern: &'a Pattern, view: &'a View) -> Self {
        Self { registrar, outlined, pattern, view, best: None, starts: 0 }
    }

    /// Try what is likely first, until a theta is accepted.
    pub fn run(&mut self, last: Option<&[f64]>, seed: u64) {
        let identity = self.registrar.start().to_vec();
        if let Some(last) = last
            && self.contour(last, Schedule::TRACK, "last")
        {
            return;
        }
        if self.registrar.given && last.is_none() {
            let accepted = self.contour(&identity, Schedule::TRACK, "start");
            // Who gives a start knows where the pattern is: periodic ones fit nearly as well elsewhere.
            let near = self.best.as_ref().is_some_and(|(_, best, _)| best.share * best.visible > NEAR_START);
            if accepted || near {
                return;
            }
        }
        let begin = last.map_or_else(|| identity.clone(), <[f64]>::to_vec);
        let mut disturbed = Disturbed::new(self.registrar, self.pattern, seed);
        let centred = disturbed.centred(&begin, self.view);
        // Regions: as far as they are seen where parts are hidden or outside the frame, then as if they were whole.
        for seen in [true, false] {
            if seen && self.view.partly.is_none() {
                continue;
            }
            if self.moments(&begin, seen, "moments") || self.moments(&centred, seen, "moments-centred") {
                return;
            }
        }
        let visible = self.view.partly.is_some();
        // Any turn and tilt, where the pattern is seen as a whole.
        let anywhere = if visible { Vec::new() } else { self.registrar.whitened(self.pattern, self.view) };
        if anywhere.iter().any(|start| self.moments(start, false, "moments-whitened")) {
            return;
        }
        for k in [4, 2, 6, 1, 7, 3, 5] {
            let start = disturbed.turned(&centred, f64::from(k) * std::f64::consts::FRAC_PI_4);
            if self.moments(&start, visible, "moments-turned") {
                return;
            }
        }
        for k in 0..MOMENT_STARTS {
            let base = if k % 2 == 0 { &centred } else { &identity };
            let start = disturbed.near(base, if k < 6 { 1.0 } else { 1.6 });
            if self.moments(&start, visible, "moments-disturbed") {
                return;
            }
        }
        let by_moments = self.best.as_ref().map_or_else(|| identity.clone(), |(theta, ..)| theta.clone());
        for start in [&identity, &by_moments] {
            if self.contour(start, Schedule::FAR, "contour") {
                return;
            }
        }
        // Half planes of the reference left out: the moments of the rest tell which part is hidden.
        let parts = self.registrar.by_parts(self.pattern, self.view, &centred);
        for start in &parts {
            if self.contour(start, Schedule::FAR, "parts") {
                return;
            }
        }
        let coarse = self.registrar.coarse(self.pattern);
        let Some(coarse) = coarse else { return };
        for k in 0..CONTOUR_STARTS {
            let best = self.best.as_ref().map_or_else(|| begin.clone(), |(theta, ..)| theta.clone());
            let (base, scale) = match k % 5 {
                0 => (&by_moments, 1.2),
                1 => (&best, 0.6),
                2 => (&centred, 1.2),
                3 => (&begin, 1.2),
                _ => (parts.get(k / 5 % parts.len().max(1)).unwrap_or(&begin), 0.8),
            };
            let start = disturbed.near(base, scale);
            if self.screened(&coarse, &start, "contour-disturbed") {
                return;
            }
        }
    }

    /// Look for a theta about the best one that explains the frame clearly better: a fit may rest beside the pattern, most of all where
    /// parts of the contour are missing. Say whether one was found.
    pub fn improve(&mut self, rivals: &[Rival], seed: u64) -> bool {
        let Some((theta, mut best, _)) = self.best.clone() else { return false };
        let mut disturbed = Disturbed::new(self.registrar, self.pattern, seed);
        let mut starts = disturbed.tilted(&theta);
        // The fit of a tilt that the model implies may rest beside it as well.
        starts.extend(rivals.iter().flat_map(|rival| disturbed.tilted(&rival.theta)));
        starts.extend((0..IMPROVED_STARTS).map(|k| disturbed.near(&theta, if k % 2 == 0 { 0.7 } else { 1.2 })));
        let mut improved = false;
        for start in &starts {
            self.starts += 1;
            let fit = |from: &[f64], schedule| {
                let fit = self.registrar.fit_outline(self.outlined, self.view, from, schedule)?;
                let plausible = self.registrar.is_plausible(self.pattern, &fit.theta);
                let quality = self.registrar.quality_of(self.outlined, self.pattern, self.view, &fit.theta);
                plausible.then_some((fit.theta, quality))
            };
            let Some((near, quality)) = fit(start, Schedule::ABOUT) else { continue };
            if !quality.promises(&best) {
                continue;
            }
            let Some((theta, quality)) = fit(&near, Schedule::NEAR).filter(|(_, quality)| quality.beats(&best)) else {
                continue;
            };
            self.best = Some((theta, quality, "improved"));
            (best, improved) = (quality, true);
            if quality.is_settled() {
                break;
            }
        }
        improved
    }

    /// Find a theta by moments and finish it by the contour; say whether it is accepted.
    fn moments(&mut self, start: &[f64], seen: bool, by: &'static str) -> bool {
        let found = self.registrar.by_moments(self.pattern, self.view, start, seen);
        match found {
            Some((theta, _)) if self.registrar.is_plausible(self.pattern, &theta) => {
                self.contour(&theta, Schedule::NEAR, by)
            }
            _ => false,
        }
    }

    /// Fit a few places of the contour from a theta, and all of them where that is promising; say whether the result is accepted.
    pub fn screened(&mut self, coarse: &Outlined, start: &[f64], by: &'static str) -> bool {
        let fit = self.registrar.fit_outline(coarse, self.view, start, Schedule::SCREEN);
        let share = fit.as_ref().and_then(|fit| {
            let found = self.registrar.search(coarse, self.view, &fit.theta, 3.0)?;
            let near = found.distances.iter().filter(|distance| distance.abs() < 1.5).count();
            Some(near as f64 / found.distances.len() as f64)
        });
        match fit {
            Some(fit) if share.is_some_and(|share| share > PROMISING) => self.contour(&fit.theta, Schedule::NEAR, by),
            _ => {
                self.starts += 1;
                false
            }
        }
    }

    /// Fit the contour from a theta and keep the result if it is better; say whether it is accepted.
    pub fn contour(&mut self, start: &[f64], schedule: Schedule, by: &'static str) -> bool {
        self.starts += 1;
        let fit = self.registrar.fit_outline(self.outlined, self.view, start, schedule);
        let Some(fit) = fit.filter(|fit| self.registrar.is_plausible(self.pattern, &fit.theta)) else { return false };
        let quality = self.registrar.quality_of(self.outlined, self.pattern, self.view, &fit.theta);
        let accepted = accepts(self.pattern, self.view, &quality);
        if accepted || self.best.as_ref().is_none_or(|(_, best, _)| quality.score() > best.score()) {
            self.best = Some((fit.theta, quality, by));
        }
        accepted
    }
}
