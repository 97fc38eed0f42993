//! Noise of the target as a nuisance parameter: E f(q + noise) differs from f(q), and the family's blur says by how much.

use cfpose_kernel::family::DynFamily;
use cfpose_kernel::map::Transform;
use cfpose_kernel::means::Means;
use num_dual::HyperDual64;

use super::real_parts;

/// Additive Gaussian noise of the target in the feature space, before normalisation (docs/method.md, *Noise*).
///
/// Its parameters follow the model's theta: a variance, or the upper triangle of a covariance row by row. A variance may go
/// negative while optimising; reports clip it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Noise {
    /// Not modelled.
    #[default]
    None,
    /// One variance for all coordinates.
    Isotropic,
    /// A full covariance.
    Full,
}

impl Noise {
    /// Return the number of nuisance parameters in a feature space of `dim` dimensions.
    pub fn num_parameters(self, dim: usize) -> usize {
        match self {
            Noise::None => 0,
            Noise::Isotropic => 1,
            Noise::Full => dim * (dim + 1) / 2,
        }
    }

    /// Return the covariance (3 x 3, zeros beyond `dim`) of given nuisance parameters, `None` where noise is not modelled.
    ///
    /// ```
    /// use cfpose::problem::Noise;
    /// let covariance = Noise::Full.covariance(2, &[4.0, 1.0, 9.0]).unwrap();
    /// assert_eq!(covariance, [[4.0, 1.0, 0.0], [1.0, 9.0, 0.0], [0.0; 3]]);
    /// assert_eq!(Noise::None.covariance(2, &[]), None);
    /// ```
    pub fn covariance(self, dim: usize, parameters: &[f64]) -> Option<[[f64; 3]; 3]> {
        let mut covariance = [[0.0; 3]; 3];
        match self {
            Noise::None => return None,
            Noise::Isotropic => (0..dim).for_each(|d| covariance[d][d] = parameters[0]),
            Noise::Full => {
                let pairs = (0..dim).flat_map(|a| (a..dim).map(move |b| (a, b)));
                for ((a, b), value) in pairs.zip(parameters) {
                    covariance[a][b] = *value;
                    covariance[b][a] = *value;
                }
            }
        }
        Some(covariance)
    }

    /// Return the weights of the nuisance parameters in the variance along a unit vector.
    pub(crate) fn weights_along(self, direction: &[f64]) -> Vec<f64> {
        let dim = direction.len();
        match self {
            Noise::None => Vec::new(),
            Noise::Isotropic => vec![1.0],
            Noise::Full => {
                let pairs = (0..dim).flat_map(|a| (a..dim).map(move |b| (a, b)));
                let weight = |(a, b): (usize, usize)| if a == b { 1.0 } else { 2.0 } * direction[a] * direction[b];
                pairs.map(weight).collect()
            }
        }
    }

    /// Return the covariance after normalisation as an upper triangle: matrix * covariance * matrix'.
    fn normalised(self, dim: usize, transform: &Transform, parameters: &[HyperDual64]) -> Vec<HyperDual64> {
        let zero = HyperDual64::from(0.0);
        let mut covariance = vec![vec![zero; dim]; dim];
        let mut next = 0;
        for a in 0..dim {
            match self {
                Noise::Isotropic => covariance[a][a] = parameters[0],
                _ => {
                    for b in a..dim {
                        covariance[a][b] = parameters[next];
                        covariance[b][a] = parameters[next];
                        next += 1;
                    }
                }
            }
        }
        let matrix = transform.matrix();
        let mut upper = Vec::with_capacity(dim * (dim + 1) / 2);
        for a in 0..dim {
            for b in a..dim {
                let mut sum = zero;
                for c in 0..dim {
                    for d in 0..dim {
                        sum += covariance[c][d] * (matrix[a][c] * matrix[b][d]);
                    }
                }
                upper.push(sum);
            }
        }
        upper
    }

    /// Blur basis means over second-order duals.
    pub(super) fn blur_hyper(
        self,
        family: &dyn DynFamily,
        dim: usize,
        transform: &Transform,
        parameters: &[HyperDual64],
        means: &mut [HyperDual64],
    ) {
        if self == Noise::None {
            return;
        }
        family.blur_hyper(dim, &self.normalised(dim, transform, parameters), means);
    }

    /// Blur basis means and their Jacobian; the last columns of the tangent are the nuisance parameters.
    pub(super) fn blur(
        self,
        family: &dyn DynFamily,
        dim: usize,
        transform: &Transform,
        parameters: &[f64],
        means: &mut Means,
    ) {
        if self == Noise::None {
            return;
        }
        let tangent = means.tangent;
        let first_nuisance = tangent.saturating_sub(parameters.len());
        // One dual direction at a time: the blur is cheap beside the sums.
        let run = |column: Option<usize>| -> Vec<HyperDual64> {
            let mut duals: Vec<HyperDual64> = means.values.iter().map(|value| HyperDual64::from(*value)).collect();
            let mut noise: Vec<HyperDual64> = parameters.iter().map(|value| HyperDual64::from(*value)).collect();
            if let Some(j) = column {
                for (i, dual) in duals.iter_mut().enumerate() {
                    dual.eps1 = means.jacobian[i * tangent + j];
                }
                if j >= first_nuisance {
                    noise[j - first_nuisance].eps1 = 1.0;
                }
            }
            family.blur_hyper(dim, &self.normalised(dim, transform, &noise), &mut duals);
            duals
        };
        let columns: Vec<Vec<HyperDual64>> = (0..tangent).map(|j| run(Some(j))).collect();
        let values = real_parts(&run(None));
        for (j, column) in columns.iter().enumerate() {
            for (i, dual) in column.iter().enumerate() {
                means.jacobian[i * tangent + j] = dual.eps1;
            }
        }
        means.values = values;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn isotropic_noise_is_scaled_by_the_transform() {
        let transform = Transform::new([0.0; 3], [[2.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 1.0]]);
        let upper = Noise::Isotropic.normalised(2, &transform, &[HyperDual64::from(0.5)]);
        assert_eq!(upper.iter().map(|dual| dual.re).collect::<Vec<_>>(), vec![2.0, 0.0, 4.5]);
    }
}
