//! A rigid motion of a 3-D cloud in any orientation, from principal axes.
use cfpose::theta::rotation_of_euler;
use cfpose::{Estimator, Execution, Points, Pose, PoseError, Registry, Settings, Start, Supervision};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A bent strip with a bump, in golden-ratio order; the target is the moved strip from its last point to its first.
    let strip: Vec<[f64; 3]> = (0..2000)
        .map(|k| {
            let (u, v) = (f64::from(k) / 2000.0, (f64::from(k) * 0.618_034).fract());
            [2.0 * u, v * (1.0 + 0.5 * u), 0.6 * u * u + 0.3 * (3.0 * v).sin() * u]
        })
        .collect();
    let truth = Pose { rotation: rotation_of_euler(&[2.0, -0.8, 1.1]), translation: [5.0, -3.0, 1.0] };
    let moved: Vec<[f64; 3]> = strip.iter().rev().map(|p| truth.apply(*p)).collect();
    let registry = Registry::default();
    let settings = Settings {
        features: Some("hermite[degree=3]".into()),
        start: Some(Start::Named("pca".into())),
        ..Settings::preset("paper", "rigid3")?
    };
    let (source, target) = (Points::from_rows(&strip)?, Points::from_rows(&moved)?);
    let estimator = Estimator::new(&registry, &settings, &source, &target, &Execution::default())?;
    let estimate = estimator.solve(Supervision::default())?;
    let pose = Pose::of_theta(&estimator.model().layout, &estimate.theta).ok_or("no pose")?;
    let error = PoseError::between(&pose, &truth);
    println!(
        "{} starts, {} evaluations, {:.1e} degrees off",
        estimate.starts,
        estimate.evaluations,
        error.angle.to_degrees()
    );
    assert!(error.angle.to_degrees() < 1e-6);
    Ok(())
}
