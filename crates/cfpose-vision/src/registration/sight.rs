//! What the contour needs of a frame: numbers over its places, and how sure they are.

use std::sync::Arc;

use super::edges::Field;
use crate::camera::Camera;
use crate::raster::Raster;
use crate::segment::sparse::Sparse;

/// Coverage over a frame.
#[derive(Debug, Clone)]
pub enum Shown {
    /// Of all pixels, NaN where something else hides the pattern.
    All(Raster),
    /// Darkness of all pixels: the missing share of the background's light.
    Greys(Raster),
    /// Light, and what it is divided by where it is asked for.
    Asked(Arc<Raster>, Sparse),
}

impl Shown {
    /// Say whether it holds several greys, not the coverage by one.
    pub fn is_greys(&self) -> bool {
        matches!(self, Self::Greys(_))
    }

    /// Return the number of columns.
    pub fn width(&self) -> usize {
        match self {
            Self::All(raster) | Self::Greys(raster) => raster.width(),
            Self::Asked(light, _) => light.width(),
        }
    }

    /// Return the number of rows.
    pub fn height(&self) -> usize {
        match self {
            Self::All(raster) | Self::Greys(raster) => raster.height(),
            Self::Asked(light, _) => light.height(),
        }
    }

    /// Return the distance between the pixels at which regions are compared.
    pub(super) fn stride(&self) -> usize {
        match self {
            Self::All(_) | Self::Greys(_) => 2,
            Self::Asked(light, _) => ((light.width() * light.height()) as f64 / 5000.0).sqrt().ceil().max(2.0) as usize,
        }
    }

    /// Return the coverage of a pixel from 0 to 1, exactly 0 and 1 where noise may be all that differs from it.
    pub(super) fn at(&self, x: usize, y: usize) -> f64 {
        match self {
            Self::All(raster) | Self::Greys(raster) => f64::from(raster.at(x, y)),
            Self::Asked(light, sparse) => {
                let value = sparse.coverage(light, x as f64, y as f64).unwrap_or(0.0);
                let noise = (4.0 * f64::from(sparse.noise)).min(0.4);
                if value < noise {
                    0.0
                } else if value > 1.0 - noise {
                    1.0
                } else {
                    value
                }
            }
        }
    }
}

impl Field for Shown {
    #[inline]
    fn sample(&self, x: f64, y: f64) -> Option<f64> {
        match self {
            Self::All(raster) | Self::Greys(raster) => raster.sample(x, y),
            Self::Asked(light, sparse) => sparse.coverage(light, x, y),
        }
    }
}

/// A frame as the contour sees it.
#[derive(Debug, Clone)]
pub struct Sight {
    /// Where edges are searched.
    pub field: Shown,
    /// Pixels over which neighbouring edges have alike noise.
    pub alike: f64,
    /// Standard deviation of a shift of all edges alike: over-exposure.
    pub shift: f64,
    /// Its camera.
    pub camera: Camera,
    /// Standard deviation of the coverage by noise.
    pub noise: f64,
    /// The same of one pixel before any smoothing.
    pub pixel_noise: f64,
}

/// Pixels over which neighbouring edges have alike noise where nothing is smoothed.
pub(super) const ALIKE: f64 = 2.0;
