//! Pixels of a calibrated camera to image points on the plane z = 1 and back.

mod file;
mod lens;
mod xml;
mod yaml;

use cfpose::homography::Intrinsics;
use cfpose::{Points, PointsError};

pub(crate) use file::parse_camera;
pub use file::read_camera;
pub use lens::Lens;

/// A camera: u = fx x' + cx, v = fy y' + cy where the lens moves (x / z, y / z) to (x', y'); x right, y down, z forward, pixel
/// centres at integers. Without a lens it is the pinhole camera.
///
/// ```
/// use cfpose::Points;
/// use cfpose_vision::Camera;
/// let camera = Camera::new(500.0, 250.0, 320.0, 240.0).unwrap();
/// let image = camera.normalise(&Points::from_rows(&[[820.0, 240.0], [320.0, 490.0]]).unwrap()).unwrap();
/// assert_eq!((image.point(0)[..2].to_vec(), image.point(1)[..2].to_vec()), (vec![1.0, 0.0], vec![0.0, 1.0]));
/// assert!(Camera::new(0.0, 1.0, 0.0, 0.0).is_none());
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera(Intrinsics, Lens, Option<[usize; 2]>);

impl Camera {
    /// The camera that leaves image points as they are.
    pub const IDENTITY: Self = Self(Intrinsics { fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0 }, Lens::None, None);

    /// Return the focal length in pixels, the geometric mean of both.
    ///
    /// ```
    /// assert_eq!(cfpose_vision::Camera::new(400.0, 900.0, 0.0, 0.0).unwrap().focal(), 600.0);
    /// ```
    pub fn focal(self) -> f64 {
        (self.0.fx * self.0.fy).sqrt()
    }

    /// Make a camera of focal lengths and principal point, all in pixels; `None` when a number is not finite or a focal
    /// length is not positive.
    pub fn new(fx: f64, fy: f64, cx: f64, cy: f64) -> Option<Self> {
        let valid = [fx, fy, cx, cy].iter().all(|v| v.is_finite()) && fx > 0.0 && fy > 0.0;
        valid.then_some(Self(Intrinsics { fx, fy, cx, cy }, Lens::None, None))
    }

    /// Put a lens before the camera.
    ///
    /// ```
    /// use cfpose::Points;
    /// use cfpose_vision::{Camera, Lens};
    /// let bare = Camera::new(500.0, 500.0, 320.0, 240.0).unwrap();
    /// let camera = bare.with_lens(Lens::polynomial(&[-0.2, 0.05, 0.0, 0.0]).unwrap());
    /// let ray = Points::from_rows(&[[0.5, 0.0]]).unwrap();
    /// // r' = r (1 - 0.2 r^2 + 0.05 r^4) = 0.4765625
    /// let pixels = camera.project(&ray).unwrap();
    /// assert!((pixels.point(0)[0] - (500.0 * 0.476_562_5 + 320.0)).abs() < 1e-12);
    /// assert!((camera.normalise(&pixels).unwrap().point(0)[0] - 0.5).abs() < 1e-13);
    /// ```
    #[must_use]
    pub fn with_lens(self, lens: Lens) -> Self {
        Self(self.0, lens, self.2)
    }

    /// State for which width and height of images, in pixels, the numbers hold.
    #[must_use]
    pub fn with_size(self, size: Option<[usize; 2]>) -> Self {
        Self(self.0, self.1, size)
    }

    /// Return the camera for images of a size: the same where it is the one that the numbers hold for or none is known, scaled where one is
    /// an exact multiple of the other.
    ///
    /// # Errors
    /// One sentence that names both sizes.
    ///
    /// ```
    /// let camera = cfpose_vision::Camera::new(600.0, 600.0, 319.5, 239.5).unwrap().with_size(Some([640, 480]));
    /// // Pixel centres at integers: the corner of the image at -0.5 stays where it is.
    /// assert_eq!(camera.for_size(320, 240).unwrap().intrinsics().cx, 159.5);
    /// assert!(camera.for_size(640, 360).unwrap_err().contains("640 x 480"));
    /// ```
    pub fn for_size(self, width: usize, height: usize) -> Result<Self, String> {
        let Some([w, h]) = self.2 else { return Ok(self) };
        let whole = |a: usize, b: usize| a > 0 && b.is_multiple_of(a);
        let same = w * height == h * width;
        if !same || !(whole(w, width) || whole(width, w)) {
            return Err(format!(
                "the image has {width} x {height} pixels, the camera was calibrated for {w} x {h}; give the camera of this size"
            ));
        }
        let scale = width as f64 / w as f64;
        let k = self.0;
        let moved = |c: f64| (c + 0.5) * scale - 0.5;
        let k = Intrinsics { fx: k.fx * scale, fy: k.fy * scale, cx: moved(k.cx), cy: moved(k.cy) };
        Ok(Self(k, self.1, Some([width, height])))
    }

