//! The 27 nonlinear regression problems of NIST's Statistical Reference Datasets (public domain): certified parameters,
//! standard deviations and sums of squares, two starts each.
//!
//! Source: <https://www.itl.nist.gov/div898/strd/nls/nls_main.shtml>.

use std::f64::consts::PI;
use std::sync::Arc;

use num_dual::DualNum;

use crate::auto::{AutoFunction, AutoProblem};
use crate::manifold::Euclidean;

mod data;

/// Published numbers of one problem.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Certified {
    /// First start, far from the solution.
    pub start1: &'static [f64],
    /// Second start, near the solution.
    pub start2: &'static [f64],
    /// Certified parameters, 11 digits.
    pub parameters: &'static [f64],
    /// Certified standard deviations of the parameters.
    pub deviations: &'static [f64],
    /// Certified sum of squared residuals.
    pub sum_of_squares: f64,
    /// Numbers per row of `data`.
    pub columns: usize,
    /// Observations, row by row: y, x (Nelson: y, x1, x2).
    pub data: &'static [f64],
}

/// The formulas; several problems share one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Formula {
    Bennett,
    Saturation,
    ExpRational,
    Power,
    Enso,
    Eckerle,
    Gauss,
    Rational { numerator: usize, denominator: usize },
    Exponentials,
    Kowalik,
    Meyer,
    Osborne,
    Misra1b,
    Misra1c,
    Misra1d,
    Nelson,
    Logistic,
    Richards,
    Roszman,
}

/// One problem: name, published numbers and the residual `y - f(x, b)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nist {
    /// NIST's name.
    pub name: &'static str,
    /// Published numbers.
    pub certified: Certified,
    formula: Formula,
}

impl Nist {
    /// Return the least-squares problem.
    pub fn problem(self) -> AutoProblem<Nist> {
        AutoProblem::new(self, Arc::new(Euclidean(self.certified.parameters.len())))
    }

    /// Return the two starts.
    pub fn starts(&self) -> [&'static [f64]; 2] {
        [self.certified.start1, self.certified.start2]
    }

    /// Return the number of correct digits: the least `-log10(|b_j - c_j| / |c_j|)` over the parameters, within 0 to 11.
    pub fn digits(&self, theta: &[f64]) -> f64 {
        let digits = |(b, c): (&f64, &f64)| {
            let error = ((b - c) / c).abs();
            if error < 1.0 { (-error.log10()).min(11.0) } else { 0.0 }
        };
        theta.iter().zip(self.certified.parameters).map(digits).fold(11.0, f64::min)
    }
}

impl AutoFunction for Nist {
    fn num_values(&self) -> usize {
        self.certified.data.len() / self.certified.columns
    }

    fn values<T: DualNum<Primitive = f64> + Copy>(&self, theta: &[T], values: &mut [T]) {
        for (row, value) in self.certified.data.chunks_exact(self.certified.columns).zip(values) {
            let y = if self.formula == Formula::Nelson { row[0].ln() } else { row[0] };
            *value = -self.formula.value(&row[1..], theta) + y;
        }
    }
}

