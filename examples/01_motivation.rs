//! The paper's motivation example: theta p = q without correspondences.
use cfpose::{Estimator, Execution, Points, Registry, Settings, Supervision};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let p = Points::from_rows(&[[1.0], [2.0], [3.0], [4.0]])?;
    let q = Points::from_rows(&[[2.0], [3.0], [1.0], [4.0]])?;
    let registry = Registry::default();
    let settings = Settings { features: Some("coordinates".into()), ..Settings::preset("paper", "gain1")? };
    let estimator = Estimator::new(&registry, &settings, &p, &q, &Execution::default())?;
    let estimate = estimator.solve(Supervision::default())?;
    let c: Vec<usize> = estimator.correspondence(&estimate.theta)?.iter().map(|k| k + 1).collect();
    println!("theta = {:.12}, c = {c:?}", estimate.theta[0]);
    assert!((estimate.theta[0] - 1.0).abs() < 1e-12 && c == [3, 1, 2, 4]);
    Ok(())
}
