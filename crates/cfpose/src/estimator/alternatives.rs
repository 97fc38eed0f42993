//! What else a solution may be: its canonical form, other thetas that do as well.

use super::Parts;
use super::candidate::Candidate;
use super::estimate::Alternative;
use super::modes::Mode;
use super::search::Search;
use super::stage::ReadyStage;
use super::verdict::Verdict;
use crate::model::{Findings, Scene};
use cfpose_optim::manifold::Manifold;

impl ReadyStage {
    /// Let the model examine a theta; nuisance parameters after the model's own are carried along, and only what the free
    /// parameters can reach is proposed.
    fn examine(&self, theta: &[f64], parts: &Parts) -> Findings {
        let (own, nuisance) = theta.split_at(self.own());
        let scene = Scene { theta: own, source: &self.sides.source, target: &self.sides.target };
        let mut findings = (self.model().examine)(&scene);
        for other in findings.theta.iter_mut().chain(&mut findings.candidates) {
            self.model().layout.manifold().project(other);
            other.extend(nuisance);
        }
        let base = parts.freedom.as_ref().map(|freedom| freedom.at(own));
        let is_inside = |other: &Vec<f64>| parts.admits(&other[..self.own()]);
        let reachable = |other: &Vec<f64>| base.as_ref().is_none_or(|base| base.admits(other)) && is_inside(other);
        findings.theta = findings.theta.filter(&reachable);
        findings.candidates.retain(reachable);
        findings
    }
}

impl ReadyStage {
    /// Return the thetas that the model says a theta may also be.
    pub fn implied(&self, theta: &[f64], parts: &Parts) -> Vec<Vec<f64>> {
        let findings = self.examine(theta, parts);
        findings.theta.into_iter().chain(findings.candidates).collect()
    }
}

impl Search<'_> {
    /// Bring the best candidate into its canonical form and return what the model says about it, and the other thetas.
    ///
    /// Thetas that the model implies (mirrored, other sign, other decomposition) are judged by the cost of the problem that the
    /// best one minimises. A plausible theta is preferred to an implausible one of the same cost.
    pub fn compare(&self, best: &mut Candidate, all: &[Candidate]) -> (Vec<String>, Vec<Alternative>) {
        let (stage, parts) = (self.last(), self.parts);
        let mut findings = stage.examine(&best.theta, parts);
        if let Some(canonical) = findings.theta.take() {
            best.move_to(&canonical);
        }
        let mut alternatives = self.implied(best, std::mem::take(&mut findings.candidates));
        let equal = |other: &Alternative| self.is_as_good(other.cost, best.outcome.cost);
        if findings.implausible
            && let Some(index) =
                alternatives.iter().position(|other| equal(other) && !stage.examine(&other.theta, parts).implausible)
        {
            let before = (best.theta.clone(), best.outcome.cost);
            best.move_to(&alternatives[index].theta.clone());
            (alternatives[index].theta, alternatives[index].cost) = before;
            findings.warnings = stage.examine(&best.theta, parts).warnings;
        }
        if best.evidence.is_some() {
            alternatives = self.modes_of(best);
        } else {
            self.add_found(&mut alternatives, best, all);
            let equals = alternatives.iter().filter(|other| self.is_as_good(other.cost, best.outcome.cost)).count();
            if equals > 0 {
                findings
                    .warnings
                    .push(format!("{equals} other theta explain(s) the data as well: see the alternatives"));
            }
        }
        let own = stage.own();
        alternatives.iter_mut().for_each(|other| other.theta.truncate(own));
        (findings.warnings, alternatives)
    }

    /// Return the other modes of the points' likelihood; the cost is that of the problem that the best one minimises.
    fn modes_of(&self, best: &Candidate) -> Vec<Alternative> {
        let nuisance = &best.theta[self.last().own()..];
        let of = |mode: &Mode| {
            let theta = [&mode.fit.theta[..self.last().own()], nuisance].concat();
            let equal = mode.behind.is_equal(&self.parts.criteria);
            let verdict = Some(if equal { Verdict::Ambiguous } else { Verdict::Suspect });
            let cost = best.problem.evaluate(&theta).cost;
            Alternative { theta, cost, verdict, relative_likelihood: Some((-mode.behind.nats).exp()) }
        };
        best.modes.iter().map(of).collect()
    }

    /// Return the thetas that the model implies and that do as well, cheapest first.
    fn implied(&self, best: &Candidate, candidates: Vec<Vec<f64>>) -> Vec<Alternative> {
        let mut implied: Vec<Alternative> = Vec::new();
        for theta in candidates {
            let cost = best.problem.evaluate(&theta).cost;
            let known = implied.iter().any(|other| self.is_same(&other.theta, &theta));
            if self.is_as_good(cost, best.outcome.cost) && !self.is_same(&best.theta, &theta) && !known {
                implied.push(Alternative { theta, cost, verdict: None, relative_likelihood: None });
            }
        }
        implied.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        implied
    }

    /// Add what other starts led to, best first.
    fn add_found(&self, alternatives: &mut Vec<Alternative>, best: &Candidate, all: &[Candidate]) {
        for other in all.iter().filter(|other| other.outcome.usable()) {
            let different = |theta: &[f64]| !self.is_same(theta, &other.theta);
            if different(&best.theta) && alternatives.iter().all(|known| different(&known.theta)) {
                let verdict = other.statistics.as_ref().map(|_| match other.accepted {
                    true => Verdict::Good,
                    false => Verdict::Suspect,
                });
                let (theta, cost) = (other.theta.clone(), other.outcome.cost);
                alternatives.push(Alternative { theta, cost, verdict, relative_likelihood: None });
            }
        }
    }

    fn is_as_good(&self, cost: f64, best: f64) -> bool {
        let criteria = &self.parts.criteria;
        cost <= criteria.equal_factor * best + criteria.equal_floor
    }
}
