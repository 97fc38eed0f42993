//! The paper's motivation example: theta p = q without correspondences.
use cfpose::{Execution, Points, Prepared, Registry, Settings, Supervision};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let p = Points::from_rows(&[[1.0], [2.0], [3.0], [4.0]])?;
    let q = Points::from_rows(&[[2.0], [3.0], [1.0], [4.0]])?;
    let registry = Registry::default();
    let settings = Settings { features: "coordinates".into(), ..Settings::preset("paper", "gain1")? };
    let prepared = Prepared::new(&registry, &settings, &p, &q, &Execution::default())?;
    let estimate = prepared.solve(&registry, Supervision::default())?;
    let c: Vec<usize> = prepared.correspondence(&estimate.theta)?.iter().map(|k| k + 1).collect();
    println!("theta = {:.12}, c = {c:?}", estimate.theta[0]);
    assert!((estimate.theta[0] - 1.0).abs() < 1e-12 && c == [3, 1, 2, 4]);
    Ok(())
}
