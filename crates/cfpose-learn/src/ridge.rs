//! Functions of w.x + b with trained w and b: waves, and the hidden layer of a perceptron. States hold points.

use std::ops::Range;
use std::sync::Arc;

use cfpose::block::{DynMap, MapBlock, Transform};
use cfpose::families::learned::{Architecture, Matrix};
use cfpose::{Isa, Points};
use cfpose_lab::ChaCha12Rng;
use cfpose_lab::rand::RngExt;
use cfpose_lab::rand_distr::StandardNormal;
use cfpose_optim::Manifold;
use nalgebra::SVector;
use num_dual::{Derivative, DualNumCopy, DualSVec64};

use crate::config::{Config, Kind};
use crate::error::LearnError;
use crate::learner::{Learner, loss_of_columns};
use crate::linear::normalised_target;
use crate::normal::Shape;
use crate::sample::Scene;

/// Source points of a state and target points of a trial; training looks at means over them.
const POINTS: [usize; 2] = [192, 512];
/// States in a row that a batch takes: those of one trial share the means of their target.
const TRIAL_RUN: usize = 4;
/// Most parameters of a unit: three of w, and b.
const SEEDS: usize = 4;
/// Smallest and largest typical frequency at the beginning, rad per unit of the feature space.
const FREQUENCIES: [f64; 2] = [0.8, 4.0];

/// Waves or hidden units under training.
///
/// Parameters: w (and b) of each unit, then the logarithms of the amplitudes of waves, or the output matrix of a perceptron row by row.
pub struct RidgeLearner<'a> {
    config: &'a Config,
    dim: usize,
    shape: Shape,
}

/// One state of waves or hidden units.
pub struct RidgeState {
    /// Source points in the normalised feature space and their derivatives by theta: per point x, then dx / dtheta_j for each j.
    source: Vec<f64>,
    /// Target points, shared by the states of a trial.
    target: Arc<Vec<f64>>,
    delta: Vec<f64>,
}

impl<'a> RidgeLearner<'a> {
    /// Train units in `dim` dimensions.
    ///
    /// # Errors
    /// [`LearnError::Data`] for objectives that perturb the target, which only a linear kind knows.
    pub fn new(config: &'a Config, dim: usize, shape: Shape) -> Result<Self, LearnError> {
        if shape.perturbations > 0 {
            let problem = "covariance and influence are objectives of kind linear; leave them out";
            return Err(LearnError::Data(problem.to_string()));
        }
        Ok(Self { config, dim, shape })
    }

    fn waves(&self) -> bool {
        self.config.kind == Kind::Frequencies
    }

    /// Return the number of units, of parameters of each, and of functions of each.
    fn sizes(&self) -> [usize; 3] {
        if self.waves() { [self.config.features / 2, self.dim, 2] } else { [self.config.hidden, self.dim + 1, 1] }
    }

    /// Return the places of the parameters behind those of the units.
    fn rest(&self) -> Range<usize> {
        let [units, each, _] = self.sizes();
        units * each..units * each + if self.waves() { units } else { self.config.features * units }
    }

    /// Add the values of a unit's functions at x, and their derivatives along each dx, to `sums` (function, then 1 + number of dx).
    fn add<D: DualNumCopy<Primitive = f64>>(&self, unit: &[D], x: &[f64], dx: &[f64], sums: &mut [D]) {
        let dim = self.dim;
        let dot = |v: &[f64]| (1..dim).fold(unit[0] * v[0], |sum, q| sum + unit[q] * v[q]);
        let width = 1 + dx.len() / dim;
        let phase = dot(x);
        if self.waves() {
            let (sine, cosine) = phase.sin_cos();
            sums[0] += cosine;
            sums[width] += sine;
            for (j, direction) in dx.chunks_exact(dim).enumerate() {
                let along = dot(direction);
                sums[1 + j] -= sine * along;
                sums[width + 1 + j] += cosine * along;
            }
        } else {
            let value = (phase + unit[dim]).tanh();
            let slope = -(value * value) + 1.0;
            sums[0] += value;
            for (j, direction) in dx.chunks_exact(dim).enumerate() {
                sums[1 + j] += slope * dot(direction);
            }
        }
    }

