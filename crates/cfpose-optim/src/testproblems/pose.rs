//! Poses from *given* correspondences: plain least-squares problems on SO(3) x R^3 and SO(3) x S^2 whose solutions are known.

use std::sync::Arc;

use num_dual::DualNum;
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use crate::auto::{AutoFunction, AutoProblem};
use crate::linear::symmetric_eigen;
use crate::manifold::{
    Euclidean, Manifold, Product, Rotation3, UnitSphere, norm, rotation_exp, rotation_of_quaternion,
};

type Point = [f64; 3];

/// Return R p (R row by row).
fn rotate<T: DualNum<Primitive = f64> + Copy>(rotation: &[T], p: &Point) -> [T; 3] {
    let row = |i: usize| rotation[3 * i] * p[0] + rotation[3 * i + 1] * p[1] + rotation[3 * i + 2] * p[2];
    [row(0), row(1), row(2)]
}

fn normal_point(rng: &mut ChaCha12Rng, scale: f64) -> Point {
    let mut next = || scale * Distribution::<f64>::sample(&StandardNormal, rng);
    [next(), next(), next()]
}

/// Rigid alignment: residuals `R p_k + T - q_k`, theta = (R row by row, T) on SO(3) x R^3.
#[derive(Debug, Clone, PartialEq)]
pub struct Alignment {
    /// Source points.
    pub source: Vec<Point>,
    /// Target points, in the same order.
    pub target: Vec<Point>,
}

impl AutoFunction for Alignment {
    fn num_values(&self) -> usize {
        3 * self.source.len()
    }
    fn values<T: DualNum<Primitive = f64> + Copy>(&self, theta: &[T], values: &mut [T]) {
        for ((p, q), r) in self.source.iter().zip(&self.target).zip(values.chunks_exact_mut(3)) {
            let moved = rotate(&theta[..9], p);
            for i in 0..3 {
                r[i] = moved[i] + theta[9 + i] - q[i];
            }
        }
    }
}

impl Alignment {
    /// Draw points, a rotation by `angle` (radians) about a random axis, a translation, and noise.
    pub fn simulate(num_points: usize, angle: f64, noise: f64, seed: u64) -> Self {
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        let axis = normal_point(&mut rng, 1.0);
        let rotation = rotation_exp(&axis.map(|a| a * angle / norm(&axis)));
        let translation = normal_point(&mut rng, 1.0);
        let source: Vec<Point> = (0..num_points).map(|_| normal_point(&mut rng, 1.0)).collect();
        let move_point = |p: &Point| {
            let (moved, error) = (rotate(&rotation, p), normal_point(&mut rng, noise));
            [0, 1, 2].map(|i| moved[i] + translation[i] + error[i])
        };
        let target = source.iter().map(move_point).collect();
        Self { source, target }
    }

    /// Return the problem on SO(3) x R^3.
    pub fn problem(self) -> AutoProblem<Self> {
        AutoProblem::new(self, Arc::new(Product::new(vec![Arc::new(Rotation3), Arc::new(Euclidean(3))])))
    }

    /// Return the minimiser in closed form: the quaternion of the largest eigenvalue of Horn's 4 x 4 matrix; nothing for an
    /// empty set.
    ///
    /// Source: Horn, Closed-form solution of absolute orientation using unit quaternions, J. Opt. Soc. Am. A 4 (1987); the
    /// same rotation as Kabsch (1976).
    ///
    /// ```
    /// use cfpose_optim::testproblems::pose::Alignment;
    /// use cfpose_optim::{Control, solvers};
    /// let points = Alignment::simulate(20, 1.0, 0.1, 7);
    /// let truth = points.closed_form().unwrap();
    /// let start = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
    /// let solver = solvers::build("levenberg-marquardt").unwrap();
    /// let outcome = solver.solve(&points.problem(), &start, &mut Control::default()).unwrap();
    /// assert!(outcome.theta.iter().zip(&truth).all(|(a, b)| (a - b).abs() < 1e-8));
    /// ```
    pub fn closed_form(&self) -> Option<Vec<f64>> {
        let mean = |points: &[Point]| [0, 1, 2].map(|i| points.iter().map(|p| p[i]).sum::<f64>() / points.len() as f64);
        let (from, to) = (mean(&self.source), mean(&self.target));
        let mut s = [[0.0; 3]; 3];
        for (p, q) in self.source.iter().zip(&self.target) {
            for i in 0..3 {
                for j in 0..3 {
                    s[i][j] += (p[i] - from[i]) * (q[j] - to[j]);
                }
            }
        }
        let trace = s[0][0] + s[1][1] + s[2][2];
        let skew = [s[1][2] - s[2][1], s[2][0] - s[0][2], s[0][1] - s[1][0]];
        let mut matrix = [0.0; 16];
        matrix[0] = trace;
        for i in 0..3 {
            matrix[i + 1] = skew[i];
            matrix[4 * (i + 1)] = skew[i];
            for j in 0..3 {
                matrix[4 * (i + 1) + j + 1] = s[i][j] + s[j][i] - if i == j { trace } else { 0.0 };
            }
        }
        let (_, vectors) = symmetric_eigen(4, &matrix)?;
        let rotation = rotation_of_quaternion(&[0, 1, 2, 3].map(|i| vectors[4 * i + 3]));
        let moved = rotate(&rotation, &from);
        let mut theta = rotation.to_vec();
        theta.extend([0, 1, 2].map(|i| to[i] - moved[i]));
        Some(theta)
    }
}

