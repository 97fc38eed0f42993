//! A model joined with its stages, and the order in which things are tried.

use std::sync::Arc;

use cfpose::family::DynFamily;
use cfpose::free::Freedom;
use cfpose::model::{HomographyOf, TargetSide};
use cfpose::{BuildContext, Model, PointsError, Registry};
use cfpose_optim::Manifold;

use super::fit::Schedule;
use super::hunt::{Hunt, accepts};
use super::mapper::Mapper;
use super::pattern::{Outline, Pattern};
use super::quality::Quality;
use super::verdict::{FrameVerdict, SUPPORT, SUPPORT_OF_GREYS};
use super::view::View;

/// Families of the stages of [`Registrar::by_moments`]: coarse points for the first two. The damping is exp(-0.15 |k|^2 / 2).
const FAMILIES: [&str; 3] = [
    "fourier[k=1,w0=1.2,damping=0.32275]",
    "fourier[k=2,w0=1.2,damping=0.32275]",
    "fourier[k=4,w0=1.2,damping=0.32275]",
];

/// Standard deviation of an edge from which a frame is smoothed for the last fit, pixels.
const NOISY: f64 = 0.08;

/// Standard deviation of the blur from which the last fit compares with the blurred reference, pixels.
const BLURRED: f64 = 1.2;

/// What is said where a shift fits as well.
const REPEATED: &str = "the pattern repeats itself, and shifted by one of its periods it fits nearly as well";

/// Why a registrar cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RegistrarError {
    /// The model.
    #[error(transparent)]
    Model(#[from] cfpose::Error),
    /// A model that maps no plane to a plane.
    #[error(
        "model `{0}` maps no image to an image; use plane-bearing, homography, plane-homography, affine2, similarity2 or rigid2"
    )]
    NotPlanar(String),
}

/// A transformation model, made ready for patterns and frames.
pub struct Registrar {
    /// Model without area elements: contours.
    pub(super) model: Arc<Model>,
    /// Name with area elements: regions.
    pub(super) region_model: String,
    pub(super) registry: Registry,
    pub(super) families: Vec<Arc<dyn DynFamily>>,
    pub(super) homography: HomographyOf,
    free: Option<Vec<usize>>,
    start: Vec<f64>,
    /// Whether the start was given, and is nearer than the identity.
    pub(super) given: bool,
}

/// An outline under a model.
pub(super) struct Outlined {
    pub places: Mapper,
    pub ahead: Mapper,
    pub levels: Vec<super::edges::Levels>,
    /// Standard deviation of a place by the reference's own noise, and distance between neighbours, pixels of the reference.
    pub deviation: f64,
    pub spacing: f64,
}

/// Another theta that was examined.
#[derive(Debug, Clone, PartialEq)]
pub struct Rival {
    /// Ambient theta.
    pub theta: Vec<f64>,
    /// Root mean square distance of its edges over that of the best theta.
    pub ratio: f64,
}

/// What came out for a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Registered {
    /// Ambient theta.
    pub theta: Vec<f64>,
    /// How well it explains the frame.
    pub quality: Quality,
    /// Verdict.
    pub verdict: FrameVerdict,
    /// Covariance of the tangent step at theta, row by row.
    pub covariance: Vec<f64>,
    /// Other thetas that the model implies, nearest in residual first.
    pub rivals: Vec<Rival>,
    /// Number of starts that were tried.
    pub starts: usize,
    /// What led to it.
    pub by: &'static str,
    /// One sentence each.
    pub warnings: Vec<String>,
}

impl Registrar {
    /// Build a model by its name, without parameters. `free` are the tangent columns that move (all when `None`), `start` the ambient theta
    /// from which the first frame begins (the model's identity when `None`).
    ///
    /// # Errors
    /// [`RegistrarError`].
    pub fn new(
        registry: &Registry,
        model: &str,
        free: Option<Vec<usize>>,
        start: Option<Vec<f64>>,
    ) -> Result<Self, RegistrarError> {
        let entry = registry.models.iter().find(|entry| entry.name == model);
        let has = |name: &str| entry.is_some_and(|entry| entry.parameters.iter().any(|p| p.name == name));
        let with = |area: bool| {
            let parts = [has("relation").then_some("relation=plane"), (area && has("area")).then_some("area=on")];
            let parts: Vec<&str> = parts.into_iter().flatten().collect();
            if parts.is_empty() { model.to_string() } else { format!("{model}[{}]", parts.join(",")) }
        };
        let context = BuildContext::default();
        let built = registry.model(&with(false), &context)?;
        let planar = built.dim() == 2 && matches!(built.target, TargetSide::Fixed(_));
        let Some(homography) = built.homography.filter(|_| planar) else {
            return Err(RegistrarError::NotPlanar(model.to_string()));
        };
        let context = BuildContext { dim: 2, ..context };
        let families: Result<Vec<_>, _> =
            FAMILIES.iter().map(|name| registry.family(name, &context).map(Arc::from)).collect();
        let given = start.is_some();
        let start = start.unwrap_or_else(|| built.identity.clone());
        Ok(Self {
            region_model: with(true),
            registry: registry.clone(),
            families: families?,
            homography,
            free,
            start,
            given,
            model: Arc::new(built),
        })
    }

