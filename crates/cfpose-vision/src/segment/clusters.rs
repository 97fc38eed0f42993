//! Grey values in clusters: seeded k-means on the pixels that lie in no edge.

use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;

use crate::raster::Raster;

/// Bins between the ends of the scale.
const BINS: usize = 512;
const ENDS: [f32; 2] = [-0.5, 1.1];

/// Begins of k-means, the best of which counts, and its rounds.
const BEGINS: usize = 4;
const ROUNDS: usize = 60;

/// Smallest cluster whose spread counts, as a share of all pixels.
const SMALL: f64 = 0.004;

/// Clusters nearer to each other than this are one.
const APART: f32 = 0.04;

/// Spread of a cluster of one grey beside its noise: what is left of uneven light.
const UNEVEN: f32 = 0.012;

/// Half the distance over which a pixel in no edge may change, pixels, and by how much beside its noise.
const FLAT: (usize, f32) = (2, 0.02);

/// Find the greys of a raster of values about 0 to 1 that is smoothed: k-means (k-means++: D. Arthur and S. Vassilvitskii, 2007) on the
/// pixels that lie in no edge, with as many clusters, at most `most`, as leave each of them no wider than noise and uneven light.
/// Returns the means, rising.
pub fn clusters(smooth: &Raster, noise: f32, most: usize, seed: u64) -> Vec<f32> {
    let counts = histogram(smooth, noise);
    let total: f64 = counts.iter().sum();
    let mut rng = ChaCha12Rng::seed_from_u64(seed);
    let mut found = Vec::new();
    for k in 2..=most {
        let begins = (0..BEGINS).filter_map(|_| k_means(&counts, k, &mut rng));
        let Some((centres, _)) = begins.min_by(|a, b| a.1.total_cmp(&b.1)) else { break };
        let wide = spreads(&counts, &centres)
            .iter()
            .any(|(count, spread)| *count > SMALL * total && *spread > f64::from(UNEVEN + 0.5 * noise));
        found = centres;
        if !wide {
            break;
        }
    }
    merged(&counts, found)
}

/// Return the centre of a bin.
fn value(bin: usize) -> f64 {
    f64::from(ENDS[0]) + (bin as f64 + 0.5) / BINS as f64 * f64::from(ENDS[1] - ENDS[0])
}

/// Count pixels in no edge.
fn histogram(smooth: &Raster, noise: f32) -> Vec<f64> {
    let (reach, flat) = (FLAT.0, FLAT.1 + noise);
    let mut counts = vec![0.0; BINS];
    for y in (reach..smooth.height().saturating_sub(reach)).step_by(2) {
        for x in (reach..smooth.width().saturating_sub(reach)).step_by(2) {
            let across = smooth.at(x + reach, y) - smooth.at(x - reach, y);
            let down = smooth.at(x, y + reach) - smooth.at(x, y - reach);
            if across.abs() + down.abs() < flat {
                let bin = (smooth.at(x, y) - ENDS[0]) / (ENDS[1] - ENDS[0]) * BINS as f32;
                counts[(bin.max(0.0) as usize).min(BINS - 1)] += 1.0;
            }
        }
    }
    counts
}

/// Return centres and the sum of squared distances; `None` where fewer values than centres exist.
fn k_means(counts: &[f64], k: usize, rng: &mut ChaCha12Rng) -> Option<(Vec<f32>, f64)> {
    let mut centres: Vec<f64> = Vec::with_capacity(k);
    while centres.len() < k {
        let far = |bin: usize| centres.iter().map(|c| (value(bin) - c).powi(2)).fold(f64::INFINITY, f64::min).min(1.0);
        let weights: Vec<f64> = counts.iter().enumerate().map(|(bin, count)| count * far(bin)).collect();
        let total: f64 = weights.iter().sum();
        if total < 1e-9 {
            return None;
        }
        let mut left = rng.random_range(0.0..1.0) * total;
        let drawn = weights.iter().position(|w| {
            left -= w;
            left < 0.0
        });
        centres.push(value(drawn.unwrap_or(0)));
    }
    for _ in 0..ROUNDS {
        let mut sums = vec![(0.0, 0.0); k];
        for (bin, count) in counts.iter().enumerate().filter(|(_, count)| **count > 0.0) {
            let sum = &mut sums[nearest(&centres, value(bin))];
            *sum = (sum.0 + count, sum.1 + count * value(bin));
        }
        let moved: Vec<f64> =
            sums.iter().zip(&centres).map(|((n, sum), c)| if *n > 0.0 { sum / n } else { *c }).collect();
        let rests = moved.iter().zip(&centres).all(|(a, b)| (a - b).abs() < 1e-5);
        centres = moved;
        if rests {
            break;
        }
    }
    centres.sort_by(f64::total_cmp);
    let inertia = counts
        .iter()
        .enumerate()
        .map(|(bin, n)| n * (value(bin) - centres[nearest(&centres, value(bin))]).powi(2))
        .sum();
    Some((centres.iter().map(|c| *c as f32).collect(), inertia))
}

fn nearest(centres: &[f64], at: f64) -> usize {
    let distance = |k: &usize| (centres[*k] - at).abs();
    (0..centres.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0)
}

/// Return the number of pixels and the standard deviation of each cluster.
fn spreads(counts: &[f64], centres: &[f32]) -> Vec<(f64, f64)> {
    let centres: Vec<f64> = centres.iter().map(|c| f64::from(*c)).collect();
    let mut sums = vec![(0.0, 0.0); centres.len()];
    for (bin, count) in counts.iter().enumerate() {
        let k = nearest(&centres, value(bin));
        sums[k] = (sums[k].0 + count, sums[k].1 + count * (value(bin) - centres[k]).powi(2));
    }
    sums.into_iter().map(|(n, square)| (n, (square / f64::max(n, 1.0)).sqrt())).collect()
}

/// Join clusters that are one, and drop empty ones.
fn merged(counts: &[f64], centres: Vec<f32>) -> Vec<f32> {
    let sizes = spreads(counts, &centres);
    let mut out: Vec<(f32, f32)> = Vec::new();
    for (centre, (size, _)) in centres.into_iter().zip(sizes).filter(|(_, (size, _))| *size > 0.0) {
        match out.last_mut().filter(|(last, _)| centre - *last < APART) {
            Some((last, weight)) => {
                let all = *weight + size as f32;
                (*last, *weight) = ((*last * *weight + centre * size as f32) / all, all);
            }
            None => out.push((centre, size as f32)),
        }
    }
    out.into_iter().map(|(centre, _)| centre).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn greys_are_found_and_noise_is_one_grey() {
        let grey = |x: usize| [0.0, 0.3, 0.55, 0.9][x / 50];
        let stripes = Raster::from_fn(200, 60, |x, y| grey(x) + 0.004 * (((x * 7 + y * 13) % 5) as f32 - 2.0));
        let found = clusters(&stripes, 0.006, 8, 1);
        assert_eq!(found.len(), 4, "{found:?}");
        assert!(found.iter().zip([0.0, 0.3, 0.55, 0.9]).all(|(a, b)| (a - b).abs() < 0.01), "{found:?}");
        assert_eq!(found, clusters(&stripes, 0.006, 8, 1));
        let one = Raster::from_fn(60, 60, |x, y| 0.5 + 0.004 * (((x * 7 + y * 13) % 5) as f32 - 2.0));
        assert_eq!(clusters(&one, 0.006, 8, 1).len(), 1);
    }
}
