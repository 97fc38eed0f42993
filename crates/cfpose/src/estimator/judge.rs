//! What to think of a solution: its canonical form, other thetas that do as well, and what the data leave undetermined.

use cfpose_optim::Outcome;
use cfpose_optim::manifold::Manifold;
use cfpose_optim::problem::LeastSquares;

use super::{Alternative, Prepared};
use crate::model::{Findings, Scene};
use crate::statistics::conditioning::{Conditioning, observe};

/// A candidate counts as good as the best theta up to this factor of the cost, ...
const EQUAL_FACTOR: f64 = 4.0;
/// ... or below this cost: rounding, for features of order 1.
const EQUAL_FLOOR: f64 = 1e-16;

/// A solution after its examination.
pub(super) struct Judged {
    pub theta: Vec<f64>,
    pub alternatives: Vec<Alternative>,
    pub warnings: Vec<String>,
    pub conditioning: Conditioning,
}

impl Prepared {
    /// Let the model examine a theta; nuisance parameters after the model's own are carried along.
    fn examine(&self, theta: &[f64]) -> Findings {
        let (own, nuisance) = theta.split_at(self.model.layout.manifold().ambient());
        let scene = Scene { theta: own, source: &self.source, target: &self.target };
        let mut findings = (self.model.examine)(&scene);
        for other in findings.theta.iter_mut().chain(&mut findings.candidates) {
            self.model.layout.manifold().project(other);
            other.extend(nuisance);
        }
        findings
    }

    /// Return what the model says about theta (its own part), and what the data determine there.
    pub(super) fn examination(&self, theta: &[f64]) -> (Vec<String>, Conditioning) {
        let findings = self.examine(theta);
        let evaluation = self.problem.evaluate(theta);
        let unknowns = self.problem.manifold().tangent();
        let free = self.settings.free.as_deref();
        (findings.warnings, observe(&evaluation.jacobian, unknowns, &self.model.layout, free, theta))
    }

    /// Examine the best outcome against the other starts' outcomes.
    pub(super) fn judge(&self, best: &Outcome, others: impl Iterator<Item = Outcome>) -> Judged {
        if !best.usable() {
            return Judged {
                theta: best.theta.clone(),
                alternatives: Vec::new(),
                warnings: Vec::new(),
                conditioning: Conditioning::unknown(self.problem.manifold().tangent()),
            };
        }
        let mut findings = self.examine(&best.theta);
        let canonical = findings.theta.take().filter(|theta| self.admits(&best.theta, theta));
        let mut theta = canonical.unwrap_or_else(|| best.theta.clone());
        let mut cost = best.cost;
        let mut alternatives = self.alternatives(&theta, cost, &mut findings, others);
        if findings.implausible {
            let equal = |other: &Alternative| as_good(other.cost, cost) && !self.examine(&other.theta).implausible;
            if let Some(index) = alternatives.iter().position(equal) {
                let preferred = &mut alternatives[index];
                std::mem::swap(&mut preferred.theta, &mut theta);
                std::mem::swap(&mut preferred.cost, &mut cost);
                findings.warnings = self.examine(&theta).warnings;
            }
        }
        let mut warnings = findings.warnings;
        let equals = alternatives.iter().filter(|other| as_good(other.cost, cost)).count();
        if equals > 0 {
            warnings.push(format!("{equals} other theta explain(s) the data as well: see the alternatives"));
        }
        let evaluation = self.problem.evaluate(&theta);
        let unknowns = self.problem.manifold().tangent();
        let free = self.settings.free.as_deref();
        let conditioning = observe(&evaluation.jacobian, unknowns, &self.model.layout, free, &theta);
        warnings.extend(conditioning.warnings());
        Judged { theta, alternatives, warnings, conditioning }
    }

    /// Collect the model's candidates that do as well, and the other starts' results that are different thetas.
    fn alternatives(
        &self,
        theta: &[f64],
        cost: f64,
        findings: &mut Findings,
        others: impl Iterator<Item = Outcome>,
    ) -> Vec<Alternative> {
        let mut found: Vec<Alternative> = Vec::new();
        let candidates = std::mem::take(&mut findings.candidates).into_iter().map(|other| {
            let cost = self.problem.evaluate(&other).cost;
            (other, cost)
        });
        let implied = candidates.filter(|(other, other_cost)| self.admits(theta, other) && as_good(*other_cost, cost));
        let solved = others.filter(Outcome::usable).map(|o| (o.theta, o.cost));
        for (other, other_cost) in implied.chain(solved) {
            let distinct = |known: &[f64]| known.iter().zip(&other).any(|(a, b)| (a - b).abs() > 1e-3);
            if distinct(theta) && found.iter().all(|known| distinct(&known.theta)) {
                found.push(Alternative { theta: other, cost: other_cost, verdict: None });
            }
        }
        found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        found
    }

    /// Say whether `other` can be reached from `theta` by the free parameters alone.
    fn admits(&self, theta: &[f64], other: &[f64]) -> bool {
        if self.settings.free.is_none() {
            return true;
        }
        let manifold = self.problem.manifold();
        let mut step = vec![0.0; manifold.tangent()];
        let mut reached = vec![0.0; theta.len()];
        manifold.local(theta, other, &mut step);
        manifold.retract(theta, &step, &mut reached);
        reached.iter().zip(other).all(|(a, b)| (a - b).abs() < 1e-6)
    }
}

fn as_good(cost: f64, best: f64) -> bool {
    cost <= EQUAL_FACTOR * best + EQUAL_FLOOR
}
