//! The statistics of moment matching against draws: the covariance of the residual, J, the covariance of theta.

use std::sync::Arc;

use cfpose::block::Transform;
use cfpose::distances::Sampling;
use cfpose::estimator::Pipeline;
use cfpose::problem::Noise;
use cfpose::statistics::{Randomness, feature_covariance};
use cfpose::{
    BuildContext, Estimate, Estimator, Execution, MomentProblem, Points, Pose, Registry, Settings, Start, estimate,
};
use cfpose_optim::manifold::{Manifold, rotation_exp};
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

fn rng(seed: u64) -> ChaCha12Rng {
    ChaCha12Rng::seed_from_u64(seed)
}

/// A bent sheet with a bump, about 0 and of size about 1; in two dimensions its projection.
fn shape<const D: usize>(count: usize, rng: &mut ChaCha12Rng) -> Vec<[f64; D]> {
    let mut point = || {
        let (u, v) = (rng.random::<f64>(), rng.random::<f64>());
        let x = [2.0 * u - 1.1, v * (1.0 + 0.5 * u) - 0.6, 0.6 * u * u + 0.3 * (3.0 * v).sin() * u - 0.3];
        std::array::from_fn(|d| x[d])
    };
    (0..count).map(|_| point()).collect()
}

fn noisy<const D: usize>(rows: &[[f64; D]], sigma: f64, rng: &mut ChaCha12Rng) -> Vec<[f64; D]> {
    rows.iter().map(|row| row.map(|x| x + sigma * rng.sample::<f64, _>(StandardNormal))).collect()
}

/// What a Monte Carlo of the residual at the truth is made of.
struct Setup {
    model: &'static str,
    family: &'static str,
    sampling: Sampling,
    num_source: usize,
    num_target: usize,
    sigma: f64,
}

impl Setup {
    /// Make the problem with the noise as a parameter.
    fn problem<const D: usize>(&self, source: &[[f64; D]], target: &[[f64; D]]) -> MomentProblem {
        let registry = Registry::default();
        let context = BuildContext { dim: D, ..BuildContext::default() };
        let model = Arc::new(registry.model(self.model, &context).unwrap());
        let family = Arc::from(registry.family(self.family, &context).unwrap());
        let points = |rows: &[[f64; D]]| Points::from_rows(rows).unwrap();
        let (source, target) = (points(source), points(target));
        MomentProblem::new(model, family, Transform::identity(), &source, &target, Execution::default())
            .with_noise(Noise::Isotropic)
    }

    /// Draw the two sets as the sampling says.
    fn draw<const D: usize>(&self, fixed: &[[f64; D]], rng: &mut ChaCha12Rng) -> [Vec<[f64; D]>; 2] {
        let (source, target) = match self.sampling {
            Sampling::Same => (fixed.to_vec(), fixed.to_vec()),
            Sampling::Thinned => {
                let mut part = fixed.to_vec();
                part.shuffle(rng);
                part.truncate(self.num_target);
                (fixed.to_vec(), part)
            }
            Sampling::Independent => (shape(self.num_source, rng), shape(self.num_target, rng)),
            Sampling::Raster => unreachable!("no pixels here"),
        };
        [source, noisy(&target, self.sigma, rng)]
    }

    /// Return the covariances that ten of the draws predict, and the residuals of all at the true theta.
    fn run<const D: usize>(&self, draws: usize, seed: u64) -> (Vec<Mat<f64>>, Vec<Vec<f64>>) {
        let mut rng = rng(seed);
        let fixed = shape::<D>(self.num_source, &mut rng);
        let mut residuals = Vec::new();
        let mut covariances = Vec::new();
        for draw in 0..draws {
            let [source, target] = self.draw(&fixed, &mut rng);
            let problem = self.problem(&source, &target);
            let mut theta = problem.model().identity.clone();
            theta.push(self.sigma * self.sigma);
            if draw % (draws / 10) == 0 {
                let mut noise = [[0.0; 3]; 3];
                (0..D).for_each(|d| noise[d][d] = self.sigma * self.sigma);
                let (n, m) = (self.num_target as f64, self.num_source as f64);
                let randomness = Randomness { noise, kappa: self.sampling.kappa(n, m), num_target: n };
                let covariance = feature_covariance(&problem, &theta, &randomness, seed + draw as u64).unwrap();
                covariances.push(square(problem.num_features(), &covariance));
            }
            residuals.push(problem.evaluate(&theta).residual);
        }
        (covariances, residuals)
    }
}

fn square(size: usize, rows: &[f64]) -> Mat<f64> {
    assert_eq!(rows.len(), size * size);
    Mat::from_fn(size, size, |i, j| rows[i * size + j])
}