/// Relative pose of two calibrated views: residuals `b_k . (T x R a_k)` over unit rays `a_k`, `b_k`, theta = (R, T) with
/// norm(T) = 1 (the essential matrix `[T]x R`).
#[derive(Debug, Clone, PartialEq)]
pub struct RelativePose {
    /// Unit rays in the first view.
    pub first: Vec<Point>,
    /// Unit rays in the second view, in the same order.
    pub second: Vec<Point>,
    /// The pose from which the rays were simulated, (R row by row, T).
    pub truth: Vec<f64>,
}

impl AutoFunction for RelativePose {
    fn num_values(&self) -> usize {
        self.first.len()
    }
    fn values<T: DualNum<Primitive = f64> + Copy>(&self, theta: &[T], values: &mut [T]) {
        let t = &theta[9..12];
        for ((a, b), r) in self.first.iter().zip(&self.second).zip(values) {
            let m = rotate(&theta[..9], a);
            let cross = [t[1] * m[2] - t[2] * m[1], t[2] * m[0] - t[0] * m[2], t[0] * m[1] - t[1] * m[0]];
            *r = cross[0] * b[0] + cross[1] * b[1] + cross[2] * b[2];
        }
    }
}

/// The constraint norm(T)^2 = 1 and, where asked for, that T does not point away from the start: `T . forward >= least`.
#[derive(Debug, Clone, PartialEq)]
pub struct UnitTranslation {
    /// Direction and least component along it, if any.
    pub half_space: Option<(Point, f64)>,
}

impl AutoFunction for UnitTranslation {
    fn num_values(&self) -> usize {
        1 + usize::from(self.half_space.is_some())
    }
    fn values<T: DualNum<Primitive = f64> + Copy>(&self, theta: &[T], values: &mut [T]) {
        let t = &theta[9..12];
        values[0] = t[0] * t[0] + t[1] * t[1] + t[2] * t[2] - 1.0;
        if let Some((n, least)) = &self.half_space {
            values[1] = t[0] * n[0] + t[1] * n[1] + t[2] * n[2] - *least;
        }
    }
}

impl RelativePose {
    /// Draw points before both cameras, a rotation of about `angle` radians, a unit translation, and noise on the rays.
    pub fn simulate(num_points: usize, angle: f64, noise: f64, seed: u64) -> Self {
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        let unit = |v: Point| v.map(|a| a / norm(&v));
        let rotation = rotation_exp(&unit(normal_point(&mut rng, 1.0)).map(|a| a * angle));
        let mut side = normal_point(&mut rng, 1.0);
        side[2] *= 0.3;
        let translation = unit(side);
        let (mut first, mut second) = (Vec::new(), Vec::new());
        while first.len() < num_points {
            let [x, y, z] = normal_point(&mut rng, 1.0);
            let point = [1.5 * x, 1.5 * y, 6.0 + z];
            let moved = rotate(&rotation, &point);
            let jitter = [normal_point(&mut rng, noise), normal_point(&mut rng, noise)];
            let seen = [0, 1, 2].map(|i| moved[i] + translation[i]);
            let (a, b) = (unit(point), unit(seen));
            first.push(unit([0, 1, 2].map(|i| a[i] + jitter[0][i])));
            second.push(unit([0, 1, 2].map(|i| b[i] + jitter[1][i])));
        }
        let mut truth = rotation.to_vec();
        truth.extend(translation);
        Self { first, second, truth }
    }

    /// Return a start near the truth: rotation and translation turned by `distance` (radians).
    pub fn start(&self, distance: f64) -> Vec<f64> {
        let manifold = Product::new(vec![Arc::new(Rotation3), Arc::new(UnitSphere(2))]);
        let mut start = self.truth.clone();
        let step = [0.6, -0.64, 0.48, 0.8, -0.6].map(|d| d * distance);
        manifold.retract(&self.truth, &step, &mut start);
        start
    }

    /// Return the problem with norm(T) = 1 by the manifold SO(3) x S^2.
    pub fn on_sphere(self) -> AutoProblem<Self> {
        AutoProblem::new(self, Arc::new(Product::new(vec![Arc::new(Rotation3), Arc::new(UnitSphere(2))])))
    }

    /// Return the problem on SO(3) x R^3 with norm(T)^2 = 1 as a constraint, for the constrained solvers.
    pub fn constrained(self, half_space: Option<(Point, f64)>) -> AutoProblem<Self> {
        AutoProblem::new(self, Arc::new(Product::new(vec![Arc::new(Rotation3), Arc::new(Euclidean(3))])))
            .with_constraints(UnitTranslation { half_space }, 1)
    }
}