    /// Return the means of a unit's functions over the target.
    fn target_means<D: DualNumCopy<Primitive = f64>>(&self, unit: &[D], target: &[f64]) -> Vec<D> {
        let mut sums = vec![D::from(0.0); self.sizes()[2]];
        target.chunks_exact(self.dim).for_each(|x| self.add(unit, x, &[], &mut sums));
        let scale = (target.len() as f64 / self.dim as f64).recip();
        sums.into_iter().map(|sum| sum * scale).collect()
    }

    /// Return the rows of a unit at a state: per function the difference of means, then its derivatives.
    fn rows<D: DualNumCopy<Primitive = f64>>(&self, unit: &[D], state: &RidgeState, target: &[D]) -> Vec<D> {
        let width = self.shape.width();
        let mut sums = vec![D::from(0.0); self.sizes()[2] * width];
        let stride = self.dim * width;
        state.source.chunks_exact(stride).for_each(|p| self.add(unit, &p[..self.dim], &p[self.dim..], &mut sums));
        let scale = (state.source.len() as f64 / stride as f64).recip();
        sums.iter_mut().for_each(|sum| *sum *= scale);
        target.iter().enumerate().for_each(|(k, mean)| sums[k * width] -= *mean);
        sums
    }

    /// Return the parameters of a unit with a derivative each.
    fn seeded(unit: &[f64]) -> Vec<DualSVec64<SEEDS>> {
        let seed = |(i, value): (usize, &f64)| {
            let mut dual = DualSVec64::from(*value);
            dual.eps = Derivative::some(SVector::from_fn(|k, _| f64::from(u8::from(k == i))));
            dual
        };
        unit.iter().enumerate().map(seed).collect()
    }

    /// Return Y column by column from the rows of all functions.
    fn columns(&self, parameters: &[f64], rows: &[f64]) -> Vec<f64> {
        let (features, width, [units, _, each]) = (self.config.features, self.shape.width(), self.sizes());
        let rest = &parameters[self.rest()];
        let mut columns = vec![0.0; features * width];
        for c in 0..width {
            for i in 0..features {
                columns[c * features + i] = if self.waves() {
                    // All cosines, then all sines, as the family orders them.
                    rest[i % units].exp() * rows[((i % units) * each + i / units) * width + c]
                } else {
                    (0..units).map(|h| rest[i * units + h] * rows[h * width + c]).sum()
                };
            }
        }
        columns
    }

    /// Return d loss / d rows from d loss / dY, and add the slopes of the parameters behind those of the units.
    fn pull(&self, parameters: &[f64], rows: &[f64], slopes: &[f64], gradient: &mut [f64]) -> Vec<f64> {
        let (features, width, [units, _, each]) = (self.config.features, self.shape.width(), self.sizes());
        let range = self.rest();
        let (rest, own) = (&parameters[range.clone()], &mut gradient[range]);
        let mut back = vec![0.0; rows.len()];
        for c in 0..width {
            for i in 0..features {
                let slope = slopes[c * features + i];
                if self.waves() {
                    let (unit, row) = (i % units, ((i % units) * each + i / units) * width + c);
                    let amplitude = rest[unit].exp();
                    back[row] += amplitude * slope;
                    own[unit] += amplitude * rows[row] * slope;
                } else {
                    for h in 0..units {
                        back[h * width + c] += rest[i * units + h] * slope;
                        own[i * units + h] += rows[h * width + c] * slope;
                    }
                }
            }
        }
        back
    }
}