    /// Return the model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Return the homography of a theta, from the plane z = 1 of the reference to that of the frame.
    pub fn homography(&self, theta: &[f64]) -> [f64; 9] {
        (self.homography)(theta)
    }

    /// Map the outline of a pattern into a frame, pixels; what is behind the camera is NaN.
    pub fn outline_in(&self, pattern: &Pattern, view_camera: crate::Camera, theta: &[f64]) -> Vec<[f64; 2]> {
        let Ok(outlined) = self.outlined(pattern) else { return Vec::new() };
        let mapped = outlined.places.at(theta, None);
        let places = mapped.x.iter().zip(&mapped.ahead);
        places.map(|(x, ahead)| if *ahead { view_camera.pixel_of(*x) } else { [f64::NAN; 2] }).collect()
    }

    /// Begin the first frame at a theta.
    #[must_use]
    pub fn starting_at(self, start: Vec<f64>) -> Self {
        Self { start, given: true, ..self }
    }

    /// Return the start of the first frame.
    pub fn start(&self) -> &[f64] {
        &self.start
    }

    /// Return the manifold on which a theta moves.
    pub(super) fn manifold_at(&self, theta: &[f64]) -> Arc<dyn Manifold> {
        match &self.free {
            Some(free) => Arc::new(Freedom::new(&self.model.layout, free, theta).manifold().clone()),
            None => Arc::new(self.model.layout.manifold().clone()),
        }
    }

    pub(super) fn outlined(&self, pattern: &Pattern) -> Result<Outlined, PointsError> {
        self.outlined_of(&pattern.outline, 1)
    }

    pub(super) fn outlined_of(&self, outline: &Outline, every: usize) -> Result<Outlined, PointsError> {
        let some = |places: &[[f64; 2]]| places.iter().copied().step_by(every).collect::<Vec<_>>();
        Ok(Outlined {
            places: Mapper::new(&self.model, &some(&outline.places))?,
            ahead: Mapper::new(&self.model, &some(&outline.ahead))?,
            levels: outline.levels.iter().copied().step_by(every).collect(),
            deviation: outline.deviation,
            spacing: outline.spacing * every as f64,
        })
    }

    /// Register a frame. `last` is the theta of the frame before, tried first; `seed` draws the disturbed starts.
    pub fn register(&self, pattern: &Pattern, view: &View, last: Option<&[f64]>, seed: u64) -> Option<Registered> {
        let outlined = self.outlined(pattern).ok()?;
        let by_greys = pattern.greys.as_ref().and_then(|greys| self.register_greys(greys, pattern, view, last, seed));
        // With most of the steps between greys the pattern is found, however far off its edges may be: one threshold tells no more.
        let is_found =
            |found: &&Registered| found.verdict.accepted() || found.quality.share * found.quality.visible > SUPPORT;
        if let Some(found) = by_greys.as_ref().filter(is_found) {
            return Some(found.clone());
        }
        let mut hunt = Hunt::new(self, &outlined, pattern, view);
        hunt.run(last, seed);
        let found = self.finished(hunt, seed);
        match (&pattern.greys, found) {
            (Some(greys), found) => self.of_both(greys, pattern, view, by_greys, found),
            (None, found) => found,
        }
    }

