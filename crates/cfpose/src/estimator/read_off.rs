//! What can be read off a theta: who corresponds to whom, where points come to lie, the homography.

use cfpose_kernel::points::Points;

use super::Estimator;
use super::workbench::of_side;
use crate::distances::correspondence::{Correspondence, correspond, nearest_neighbours};
use crate::error::{Error, Side};
use crate::problem::{adapt, map_points};

impl Estimator {
    /// Return for each source point the index (from 0) of its nearest target point at theta.
    ///
    /// # Errors
    /// [`Error::Points`] when a mapped point is not finite.
    pub fn correspondence(&self, theta: &[f64]) -> Result<Vec<usize>, Error> {
        let (source, target) = self.mapped(theta)?;
        Ok(nearest_neighbours(&source, &target))
    }

    /// Match the points at theta, one to one for small sets, with statistics of the distances in the feature space.
    ///
    /// `threshold` is the distance up to which a pair is an inlier; `None` takes half the median spacing of the target.
    ///
    /// # Errors
    /// As [`Estimator::correspondence`].
    pub fn matches(&self, theta: &[f64], threshold: Option<f64>) -> Result<Correspondence, Error> {
        let (source, target) = self.mapped(theta)?;
        Ok(correspond(&source, &target, threshold))
    }

    /// Map all source points into the feature space of the last stage at theta, not normalised.
    ///
    /// # Errors
    /// As [`Estimator::correspondence`].
    pub fn mapped_source(&self, theta: &[f64]) -> Result<Points, Error> {
        if self.whole.source.len() == self.stages.data.source.len() {
            return self.stages.last().mapped_source(theta);
        }
        let (model, own) = (self.model(), &theta[..self.stages.last().own()]);
        let source = adapt(Side::Source, &self.parts.settings.model, model.source_points, &self.whole.source)?;
        let map = model.source.as_ref();
        map_points(map, &map.lift(&source), own, &self.parts.execution).map_err(of_side(Side::Source))
    }

    /// Map all points of both sides (source, target) into the feature space of the last stage at theta, not normalised.
    ///
    /// # Errors
    /// As [`Estimator::correspondence`].
    pub fn mapped(&self, theta: &[f64]) -> Result<(Points, Points), Error> {
        let (model, data) = (self.model(), &self.whole);
        let target = adapt(Side::Target, &self.parts.settings.model, model.target_points, &data.target)?;
        let (map, own) = (model.target.map(), &theta[..self.stages.last().own()]);
        let target = map_points(map, &map.lift(&target), own, &self.parts.execution).map_err(of_side(Side::Target))?;
        Ok((self.mapped_source(theta)?, target))
    }

    /// Return the homography (row by row) that a theta applies to image or plane points (x, y, 1) of the source, for models
    /// that do; [`crate::geometry::homography`] brings it into the units of the files and decomposes it.
    pub fn homography(&self, theta: &[f64]) -> Option<[f64; 9]> {
        self.model().homography.map(|matrix| matrix(theta))
    }
}
