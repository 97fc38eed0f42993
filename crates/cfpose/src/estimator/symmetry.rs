//! Symmetries of the source, read off modes that the data cannot tell apart (docs/method.md, *Modes*).
//!
//! Where theta_1 and theta_j explain the target equally well, g = theta_1^-1 theta_j maps the source onto itself, so theta_i g does as
//! well as theta_i for every mode i. A cube has 24 poses; two of them beside the first usually lead to all.

use super::modes::{Mode, ONE_MODE};
use super::search::Search;
use crate::distances::Mover;
use crate::geometry::pose::Pose;
use cfpose_kernel::points::Points;
use faer::linalg::solvers::DenseSolveCore;

/// x -> A x + b, A row by row.
struct Affine {
    a: Vec<f64>,
    b: Vec<f64>,
}

impl Affine {
    /// Return the map that applies `first`, then this one.
    fn after(&self, first: &Self) -> Self {
        let d = self.b.len();
        let turned =
            |column: &dyn Fn(usize) -> f64, i: usize| (0..d).map(|k| self.a[d * i + k] * column(k)).sum::<f64>();
        let a = (0..d * d).map(|at| turned(&|k| first.a[d * k + at % d], at / d)).collect();
        let b = (0..d).map(|i| turned(&|k| first.b[k], i) + self.b[i]).collect();
        Self { a, b }
    }

    fn inverse(&self) -> Option<Self> {
        let d = self.b.len();
        let lu = faer::Mat::from_fn(d, d, |i, k| self.a[d * i + k]).partial_piv_lu();
        let inverse = lu.inverse();
        let a: Vec<f64> = (0..d * d).map(|at| inverse[(at / d, at % d)]).collect();
        let b: Vec<f64> = (0..d).map(|i| -(0..d).map(|k| a[d * i + k] * self.b[k]).sum::<f64>()).collect();
        a.iter().chain(&b).all(|x| x.is_finite()).then_some(Self { a, b })
    }
}

impl Search<'_> {
    /// Return at most so many thetas that the modes that may be equal imply and that are neither one of them nor among those `tried`; none
    /// for a model whose maps of the source do not form a group.
    pub fn symmetric(&self, modes: &[Mode], tried: &[Vec<f64>], most: usize) -> Vec<Vec<f64>> {
        let equal = modes.iter().filter(|mode| mode.behind.may_be_equal(&self.parts.criteria));
        let equal: Vec<&Vec<f64>> = equal.map(|mode| &mode.fit.theta).collect();
        if equal.len() < 2 {
            return Vec::new();
        }
        let maps: Option<Vec<Affine>> = equal.iter().map(|theta| self.affine(theta)).collect();
        let Some(maps) = maps else { return Vec::new() };
        let Some(back) = maps[0].inverse() else { return Vec::new() };
        let mut found: Vec<Vec<f64>> = Vec::new();
        let known = |theta: &[f64], found: &[Vec<f64>]| {
            let is_near = |other: &[f64]| self.apart(other, theta) <= ONE_MODE;
            modes.iter().any(|mode| is_near(&mode.fit.theta)) || tried.iter().chain(found).any(|other| is_near(other))
        };
        for step in &maps[1..] {
            let symmetry = back.after(step);
            let inverse = symmetry.inverse();
            for map in &maps {
                for symmetry in inverse.iter().chain([&symmetry]) {
                    if found.len() >= most {
                        return found;
                    }
                    let theta = self.of_affine(equal[0], &map.after(symmetry));
                    let reached = theta.and_then(|theta| self.reached(theta, equal[0]));
                    let new = reached.filter(|theta| !known(theta, &found));
                    found.extend(new);
                }
            }
        }
        found
    }

    /// Return theta with what is fixed as it is `from` where the free parameters lead; `None` where they do not lead there, or where the
    /// scene is impossible.
    fn reached(&self, mut theta: Vec<f64>, from: &[f64]) -> Option<Vec<f64>> {
        let own = self.last().own();
        if let Some(freedom) = self.parts.freedom.as_ref().map(|freedom| freedom.at(&from[..own])) {
            if !freedom.admits(&theta[..own]) {
                return None;
            }
            let held = freedom.hold(&theta[..own]);
            theta[..own].copy_from_slice(&held);
        }
        self.is_plausible(&theta).then_some(theta)
    }

    /// Return the map of the source that theta stands for: of poses, and of models that are linear maps.
    fn affine(&self, theta: &[f64]) -> Option<Affine> {
        let (stage, own) = (self.last(), self.last().own());
        let Some(group) = stage.model().linear.as_ref() else {
            let pose = Pose::of_theta(&stage.model().layout, &theta[..own])?;
            return Some(Affine { a: pose.rotation.to_vec(), b: pose.translation.to_vec() });
        };
        // The images of the origin and of the unit points.
        let d = group.dim;
        let unit = |k: usize| (0..d).map(|c| f64::from(u8::from(c + 1 == k))).collect::<Vec<f64>>();
        let columns: Vec<Vec<f64>> = (0..d).map(|c| (0..=d).map(|k| unit(k)[c]).collect()).collect();
        if stage.sides.source.dim() != d {
            return None;
        }
        let images = Mover::new(&stage.problem, &Points::from_columns(columns).ok()?).map(theta, false).x;
        let a = (0..d * d).map(|at| images[1 + at % d][at / d] - images[0][at / d]).collect();
        let map = Affine { a, b: images[0][..d].to_vec() };
        // A bent map is not what its linear part says.
        let same = self.of_affine(theta, &map)?;
        (self.apart(&same, theta) < 1e-6).then_some(map)
    }

    /// Return the theta of a map; what the map does not say is that of `like`.
    fn of_affine(&self, like: &[f64], map: &Affine) -> Option<Vec<f64>> {
        let (stage, own) = (self.last(), self.last().own());
        let layout = &stage.model().layout;
        let mut theta = like.to_vec();
        match stage.model().linear.as_ref() {
            Some(group) => theta[..own].copy_from_slice(&(group.theta)(&map.a, &map.b)),
            None => {
                theta[layout.range("rotation")?].copy_from_slice(&map.a);
                theta[layout.range("translation")?].copy_from_slice(&map.b);
            }
        }
        theta.iter().all(|x| x.is_finite()).then_some(theta)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_after_its_inverse_moves_nothing() {
        let map = Affine { a: vec![0.0, -2.0, 0.0, 1.5, 0.1, 0.0, 0.0, 0.3, 1.0], b: vec![0.5, -1.0, 2.0] };
        let same = map.inverse().unwrap().after(&map);
        let unit = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        assert!(same.a.iter().zip(&unit).all(|(a, b)| (a - b).abs() < 1e-12), "{:?}", same.a);
        assert!(same.b.iter().all(|b| b.abs() < 1e-12), "{:?}", same.b);
        assert!(Affine { a: vec![1.0, 1.0, 1.0, 1.0], b: vec![0.0; 2] }.inverse().is_none());
    }
}