/// Return v' S^-1 v; S must be positive definite.
fn in_units_of(covariance: &Mat<f64>, v: &[f64]) -> f64 {
    let factor = covariance.llt(Side::Lower).expect("a positive definite covariance");
    let solution = factor.solve(Mat::from_fn(v.len(), 1, |i, _| v[i]));
    v.iter().enumerate().map(|(i, x)| x * solution[(i, 0)]).sum()
}

/// The residual at the truth has the predicted covariance: entry by entry, and as J = r' S^-1 r, whose mean is the number of
/// features. A forgotten term, a missing blur or a factor 2 moves J by much more than the bounds.
#[test]
fn the_covariance_of_the_residual_equals_that_of_real_draws() {
    const DRAWS: usize = 400;
    let cases = [
        ("rigid2", "fourier[k=2,w0=1.5]", Sampling::Same, 200, 200, 0.1),
        ("rigid3", "hermite[degree=3]", Sampling::Same, 200, 200, 0.05),
        ("rigid3", "hermite[degree=3]", Sampling::Thinned, 240, 120, 0.05),
        ("rigid2", "fourier[k=2,w0=1.5]", Sampling::Independent, 800, 1200, 0.1),
        ("rigid2", "trig18", Sampling::Thinned, 240, 120, 0.02),
        ("rigid2", "trig18", Sampling::Independent, 1200, 600, 0.02),
    ];
    for (seed, (model, family, sampling, num_source, num_target, sigma)) in cases.into_iter().enumerate() {
        let setup = Setup { model, family, sampling, num_source, num_target, sigma };
        let (predicted, residuals) = match model {
            "rigid2" => setup.run::<2>(DRAWS, seed as u64),
            _ => setup.run::<3>(DRAWS, seed as u64),
        };
        let case = format!("{model}, {family}, {sampling:?}");
        let size = residuals[0].len();
        let j_of = |s: &Mat<f64>| residuals.iter().map(|r| in_units_of(s, r)).sum::<f64>() / DRAWS as f64;
        let j = predicted.iter().map(j_of).sum::<f64>() / predicted.len() as f64;
        // The mean of J has the relative deviation sqrt(2 / (L draws)), and each S is known from a thousand draws of points.
        let deviation = (2.0 / size as f64 * (1.0 / DRAWS as f64 + 1.0 / 10_000.0)).sqrt();
        println!("{case}: J / L = {:.3} +- {deviation:.3}", j / size as f64);
        assert!((j / size as f64 - 1.0).abs() < 4.0 * deviation, "{case}: J / L = {}", j / size as f64);
        let mut worst = 0.0_f64;
        for i in 0..size {
            for k in 0..size {
                let predicted = &predicted[0];
                let scale = (predicted[(i, i)] * predicted[(k, k)]).sqrt();
                let sample = residuals.iter().map(|r| r[i] * r[k]).sum::<f64>() / DRAWS as f64;
                worst = worst.max((sample - predicted[(i, k)]).abs() / scale);
            }
        }
        // Five standard deviations of a variance from so many draws, and of one from 1000 points.
        let bound = 5.0 * (2.0_f64 / DRAWS as f64 + 2.0 / 1000.0).sqrt();
        println!("{case}: worst entry {worst:.3} of {bound:.3}");
        assert!(worst < bound, "{case}: an entry of S is off by {worst} of its scale");
    }
}

/// A fresh cloud and a moved, noisy and permuted copy, of the same points or of others on the same sheet; the true theta of `rigid3` as well.
fn moved_pair(count: usize, sampling: Sampling, sigma: f64, seed: u64) -> (Points, Points, Vec<f64>) {
    let mut rng = rng(seed);
    let rows = shape::<3>(count, &mut rng);
    let vector: [f64; 3] = std::array::from_fn(|_| 0.5 * rng.sample::<f64, _>(StandardNormal));
    let pose = Pose { rotation: rotation_exp(&vector), translation: [0.3, -0.2, 0.1] };
    let clean = if sampling == Sampling::Same { rows.clone() } else { shape(count, &mut rng) };
    let mut moved: Vec<[f64; 3]> = clean.iter().map(|p| pose.apply(*p)).collect();
    moved = noisy(&moved, sigma, &mut rng);
    moved.shuffle(&mut rng);
    let truth = pose.rotation.iter().chain(&pose.translation).copied().collect();
    (Points::from_rows(&rows).unwrap(), Points::from_rows(&moved).unwrap(), truth)
}