    /// Return the lens.
    pub fn lens(&self) -> Lens {
        self.1
    }

    /// Return the numbers.
    pub fn intrinsics(&self) -> Intrinsics {
        self.0
    }

    /// Return the pixel in which a place of the plane z = 1 is seen.
    #[inline]
    pub fn pixel_of(self, place: [f64; 2]) -> [f64; 2] {
        let [x, y] = self.1.distort(place);
        [self.0.fx * x + self.0.cx, self.0.fy * y + self.0.cy]
    }

    /// Return the place of the plane z = 1 that is seen in a pixel; `None` where the lens shows none.
    #[inline]
    pub fn place_of(self, pixel: [f64; 2]) -> Option<[f64; 2]> {
        self.1.undistort([(pixel[0] - self.0.cx) / self.0.fx, (pixel[1] - self.0.cy) / self.0.fy])
    }

    /// Return the points (x, y) of pixels (u, v), weights with them: ((u - cx) / fx, (v - cy) / fy) where there is no lens.
    ///
    /// # Errors
    /// [`PointsError::Dimension`] for points that are not 2-D, [`PointsError::NotFinite`] on overflow and for a pixel that the lens
    /// shows no point in front of the camera in (the row, value NaN).
    pub fn normalise(&self, pixels: &Points) -> Result<Points, PointsError> {
        if pixels.dim() != 2 {
            return Err(PointsError::Dimension { dim: pixels.dim() });
        }
        let seen = pixels.column(0).iter().zip(pixels.column(1));
        let seen = seen.map(|(u, v)| [(u - self.0.cx) / self.0.fx, (v - self.0.cy) / self.0.fy]);
        let (x, y) = seen.map(|point| self.1.undistort(point).unwrap_or([f64::NAN; 2])).map(|[x, y]| (x, y)).unzip();
        rebuild(vec![x, y], pixels)
    }

    /// Return the pixels of image points (x, y) or of rays (x, y, z), weights with them.
    ///
    /// # Errors
    /// [`PointsError::Dimension`] for 1-D points, [`PointsError::NotFinite`] (the row, value NaN) for a ray that does not
    /// point forward.
    pub fn project(&self, points: &Points) -> Result<Points, PointsError> {
        if points.dim() < 2 {
            return Err(PointsError::Dimension { dim: points.dim() });
        }
        let depth = |k: usize| match points.dim() {
            2 => 1.0,
            _ if points.column(2)[k] > 0.0 => points.column(2)[k],
            _ => f64::NAN,
        };
        let ahead = |k: usize| [0, 1].map(|d| points.column(d)[k] / depth(k));
        let seen = (0..points.len()).map(|k| self.1.distort(ahead(k)));
        let (u, v) = seen.map(|[x, y]| (self.0.fx * x + self.0.cx, self.0.fy * y + self.0.cy)).unzip();
        rebuild(vec![u, v], points)
    }
}

/// Make points of new coordinates with the weights of others.
fn rebuild(columns: Vec<Vec<f64>>, like: &Points) -> Result<Points, PointsError> {
    let points = match like.is_uniform() {
        true => Points::from_columns(columns),
        false => Points::weighted(columns, like.weights().to_vec()),
    }?;
    Ok(if like.is_in_curve_order() { points.in_curve_order() } else { points })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_of_image_points_are_the_pixels_they_came_from() {
        let camera = Camera::new(700.0, 710.0, 311.5, 242.25).unwrap();
        let pixels = Points::weighted(vec![vec![0.0, 639.0], vec![3.5, 479.0]], vec![1.0, 2.0]).unwrap();
        let back = camera.project(&camera.normalise(&pixels).unwrap()).unwrap();
        for k in 0..2 {
            for d in 0..2 {
                assert!((back.column(d)[k] - pixels.column(d)[k]).abs() < 1e-12);
            }
        }
        assert_eq!(back.weights(), pixels.weights());
    }

    #[test]
    fn a_ray_behind_the_camera_is_an_error_that_names_the_row() {
        let rays = Points::from_rows(&[[0.0, 0.0, 1.0], [0.0, 0.1, -1.0]]).unwrap();
        let error = Camera::IDENTITY.project(&rays).unwrap_err();
        assert!(matches!(error, PointsError::NotFinite { row: 2, .. }), "{error}");
    }
}
