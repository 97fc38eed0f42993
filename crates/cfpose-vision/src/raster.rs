//! A grid of numbers over the pixels of an image.

/// One number a pixel, row by row; pixel centres at integers, x to the right and y down.
///
/// ```
/// use cfpose_vision::Raster;
/// let ramp = Raster::from_fn(3, 2, |x, y| (x + 10 * y) as f32);
/// assert_eq!(ramp.at(2, 1), 12.0);
/// assert_eq!(ramp.sample(0.5, 0.25), Some(3.0));
/// assert_eq!(ramp.sample(2.1, 0.0), None);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Raster {
    width: usize,
    height: usize,
    values: Vec<f32>,
}

impl Raster {
    /// Make a raster of one value.
    pub fn filled(width: usize, height: usize, value: f32) -> Self {
        Self { width, height, values: vec![value; width * height] }
    }

    /// Make a raster of a function of the pixel's column and row.
    pub fn from_fn(width: usize, height: usize, mut value: impl FnMut(usize, usize) -> f32) -> Self {
        let mut values = Vec::with_capacity(width * height);
        for y in 0..height {
            values.extend((0..width).map(|x| value(x, y)));
        }
        Self { width, height, values }
    }

    /// Make a raster of values row by row; `None` where their number is not width x height.
    pub fn from_values(width: usize, height: usize, values: Vec<f32>) -> Option<Self> {
        (values.len() == width * height).then_some(Self { width, height, values })
    }

    /// Return the number of columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Return the number of rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Return all values, row by row.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Return all values, row by row, to be changed.
    pub fn values_mut(&mut self) -> &mut [f32] {
        &mut self.values
    }

    /// Return the value of a pixel.
    ///
    /// # Panics
    /// Outside the raster.
    #[inline]
    pub fn at(&self, x: usize, y: usize) -> f32 {
        self.values[y * self.width + x]
    }

    /// Return a row.
    pub fn row(&self, y: usize) -> &[f32] {
        &self.values[y * self.width..(y + 1) * self.width]
    }

    /// Return a row, to be changed.
    pub fn row_mut(&mut self, y: usize) -> &mut [f32] {
        &mut self.values[y * self.width..(y + 1) * self.width]
    }

    /// Interpolate between the four pixels around a place; `None` outside the centres of the outermost pixels.
    #[inline]
    pub fn sample(&self, x: f64, y: f64) -> Option<f64> {
        let ([a, b, c, d], [u, v]) = self.around(x, y)?;
        let (top, bottom) = (a + u * (b - a), c + u * (d - c));
        Some(top + v * (bottom - top))
    }

    /// Return value and derivatives along x and y of the interpolation of [`Raster::sample`].
    #[inline]
    pub fn slope(&self, x: f64, y: f64) -> Option<[f64; 3]> {
        let ([a, b, c, d], [u, v]) = self.around(x, y)?;
        let (top, bottom) = (a + u * (b - a), c + u * (d - c));
        Some([top + v * (bottom - top), (b - a) + v * ((d - c) - (b - a)), bottom - top])
    }

    #[inline]
    fn around(&self, x: f64, y: f64) -> Option<([f64; 4], [f64; 2])> {
        let inside = x >= 0.0 && y >= 0.0 && x <= (self.width as f64 - 1.0) && y <= (self.height as f64 - 1.0);
        if !inside || self.width < 2 || self.height < 2 {
            return None;
        }
        let (left, top) = ((x as usize).min(self.width - 2), (y as usize).min(self.height - 2));
        let at = top * self.width + left;
        let cell = [at, at + 1, at + self.width, at + self.width + 1].map(|k| f64::from(self.values[k]));
        Some((cell, [x - left as f64, y - top as f64]))
    }

    /// Smooth by [1, 4, 6, 4, 1] / 16 along both axes: a Gaussian of standard deviation 1 pixel. Values are repeated beyond the border.
    #[must_use]
    pub fn smoothed(&self) -> Self {
        const TAPS: [f32; 5] = [1.0 / 16.0, 4.0 / 16.0, 6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0];
        self.convolved(&TAPS)
    }

    /// Convolve with odd symmetric taps along both axes; values are repeated beyond the border.
    #[must_use]
    pub fn convolved(&self, taps: &[f32]) -> Self {
        let (w, h, reach) = (self.width, self.height, taps.len() / 2);
        let mut across = Self::filled(w, h, 0.0);
        let mut padded = vec![0.0; w + 2 * reach];
        for y in 0..h {
            let row = self.row(y);
            let (first, last) = (row[0], row[w - 1]);
            padded[..reach].fill(first);
            padded[reach..reach + w].copy_from_slice(row);
            padded[reach + w..].fill(last);
            let out = across.row_mut(y);
            for (k, tap) in taps.iter().enumerate() {
                out.iter_mut().zip(&padded[k..k + w]).for_each(|(sum, value)| *sum += tap * value);
            }
        }
        let mut down = Self::filled(w, h, 0.0);
        for y in 0..h {
            let out = &mut down.values[y * w..(y + 1) * w];
            for (k, tap) in taps.iter().enumerate() {
                let from = (y + k).saturating_sub(reach).min(h - 1);
                out.iter_mut().zip(across.row(from)).for_each(|(sum, value)| *sum += tap * value);
            }
        }
        down
    }

    /// Smooth by a sampled Gaussian of a standard deviation in pixels, cut at 4 of them; values are repeated beyond the border.
    #[must_use]
    pub fn gaussian(&self, deviation: f64) -> Self {
        let reach = (4.0 * deviation).ceil() as i32;
        let weight = |k: i32| (-0.5 * (f64::from(k) / deviation).powi(2)).exp();
        let total: f64 = (-reach..=reach).map(weight).sum();
        let taps: Vec<f32> = (-reach..=reach).map(|k| (weight(k) / total) as f32).collect();
        self.convolved(&taps)
    }
}
