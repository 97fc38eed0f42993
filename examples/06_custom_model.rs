//! A transformation model of your own: a planar shear with translation. One file, no derivative, selected by name.
use cfpose::theta::{BlockKind, Layout};
use cfpose::{Execution, Map, Model, ModelEntry, Points, Registry, Scalar, Settings, estimate};

struct Shear;

impl Map<2, 2, 2> for Shear {
    fn affine<S: Scalar>(&self, theta: &[S], a: &mut [S], b: &mut [S]) {
        let one = theta[0].constant(1.0);
        a.copy_from_slice(&[one, theta[0], theta[1], one]);
        b.copy_from_slice(&theta[2..4]);
    }
    #[inline(always)]
    fn project<S: Scalar>(&self, y: [S; 2]) -> [S; 2] {
        y
    }
}

pub(crate) static SHEAR: ModelEntry = ModelEntry {
    name: "shear2",
    summary: "planar shear with translation",
    parameters: &[],
    source: "this example",
    details: "h(p, theta) = [[1, a], [b, 1]] p + T",
    build: |_, _| Ok(Model::new(Layout::new(&[("shear", "1", BlockKind::Vector(4))]), Shear)),
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut registry = Registry::default();
    registry.models.push(&SHEAR);
    let p: Vec<[f64; 2]> = (0..500).map(|k| [f64::from(k) / 250.0, (f64::from(k) * 0.618).fract().powi(2)]).collect();
    let q: Vec<[f64; 2]> = p.iter().rev().map(|p| [p[0] + 0.3 * p[1] + 1.0, p[1] - 0.2 * p[0] - 2.0]).collect();
    let settings = Settings { features: Some("hermite".into()), ..Settings::preset("paper", "shear2")? };
    let (p, q) = (Points::from_rows(&p)?, Points::from_rows(&q)?);
    let theta = estimate(&registry, &settings, &p, &q, &Execution::default())?.theta;
    println!("shear and translation: {theta:.9?}");
    assert!((theta[0] - 0.3).abs() + (theta[1] + 0.2).abs() < 1e-8);
    Ok(())
}