impl Formula {
    /// Return f(x, b).
    fn value<T: DualNum<Primitive = f64> + Copy>(self, row: &[f64], b: &[T]) -> T {
        let x = row[0];
        let constant = |v: f64| T::from(v);
        match self {
            Formula::Bennett => b[0] * (-(b[1] + x).ln() / b[2]).exp(),
            Formula::Saturation => b[0] * (-(-b[1] * x).exp() + 1.0),
            Formula::ExpRational => (-b[0] * x).exp() / (b[1] + b[2] * x),
            Formula::Power => b[0] * (b[1] * x.ln()).exp(),
            Formula::Enso => {
                let wave = |period: T, c: T, s: T| {
                    let angle = constant(2.0 * PI * x) / period;
                    c * angle.cos() + s * angle.sin()
                };
                b[0] + wave(constant(12.0), b[1], b[2]) + wave(b[3], b[4], b[5]) + wave(b[6], b[7], b[8])
            }
            Formula::Eckerle => b[0] / b[1] * (((constant(x) - b[2]) / b[1]).powi(2) * -0.5).exp(),
            Formula::Gauss => {
                let bell = |height: T, at: T, width: T| height * (-((constant(x) - at) / width).powi(2)).exp();
                b[0] * (-b[1] * x).exp() + bell(b[2], b[3], b[4]) + bell(b[5], b[6], b[7])
            }
            Formula::Rational { numerator, denominator } => {
                let above = horner(&b[..numerator], x);
                above / (horner(&b[numerator..numerator + denominator], x) * x + 1.0)
            }
            Formula::Exponentials => (0..3).fold(constant(0.0), |sum, i| sum + b[2 * i] * (-b[2 * i + 1] * x).exp()),
            Formula::Kowalik => b[0] * (b[1] * x + x * x) / (b[2] * x + x * x + b[3]),
            Formula::Meyer => b[0] * (b[1] / (b[2] + x)).exp(),
            Formula::Osborne => b[0] + b[1] * (-b[3] * x).exp() + b[2] * (-b[4] * x).exp(),
            Formula::Misra1b => b[0] * (-(b[1] * (0.5 * x) + 1.0).powi(-2) + 1.0),
            Formula::Misra1c => b[0] * (-(b[1] * (2.0 * x) + 1.0).sqrt().recip() + 1.0),
            Formula::Misra1d => b[0] * b[1] * x / (b[1] * x + 1.0),
            Formula::Nelson => b[0] - b[1] * x * (-b[2] * row[1]).exp(),
            Formula::Logistic => b[0] / ((b[1] - b[2] * x).exp() + 1.0),
            Formula::Richards => b[0] / (((b[1] - b[2] * x).exp() + 1.0).ln() / b[3]).exp(),
            Formula::Roszman => b[0] - b[1] * x - (b[2] / (-b[3] + x)).atan() / PI,
        }
    }
}

/// Return c_0 + c_1 x + c_2 x^2 + ...
fn horner<T: DualNum<Primitive = f64> + Copy>(coefficients: &[T], x: f64) -> T {
    coefficients.iter().rev().fold(T::from(0.0), |sum, c| sum * x + *c)
}

/// Return the 27 problems in NIST's order: lower, average, higher difficulty.
///
/// ```
/// use cfpose_optim::problem::{LeastSquares, half_squared_norm};
/// use cfpose_optim::testproblems::nist;
/// let thurber = nist::all().into_iter().find(|p| p.name == "Thurber").unwrap();
/// let mut residual = vec![0.0; 37];
/// thurber.problem().residual(thurber.certified.parameters, &mut residual);
/// let relative = 2.0 * half_squared_norm(&residual) / thurber.certified.sum_of_squares - 1.0;
/// assert!(relative.abs() < 1e-10);
/// ```
pub fn all() -> Vec<Nist> {
    use Formula as F;
    let rational = |numerator, denominator| F::Rational { numerator, denominator };
    [
        ("Misra1a", data::MISRA1A, F::Saturation),
        ("Chwirut2", data::CHWIRUT2, F::ExpRational),
        ("Chwirut1", data::CHWIRUT1, F::ExpRational),
        ("Lanczos3", data::LANCZOS3, F::Exponentials),
        ("Gauss1", data::GAUSS1, F::Gauss),
        ("Gauss2", data::GAUSS2, F::Gauss),
        ("DanWood", data::DANWOOD, F::Power),
        ("Misra1b", data::MISRA1B, F::Misra1b),
        ("Kirby2", data::KIRBY2, rational(3, 2)),
        ("Hahn1", data::HAHN1, rational(4, 3)),
        ("Nelson", data::NELSON, F::Nelson),
        ("MGH17", data::MGH17, F::Osborne),
        ("Lanczos1", data::LANCZOS1, F::Exponentials),
        ("Lanczos2", data::LANCZOS2, F::Exponentials),
        ("Gauss3", data::GAUSS3, F::Gauss),
        ("Misra1c", data::MISRA1C, F::Misra1c),
        ("Misra1d", data::MISRA1D, F::Misra1d),
        ("Roszman1", data::ROSZMAN1, F::Roszman),
        ("ENSO", data::ENSO, F::Enso),
        ("MGH09", data::MGH09, F::Kowalik),
        ("Thurber", data::THURBER, rational(4, 3)),
        ("BoxBOD", data::BOXBOD, F::Saturation),
        ("Rat42", data::RAT42, F::Logistic),
        ("MGH10", data::MGH10, F::Meyer),
        ("Eckerle4", data::ECKERLE4, F::Eckerle),
        ("Rat43", data::RAT43, F::Richards),
        ("Bennett5", data::BENNETT5, F::Bennett),
    ]
    .map(|(name, certified, formula)| Nist { name, certified, formula })
    .to_vec()
}