/// Move theta of `rigid3` a little.
fn near(truth: &[f64]) -> Vec<f64> {
    let layout = cfpose::theta::Layout::pose3();
    let mut start = vec![0.0; 12];
    layout.manifold().retract(truth, &[0.08, -0.05, 0.06, 0.03, 0.05, -0.04], &mut start);
    start
}

fn solve(settings: &Settings, source: &Points, target: &Points) -> Estimate {
    estimate(&Registry::default(), settings, source, target, &Execution::default()).unwrap()
}

/// Return the tangent step from the estimate to the truth.
fn step_to(truth: &[f64], theta: &[f64]) -> Vec<f64> {
    let layout = cfpose::theta::Layout::pose3();
    let mut step = vec![0.0; 6];
    layout.manifold().local(theta, truth, &mut step);
    step
}

/// Over many data sets J is chi-square in mean with the reported degrees of freedom, p-values are spread evenly, the noise
/// is found, and errors are what the reported covariance says.
#[test]
fn j_noise_and_covariance_are_calibrated() {
    const DRAWS: usize = 60;
    const SIGMA: f64 = 0.04;
    let (mut j, mut dof, mut low, mut squared, mut noise) = (0.0, 0.0, 0, 0.0, 0.0);
    for seed in 0..DRAWS as u64 {
        let (source, target, truth) = moved_pair(500, Sampling::Same, SIGMA, 100 + seed);
        let settings = Settings {
            start: Some(Start::Given(vec![near(&truth)])),
            seed,
            sampling: Some(Sampling::Same),
            ..Settings::preset("auto", "rigid3").unwrap()
        };
        // The means alone: where J is small by chance, `auto` polishes the likelihood of the points.
        let whole = Estimator::new(&Registry::default(), &settings, &source, &target, &Execution::default()).unwrap();
        let pipeline = Pipeline { points: None, ..whole.pipeline().clone() };
        let estimate = solve(&Settings { pipeline: Some(pipeline), ..settings }, &source, &target);
        assert!(!estimate.refined && estimate.clutter.is_none(), "seed {seed}: the moments are not what is tested");
        let statistics = estimate.statistics.unwrap();
        j += statistics.j_statistic;
        dof += statistics.degrees_of_freedom as f64;
        low += usize::from(statistics.p_value < 0.5);
        noise += statistics.noise_sigma.unwrap() / DRAWS as f64;
        let step = step_to(&truth, &estimate.theta);
        squared += in_units_of(&square(6, &statistics.covariance), &step) / DRAWS as f64;
    }
    println!("J / dof {:.3}, p < 0.5: {low}, Mahalanobis {squared:.2}, noise {noise:.4}", j / dof);
    // Four standard deviations of the mean of so many chi-square values.
    assert!((j / dof - 1.0).abs() < 4.0 * (2.0 / dof).sqrt(), "J / dof = {}", j / dof);
    assert!((low as f64 / DRAWS as f64 - 0.5).abs() < 4.0 * 0.5 / (DRAWS as f64).sqrt(), "{low} p-values below 0.5");
    assert!((noise / SIGMA - 1.0).abs() < 0.03, "noise {noise}");
    // The 95 % band of a mean of 60 chi-square values of 6 degrees of freedom is 5.16..6.91; both ends a factor 1.5 wider.
    assert!((5.16 / 1.5..6.91 * 1.5).contains(&squared), "mean squared Mahalanobis distance {squared}");
}

/// The same data, three weightings: only full inverses have a statistic, and by Gauss and Markov the more a weighting knows
/// of S the smaller the errors are.
#[test]
fn weightings_differ_as_they_should() {
    let registry = Registry::default();
    let covariance = [4.0, 1.8, 1.8, 1.0];
    let whiten = |name: &str| registry.weighting(name).unwrap().whitening(&covariance, 2);
    assert!(whiten("identity").is_none());
    let diagonal = whiten("diagonal[regularisation=0]").unwrap();
    assert_eq!((diagonal.matrix, diagonal.rank), (vec![0.5, 0.0, 0.0, 1.0], 2));
    let root = whiten("two-step[regularisation=0]").unwrap();
    let root = square(root.rank, &root.matrix);
    let product = root.transpose() * &root * square(2, &covariance);
    assert!((product - Mat::<f64>::identity(2, 2)).norm_max() < 1e-12);

    let names = ["identity", "diagonal", "two-step"];
    let mut squares = [0.0; 3];
    for seed in 0..40 {
        let (source, target, truth) = moved_pair(300, Sampling::Independent, 0.01, 300 + seed);
        for (square, name) in squares.iter_mut().zip(names) {
            let mut pipeline = only(name);
            pipeline.stages[0].noise = cfpose::estimator::NoiseModel::Isotropic;
            let settings = Settings {
                start: Some(Start::Given(vec![near(&truth)])),
                sampling: Some(Sampling::Independent),
                pipeline: Some(pipeline),
                ..Settings::preset("auto", "rigid3").unwrap()
            };
            let estimate = solve(&settings, &source, &target);
            assert_eq!(estimate.statistics.is_some(), name == "two-step", "{name}");
            *square += step_to(&truth, &estimate.theta).iter().map(|d| d * d).sum::<f64>();
        }
    }
    println!("sums of squares {squares:?}");
    assert!(squares[2] < 0.8 * squares[1] && squares[2] < 0.8 * squares[0], "{names:?}: {squares:?}");
}

