//! What the back-end `basin` needs: the problem that its methods call, and the loop that steps them inside a [`Frame`].
//!
//! basin's own tests of convergence are switched off where that is possible: the frame's tests decide, as for argmin.

use basin::{
    BoxBounds, ConstraintDescription, ConstraintSet, Constraints, CostFunction, CountsMirror, DenseMatrix, Executor,
    Gradient, InitialState, Jacobian, Residual, Solver as Method, State, StepOutcome,
};

use crate::tangent::{Frame, guarded};

/// Steps of a method without a relative decrease of the least cost after which its round is over.
const WITHOUT_GAIN: usize = 3;

/// The problem as basin sees it. Its coordinates are `x = (flat - 0) / units + origin`, flat ones being the frame's.
pub(crate) struct Operator<'o, 'f, 's, 'a> {
    frame: &'o Frame<'f, 's, 'a>,
    origin: Vec<f64>,
    units: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    /// Give an infinite cost where there is none, instead of an error: populations go on.
    lenient: bool,
}

/// The solve is over, or the point is not finite.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stopped;

impl<'o, 'f, 's, 'a> Operator<'o, 'f, 's, 'a> {
    /// Make the problem of methods with derivatives: coordinates that know the size of theta.
    pub(crate) fn smooth(frame: &'o Frame<'f, 's, 'a>) -> Self {
        let origin = frame.origin();
        let units = vec![1.0; frame.size];
        Self::new(frame, origin, units, false)
    }

    /// Make the problem of methods without derivatives: each coordinate in units of the size of theta, at least 1.
    pub(crate) fn searched(frame: &'o Frame<'f, 's, 'a>) -> Self {
        let units = frame.extent().iter().map(|extent| extent.max(1.0)).collect();
        Self::new(frame, vec![0.0; frame.size], units, true)
    }

    fn new(frame: &'o Frame<'f, 's, 'a>, origin: Vec<f64>, units: Vec<f64>, lenient: bool) -> Self {
        let size = frame.size;
        let (lower, upper) = frame.bounds().unwrap_or((vec![f64::NEG_INFINITY; size], vec![f64::INFINITY; size]));
        let placed = |bound: &[f64]| -> Vec<f64> {
            bound.iter().zip(&units).zip(&origin).map(|((b, u), o)| b / u + o).collect()
        };
        let (lower, upper) = (placed(&lower), placed(&upper));
        Self { frame, origin, units, lower, upper, lenient }
    }

    /// Return where a method begins: the frame's base.
    pub(crate) fn start(&self) -> Vec<f64> {
        self.origin.iter().zip(self.lower.iter().zip(&self.upper)).map(|(x, (l, u))| x.clamp(*l, *u)).collect()
    }

    /// Say whether any coordinate is bounded.
    pub(crate) fn is_bounded(&self) -> bool {
        self.lower.iter().chain(&self.upper).any(|bound| bound.is_finite())
    }

    fn flat(&self, x: &[f64]) -> Vec<f64> {
        x.iter().zip(&self.origin).zip(&self.units).map(|((x, o), u)| (x - o) * u).collect()
    }
}

impl Constraints for Operator<'_, '_, '_, '_> {
    type Set = ConstraintSet<BoxBounds<Vec<f64>>>;

    fn constraints(&self) -> <Self::Set as ConstraintDescription>::Borrowed<'_> {
        ConstraintSet::new().with_bounds(BoxBounds::new(Some(&self.lower), Some(&self.upper)))
    }
}

impl CostFunction for Operator<'_, '_, '_, '_> {
    type Param = Vec<f64>;
    type Output = f64;
    type Error = Stopped;

    fn cost(&self, x: &Vec<f64>) -> Result<f64, Stopped> {
        let flat = self.flat(x);
        let cost = if self.lenient {
            self.frame.cost(&flat)
        } else {
            self.frame.cost_and_gradient(&flat).map(|(cost, _)| cost)
        };
        match cost {
            Some(cost) => Ok(cost),
            // Line searches step back from an infinite value.
            None if !self.frame.is_over() => Ok(f64::INFINITY),
            None => Err(Stopped),
        }
    }
}