    /// Settle the best theta of a hunt: the other tilt, the last fit, covariance and verdict.
    pub(super) fn finished(&self, mut hunt: Hunt, seed: u64) -> Option<Registered> {
        let (outlined, pattern, view) = (hunt.outlined, hunt.pattern, hunt.view);
        let (theta, quality, _) = hunt.best.clone()?;
        let (theta, quality, repeated) = self.among_shifts(outlined, pattern, view, theta, quality);
        let (mut theta, mut quality, mut rivals) = self.tilts(outlined, pattern, view, theta, quality);
        let (mut settled, mut covariance, mut crisp) = self.settled(outlined, pattern, view, theta.clone(), &quality);
        if !crisp || (accepts(pattern, view, &quality) && !quality.is_settled()) {
            hunt.best = hunt.best.map(|(_, _, by)| (theta, quality, by));
            if hunt.improve(&rivals, seed) {
                (theta, quality, _) = hunt.best.clone()?;
                (theta, quality, rivals) = self.tilts(outlined, pattern, view, theta, quality);
                (settled, covariance, crisp) = self.settled(outlined, pattern, view, theta, &quality);
            }
        }
        let accepted = accepts(pattern, view, &quality);
        let (theta, starts, by) = (settled, hunt.starts, hunt.best.map_or("", |(_, _, by)| by));
        let support = if view.field.is_greys() { SUPPORT_OF_GREYS } else { SUPPORT };
        let ratio = if repeated { Some(1.0) } else { rivals.first().map(|rival| rival.ratio) };
        let (verdict, why) = FrameVerdict::of(&quality, accepted && crisp, ratio, support);
        // Of a pattern that repeats itself the ratio says nothing more.
        let why = why.filter(|_| !(repeated && verdict == FrameVerdict::Ambiguous));
        let warnings = repeated.then(|| REPEATED.to_string()).into_iter().chain(why).collect();
        Some(Registered { theta, quality, verdict, covariance, rivals, starts, by, warnings })
    }

    /// Fit once more on a smoothed frame where noise moves edges by more than a tenth of a pixel; return theta, its
    /// covariance, and whether the contour fits the smoothed frame as its smaller noise lets expect.
    fn settled(
        &self,
        outlined: &Outlined,
        pattern: &Pattern,
        view: &View,
        theta: Vec<f64>,
        quality: &Quality,
    ) -> (Vec<f64>, Vec<f64>, bool) {
        if quality.expected > NOISY {
            let smoothed = view.smoothed((0.7 * quality.blur).clamp(0.8, 2.5));
            let fit = self.fit_outline(outlined, &smoothed, &theta, Schedule::LAST);
            if let Some(fit) = fit.filter(|fit| self.is_plausible(pattern, &fit.theta)) {
                let quality = self.quality_of(outlined, pattern, &smoothed, &fit.theta);
                let fit = self.unblurred(outlined, pattern, &smoothed, fit.theta, &quality);
                let covariance = self.covariance(outlined, &smoothed, &fit, &quality);
                let most = 0.04 + 0.01 * quality.blur.powi(2) + 0.9 * quality.expected;
                return (fit, covariance, quality.median < most);
            }
        }
        let theta = self.unblurred(outlined, pattern, view, theta, quality);
        let covariance = self.covariance(outlined, view, &theta, quality);
        (theta, covariance, true)
    }

    /// Take the shifts of the edges by a considerable blur off.
    fn unblurred(
        &self,
        outlined: &Outlined,
        pattern: &Pattern,
        view: &View,
        theta: Vec<f64>,
        quality: &Quality,
    ) -> Vec<f64> {
        if quality.blur < BLURRED || view.field.is_greys() {
            return theta;
        }
        let fit = self.fit_blurred(outlined, pattern, view, &theta, quality.blur);
        fit.map(|fit| fit.theta).filter(|fit| self.is_plausible(pattern, fit)).unwrap_or(theta)
    }

    /// Return a theta whose fixed parameters are those of another.
    pub(super) fn held_at_start(&self, theta: &[f64], base: &[f64]) -> Vec<f64> {
        match &self.free {
            Some(free) => Freedom::new(&self.model.layout, free, base).hold(theta),
            None => theta.to_vec(),
        }
    }

    /// Say whether a theta shows the pattern from its front, whole before the camera and at a reasonable size.
    pub(super) fn is_plausible(&self, pattern: &Pattern, theta: &[f64]) -> bool {
        let h = (self.homography)(theta);
        let mean = pattern.points[0].mean();
        let depth = |x: f64, y: f64| h[6] * x + h[7] * y + h[8];
        let centre = depth(mean[0], mean[1]);
        let places = &pattern.outline.places;
        let ratio = places
            .iter()
            .map(|p| depth(p[0], p[1]) / centre)
            .fold((f64::INFINITY, 0.0_f64), |(a, b), r| (a.min(r), b.max(r)));
        // Signed change of area at the centre.
        let area = cfpose_optim::manifold::determinant3(&h) / centre.powi(3);
        centre != 0.0 && ratio.0 > 0.2 && ratio.1 < 5.0 && (0.02..30.0).contains(&area)
    }
}
