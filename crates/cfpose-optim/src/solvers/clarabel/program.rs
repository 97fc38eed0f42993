//! The second-order cone program of one step.

use ::clarabel::algebra::CscMatrix;
use ::clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};

use crate::constrained::Loss;
use crate::linear::Qr;
use crate::manifold::norm;
use crate::tangent::guarded;

/// The linearised problem of one step: residual r (rows), Jacobian J (rows x cols), equalities c + A d = 0 first and then
/// inequalities h + G d >= 0 in `values` and `constraints`, scaling D.
#[derive(Debug, Clone, Copy)]
pub struct ConeProblem<'p> {
    /// Number of residuals.
    pub rows: usize,
    /// Number of step coordinates.
    pub cols: usize,
    /// Residual.
    pub residual: &'p [f64],
    /// Jacobian, row by row.
    pub jacobian: &'p [f64],
    /// Gradient of the summed loss.
    pub gradient: &'p [f64],
    /// Number of equalities.
    pub num_equalities: usize,
    /// Values of the constraints.
    pub values: &'p [f64],
    /// Rows of the constraints.
    pub constraints: &'p [f64],
    /// Diagonal of D.
    pub scaling: &'p [f64],
}

/// The second-order cone program of a step, kept for data updates.
///
/// Rows: equalities, loss rows that are equalities, inequalities, loss rows that are inequalities, region. Variables:
/// x = D d, then those of the loss: for squares the rotated residual `u = R x + Q'r` (so that the condition of
/// J is not squared), for absolute values their bounds t, for Huber's loss the parts u + v - w of the residual.
pub struct ConeStep {
    loss: Loss,
    solver: Option<DefaultSolver<f64>>,
    shape: (usize, usize, usize, usize),
    hessian: Columns,
    linear: Vec<f64>,
    matrix: Columns,
    rhs: Vec<f64>,
    qr: Qr,
    scaled: Vec<f64>,
    /// Unit of the step over unit of the residual.
    per_step: f64,
}

/// Units of step (scaled by D) and residual.
#[derive(Debug, Clone, Copy)]
struct Units {
    step: f64,
    residual: f64,
}

/// A sparse matrix, column by column.
#[derive(Debug, Clone, Default)]
struct Columns {
    starts: Vec<usize>,
    indices: Vec<usize>,
    values: Vec<f64>,
}

impl Columns {
    fn clear(&mut self) {
        self.starts.clear();
        self.starts.push(0);
        self.indices.clear();
        self.values.clear();
    }

    fn push(&mut self, row: usize, value: f64) {
        self.indices.push(row);
        self.values.push(value);
    }

    fn close(&mut self) {
        self.starts.push(self.indices.len());
    }

    fn build(&self, rows: usize) -> CscMatrix<f64> {
        let cols = self.starts.len() - 1;
        CscMatrix::new(rows, cols, self.starts.clone(), self.indices.clone(), self.values.clone())
    }
}

/// First rows of the parts of the program.
#[derive(Debug, Clone, Copy)]
struct Layout {
    loss_equal: usize,
    unequal: usize,
    loss_unequal: usize,
    region: usize,
}

impl Layout {
    fn new(p: &ConeProblem<'_>, loss: Loss) -> Self {
        let (equal, unequal) = match loss {
            Loss::Squares => (p.cols, 0),
            Loss::Absolute => (0, 2 * p.rows),
            Loss::Huber { .. } => (p.rows, 2 * p.rows),
        };
        let first_unequal = p.num_equalities + equal;
        let loss_unequal = first_unequal + p.values.len() - p.num_equalities;
        Self { loss_equal: p.num_equalities, unequal: first_unequal, loss_unequal, region: loss_unequal + unequal }
    }
}

/// Region in units of the step beyond which its size makes no difference but to the conditioning.
const LARGEST_REGION: f64 = 1e2;

impl ConeStep {
    /// Make an empty program; the first step gives it its structure.
    pub fn new(loss: Loss) -> Self {
        Self {
            loss,
            solver: None,
            shape: (0, 0, 0, 0),
            hessian: Columns::default(),
            linear: Vec::new(),
            matrix: Columns::default(),
            rhs: Vec::new(),
            qr: Qr::default(),
            scaled: Vec::new(),
            per_step: 1.0,
        }
    }