/// A pipeline of one stage.
fn only(weighting: &str) -> cfpose::estimator::Pipeline {
    let stage = cfpose::estimator::Stage {
        weighting: weighting.to_string(),
        ..cfpose::estimator::Stage::new("only", "fourier[k=2,w0=1.5]")
    };
    cfpose::estimator::Pipeline::new(vec![stage])
}

/// The continuously updated estimate minimises r(theta)' S(theta)^-1 r(theta), S moving along: its gradient there, taken by
/// finite differences of that function itself, vanishes, which it cannot where the Jacobian forgets dS; and it is close to
/// the two-step estimate.
#[test]
fn the_continuously_updated_estimate_minimises_its_own_function() {
    let (source, target, truth) = moved_pair(1500, Sampling::Independent, 0.005, 7);
    let settings = |weighting: &str| Settings {
        features: Some("hermite[degree=3]".to_string()),
        weighting: Some(weighting.to_string()),
        start: Some(Start::Given(vec![near(&truth)])),
        sampling: Some(Sampling::Independent),
        seed: 3,
        ..Settings::preset("paper", "rigid3").unwrap()
    };
    let registry = Registry::default();
    let given = settings("continuously-updated");
    let estimator = cfpose::Estimator::new(&registry, &given, &source, &target, &Execution::default()).unwrap();
    let estimate = estimator.solve(cfpose::Supervision::default()).unwrap();
    let two_step = solve(&settings("two-step"), &source, &target);
    let statistics = estimate.statistics.as_ref().unwrap();
    let deviations: Vec<f64> = (0..6).map(|j| statistics.covariance[7 * j].sqrt()).collect();

    // What the library weighted by: the noise along the normals, kappa of independent samples.
    let variance = estimate.support.unwrap().normal_sigma.powi(2);
    let mut noise = [[0.0; 3]; 3];
    (0..3).for_each(|d| noise[d][d] = variance);
    let randomness = Randomness { noise, kappa: statistics.kappa, num_target: target.len() as f64 };
    assert_eq!(statistics.kappa, 2.0 / 1500.0);
    let problem = &estimator.problem();
    let objective = |theta: &[f64], at: &[f64]| {
        let size = problem.num_features();
        let mut s = square(size, &feature_covariance(problem, at, &randomness, given.seed).unwrap());
        let ridge = 1e-7 * (0..size).map(|i| s[(i, i)]).sum::<f64>() / size as f64;
        (0..size).for_each(|i| s[(i, i)] += ridge);
        in_units_of(&s, &problem.evaluate(theta).residual)
    };
    assert!((objective(&estimate.theta, &estimate.theta) / (2.0 * estimate.outcome.cost) - 1.0).abs() < 1e-6);
    let slope = |j: usize, frozen: bool| {
        let at = |sign: f64| {
            let mut step = vec![0.0; 6];
            step[j] = sign * 0.02 * deviations[j];
            let mut moved = vec![0.0; 12];
            problem.model().layout.manifold().retract(&estimate.theta, &step, &mut moved);
            objective(&moved, if frozen { &estimate.theta } else { &moved })
        };
        (at(1.0) - at(-1.0)) / 0.04
    };
    // A slope of 2 a standard deviation moves the estimate by one.
    let largest = |frozen| (0..6).map(|j| slope(j, frozen).abs()).fold(0.0, f64::max);
    println!("slopes {:.2e}, with S held fixed {:.2e}", largest(false), largest(true));
    assert!(largest(false) < 1e-2, "slope {}", largest(false));
    assert!(largest(true) > 10.0 * largest(false), "S hardly depends on theta here: the test says nothing");
    let apart = step_to(&two_step.theta, &estimate.theta);
    let normed = (0..6).map(|j| (apart[j] / deviations[j]).abs()).fold(0.0, f64::max);
    println!("{normed:.2} standard deviations from two-step, J / dof {:.2}", statistics.reduced());
    assert!(normed > 1e-6 && normed < 1.0, "{normed} standard deviations from the two-step estimate");
}
