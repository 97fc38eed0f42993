//! How two sets were sampled, and random parts of a set.

use cfpose_kernel::points::{Points, PointsError};

use super::support::Support;
use crate::criteria::Criteria;

/// How the two sets were sampled, which decides kappa (docs/method.md, *Means have statistics*).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sampling {
    /// The same physical points: kappa = 0.
    Same,
    /// One set is a random part of the other: kappa = abs(1/N - 1/M).
    Thinned,
    /// Sampled independently from one shape: kappa = 1/N + 1/M.
    Independent,
}

impl Sampling {
    /// Names, as the command line gives them.
    pub const NAMES: [(&'static str, Sampling); 3] =
        [("same", Sampling::Same), ("thinned", Sampling::Thinned), ("independent", Sampling::Independent)];

    /// Return the name.
    pub fn name(self) -> &'static str {
        match self {
            Sampling::Same => "same",
            Sampling::Thinned => "thinned",
            Sampling::Independent => "independent",
        }
    }

    /// Return kappa for effective numbers of points.
    ///
    /// ```
    /// use cfpose::distances::Sampling;
    /// assert_eq!(Sampling::Thinned.kappa(50.0, 100.0), 0.01);
    /// assert_eq!(Sampling::Same.kappa(50.0, 100.0), 0.0);
    /// ```
    pub fn kappa(self, num_target: f64, num_source: f64) -> f64 {
        match self {
            Sampling::Same => 0.0,
            Sampling::Thinned => (num_target.recip() - num_source.recip()).abs(),
            Sampling::Independent => num_target.recip() + num_source.recip(),
        }
    }

    /// Choose by nearest-neighbour distances after the fit against the spacing, never from the residual: were kappa fitted,
    /// J would be 1 by construction and detect nothing.
    ///
    /// Same points: the median distance is that of the noise, seen along the normals. Independent ones: about the spacing,
    /// with the noise on top. Where the noise hides the spacing, the numbers of points (`counts`: target, source) decide:
    /// equal within 3 % counts as the same points. `dim` is the dimension of the feature space.
    pub fn detect(support: &Support, dim: usize, counts: [usize; 2], criteria: &Criteria) -> Self {
        let (noise, spacing) = (support.normal_sigma.powi(2) * dim as f64, support.source_spacing.powi(2));
        let visible = noise < criteria.visible * spacing;
        let gap = criteria.gap_spacing * spacing + criteria.gap_noise * noise;
        if visible && support.mutual < criteria.mutual && support.median.powi(2) > gap {
            return Sampling::Independent;
        }
        let ratio = counts[0] as f64 / counts[1] as f64;
        if (ratio - 1.0).abs() < criteria.equal_counts { Sampling::Same } else { Sampling::Thinned }
    }
}

/// Return at most `limit` of the points: evenly spaced along a curve, else a random choice in the order of the points.
///
/// Every n-th of unordered points would be a random choice whose quality depends on the order of the file; points in curve
/// order may be thinned as a quadrature.
///
/// # Errors
/// [`PointsError::NoWeight`] when all chosen weights are zero.
pub(crate) fn thin(points: &Points, limit: usize, rng: &mut impl rand::Rng) -> Result<Points, PointsError> {
    let len = points.len();
    if len <= limit || limit == 0 {
        return Ok(points.clone());
    }
    if points.is_in_curve_order() {
        let indices: Vec<usize> = (0..limit).map(|i| i * len / limit).collect();
        return points.select(&indices);
    }
    // Selection sampling (Knuth 3.4.2, algorithm S): every subset is equally likely, and the order is kept.
    let mut indices = Vec::with_capacity(limit);
    for k in 0..len {
        let (needed, left) = ((limit - indices.len()) as f64, (len - k) as f64);
        if rand::RngExt::random::<f64>(rng) * left < needed {
            indices.push(k);
        }
    }
    points.select(&indices)
}