/// Map some source points at theta: per point x, then dx / dtheta_j.
fn moved(scene: &Scene, theta: &[f64]) -> Option<Vec<f64>> {
    let model = scene.estimator.model();
    let map: &dyn DynMap = model.source.as_ref();
    let (dim, manifold) = (map.dim(), model.layout.manifold());
    let (m, points) = (manifold.tangent(), few(scene.source(), POINTS[0])?);
    let points = if points.dim() < map.point_dim() { points.with_constant_coordinate(1.0).ok()? } else { points };
    let lifted = map.lift(&points);
    let mut basis = vec![0.0; manifold.ambient() * m];
    manifold.basis(theta, &mut basis);
    let prepared = map.prepare(theta, &basis, m);
    let transform: &Transform = scene.estimator.problem().transform();
    let mut block = MapBlock::new(dim, m);
    let mut out = Vec::with_capacity(points.len() * dim * (1 + m));
    let size = block.weight.0.len();
    for start in (0..points.len()).step_by(size) {
        map.block(Isa::detect(), &prepared, transform, &lifted, start, &mut block);
        for k in 0..size.min(points.len() - start) {
            out.extend((0..dim).map(|q| block.x[q].0[k]));
            // A density that moves with theta is not part of these means; a point of weight 0 is behind the camera.
            let weight = block.weight.0[k];
            if weight != 1.0 || block.moving_weight && block.dweight.iter().any(|row| row.0[k] != 0.0) {
                return None;
            }
            out.extend((0..m).flat_map(|j| (0..dim).map(move |q| (q, j))).map(|(q, j)| block.dx[q * m + j].0[k]));
        }
    }
    // Nor is a target that moves.
    (!model.target.is_moving() && out.iter().all(|v| v.is_finite())).then_some(out)
}

/// Keep at most `count` points, evenly by their order.
fn few(points: &Points, count: usize) -> Option<Points> {
    let step = points.len().div_ceil(count).max(1);
    points.select(&(0..points.len()).step_by(step).collect::<Vec<_>>()).ok()
}

