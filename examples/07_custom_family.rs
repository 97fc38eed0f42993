//! A feature family of your own: Gaussian bumps on each coordinate. One file, no derivative, selected by name.
use cfpose::family::Separable;
use cfpose::{Execution, FamilyEntry, Points, Registry, Scalar, SeparableFamily, Settings, estimate};

struct Bumps;

impl SeparableFamily for Bumps {
    fn num_basis(&self) -> usize {
        4
    }
    #[inline(always)]
    fn basis<S: Scalar>(&self, x: S, out: &mut [S]) {
        for i in 0..4 {
            let distance = x - (0.5 * i as f64 - 0.75);
            out[i] = (distance * distance * -4.0).exp();
        }
    }
}

pub(crate) static BUMPS: FamilyEntry = FamilyEntry {
    name: "bumps",
    summary: "four Gaussian bumps on each coordinate",
    parameters: &[],
    source: "this example",
    details: "f_i(x) = exp(-4 (x - c_i)^2)",
    build: |_, _| Ok(Box::new(Separable(Bumps))),
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut registry = Registry::default();
    registry.families.push(&BUMPS);
    let p: Vec<[f64; 1]> = (0..500).map(|k| [(f64::from(k) / 500.0).powi(2)]).collect();
    let q: Vec<[f64; 1]> = p.iter().rev().map(|p| [1.3 * p[0]]).collect();
    let settings = Settings { features: Some("bumps".into()), ..Settings::preset("paper", "gain1")? };
    let (p, q) = (Points::from_rows(&p)?, Points::from_rows(&q)?);
    let theta = estimate(&registry, &settings, &p, &q, &Execution::default())?.theta;
    assert!((theta[0] - 1.3).abs() < 1e-9, "{theta:?}");
    Ok(())
}
