//! A renderer whose images are exact: what tests of the registration compare with.
//!
//! A scene is a stack of plane polygons of one grey each, seen through a homography. Coverage is the exact area of the polygon in each
//! pixel; then light gradient, motion, defocus, noise and the transfer function follow in the order of a camera.

mod cover;
mod effects;

use rand_chacha::ChaCha12Rng;

use crate::picture::{Picture, Transfer};
use crate::raster::Raster;

pub use cover::coverage;
pub(crate) use cover::winding;

/// A closed polygon of one grey, painted over what is there.
#[derive(Debug, Clone, PartialEq)]
pub struct Patch {
    /// Corners in pixels of the image.
    pub polygon: Vec<[f64; 2]>,
    /// Light, from 0 to 255.
    pub grey: f64,
}

/// What happens to the light between scene and file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exposure {
    /// Light of the background, 0 to 255.
    pub background: f64,
    /// Relative change of light from the centre to the image's border, in a random direction.
    pub gradient: f64,
    /// Length of a straight motion in a random direction, pixels.
    pub motion: f64,
    /// Standard deviation of the defocus, pixels.
    pub blur: f64,
    /// Standard deviation of the noise, in units of 0 to 255.
    pub noise: f64,
    /// Factor on all light: above 1 the brightest parts are cut off at 255.
    pub gain: f64,
    /// How light is written.
    pub transfer: Transfer,
}

impl Default for Exposure {
    /// A sharp, evenly lit image with a little noise.
    fn default() -> Self {
        Self {
            background: 200.0,
            gradient: 0.0,
            motion: 0.0,
            blur: 0.7,
            noise: 2.0,
            gain: 1.0,
            transfer: Transfer::Linear,
        }
    }
}

/// Paint patches, later ones over earlier ones, and take a picture of them. Drawn from `rng` in this order: direction of the gradient
/// and of the motion where there are any, noise row by row.
///
/// ```
/// use cfpose_vision::{Exposure, Patch, render};
/// use rand_chacha::rand_core::SeedableRng;
/// let square = Patch { polygon: vec![[10.25, 10.0], [30.25, 10.0], [30.25, 30.0], [10.25, 30.0]], grey: 60.0 };
/// let still = Exposure { blur: 0.0, noise: 0.0, ..Exposure::default() };
/// let mut rng = rand_chacha::ChaCha12Rng::seed_from_u64(1);
/// let picture = render(48, 40, &[square], &still, &mut rng);
/// // Pixel 10 reaches from 9.5 to 10.5: a quarter of it is covered, 200 - 140 / 4.
/// let light = picture.light(cfpose_vision::Transfer::Linear);
/// assert_eq!((light.at(10, 20) * 255.0).round(), 165.0);
/// ```
pub fn render(width: usize, height: usize, patches: &[Patch], exposure: &Exposure, rng: &mut ChaCha12Rng) -> Picture {
    let mut light = Raster::filled(width, height, exposure.background as f32);
    for patch in patches {
        let cover = coverage(&patch.polygon, width, height);
        for (value, share) in light.values_mut().iter_mut().zip(cover.values()) {
            *value += share * (patch.grey as f32 - *value);
        }
    }
    effects::expose(light, exposure, rng)
}
