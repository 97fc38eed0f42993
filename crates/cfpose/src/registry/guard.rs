//! Entries that a program adds are looked at where they enter: what would be a panic or a silent untruth later is an error with the
//! entry's name.
//!
//! Entries that ship are held by the tests of this library and are not looked at again.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, PoisonError};

use cfpose_kernel::family::{BasisBlock, DynFamily};
use cfpose_kernel::isa::Isa;
use cfpose_kernel::map::{DynMap, MapBlock, Transform};
use cfpose_kernel::means::Execution;
use cfpose_kernel::points::{BLOCK, Points};
use cfpose_optim::Outcome;
use cfpose_optim::constraint::{Bounds, Constraints};
use cfpose_optim::manifold::Manifold;
use cfpose_optim::problem::{Capabilities, LeastSquares, half_squared_norm};
use cfpose_optim::solver::{Control, Needs, SolveError, Solver};

use crate::entry::BuildError;
use crate::error::Error;
use crate::model::{Model, PointKind};
use crate::problem::map_points;
use crate::start::{StartContext, StartStrategy};

/// Largest relative difference between the cost that a solver reports and that of its theta.
const SAME_COST: f64 = 1e-6;

/// Say whether an entry is a line of a table that ships.
pub(super) fn ships<E>(table: &[&'static E], entry: &E) -> bool {
    table.iter().any(|known| std::ptr::eq(*known, entry))
}

/// Build an entry; a panic becomes an error with its name.
pub(super) fn build<T>(
    kind: &'static str,
    name: &str,
    build: impl FnOnce() -> Result<T, BuildError>,
) -> Result<T, BuildError> {
    catch_unwind(AssertUnwindSafe(build)).unwrap_or_else(|panic| {
        let problem = format!("it panics when it is built: {}", words(panic.as_ref()));
        Err(BuildError::Broken { kind, name: name.to_string(), problem })
    })
}

/// Return the message of a panic.
fn words(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
    text.unwrap_or("without a message").split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Look at a model: sizes of theta, dimensions of both sides, and what its maps do to a few points.
pub(super) fn model(name: &str, model: &Model) -> Result<(), BuildError> {
    let broken = |problem: String| BuildError::Broken { kind: "model", name: name.to_string(), problem };
    let expected = model.layout.manifold().ambient();
    for (what, theta) in [("identity", &model.identity), ("typical", &model.typical)] {
        if theta.len() != expected {
            return Err(broken(format!("its `{what}` has {} numbers, its layout {expected}", theta.len())));
        }
        if theta.iter().any(|value| !value.is_finite()) {
            return Err(broken(format!("its `{what}` is not finite")));
        }
    }
    let (source, target) = (model.source.as_ref(), model.target.map());
    if !(1..=3).contains(&source.dim()) || source.dim() != target.dim() {
        let dims = [source.dim(), target.dim()];
        return Err(broken(format!(
            "its sides map into {} and {} dimensions; both need the same 1 to 3",
            dims[0], dims[1]
        )));
    }
    for (side, map, kind) in [("source", source, model.source_points), ("target", target, model.target_points)] {
        let takes = if let PointKind::Plain(dim) = kind { dim } else { 3 };
        if takes != map.point_dim() {
            let map = map.point_dim();
            return Err(broken(format!("its {side} side takes points of {takes} coordinates, its map of {map}")));
        }
        let mapped = catch_unwind(AssertUnwindSafe(|| maps(map, [&model.identity, &model.typical])));
        match mapped {
            Ok(Ok(())) => {}
            Ok(Err(problem)) => return Err(broken(format!("its {side} map {problem}"))),
            Err(panic) => return Err(broken(format!("its {side} map panics: {}", words(panic.as_ref())))),
        }
    }
    Ok(())
}

/// Return points in general position, more than one block of them.
fn probes(dim: usize) -> Option<Points> {
    let value =
        |k: usize, d: usize| 0.3 + 0.7 * (((k * 37 + d * 101) % 97) as f64 / 97.0) + if d == 2 { 1.0 } else { 0.0 };
    Points::from_columns((0..dim).map(|d| (0..BLOCK + 5).map(|k| value(k, d)).collect()).collect()).ok()
}

/// Map points at thetas; some point must have a finite image at one of them.
fn maps(map: &dyn DynMap, thetas: [&Vec<f64>; 2]) -> Result<(), String> {
    let Some(points) = probes(map.point_dim()) else {
        return Err(format!("takes points of {} coordinates; 1 to 3 are possible", map.point_dim()));
    };
    let lifted = map.lift(&points);
    if lifted.len != points.len() || lifted.columns.iter().any(|column| column.len() != lifted.weights.len()) {
        return Err(format!("lifts {} points to {}", points.len(), lifted.len));
    }
    let execution = Execution { isa: Isa::baseline(), pool: None };
    let mut block = MapBlock::new(map.dim(), 0);
    for theta in thetas {
        if map_points(map, &lifted, theta, &execution).is_ok() {
            return Ok(());
        }
        let prepared = map.prepare(theta, &[], 0);
        map.block(execution.isa, &prepared, &Transform::identity(), &lifted, 0, &mut block);
        if (0..BLOCK).any(|k| block.x.iter().all(|row| row.0[k].is_finite())) {
            return Ok(());
        }
    }
    Err("returns NaN or infinity for every point, at its identity and at its typical theta".to_string())
}

/// Look at a family: its size, what it writes, and that blocks and single points agree.
pub(super) fn family(name: &str, family: &dyn DynFamily, dim: usize) -> Result<(), BuildError> {
    let problem = match catch_unwind(AssertUnwindSafe(|| fills(family, dim))) {
        Ok(Ok(())) => return Ok(()),
        Ok(Err(problem)) => problem,
        Err(panic) => format!("it panics: {}", words(panic.as_ref())),
    };
    Err(BuildError::Broken { kind: "family", name: name.to_string(), problem })
}

fn fills(family: &dyn DynFamily, dim: usize) -> Result<(), String> {
    let size = family.num_basis(dim);
    if size == 0 {
        return Err(format!("it has no functions in {dim} dimension(s)"));
    }
    if let Some(c) = family.coefficients(dim)
        && (c.is_empty() || !c.len().is_multiple_of(size) || c.iter().any(|v| !v.is_finite()))
    {
        return Err(format!("its coefficients are {} numbers, no whole rows of {size} finite ones", c.len()));
    }
    let runs: usize = family.segments(dim).iter().map(|segment| segment.num_basis).sum();
    if runs != size {
        return Err(format!("its runs hold {runs} functions, it says {size}"));
    }
    let Some(points) = probes(dim) else { return Ok(()) };
    let mut block = MapBlock::new(dim, 0);
    for (d, row) in block.x.iter_mut().enumerate() {
        row.0.copy_from_slice(&points.column(d)[..BLOCK]);
        row.0.iter_mut().for_each(|x| *x -= if d == 2 { 1.6 } else { 0.6 });
    }
    let mut basis = BasisBlock::new(family, dim, true);
    for row in basis.value.iter_mut().chain(&mut basis.gradient) {
        row.0.fill(f64::NAN);
    }
    family.block(Isa::baseline(), &block, basis.rows());
    for (what, rows) in [("value", &basis.value), ("gradient", &basis.gradient)] {
        if let Some((i, _)) = rows.iter().enumerate().find(|(_, row)| row.0.iter().all(|v| !v.is_finite())) {
            return Err(format!("{what} {} of {} is NaN at every point, or not written", i + 1, rows.len()));
        }
    }
    let mut single = vec![f64::NAN; size];
    for k in [0, BLOCK / 2] {
        let x: Vec<f64> = block.x.iter().map(|row| row.0[k]).collect();
        single.fill(f64::NAN);
        family.values(&x, &mut single);
        if let Some(i) = single.iter().position(|v| !v.is_finite()) {
            return Err(format!("function {} of {size} is {} at {x:?}, or not written", i + 1, single[i]));
        }
    }
    Ok(())
}

/// A solver whose panics are errors, and whose outcomes are looked at where it does not ship.
pub(super) struct Watched {
    /// The solver.
    pub solver: Box<dyn Solver>,
    /// Whether a program added it.
    pub own: bool,
}

impl Solver for Watched {
    fn name(&self) -> &'static str {
        self.solver.name()
    }

    fn needs(&self) -> Needs {
        self.solver.needs()
    }

    fn solve(
        &self,
        problem: &dyn LeastSquares,
        start: &[f64],
        control: &mut Control<'_>,
    ) -> Result<Outcome, SolveError> {
        let broken = |problem: String| SolveError::Broken { solver: self.solver.name().to_string(), problem };
        let seen = Seen { problem, costs: Mutex::default() };
        let given: &dyn LeastSquares = if self.own { &seen } else { problem };
        let solved = catch_unwind(AssertUnwindSafe(|| self.solver.solve(given, start, control)));
        let outcome = solved.map_err(|panic| {
            broken(format!("a panic in it, or in the model or family that it evaluates: {}", words(panic.as_ref())))
        })??;
        if self.own {
            plausible(&outcome, &seen, start.len()).map_err(broken)?;
        }
        Ok(outcome)
    }
}

/// Check that an outcome is one: theta of the right size, finite where it is usable, with its own cost.
fn plausible(outcome: &Outcome, seen: &Seen<'_>, expected: usize) -> Result<(), String> {
    if outcome.theta.len() != expected {
        return Err(format!("it returns a theta of {} numbers, not {expected}", outcome.theta.len()));
    }
    if outcome.cost.is_nan() || outcome.cost < 0.0 {
        return Err(format!("it returns the cost {}", outcome.cost));
    }
    if !outcome.usable() {
        return Ok(());
    }
    if let Some(value) = outcome.theta.iter().find(|value| !value.is_finite()) {
        return Err(format!("it returns a theta that holds {value} as usable"));
    }
    let cost = seen.cost(&outcome.theta);
    let same = (cost - outcome.cost).abs() <= SAME_COST * (1e-12 + cost.max(outcome.cost));
    if same { Ok(()) } else { Err(format!("it reports the cost {:e} at a theta whose cost is {cost:e}", outcome.cost)) }
}

/// A start strategy whose panics are errors, and whose proposals are looked at where it does not ship.
pub(super) struct WatchedStart {
    /// The strategy.
    pub start: Box<dyn StartStrategy>,
    /// Whether a program added it.
    pub own: bool,
}

impl StartStrategy for WatchedStart {
    fn name(&self) -> &'static str {
        self.start.name()
    }

    fn starts(&self, context: &StartContext<'_>) -> Result<Vec<Vec<f64>>, Error> {
        let broken = |problem: String| {
            Error::from(BuildError::Broken { kind: "start", name: self.start.name().to_string(), problem })
        };
        let starts = catch_unwind(AssertUnwindSafe(|| self.start.starts(context)))
            .map_err(|panic| broken(format!("it panics: {}", words(panic.as_ref()))))??;
        let expected = context.model.layout.manifold().ambient();
        for theta in starts.iter().filter(|_| self.own) {
            if theta.len() != expected {
                return Err(broken(format!("it proposes a theta of {} numbers, not {expected}", theta.len())));
            }
            if let Some(value) = theta.iter().find(|value| !value.is_finite()) {
                return Err(broken(format!("it proposes a theta that holds {value}")));
            }
        }
        Ok(starts)
    }
}