    /// Write the step within `norm(D step) <= radius` and say whether the region is inactive; nothing when the program is
    /// not solved to full accuracy.
    ///
    /// ```
    /// use cfpose_optim::solvers::{ConeProblem, ConeStep, Loss};
    /// // Nearest point to (1, 0) on the line d1 + d2 = 2.
    /// let problem = ConeProblem {
    ///     rows: 2, cols: 2, residual: &[-1.0, 0.0], jacobian: &[1.0, 0.0, 0.0, 1.0], gradient: &[-1.0, 0.0],
    ///     num_equalities: 1, values: &[-2.0], constraints: &[1.0, 1.0], scaling: &[1.0, 1.0],
    /// };
    /// let mut step = [0.0; 2];
    /// assert_eq!(ConeStep::new(Loss::Squares).solve(&problem, 10.0, &mut step), Some(true));
    /// assert!((step[0] - 1.5).abs() < 1e-7 && (step[1] - 0.5).abs() < 1e-7);
    /// ```
    pub fn solve(&mut self, problem: &ConeProblem<'_>, radius: f64, step: &mut [f64]) -> Option<bool> {
        let Some(units) = self.units(problem, radius) else {
            step.fill(0.0);
            return None;
        };
        let region = (radius / units.step).min(LARGEST_REGION);
        self.fill(problem, units, region);
        let shape = (problem.rows, problem.cols, problem.num_equalities, problem.values.len());
        if self.solver.is_none() || self.shape != shape {
            self.solver = self.build(problem);
            self.shape = shape;
        } else if !self.update() {
            self.solver = None;
            return None;
        }
        let solver = self.solver.as_mut()?;
        guarded(|| solver.solve())?;
        if solver.solution.status != SolverStatus::Solved {
            return None;
        }
        let x = &solver.solution.x;
        for j in 0..problem.cols {
            step[j] = units.step * x[j] / problem.scaling[j];
        }
        let length = x[..problem.cols].iter().map(|v| v * v).sum::<f64>().sqrt();
        step.iter().all(|d| d.is_finite()).then_some(length < 0.99 * region)
    }

    /// Choose the units in which step and residual are of order 1: the shorter of the radius and the step that leads to the
    /// minimum, and the norm of the residual. Nothing for values that are not finite.
    fn units(&mut self, p: &ConeProblem<'_>, radius: f64) -> Option<Units> {
        self.scaled.clear();
        self.scaled.extend(p.jacobian.iter().enumerate().map(|(at, v)| v / p.scaling[at % p.cols]));
        self.qr.factorise(p.rows, p.cols, &self.scaled, p.residual);
        let (ones, mut newton) = (vec![1.0; p.cols], vec![0.0; p.cols]);
        let unrestricted = if self.qr.solve_damped(1e-20, &ones, &mut newton) { norm(&newton) } else { f64::INFINITY };
        let gradient: f64 = p.gradient.iter().zip(p.scaling).map(|(g, d)| (g / d) * (g / d)).sum();
        let missing =
            p.values.iter().enumerate().map(|(i, v)| if i < p.num_equalities || *v < 0.0 { v * v } else { 0.0 });
        let length = unrestricted.max((gradient + missing.sum::<f64>()).sqrt());
        let step = (10.0 * length).min(radius);
        let residual = norm(p.residual);
        let usable = step > 0.0 && step.is_finite() && residual > 0.0 && residual.is_finite();
        usable.then_some(Units { step, residual })
    }

    fn fill(&mut self, p: &ConeProblem<'_>, units: Units, region: f64) {
        self.hessian.clear();
        self.matrix.clear();
        self.linear.clear();
        self.rhs.clear();
        self.per_step = units.step / units.residual;
        let layout = Layout::new(p, self.loss);
        for j in 0..p.cols {
            self.push_step_column(p, layout, j);
        }
        match self.loss {
            Loss::Squares => self.push_squares(p, layout),
            Loss::Absolute => self.push_absolute(p, layout),
            Loss::Huber { scale } => self.push_huber(p, layout, scale / units.residual),
        }
        self.push_rhs(p, units, region);
    }

    /// Column of x_j: equalities, loss, inequalities `-G x <= h`, loss, region.
    fn push_step_column(&mut self, p: &ConeProblem<'_>, layout: Layout, j: usize) {
        let column = &mut self.matrix;
        let constraint = |i: usize| p.constraints[i * p.cols + j] / p.scaling[j];
        let residual = |k: usize| self.per_step * self.scaled[k * p.cols + j];
        for i in 0..p.num_equalities {
            column.push(i, constraint(i));
        }
        match self.loss {
            Loss::Squares => (0..=j)
                .for_each(|l| column.push(layout.loss_equal + l, self.per_step * self.qr.upper()[l * p.cols + j])),
            Loss::Absolute => {}
            Loss::Huber { .. } => (0..p.rows).for_each(|k| column.push(layout.loss_equal + k, residual(k))),
        }
        for i in p.num_equalities..p.values.len() {
            column.push(layout.unequal + i - p.num_equalities, -constraint(i));
        }
        if self.loss == Loss::Absolute {
            (0..p.rows).for_each(|k| column.push(layout.loss_unequal + k, residual(k)));
            (0..p.rows).for_each(|k| column.push(layout.loss_unequal + p.rows + k, -residual(k)));
        }
        column.push(layout.region + 1 + j, -1.0);
        column.close();
        self.hessian.close();
        self.linear.push(0.0);
    }

