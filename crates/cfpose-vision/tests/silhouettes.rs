//! Affine registration of silhouettes against their known transforms: region pixels as points, no start given.
//!
//!     cargo test -p cfpose-vision --test silhouettes -- --nocapture

use std::path::{Path, PathBuf};

use cfpose::{Estimator, Execution, Points, Registry, Settings, Start, Supervision};
use cfpose_vision::{ReadOptions, read_points};

/// A, row by row, and the cost.
struct Fit {
    a: [f64; 4],
    cost: f64,
}

impl Fit {
    /// Rotation in degrees of the nearest rotation, y pointing down as in images.
    fn degrees(&self) -> f64 {
        (self.a[2] - self.a[1]).atan2(self.a[0] + self.a[3]).to_degrees()
    }

    fn scale(&self) -> f64 {
        (self.a[0] * self.a[3] - self.a[1] * self.a[2]).sqrt()
    }
}

fn register(source: &Points, target: &Points) -> Fit {
    let registry = Registry::default();
    let settings = Settings {
        features: Some("hermite[degree=4]".into()),
        normaliser: Some("whiten".into()),
        start: Some(Start::Named("whitened-affine".into())),
        ..Settings::preset("paper", "affine2").unwrap()
    };
    let estimator = Estimator::new(&registry, &settings, source, target, &Execution::default()).unwrap();
    let estimate = estimator.solve(Supervision::default()).unwrap();
    assert!(estimate.usable() && estimate.conditioning.rank == 6, "{:?}", estimate.warnings);
    Fit { a: [estimate.theta[0], estimate.theta[1], estimate.theta[2], estimate.theta[3]], cost: estimate.outcome.cost }
}

fn data() -> PathBuf {
    let default = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    std::env::var_os("CFPOSE_DATA").map_or(default, PathBuf::from).join("mpeg7_shapes")
}

#[test]
#[cfg_attr(not(shared_data), ignore = "no real data: set CFPOSE_DATA to their folder")]
fn affine2_finds_rotations_scales_and_skews_and_tells_other_instances_apart() {
    let data = data();
    for class in ["bat", "key", "camel"] {
        let path = |folder: &str, index: usize| data.join(format!("{folder}/{class}-{index}.png"));
        let region = |folder: &str, index: usize| {
            read_points(&path(folder, index), &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}")).points
        };
        let fit = |folder: &str, index: usize| register(&region(folder, 1), &region(folder, index));
        let (mut worst_turn, mut worst_scale, mut worst_skew, mut worst_cost) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
        // Counter-clockwise as seen, which is negative with y down.
        for (index, degrees) in [(2, -9.0), (3, -36.0), (4, -45.0), (5, -90.0), (6, -150.0)] {
            let found = fit("Part-A/2-Rotation", index);
            worst_turn = worst_turn.max((found.degrees() - degrees).abs());
            worst_cost = worst_cost.max(found.cost);
        }
        for (index, scale) in [(2, 2.0), (3, 0.3), (4, 0.25), (5, 0.2)] {
            let found = fit("Part-A/1-Scale", index);
            worst_scale = worst_scale.max((found.scale() / scale - 1.0).abs());
            worst_cost = worst_cost.max(found.cost);
        }
        for (folder, sign) in [("Part-D/1-Skew_direct", -1.0), ("Part-D/2-Skew_reverse", 1.0)] {
            for (index, skew) in [(2, 0.1), (3, 0.2), (4, 0.3), (5, 0.5), (6, 0.7)] {
                let found = fit(folder, index);
                for (entry, truth) in found.a.iter().zip([1.0, sign * skew, sign * skew, 1.0]) {
                    worst_skew = worst_skew.max((entry - truth).abs());
                }
                worst_cost = worst_cost.max(found.cost);
            }
        }
        // Other instances of the class; the data hold them for two of the three.
        let others = (2..=20).filter(|index| path("Part-B/1-Similarity", *index).is_file());
        let least = others.map(|index| fit("Part-B/1-Similarity", index).cost).fold(f64::INFINITY, f64::min);
        println!(
            "{class}: rotation {worst_turn:.3} deg, scale {:.2} %, entries of A {worst_skew:.4}, cost at most {worst_cost:.1e}, \
             of other instances at least {least:.1e}",
            100.0 * worst_scale
        );
        assert!(worst_turn < 0.05 && worst_scale < 0.01 && worst_skew < 0.005);
        assert!(least > 3.0 * worst_cost, "{class}: {least} against {worst_cost}");
    }
}
