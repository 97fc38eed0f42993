//! Moments gathered in parts: the same bytes in any order, at any number of threads, on any instruction set; right far from the centre.

use std::sync::Arc;

use cfpose::moments::{BytesError, GatherError, GatheredMoments, Moments, mapped_means, monomials};
use cfpose::{Execution, Isa, Points};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;
use sha2::{Digest, Sha256};

const IDENTITY: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];

/// Return random points, weights between 0.5 and 1.5.
fn cloud(len: usize, offset: f64) -> Points {
    let mut rng = ChaCha12Rng::seed_from_u64(len as u64);
    let columns: Vec<Vec<f64>> =
        (1..4).map(|size| (0..len).map(|_| f64::from(size) * rng.random_range(0.0..1.0) + offset).collect()).collect();
    Points::weighted(columns, (0..len).map(|_| rng.random_range(0.5..1.5)).collect()).unwrap()
}

fn gathered(points: &Points, rows: impl Iterator<Item = usize>, execution: &Execution) -> GatheredMoments {
    let mut sums = GatheredMoments::new(3, 6, [0.25, -0.5, 0.1], "hermite[degree=3]");
    sums.add(&points.select(&rows.collect::<Vec<_>>()).unwrap(), execution).unwrap();
    sums
}

#[test]
fn shards_threads_and_instruction_sets_give_the_same_bytes() {
    let points = cloud(70_001, 0.0);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    let threads = Execution { pool: Some(Arc::new(pool)), ..Execution::default() };
    let whole = gathered(&points, 0..points.len(), &threads);
    let bytes = whole.to_bytes();
    for isa in Isa::available() {
        let alone = gathered(&points, 0..points.len(), &Execution { isa, pool: None });
        assert_eq!(alone.to_bytes(), bytes, "{}", isa.name());
    }
    assert_eq!(gathered(&points, (0..points.len()).rev(), &threads).to_bytes(), bytes);
    for shards in [7, 64] {
        let of = |shard: usize| gathered(&points, (shard..points.len()).step_by(shards), &Execution::default());
        // A shuffled order: 5 has no divisor in common with the number of shards.
        let mut parts = (0..shards).map(|i| of(i * 5 % shards).to_bytes());
        let mut merged = GatheredMoments::from_bytes(&parts.next().unwrap()).unwrap();
        parts.for_each(|part| merged.merge(&GatheredMoments::from_bytes(&part).unwrap()).unwrap());
        assert_eq!(merged.to_bytes(), bytes, "{shards} shards");
    }
    // And they are the moments: those of the points, up to the rounding of the latter.
    let (ours, direct) = (whole.moments(), Moments::of_points(&points, 6, &Execution::default()));
    assert!((0..3).all(|d| (ours.mean()[d] - points.mean()[d]).abs() < 1e-13));
    let covariance = points.covariance();
    assert!((0..9).all(|at| (ours.covariance()[at / 3][at % 3] - covariance[at / 3][at % 3]).abs() < 1e-13));
    let (a, b) = (mapped_means(&ours, &IDENTITY, &[0.0; 3]), mapped_means(&direct, &IDENTITY, &[0.0; 3]));
    assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-12 * b.abs().max(1.0)));
}

#[test]
fn a_centre_far_away_costs_no_digits() {
    let points = cloud(500, 4096.0);
    let means = [[0.0; 3], [4096.5, 4097.0, 4097.5]].map(|centre| {
        let mut sums = GatheredMoments::new(3, 6, centre, "");
        sums.add(&points, &Execution::default()).unwrap();
        // Both read about the same place.
        mapped_means(&sums.moments(), &IDENTITY, &points.mean().map(|x| -x))
    });
    let worst = |degree: usize| {
        let pairs = means[0].iter().zip(&means[1]).take(monomials(3, degree).len());
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    // Two doubles a number: 4096^6 1e-31, and the rounding of the place at which both are read.
    assert!(worst(3) < 1e-10 && worst(6) < 1e-8, "{:e} {:e}", worst(3), worst(6));
}

#[test]
fn what_cannot_be_added_is_refused() {
    let about = |centre, degree| GatheredMoments::new(3, degree, centre, "a");
    let mut sums = about([0.0; 3], 4);
    let error = sums.merge(&about([0.0, 1.0, 0.0], 4)).unwrap_err();
    assert_eq!(error.to_string(), "the centres differ: 0,0,0 here, 0,1,0 there");
    assert!(sums.merge(&about([0.0; 3], 6)).is_err());
    assert!(sums.merge(&GatheredMoments::new(3, 4, [0.0; 3], "b")).is_err());
    sums.add(&cloud(10, 0.0), &Execution::default()).unwrap();
    let huge = Points::from_rows(&[[0.0, 0.0, 0.0], [1e75, 0.0, 0.0]]).unwrap();
    assert!(matches!(sums.add(&huge, &Execution::default()), Err(GatherError::Overflow { row: 12, .. })));
    assert!(sums.add(&Points::from_rows(&[[1.0]]).unwrap(), &Execution::default()).is_err());
    assert_eq!(sums.count(), 10);
}

#[test]
fn damaged_bytes_are_refused() {
    let bytes = gathered(&cloud(100, 0.0), 0..100, &Execution::default()).to_bytes();
    assert_eq!(GatheredMoments::from_bytes(&bytes).unwrap().to_bytes(), bytes);
    assert_eq!(GatheredMoments::from_bytes(b"x,y,z\n1,2,3\n").unwrap_err(), BytesError::Foreign);
    for at in 0..bytes.len() {
        assert!(GatheredMoments::from_bytes(&bytes[..at]).is_err());
        let mut changed = bytes.clone();
        changed[at] ^= 1 << (at % 8);
        assert!(GatheredMoments::from_bytes(&changed).is_err(), "byte {at}");
        // Also where whoever changed it wrote the digest anew: then it is refused or a file like any other.
        let body = changed.len() - 32;
        let digest = Sha256::digest(&changed[..body]);
        changed[body..].copy_from_slice(&digest);
        if let Ok(read) = GatheredMoments::from_bytes(&changed) {
            assert_eq!(read.to_bytes(), changed, "byte {at}");
        }
    }
}