impl Gradient for Operator<'_, '_, '_, '_> {
    type Gradient = Vec<f64>;

    fn gradient(&self, x: &Vec<f64>) -> Result<Vec<f64>, Stopped> {
        let (_, gradient) = self.frame.cost_and_gradient(&self.flat(x)).ok_or(Stopped)?;
        Ok(gradient.iter().zip(&self.units).map(|(g, u)| g * u).collect())
    }
}

impl Residual for Operator<'_, '_, '_, '_> {
    type Param = Vec<f64>;
    type Output = Vec<f64>;
    type Error = Stopped;

    fn residual(&self, x: &Vec<f64>) -> Result<Vec<f64>, Stopped> {
        match self.frame.residual_and_jacobian(&self.flat(x)) {
            Some((residual, _)) => Ok(residual),
            None if self.frame.is_over() => Err(Stopped),
            // A trial whose values are not finite is a failed one: a huge value makes the method step back.
            None => Ok(vec![1e3 * (1.0 + (2.0 * self.frame.best_cost()).sqrt()); self.frame.num_residuals()]),
        }
    }
}

impl Jacobian for Operator<'_, '_, '_, '_> {
    type Jacobian = DenseMatrix<f64>;

    fn jacobian(&self, x: &Vec<f64>) -> Result<DenseMatrix<f64>, Stopped> {
        let (residual, jacobian) = self.frame.residual_and_jacobian(&self.flat(x)).ok_or(Stopped)?;
        Ok(DenseMatrix::from_row_slice(residual.len(), self.frame.size, &jacobian))
    }
}

/// When a round is over, and who counts its iterations.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pace {
    /// Steps of a round at most.
    pub(crate) steps: usize,
    /// Steps without gain at most.
    pub(crate) without_gain: usize,
    /// Whether evaluations of residual and Jacobian count the iterations already.
    pub(crate) counted: bool,
}

impl Pace {
    /// The pace of methods with derivatives.
    pub(crate) fn smooth(steps: usize, counted: bool) -> Self {
        Self { steps, without_gain: WITHOUT_GAIN, counted }
    }
}

/// Step a method until it ends, the frame's solve is over, or steps bring nothing.
pub(crate) fn drive<'o, 'f, 's, 'a, So, S>(operator: Operator<'o, 'f, 's, 'a>, method: So, pace: Pace)
where
    S: State<Param = Vec<f64>, Float = f64> + CountsMirror,
    So: Method<Operator<'o, 'f, 's, 'a>, S> + InitialState<Vec<f64>, State = S>,
{
    let frame = operator.frame;
    let (origin, units) = (operator.origin.clone(), operator.units.clone());
    let start = operator.start();
    let begin = || Executor::from_start(operator, method, start).into_stepper();
    let Some(Ok(mut stepper)) = guarded(begin) else { return };
    let (mut least, mut idle) = (frame.best_cost(), 0);
    for _ in 0..pace.steps {
        if frame.is_over() || (!pace.counted && frame.next_iteration().is_none()) {
            return;
        }
        let stopped = match guarded(|| stepper.step()) {
            Some(Ok(StepOutcome::Continue)) => false,
            Some(Ok(StepOutcome::Stopped(_))) => true,
            _ => return,
        };
        if !pace.counted {
            let now = stepper.state().param();
            let flat: Vec<f64> = now.iter().zip(&origin).zip(&units).map(|((x, o), u)| (x - o) * u).collect();
            frame.record(&flat, stepper.state().cost(), f64::NAN, f64::NAN);
        }
        let best = frame.best_cost();
        idle = if best < least * (1.0 - 4.0 * f64::EPSILON) { 0 } else { idle + 1 };
        least = best;
        if stopped || idle >= pace.without_gain || frame.flat().is_some() {
            return;
        }
    }
}