    /// R x - u = -Q'r, minimise 1/2 u'u.
    fn push_squares(&mut self, p: &ConeProblem<'_>, layout: Layout) {
        for l in 0..p.cols {
            self.matrix.push(layout.loss_equal + l, -1.0);
            self.matrix.close();
            self.hessian.push(p.cols + l, 1.0);
            self.hessian.close();
            self.linear.push(0.0);
        }
    }

    /// r + J x <= t, -r - J x <= t, minimise the sum of t.
    fn push_absolute(&mut self, p: &ConeProblem<'_>, layout: Layout) {
        for k in 0..p.rows {
            self.matrix.push(layout.loss_unequal + k, -1.0);
            self.matrix.push(layout.loss_unequal + p.rows + k, -1.0);
            self.matrix.close();
            self.hessian.close();
            self.linear.push(1.0);
        }
    }

    /// r + J x = u + v - w with v, w >= 0, minimise 1/2 u'u + scale * sum (v + w).
    fn push_huber(&mut self, p: &ConeProblem<'_>, layout: Layout, scale: f64) {
        for part in 0..3 {
            for k in 0..p.rows {
                self.matrix.push(layout.loss_equal + k, if part == 2 { 1.0 } else { -1.0 });
                if part == 0 {
                    self.hessian.push(p.cols + k, 1.0);
                } else {
                    self.matrix.push(layout.loss_unequal + (part - 1) * p.rows + k, -1.0);
                }
                self.matrix.close();
                self.hessian.close();
                self.linear.push(if part == 0 { 0.0 } else { scale });
            }
        }
    }

    fn push_rhs(&mut self, p: &ConeProblem<'_>, units: Units, region: f64) {
        let Units { step, residual } = units;
        let rhs = &mut self.rhs;
        let (equal, unequal) = p.values.split_at(p.num_equalities);
        rhs.extend(equal.iter().map(|c| -c / step));
        match self.loss {
            Loss::Squares => rhs.extend(self.qr.rotated().iter().map(|r| -r / residual)),
            Loss::Absolute => {}
            Loss::Huber { .. } => rhs.extend(p.residual.iter().map(|r| -r / residual)),
        }
        // An inequality that cannot become active within the region must not spoil the scale of the others.
        for (i, h) in unequal.iter().enumerate() {
            let row = &p.constraints[(p.num_equalities + i) * p.cols..(p.num_equalities + i + 1) * p.cols];
            let reach: f64 = row.iter().zip(p.scaling).map(|(g, d)| (g / d) * (g / d)).sum();
            rhs.push((h / step).min(10.0 * reach.sqrt() * region));
        }
        match self.loss {
            Loss::Squares => {}
            Loss::Absolute => {
                rhs.extend(p.residual.iter().map(|r| -r / residual));
                rhs.extend(p.residual.iter().map(|r| r / residual));
            }
            Loss::Huber { .. } => rhs.extend((0..2 * p.rows).map(|_| 0.0)),
        }
        rhs.push(region);
        rhs.extend((0..p.cols).map(|_| 0.0));
    }

    /// Build the solver object around the values in hand.
    fn build(&self, p: &ConeProblem<'_>) -> Option<DefaultSolver<f64>> {
        let layout = Layout::new(p, self.loss);
        let cones = [
            SupportedConeT::ZeroConeT(layout.unequal),
            SupportedConeT::NonnegativeConeT(layout.region - layout.unequal),
            SupportedConeT::SecondOrderConeT(p.cols + 1),
        ];
        let empty =
            |c: &SupportedConeT<f64>| matches!(c, SupportedConeT::ZeroConeT(0) | SupportedConeT::NonnegativeConeT(0));
        let cones: Vec<_> = cones.into_iter().filter(|c| !empty(c)).collect();
        let settings = DefaultSettings::<f64> {
            verbose: false,
            presolve_enable: false,
            max_threads: 1,
            tol_gap_abs: 1e-12,
            tol_feas: 1e-9,
            // Step and residual are of order 1 already, for every data update.
            equilibrate_enable: false,
            // A linear program has no quadratic part to lean on.
            static_regularization_constant: if self.loss == Loss::Absolute { 1e-8 } else { 1e-13 },
            ..DefaultSettings::default()
        };
        let (hessian, matrix) = (self.hessian.build(self.linear.len()), self.matrix.build(self.rhs.len()));
        guarded(|| DefaultSolver::new(&hessian, &self.linear, &matrix, &self.rhs, &cones, settings))?.ok()
    }

    fn update(&mut self) -> bool {
        let Some(solver) = self.solver.as_mut() else { return false };
        // An empty list means "no change", which is right for a loss without quadratic part.
        solver.update_data(&self.hessian.values, &self.linear, &self.matrix.values, &self.rhs).is_ok()
    }
}