impl Learner for RidgeLearner<'_> {
    type State = RidgeState;

    fn observe(&self, scene: &Scene, theta: &[f64], delta: Vec<f64>, _rng: &mut ChaCha12Rng) -> Option<RidgeState> {
        let source = moved(scene, theta)?;
        let all = normalised_target(scene)?;
        let target = scene.once.get_or_init(|| {
            let points = few(&all, POINTS[1]).unwrap_or(all);
            Arc::new((0..points.len()).flat_map(|k| points.point(k).into_iter().take(self.dim)).collect())
        });
        Some(RidgeState { source, target: Arc::clone(target), delta })
    }

    fn start(&mut self, _states: &[RidgeState], rng: &mut ChaCha12Rng) -> Result<Vec<f64>, LearnError> {
        let [units, _, _] = self.sizes();
        let mut normal = || rng.sample::<f64, _>(StandardNormal);
        let directions: Vec<Vec<f64>> = (0..units).map(|_| (0..self.dim).map(|_| normal()).collect()).collect();
        let mut parameters = Vec::new();
        let mut amplitudes = Vec::new();
        for direction in directions {
            let size = FREQUENCIES[0] * (FREQUENCIES[1] / FREQUENCIES[0]).powf(rng.random::<f64>());
            let w: Vec<f64> = direction.iter().map(|v| size * v).collect();
            amplitudes.push(-cfpose_optim::manifold::norm(&w).ln());
            parameters.extend(w);
            if !self.waves() {
                parameters.push(rng.sample::<f64, _>(StandardNormal));
            }
        }
        if self.waves() {
            parameters.extend(amplitudes);
        } else {
            let scale = (units as f64).sqrt().recip();
            let count = self.config.features * units;
            parameters.extend((0..count).map(|_| scale * rng.sample::<f64, _>(StandardNormal)));
        }
        Ok(parameters)
    }

    fn sum(&self, parameters: &[f64], states: &[&RidgeState], gradient: &mut [f64]) -> f64 {
        let [units, each, functions] = self.sizes();
        let (width, wanted) = (self.shape.width(), !gradient.is_empty());
        let unit = |u: usize| &parameters[u * each..(u + 1) * each];
        let mut loss = 0.0;
        for run in states.chunk_by(|a, b| Arc::ptr_eq(&a.target, &b.target)) {
            // Means of the target, once for the states of a trial.
            let seeded: Vec<Vec<DualSVec64<SEEDS>>> = (0..units).map(|u| Self::seeded(unit(u))).collect();
            let plain: Vec<Vec<f64>> = (0..units).map(|u| self.target_means(unit(u), &run[0].target)).collect();
            let means: Vec<Vec<DualSVec64<SEEDS>>> = if wanted {
                seeded.iter().map(|unit| self.target_means(unit, &run[0].target)).collect()
            } else {
                Vec::new()
            };
            for state in run {
                let duals: Vec<DualSVec64<SEEDS>> = if wanted {
                    (0..units).flat_map(|u| self.rows(&seeded[u], state, &means[u])).collect()
                } else {
                    Vec::new()
                };
                let rows: Vec<f64> = if wanted {
                    duals.iter().map(|dual| dual.re).collect()
                } else {
                    (0..units).flat_map(|u| self.rows(unit(u), state, &plain[u])).collect()
                };
                let columns = self.columns(parameters, &rows);
                let mut slopes = vec![0.0; if wanted { columns.len() } else { 0 }];
                let objectives = &self.config.objectives;
                loss += loss_of_columns(objectives, self.shape, [&columns, &columns], &state.delta, &mut slopes);
                if wanted {
                    let back = self.pull(parameters, &rows, &slopes, gradient);
                    for (at, (dual, slope)) in duals.iter().zip(&back).enumerate() {
                        let Some(eps) = &dual.eps.0 else { continue };
                        let u = at / (functions * width);
                        let own = &mut gradient[u * each..(u + 1) * each];
                        own.iter_mut().zip(eps.iter()).for_each(|(sum, eps)| *sum += slope * eps);
                    }
                }
            }
        }
        loss
    }

    fn run_length(&self) -> usize {
        TRIAL_RUN
    }

    fn architecture(&self, parameters: &[f64]) -> Architecture {
        let [units, each, _] = self.sizes();
        let rest = &parameters[self.rest()];
        let w = (0..units).flat_map(|u| parameters[u * each..u * each + self.dim].iter().copied()).collect();
        let w = Matrix { rows: units, values: w };
        if self.waves() {
            return Architecture::Frequencies { frequencies: w, amplitudes: rest.iter().map(|a| a.exp()).collect() };
        }
        let bias = (0..units).map(|u| parameters[u * each + self.dim]).collect();
        Architecture::Perceptron {
            hidden: w,
            bias,
            output: Matrix { rows: self.config.features, values: rest.to_vec() },
        }
    }

    fn features(&self) -> String {
        "coordinates".to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learner::check_gradient;
    use crate::sample::Sampler;
    use crate::vary::Split;
    use cfpose_lab::Lab;
    use cfpose_lab::seed::data_stream;

    #[test]
    fn gradients_equal_finite_differences() {
        let lab = Lab::default();
        for kind in ["frequencies", "perceptron"] {
            let text = format!(
                "kind = \"{kind}\"\nfeatures = 8\nhidden = 5\nseed = 5\n[[objective]]\nname = \"contraction\"\n[[objective]]\nname = \"star-convexity\"\n[[data]]\nscenario = \"cloud3\"\npoints = 80\n"
            );
            let config = Config::parse(&lab, &text, "test").unwrap();
            let mut learner = RidgeLearner::new(&config, 3, Shape { unknowns: 6, perturbations: 0 }).unwrap();
            let sampler = Sampler::new(&lab, &config, "coordinates");
            let look = |s: &Scene, t: &[f64], d, r: &mut ChaCha12Rng| learner.observe(s, t, d, r);
            let states = sampler.about_truth(Split::Training, 3, 3, look).unwrap();
            let at = learner.start(&states, &mut data_stream(1, 1)).unwrap();
            check_gradient(&learner, &at, &states, kind);
        }
    }
}
