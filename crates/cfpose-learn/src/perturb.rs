//! Perturbations of the target: what sampling, outliers and thinning do to its means.

use cfpose::Points;
use cfpose_lab::ChaCha12Rng;
use cfpose_lab::rand::RngExt;
use cfpose_lab::rand_distr::StandardNormal;

use crate::objective::Perturbations;

/// Points of the target that stand for all of them.
const POINTS: usize = 200;

/// Half the size of the box of outliers, units of the normalised feature space, whose points have a standard deviation of about .35.
const FAR: f64 = 1.5;

/// Return the changes of the means of `num` functions by perturbations of the target, one column each: halves, outliers, cuts.
///
/// A half is the mean over a random half minus the mean over all; an outlier the functions at a point of a box minus the mean; a cut
/// the mean over the points on one side of a random plane through the middle, minus the mean.
pub fn perturbed(
    points: &Points,
    wanted: Perturbations,
    num: usize,
    functions: impl Fn(&[f64]) -> Vec<f64>,
    rng: &mut ChaCha12Rng,
) -> Vec<f64> {
    let dim = points.dim();
    let step = points.len().div_ceil(POINTS).max(1);
    let kept: Vec<[f64; 3]> = (0..points.len()).step_by(step).map(|k| points.point(k)).collect();
    let values: Vec<Vec<f64>> = kept.iter().map(|x| functions(&x[..dim])).collect();
    let mean_of = |chosen: &dyn Fn(usize) -> bool| -> Vec<f64> {
        let of: Vec<&Vec<f64>> = values.iter().enumerate().filter(|(k, _)| chosen(*k)).map(|(_, v)| v).collect();
        (0..num).map(|i| of.iter().map(|v| v[i]).sum::<f64>() / of.len().max(1) as f64).collect()
    };
    let mean = mean_of(&|_| true);
    let mut columns = Vec::with_capacity(num * wanted.count());
    let mut push = |other: Vec<f64>| columns.extend(other.iter().zip(&mean).map(|(a, b)| a - b));
    for _ in 0..wanted.halves {
        let mut sides: Vec<bool> = kept.iter().map(|_| rng.random()).collect();
        sides[0] = true;
        push(mean_of(&|k| sides[k]));
    }
    for _ in 0..wanted.outliers {
        let x: Vec<f64> = (0..dim).map(|_| FAR * (2.0 * rng.random::<f64>() - 1.0)).collect();
        push(functions(&x));
    }
    for _ in 0..wanted.cuts {
        let normal: Vec<f64> = (0..dim).map(|_| rng.sample::<f64, _>(StandardNormal)).collect();
        let along: Vec<f64> = kept.iter().map(|x| x.iter().zip(&normal).map(|(a, b)| a * b).sum()).collect();
        let mut sorted = along.clone();
        let middle = *sorted.select_nth_unstable_by(along.len() / 2, f64::total_cmp).1;
        push(mean_of(&|k| along[k] >= middle));
    }
    columns
}
