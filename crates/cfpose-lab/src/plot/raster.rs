//! Pixels to draw on: the PNG form of a figure. The text is that of a small built-in font, so that no font has to be installed.

use std::convert::Infallible;
use std::io::Cursor;

use image::{ImageFormat, Rgb, RgbImage};
use plotters::prelude::DrawingBackend;
use plotters_backend::text_anchor::{HPos, VPos};
use plotters_backend::{BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingErrorKind};

use super::font::{ADVANCE, HEIGHT, glyph};

/// An image that is drawn on.
pub(super) struct Raster(RgbImage);

/// Font sizes from this one on are drawn at double size.
const LARGE: f64 = 18.0;

impl Raster {
    pub(super) fn new((width, height): (u32, u32)) -> Self {
        Self(RgbImage::from_pixel(width, height, Rgb([255; 3])))
    }

    /// Return the image as the bytes of a PNG file.
    pub(super) fn png(&self) -> Result<Vec<u8>, String> {
        let mut bytes = Cursor::new(Vec::new());
        self.0.write_to(&mut bytes, ImageFormat::Png).map_err(|error| error.to_string())?;
        Ok(bytes.into_inner())
    }
}

type Drawn = Result<(), DrawingErrorKind<Infallible>>;

/// Return how many pixels a dot of the font takes.
fn scale(size: f64) -> i32 {
    if size >= LARGE { 2 } else { 1 }
}

fn length(text: &str) -> i32 {
    i32::try_from(text.chars().count()).unwrap_or(0) * ADVANCE
}

impl DrawingBackend for &mut Raster {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        self.0.dimensions()
    }

    fn ensure_prepared(&mut self) -> Drawn {
        Ok(())
    }

    fn present(&mut self) -> Drawn {
        Ok(())
    }

    fn draw_pixel(&mut self, (x, y): BackendCoord, color: BackendColor) -> Drawn {
        if let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y))
            && let Some(pixel) = self.0.get_pixel_mut_checked(x, y)
        {
            let new = [color.rgb.0, color.rgb.1, color.rgb.2];
            for (old, new) in pixel.0.iter_mut().zip(new) {
                *old = (f64::from(*old) * (1.0 - color.alpha) + f64::from(new) * color.alpha).round() as u8;
            }
        }
        Ok(())
    }

    fn draw_text<S: BackendTextStyle>(&mut self, text: &str, style: &S, place: BackendCoord) -> Drawn {
        let scale = scale(style.size());
        let (width, height) = (length(text) * scale, HEIGHT * scale);
        let anchor = style.anchor();
        let left = match anchor.h_pos {
            HPos::Left => 0,
            HPos::Right => -width,
            HPos::Center => -width / 2,
        };
        let top = match anchor.v_pos {
            VPos::Top => 0,
            VPos::Center => -height / 2,
            VPos::Bottom => -height,
        };
        let turn = style.transform();
        for (k, c) in text.chars().enumerate() {
            let first = i32::try_from(k).unwrap_or(0) * ADVANCE;
            for (column, bits) in (0_i32..).zip(glyph(c)) {
                for row in (0..8).filter(|row| bits >> row & 1 == 1) {
                    for dot in 0..scale * scale {
                        let x = left + (first + column) * scale + dot % scale;
                        let y = top + row * scale + dot / scale;
                        let (x, y) = turn.transform(x, y);
                        self.draw_pixel((place.0 + x, place.1 + y), style.color())?;
                    }
                }
            }
        }
        Ok(())
    }

    fn estimate_text_size<S: BackendTextStyle>(
        &self,
        text: &str,
        style: &S,
    ) -> Result<(u32, u32), DrawingErrorKind<Infallible>> {
        let scale = scale(style.size());
        Ok(((length(text) * scale).unsigned_abs(), (HEIGHT * scale).unsigned_abs()))
    }

    fn draw_circle<S: BackendStyle>(&mut self, centre: BackendCoord, radius: u32, style: &S, fill: bool) -> Drawn {
        // Half a pixel more makes small discs round.
        let (outer, inner) = (f64::from(radius) + 0.5, if fill { -1.0 } else { f64::from(radius) - 0.5 });
        let reach = i32::try_from(radius).unwrap_or(0) + 1;
        for y in -reach..=reach {
            for x in -reach..=reach {
                let distance = f64::from(x).hypot(f64::from(y));
                if distance <= outer && distance > inner {
                    self.draw_pixel((centre.0 + x, centre.1 + y), style.color())?;
                }
            }
        }
        Ok(())
    }
}
