//! Manifold invariants by random points and steps.

use std::sync::Arc;

use cfpose_optim::manifold::{Euclidean, Manifold, Product, Rotation3, UnitSphere};
use cfpose_optim::masked::Masked;
use proptest::prelude::*;

/// The manifolds under test, each with the ambient numbers it needs.
fn manifolds() -> Vec<Arc<dyn Manifold>> {
    let product = Product::new(vec![Arc::new(Rotation3), Arc::new(UnitSphere(2)), Arc::new(Euclidean(3))]);
    vec![
        Arc::new(Euclidean(4)),
        Arc::new(Rotation3),
        Arc::new(UnitSphere(1)),
        Arc::new(UnitSphere(2)),
        Arc::new(UnitSphere(8)),
        Arc::new(Masked::new(Arc::new(Rotation3), &[false, false, true])),
        Arc::new(Masked::new(Arc::new(product.clone()), &[true, true, true, false, true, true, false, true])),
        Arc::new(product),
    ]
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.map(f64::abs).fold(0.0, f64::max)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

    #[test]
    fn retraction_and_its_inverse(
        which in 0usize..8,
        numbers in prop::collection::vec(-1.0f64..1.0, 16),
        moves in prop::collection::vec(-1.0f64..1.0, 16),
        scale in prop::sample::select(vec![0.0, 1e-9, 1e-3, 0.3, 0.9]),
    ) {
        let manifold = &manifolds()[which];
        let (n, m) = (manifold.ambient(), manifold.tangent());
        let mut theta = numbers[..n].to_vec();
        // Away from the singular points of a projection (zero vector, reflection).
        theta[0] += if theta[0] < 0.0 { -1.5 } else { 1.5 };
        if n >= 9 { theta[4] += 2.0; theta[8] += 2.0; theta[0] = theta[0].abs(); }
        if n > 9 { theta[9] += 2.0; }
        manifold.project(&mut theta);

        // A projected point is a fixed point of the projection.
        let mut again = theta.clone();
        manifold.project(&mut again);
        prop_assert!(largest(theta.iter().zip(&again).map(|(a, b)| a - b)) < 1e-14);

        // A zero step gives theta itself, bit for bit.
        let mut reached = vec![f64::NAN; n];
        manifold.retract(&theta, &vec![0.0; m], &mut reached);
        prop_assert_eq!(&reached, &theta);

        // local is the inverse of retract.
        let step: Vec<f64> = moves[..m].iter().map(|v| scale * v).collect();
        manifold.retract(&theta, &step, &mut reached);
        let mut back = vec![0.0; m];
        manifold.local(&theta, &reached, &mut back);
        prop_assert!(largest(step.iter().zip(&back).map(|(a, b)| a - b)) < 1e-12, "{:?} {:?}", step, back);

        // The point reached lies on the manifold.
        let mut projected = reached.clone();
        manifold.project(&mut projected);
        prop_assert!(largest(reached.iter().zip(&projected).map(|(a, b)| a - b)) < 1e-13);

        // Curved factors: every tangent vector is orthogonal to the point (which has constant norm).
        let mut basis = vec![0.0; n * m];
        manifold.basis(&theta, &mut basis);
        if which != 0 && n != 15 {
            for j in 0..m {
                let dot: f64 = (0..n).map(|i| theta[i] * basis[i * m + j]).sum();
                prop_assert!(dot.abs() < 1e-13, "{dot:e}");
            }
        }
    }
}
