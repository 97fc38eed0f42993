//! Spin images: what the shape looks like about one of its points, whatever the pose.
//!
//! Source: Johnson and Hebert, Using spin images for efficient object recognition in cluttered 3D scenes, PAMI 21 (1999). Different here:
//! the normal is that of the region's inner third, turned to the side on which the region bends; counts enter by their square root, so
//! that a dense part does not outweigh the rest; on a curve in the plane the images are made by the same formulas.

use cfpose_kernel::points::Points;

use super::normals::least_axis;
use super::sampling::even;

/// Bins along the tangent plane and across it.
const ALONG: usize = 6;
const ACROSS: usize = 9;
/// The normal is fitted to this share of the radius.
const INNER: f64 = 1.0 / 3.0;
/// Points that a normal, and an image, is made of at least.
const LEAST: [usize; 2] = [6, 20];

/// A point of the shape with its unit normal and the image of the region about it.
#[derive(Debug, Clone)]
pub(crate) struct SpinImage {
    /// The point.
    pub at: [f64; 3],
    /// Unit normal, on the side to which the region bends.
    pub normal: [f64; 3],
    /// Image of unit length.
    pub image: Vec<f64>,
}

impl SpinImage {
    /// Return the squared distance of two images, 0 to 2.
    pub fn squared_distance(&self, other: &Self) -> f64 {
        2.0 - 2.0 * self.image.iter().zip(&other.image).map(|(a, b)| a * b).sum::<f64>()
    }
}

/// Make spin images of at most `count` points that cover the shape evenly; points whose region is too empty, or has no normal, get none.
pub(crate) fn spin_images(points: &Points, count: usize, radius: f64) -> Vec<SpinImage> {
    let Ok(keys) = even(points, count) else { return Vec::new() };
    let rows = points.rows();
    keys.rows().iter().filter_map(|at| spin_image(at, &rows, points.dim(), radius)).collect()
}

fn spin_image(at: &[f64; 3], rows: &[[f64; 3]], dim: usize, radius: f64) -> Option<SpinImage> {
    let within = |r: &[f64; 3], reach: f64| r.iter().map(|v| v * v).sum::<f64>() <= reach * reach;
    let offsets = rows.iter().map(|row| std::array::from_fn(|d| row[d] - at[d]));
    let region: Vec<[f64; 3]> = offsets.filter(|r| within(r, radius)).collect();
    let inner: Vec<&[f64; 3]> = region.iter().filter(|r| within(r, INNER * radius)).collect();
    if inner.len() < LEAST[0] || region.len() < LEAST[1] {
        return None;
    }
    let mut normal = least_axis(inner.iter().copied(), dim)?;
    let height = |normal: &[f64; 3], r: &[f64; 3]| (0..3).map(|d| normal[d] * r[d]).sum::<f64>();
    if region.iter().map(|r| height(&normal, r)).sum::<f64>() < 0.0 {
        normal = normal.map(|v| -v);
    }
    let mut image = vec![0.0; ALONG * ACROSS];
    for r in &region {
        let across = height(&normal, r);
        let along = (r.iter().map(|v| v * v).sum::<f64>() - across * across).max(0.0).sqrt();
        add(&mut image, along / radius * (ALONG - 1) as f64, 0.5 * (across / radius + 1.0) * (ACROSS - 1) as f64);
    }
    image.iter_mut().for_each(|v| *v = v.sqrt());
    let length = image.iter().map(|v| v * v).sum::<f64>().sqrt();
    image.iter_mut().for_each(|v| *v /= length);
    Some(SpinImage { at: *at, normal, image })
}

/// Spread a point over the four bins about it.
fn add(image: &mut [f64], along: f64, across: f64) {
    let split = |x: f64, count: usize| {
        let low = (x.floor() as usize).min(count - 2);
        (low, (x - low as f64).clamp(0.0, 1.0))
    };
    let ((i, u), (k, v)) = (split(along, ALONG), split(across, ACROSS));
    for (di, wi) in [(0, 1.0 - u), (1, u)] {
        for (dk, wk) in [(0, 1.0 - v), (1, v)] {
            image[(i + di) * ACROSS + k + dk] += wi * wk;
        }
    }
}
