//! Clarabel's step against the null-space step, and data updates of one solver object.

use cfpose_optim::linear::null_space_step;
use cfpose_optim::solvers::{ConeProblem, ConeStep, Loss};
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

const ROWS: usize = 18;
const COLS: usize = 6;

struct Case {
    residual: Vec<f64>,
    jacobian: Vec<f64>,
    constraint: Vec<f64>,
    value: [f64; 1],
    scaling: Vec<f64>,
    gradient: Vec<f64>,
}

impl Case {
    fn draw(seed: u64) -> Self {
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        let mut normals = |n: usize, scale: f64| -> Vec<f64> {
            (0..n).map(|_| scale * Distribution::<f64>::sample(&StandardNormal, &mut rng)).collect()
        };
        let (residual, mut jacobian) = (normals(ROWS, 0.1), normals(ROWS * COLS, 1.0));
        // Columns of different units.
        jacobian.iter_mut().enumerate().for_each(|(at, v)| *v *= [1.0, 30.0, 0.02, 5.0, 1.0, 200.0][at % COLS]);
        let constraint = normals(COLS, 1.0);
        let value = [normals(1, 0.01)[0]];
        let column = |j: usize| (0..ROWS).map(|k| jacobian[k * COLS + j].powi(2)).sum::<f64>().sqrt();
        let scaling = (0..COLS).map(column).collect();
        let entry = |j: usize| (0..ROWS).map(|k| jacobian[k * COLS + j] * residual[k]).sum::<f64>();
        let gradient = (0..COLS).map(entry).collect();
        Self { residual, jacobian, constraint, value, scaling, gradient }
    }

    fn problem(&self) -> ConeProblem<'_> {
        ConeProblem {
            rows: ROWS,
            cols: COLS,
            residual: &self.residual,
            jacobian: &self.jacobian,
            gradient: &self.gradient,
            num_equalities: 1,
            values: &self.value,
            constraints: &self.constraint,
            scaling: &self.scaling,
        }
    }

    fn null_space(&self) -> Vec<f64> {
        let mut step = vec![0.0; COLS];
        let found =
            null_space_step(ROWS, COLS, &self.jacobian, &self.residual, 1, &self.constraint, &self.value, &mut step);
        assert!(found);
        step
    }

    /// Largest difference of two steps, relative to the length of the first, in scaled coordinates.
    fn difference(&self, a: &[f64], b: &[f64]) -> f64 {
        let scaled = |v: &[f64]| -> Vec<f64> { v.iter().zip(&self.scaling).map(|(x, d)| x * d).collect() };
        let (a, b) = (scaled(a), scaled(b));
        let length = a.iter().map(|x| x * x).sum::<f64>().sqrt();
        a.iter().zip(&b).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max) / length
    }
}

#[test]
fn an_inactive_region_gives_the_null_space_step() {
    // One object through all cases: its data are updated, its structure stays.
    let mut cone = ConeStep::new(Loss::Squares);
    let mut worst = 0.0_f64;
    for seed in 0..200 {
        let case = Case::draw(seed);
        let mut step = vec![0.0; COLS];
        assert_eq!(cone.solve(&case.problem(), 1e3, &mut step), Some(true), "seed {seed}");
        worst = worst.max(case.difference(&case.null_space(), &step));
    }
    assert!(worst < 1e-7, "{worst:e}");
}

#[test]
fn an_active_region_holds() {
    let mut cone = ConeStep::new(Loss::Squares);
    let case = Case::draw(1);
    let scaled_norm = |step: &[f64]| step.iter().zip(&case.scaling).map(|(x, d)| (x * d).powi(2)).sum::<f64>().sqrt();
    let radius = 0.3 * scaled_norm(&case.null_space());
    let mut step = vec![0.0; COLS];
    assert_eq!(cone.solve(&case.problem(), radius, &mut step), Some(false));
    assert!((scaled_norm(&step) / radius - 1.0).abs() < 1e-6);
    let constraint: f64 = case.value[0] + step.iter().zip(&case.constraint).map(|(d, a)| d * a).sum::<f64>();
    assert!(constraint.abs() < 1e-7, "{constraint:e}");
}
