//! A pattern of one colour on a background of another: the colour filter that tells them apart best.

use super::{Picture, Transfer};
use crate::raster::Raster;
use crate::segment::median;

/// Least saturation and value (HSV of the code values) of a pixel that has a hue.
const LEAST: [f32; 2] = [0.25, 0.08];

/// Fewest pixels of the hue, and of another.
const FEWEST: usize = 30;

/// Least light of the darker one through the filter, as a share of the brighter one's: light stays above zero, and mixes in proportion.
const DARKEST: f32 = 0.15;

/// Light of the brighter one through the filter.
const BRIGHT: f32 = 0.7;

/// Hues within a distance of one, degrees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hue {
    /// Middle: 0 red, 120 green, 240 blue.
    pub degrees: f32,
    /// Largest distance.
    pub width: f32,
}

/// Why a hue gives no filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum HueError {
    /// A grey image.
    #[error("the image has no colours; leave --hue out")]
    Grey,
    /// No pixels of the hue, or no others.
    #[error("{0} pixels have this hue; give another --hue or --hue-width")]
    Pixels(usize),
    /// Two colours that differ in nothing.
    #[error("the pattern's colour is that of the background")]
    Alike,
}

/// Weights of red, green and blue light: as an image through a colour filter, so that light and shade act on it as on grey.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Filter(pub [f32; 3]);

impl Filter {
    /// Find the filter for a hue on a reference: along the difference of both colours, where noise does least, turned towards grey as far as
    /// the darker one needs to stay above zero.
    ///
    /// ```
    /// use cfpose_vision::{Filter, Hue, Picture, Transfer};
    /// # let mut png = Vec::new();
    /// // A red square on green of the same brightness.
    /// let image = image::RgbImage::from_fn(60, 60, |x, y| {
    ///     image::Rgb(if (20..40).contains(&x) && (20..40).contains(&y) { [200, 60, 50] } else { [70, 120, 60] })
    /// });
    /// # image.write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png)?;
    /// let picture = Picture::decode(&png)?;
    /// let filter = Filter::for_hue(&picture, Hue { degrees: 0.0, width: 40.0 }, Transfer::Srgb)?;
    /// let seen = picture.through(&filter, Transfer::Srgb);
    /// assert!(seen.at(30, 30) > 2.0 * seen.at(5, 5));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`HueError`].
    pub fn for_hue(picture: &Picture, hue: Hue, transfer: Transfer) -> Result<Self, HueError> {
        if !picture.is_coloured() {
            return Err(HueError::Grey);
        }
        let (mut with, mut without) = (Vec::new(), Vec::new());
        let (w, h) = (picture.width(), picture.height());
        for k in 0..w * h {
            let codes = [0, 1, 2].map(|c| f32::from(picture.planes[c][k]) / 65535.0);
            let colour = codes.map(|code| transfer.light(code));
            if hue.has(codes) { &mut with } else { &mut without }.push(colour);
        }
        if with.len() < FEWEST || without.len() < FEWEST {
            return Err(HueError::Pixels(with.len()));
        }
        let middle = |colours: &[[f32; 3]]| {
            [0, 1, 2].map(|c| median(&mut colours.iter().map(|colour| colour[c]).collect::<Vec<_>>()).unwrap_or(0.0))
        };
        let (pattern, background) = (middle(&with), middle(&without));
        let (bright, dark) = if dot(pattern, pattern) > dot(background, background) {
            (pattern, background)
        } else {
            (background, pattern)
        };
        let along = [0, 1, 2].map(|c| bright[c] - dark[c]);
        let grey = [1.0; 3];
        // (along + a grey) . dark = DARKEST (along + a grey) . bright
        let missing = DARKEST * dot(along, bright) - dot(along, dark);
        let gained = dot(grey, dark) - DARKEST * dot(grey, bright);
        let weights = match missing > 0.0 {
            true if gained <= 1e-6 => grey,
            true => [0, 1, 2].map(|c| along[c] + missing / gained * grey[c]),
            false => along,
        };
        let top = dot(weights, bright);
        let apart = top - dot(weights, dark);
        if !(top > 1e-9 && apart > 0.02 * top) {
            return Err(HueError::Alike);
        }
        Ok(Self(weights.map(|weight| BRIGHT * weight / top)))
    }
}

impl Hue {
    /// Say whether a colour, code values from 0 to 1, has this hue.
    fn has(self, [r, g, b]: [f32; 3]) -> bool {
        let (most, least) = (r.max(g).max(b), r.min(g).min(b));
        let range = most - least;
        if most < LEAST[1] || range < LEAST[0] * most {
            return false;
        }
        let sixth = if most == r {
            (g - b) / range
        } else if most == g {
            2.0 + (b - r) / range
        } else {
            4.0 + (r - g) / range
        };
        let off = (60.0 * sixth - self.degrees).rem_euclid(360.0);
        off.min(360.0 - off) <= self.width
    }
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl Picture {
    /// Return light through a filter, from 0 on.
    pub fn through(&self, filter: &Filter, transfer: Transfer) -> Raster {
        Raster::from_fn(self.width, self.height, |x, y| dot(filter.0, self.colour(x, y, transfer)).max(0.0))
    }
}
