//! The next frame of a sequence: what lies about the last contour, and the whole frame only where that does not settle it.

use std::sync::Arc;

use cfpose::PointsError;

use super::fit::Schedule;
use super::hunt::accepts;
use super::pattern::{Outline, Pattern};
use super::registrar::{Outlined, Registered, Registrar};
use super::sight::{ALIKE, Shown, Sight};
use super::verdict::{FrameVerdict, SUPPORT};
use super::view::View;
use crate::camera::Camera;
use crate::options::Foreground;
use crate::raster::Raster;
use crate::segment::{SegmentError, SegmentOptions, segment, sparse};

/// Every so many places of the outline find the way, more apart where it has more places than a plain pattern.
const COARSE: usize = 4;
const PLACES: usize = 120;

/// Standard deviation of an edge from which the frame has to be smoothed, pixels: twice what a frame on its own is smoothed from, for the
/// pose of a frame of a sequence is wanted at once.
const MOST_NOISE: f64 = 0.16;

/// Another tilt with a residual within this factor is looked at again on the whole frame.
const NEAR: f64 = 3.0;

/// Why a frame has no pose.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Missed {
    /// It shows no pattern.
    #[error(transparent)]
    Segment(#[from] SegmentError),
    /// Its camera shows nothing at a pixel of the region.
    #[error(transparent)]
    Points(#[from] PointsError),
    /// No start led anywhere.
    #[error("no pose brings the contour onto edges of the frame")]
    NoPose,
}

impl Registrar {
    /// Register the light of a frame. From `last`, the theta of the frame before, only the pixels about the contour and a lattice of
    /// others are looked at; where that does not explain the frame, or there is no `last`, the frame is segmented and
    /// [`Registrar::register`] hunts for a theta.
    ///
    /// # Errors
    /// [`Missed`].
    pub fn follow(
        &self,
        pattern: &Pattern,
        light: Arc<Raster>,
        look: &SegmentOptions,
        camera: Camera,
        last: Option<&[f64]>,
        seed: u64,
    ) -> Result<Registered, Missed> {
        let plain = pattern.dark && look.threshold.is_none() && look.foreground != Foreground::Bright;
        if let Some(last) = last.filter(|_| plain)
            && let Some(found) = self.track(pattern, Arc::clone(&light), camera, last)
        {
            return Ok(found);
        }
        let options = pattern.look(look);
        let view = View::new(&segment(&light, &options)?, camera)?;
        self.register(pattern, &view, last, seed).ok_or(Missed::NoPose)
    }

    /// Follow the contour from a theta; `None` where the frame has to be looked at as a whole.
    pub fn track(&self, pattern: &Pattern, light: Arc<Raster>, camera: Camera, last: &[f64]) -> Option<Registered> {
        let sparse = sparse::look(&light, pattern.level?)?;
        let noise = f64::from(sparse.noise);
        let sight =
            Sight { field: Shown::Asked(light, sparse), alike: ALIKE, shift: 0.0, camera, noise, pixel_noise: noise };
        let outlined = self.outlined(pattern).ok()?;
        let coarse = self.coarse(pattern)?;
        let near = self.fit_outline(&coarse, &sight, last, Schedule::FOLLOW)?;
        let fit = self.fit_outline(&outlined, &sight, &near.theta, Schedule::SETTLE)?;
        let theta = Some(fit.theta).filter(|theta| self.is_plausible(pattern, theta))?;
        let quality = self.quality_of(&outlined, pattern, &sight, &theta);
        if quality.expected > MOST_NOISE || !accepts(pattern, &sight, &quality) {
            return None;
        }
        let rivals = self.rivals(&coarse, pattern, &sight, &pattern.points[0], &theta, Schedule::TILT_FOLLOWED);
        if rivals.first().is_some_and(|rival| rival.ratio < NEAR) {
            return None;
        }
        let covariance = self.covariance(&outlined, &sight, &theta, &quality);
        let (verdict, why) = FrameVerdict::of(&quality, true, None, SUPPORT);
        Some(Registered {
            theta,
            quality,
            verdict,
            covariance,
            rivals,
            starts: 1,
            by: "followed",
            warnings: why.into_iter().collect(),
        })
    }

    /// Return an outline of few places.
    pub(super) fn coarse(&self, pattern: &Pattern) -> Option<Outlined> {
        self.coarse_of(&pattern.outline)
    }

    /// Return few places of an outline.
    pub(super) fn coarse_of(&self, outline: &Outline) -> Option<Outlined> {
        self.outlined_of(outline, COARSE.max(outline.places.len() / PLACES)).ok()
    }
}
