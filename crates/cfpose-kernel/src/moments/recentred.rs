//! From sums about a stated centre to moments about the mean, scaled.

use super::gathered::GatheredMoments;
use super::twofold::Twofold;
use super::{Moments, monomial_family};

/// Move gathered sums to the mean of their points and scale them by the spread.
pub(super) fn recentred(gathered: &GatheredMoments) -> Moments {
    let (dim, degree) = (gathered.dim, gathered.degree);
    let family = monomial_family(degree);
    let exponents = family.exponents(dim);
    let mut sums: Vec<Twofold> =
        gathered.sums.iter().map(|sum| sum.pair()).map(|(high, low)| Twofold { high, low }).collect();
    let weight = sums[0].value();
    let unit = |k: usize, n: usize| std::array::from_fn::<usize, 3, _>(|q| if q == k { n } else { 0 });
    let place = |e: [usize; 3]| exponents.iter().position(|other| *other == e);
    let mut centre = [0.0; 3];
    for (k, entry) in centre.iter_mut().enumerate().take(dim) {
        // The mean to a few digits; what follows is right for any centre.
        let mean = place(unit(k, 1)).map_or(0.0, |i| sums[i].value() / weight);
        *entry = gathered.centre[k] + if mean.is_finite() { mean } else { 0.0 };
        shift(&mut sums, exponents, k, Twofold::sum(gathered.centre[k], -*entry));
    }
    let second = |k: usize| place(unit(k, 2)).map_or(0.0, |i| (sums[i].value() / weight).max(0.0));
    let scale = ((0..dim).map(second).sum::<f64>() / dim as f64).sqrt();
    let scale = if scale > 0.0 && scale.is_finite() { scale } else { 1.0 };
    let scaled = |(e, sum): (&[usize; 3], &Twofold)| {
        // Power by power: the power of a large scale alone overflows.
        (0..e.iter().sum::<usize>()).fold(sum.value(), |value, _| value / scale)
    };
    let sums = exponents.iter().zip(&sums).map(scaled).collect();
    Moments { dim, degree, centre, scale, weight, sums }
}

/// Replace sums of (x_q)^n by sums of (x_q + d)^n, whatever the other exponents: sum_j (n choose j) d^(n - j) (x_q)^j.
fn shift(sums: &mut [Twofold], exponents: &[[usize; 3]], q: usize, d: Twofold) {
    let degree = exponents.iter().map(|e| e.iter().sum::<usize>()).max().unwrap_or(0);
    let mut powers = vec![Twofold::of(1.0)];
    (0..degree).for_each(|n| powers.push(powers[n].times(d)));
    let place = |e: &[usize; 3]| exponents.iter().position(|other| other == e);
    let moved: Vec<Twofold> = exponents
        .iter()
        .map(|e| {
            let (n, mut choose) = (e[q], 1.0);
            let mut sum = Twofold::of(0.0);
            for j in (0..=n).rev() {
                let mut lower = *e;
                lower[q] = j;
                if let Some(at) = place(&lower) {
                    sum = sum.plus(powers[n - j].times(Twofold::of(choose)).times(sums[at]));
                }
                choose = choose * j as f64 / (n - j + 1) as f64;
            }
            sum
        })
        .collect();
    sums.copy_from_slice(&moved);
}