/// A problem that remembers the cost of every theta, so that looking at an outcome takes no evaluation more.
struct Seen<'a> {
    problem: &'a dyn LeastSquares,
    costs: Mutex<Vec<(Vec<f64>, f64)>>,
}

impl Seen<'_> {
    fn keep(&self, theta: &[f64], residual: &[f64]) {
        let mut costs = self.costs.lock().unwrap_or_else(PoisonError::into_inner);
        costs.push((theta.to_vec(), half_squared_norm(residual)));
    }

    /// Return the cost at a theta; one that was never evaluated is evaluated now.
    fn cost(&self, theta: &[f64]) -> f64 {
        let costs = self.costs.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, cost)) = costs.iter().rev().find(|(seen, _)| seen == theta) {
            return *cost;
        }
        let mut residual = vec![0.0; self.problem.num_residuals()];
        self.problem.residual(theta, &mut residual);
        half_squared_norm(&residual)
    }
}

impl LeastSquares for Seen<'_> {
    fn manifold(&self) -> &dyn Manifold {
        self.problem.manifold()
    }

    fn num_residuals(&self) -> usize {
        self.problem.num_residuals()
    }

    fn residual(&self, theta: &[f64], residual: &mut [f64]) {
        self.problem.residual(theta, residual);
        self.keep(theta, residual);
    }

    fn jacobian(&self, theta: &[f64], residual: &mut [f64], jacobian: &mut [f64]) {
        self.problem.jacobian(theta, residual, jacobian);
        self.keep(theta, residual);
    }

    fn curvature(&self, theta: &[f64], weights: &[f64], hessian: &mut [f64]) {
        self.problem.curvature(theta, weights, hessian);
    }

    fn capabilities(&self) -> Capabilities {
        self.problem.capabilities()
    }

    fn bounds(&self) -> Option<&Bounds> {
        self.problem.bounds()
    }

    fn constraints(&self) -> Option<&dyn Constraints> {
        self.problem.constraints()
    }
}
