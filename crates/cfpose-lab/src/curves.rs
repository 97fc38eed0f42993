//! Planar curves of the simulation, by name, and curves drawn at random from Fourier descriptors.
//!
//! A curve is evaluated at t = 0, .002, .., 6.282 (3142 points), centred by its bounding box and scaled so that the
//! largest absolute coordinate is the given scale. The paper's own curve (its Fig. 3) is not public.

use cfpose::entry::{EntryError, NamedEntry, ParameterSpec, Parameters, find};
use rand::RngExt;
use rand_distr::StandardNormal;

use crate::seed::data_stream;

mod letters;
mod outline;

pub use outline::{file_of, of_picture};

/// Number of points of a curve.
pub const NUM_POINTS: usize = 3142;
/// Distance of two parameters t.
pub const STEP: f64 = 0.002;

/// A function of the curve parameter t.
pub type Curve = Box<dyn Fn(f64) -> [f64; 2] + Send + Sync>;

/// A curve at its place and size.
pub type PlacedCurve = Box<dyn Fn(f64) -> [f64; 2] + Send + Sync>;

/// One line of the curve table.
pub struct CurveEntry {
    /// Name.
    pub name: &'static str,
    /// Formula, for lists.
    pub summary: &'static str,
    /// Parameters with defaults.
    pub parameters: &'static [ParameterSpec],
    /// Reference.
    pub source: &'static str,
    /// Build the curve.
    pub build: fn(&Parameters) -> Result<Curve, EntryError>,
}

impl NamedEntry for CurveEntry {
    fn name(&self) -> &'static str {
        self.name
    }
    fn summary(&self) -> &'static str {
        self.summary
    }
    fn parameters(&self) -> &'static [ParameterSpec] {
        self.parameters
    }
    fn source(&self) -> &'static str {
        self.source
    }
}

/// All curves.
pub const ALL: &[&CurveEntry] =
    &[&HEART, &FLOWER, &BUTTERFLY, &BLOB, &FISH, &FOURIER, &letters::ENTRY, &outline::ENTRY];

/// Return the 3142 points of the curve `name` or `name[key=value,...]`, largest absolute coordinate `scale`.
///
/// # Errors
/// [`EntryError`] for an unknown name or bad parameters.
///
/// ```
/// let heart = cfpose_lab::scenarios::curves::points("heart", 0.45).unwrap();
/// let largest = heart.iter().flatten().fold(0.0_f64, |a, b| a.max(b.abs()));
/// assert!(heart.len() == 3142 && (largest - 0.45).abs() < 1e-15);
/// ```
pub fn points(spec: &str, scale: f64) -> Result<Vec<[f64; 2]>, EntryError> {
    let placed = placed(spec, scale)?;
    Ok((0..NUM_POINTS).map(|k| placed(k as f64 * STEP)).collect())
}

/// Return the curve of [`points`] as a function of t, 0 to 2 pi.
///
/// # Errors
/// As [`points`].
pub fn placed(spec: &str, scale: f64) -> Result<PlacedCurve, EntryError> {
    let (entry, parameters) = find("curve", ALL, spec)?;
    let curve = (entry.build)(&parameters)?;
    let raw: Vec<[f64; 2]> = (0..NUM_POINTS).map(|k| curve(k as f64 * STEP)).collect();
    let place = place(&raw, scale);
    Ok(Box::new(move |t| place(curve(t))))
}

/// Return the map that centres points by their bounding box and scales their largest absolute coordinate to `scale`.
fn place(raw: &[[f64; 2]], scale: f64) -> impl Fn([f64; 2]) -> [f64; 2] + Send + Sync + use<> {
    let centre = [0, 1].map(|d| {
        let (low, high) =
            raw.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| (low.min(p[d]), high.max(p[d])));
        0.5 * (low + high)
    });
    let centred = move |p: [f64; 2]| [p[0] - centre[0], p[1] - centre[1]];
    let largest = raw.iter().flat_map(|p| centred(*p)).fold(0.0_f64, |a, b| a.max(b.abs()));
    move |p| centred(p).map(|x| x * scale / largest)
}

/// Return the closed polygon through corners as a curve: t = 0 .. 2 pi runs evenly along its length.
fn along(corners: &[[f64; 2]]) -> Curve {
    let count = corners.len();
    let piece = |k: usize| {
        let (a, b) = (corners[k], corners[(k + 1) % count]);
        (b[0] - a[0]).hypot(b[1] - a[1])
    };
    // Length up to each corner, and in the end the whole.
    let ends: Vec<f64> = (0..count)
        .scan(0.0, |sum, k| {
            *sum += piece(k);
            Some(*sum)
        })
        .collect();
    let corners = corners.to_vec();
    Box::new(move |t| {
        let walked = t / std::f64::consts::TAU * ends[count - 1];
        let k = ends.partition_point(|end| *end <= walked).min(count - 1);
        let begin = if k == 0 { 0.0 } else { ends[k - 1] };
        let share = (walked - begin) / (ends[k] - begin);
        let (a, b) = (corners[k], corners[(k + 1) % count]);
        [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])]
    })
}

/// Return the point at radius r and angle t.
fn polar(r: f64, t: f64) -> [f64; 2] {
    [r * t.cos(), r * t.sin()]
}

/// Make a table line of a curve without parameters.
macro_rules! plain_curve {
    ($constant:ident, $name:literal, $summary:literal, $function:expr) => {
        const $constant: CurveEntry = CurveEntry {
            name: $name,
            summary: $summary,
            parameters: &[],
            source: "project (the paper's curve, Fig. 3, is not public)",
            build: |_| Ok(Box::new($function)),
        };
    };
}

plain_curve!(HEART, "heart", "(16 sin^3 t, 13 cos t - 5 cos 2t - 2 cos 3t - cos 4t)", |t: f64| {
    [16.0 * t.sin().powi(3), 13.0 * t.cos() - 5.0 * (2.0 * t).cos() - 2.0 * (3.0 * t).cos() - (4.0 * t).cos()]
});
plain_curve!(FLOWER, "flower", "r = 1 + .30 cos 3t + .20 sin 2t + .15 cos(t + .7) + .08 sin 5t", |t: f64| {
    let r = 1.0 + 0.30 * (3.0 * t).cos() + 0.20 * (2.0 * t).sin() + 0.15 * (t + 0.7).cos() + 0.08 * (5.0 * t).sin();
    polar(r, t)
});
plain_curve!(BUTTERFLY, "butterfly", "(r sin t, r cos t), r = e^cos t - 2 cos 4t + sin^5(t / 12)", |t: f64| {
    let r = t.cos().exp() - 2.0 * (4.0 * t).cos() + (t / 12.0).sin().powi(5);
    [r * t.sin(), r * t.cos()]
});
plain_curve!(BLOB, "blob", "r = 1 + .25 cos(2t + .3) + .12 cos 3t", |t: f64| {
    polar(1.0 + 0.25 * (2.0 * t + 0.3).cos() + 0.12 * (3.0 * t).cos(), t)
});
plain_curve!(FISH, "fish", "(cos t - sin^2 t / sqrt 2, 1.2 cos t sin t)", |t: f64| {
    [t.cos() - t.sin().powi(2) / std::f64::consts::SQRT_2, 1.2 * t.cos() * t.sin()]
});

/// z(t) = e^(it) + sum_(n = 2..=harmonics) amplitude n^-1.5 ((g1 + i g2) e^(int) + (g3 + i g4) e^(-int)) with standard
/// normal g drawn in this order, n by n, from ChaCha12 of the curve's own seed (stream "fourier").
///
/// A rotational symmetry would need all descriptors but those of one residue class to vanish, a mirror symmetry all
/// phases to lie on one line: both have probability 0, so the curves are asymmetric.
const FOURIER: CurveEntry = CurveEntry {
    name: "fourier",
    summary: "closed curve with random Fourier descriptors, asymmetric",
    parameters: &[
        ParameterSpec { name: "seed", default: "0", meaning: "seed of the curve, a whole number >= 0" },
        ParameterSpec { name: "harmonics", default: "5", meaning: "highest harmonic, 2 to 20" },
        ParameterSpec { name: "amplitude", default: "0.35", meaning: "size of the descriptors, 0 < . <= 2" },
    ],
    source: "Zahn and Roskies 1972, elliptic form; construction in the documentation of the function",
    build: |parameters| {
        let seed: u64 = parameters.parse("seed", "a whole number >= 0")?;
        let harmonics = parameters.count("harmonics", 2, 20)?;
        let amplitude = parameters.number("amplitude", "a number above 0, at most 2", |v| v > 0.0 && v <= 2.0)?;
        let mut rng = data_stream(seed, u64::from_be_bytes(*b"fourier\0"));
        // (n, real part, imaginary part)
        let mut descriptors = vec![(1.0, 1.0, 0.0)];
        for n in 2..=harmonics {
            let size = amplitude * (n as f64).powf(-1.5);
            for frequency in [n as f64, -(n as f64)] {
                let (re, im): (f64, f64) = (rng.sample(StandardNormal), rng.sample(StandardNormal));
                descriptors.push((frequency, size * re, size * im));
            }
        }
        Ok(Box::new(move |t| {
            let mut z = [0.0; 2];
            for (frequency, re, im) in &descriptors {
                let (sin, cos) = (frequency * t).sin_cos();
                z[0] += re * cos - im * sin;
                z[1] += re * sin + im * cos;
            }
            z
        }))
    },
};

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest distance of a point of `a` to the nearest of `b`.
    fn hausdorff(a: &[[f64; 2]], b: &[[f64; 2]]) -> f64 {
        let nearest = |p: &[f64; 2]| b.iter().map(|q| (p[0] - q[0]).hypot(p[1] - q[1])).fold(f64::INFINITY, f64::min);
        a.iter().map(nearest).fold(0.0, f64::max)
    }

    fn centred_by_mean(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let n = points.len() as f64;
        let mean = [0, 1].map(|d| points.iter().map(|p| p[d]).sum::<f64>() / n);
        points.iter().map(|p| [p[0] - mean[0], p[1] - mean[1]]).collect()
    }

    #[test]
    fn curves_equal_the_formulas() {
        // x, y of points 0, 1000 and 3000 of the formulas written independently in Python, scale .45.
        let expected: [(&str, [[f64; 2]; 3]); 5] = [
            (
                "heart",
                [
                    [1.6295535715380476e-07, 0.21201685284725938],
                    [0.3383224873557897, -0.03876073798297225],
                    [-0.009816508207785077, 0.2547143266892475],
                ],
            ),
            (
                "flower",
                [
                    [0.4314304627235566, 0.06791263001715503],
                    [-0.22059759547231975, 0.38101690940322586],
                    [0.3193827478049837, -0.04752539513078206],
                ],
            ),
            (
                "butterfly",
                [
                    [0.0009297029242002316, 0.007868438488819561],
                    [0.13450499073033273, -0.16424908880057365],
                    [-0.07631352121573098, 0.16231763606556385],
                ],
            ),
            (
                "blob",
                [
                    [0.4488417568742294, -0.01856280670151528],
                    [-0.19464926689325746, 0.31486583359325065],
                    [0.4159651397463922, -0.15184895920433394],
                ],
            ),
            (
                "fish",
                [
                    [0.45, 8.500462387122363e-08],
                    [-0.4238550719483169, -0.19832147995584518],
                    [0.4084928607699221, -0.1406098911423944],
                ],
            ),
        ];
        for (name, rows) in expected {
            let points = points(name, 0.45).unwrap();
            for (k, row) in [0, 1000, 3000].into_iter().zip(rows) {
                for d in 0..2 {
                    assert!((points[k][d] - row[d]).abs() < 1e-14, "{name} {k} {:?}", points[k]);
                }
            }
        }
    }

    #[test]
    fn letters_run_evenly_along_their_outline() {
        for letter in ["F", "G", "J", "K", "L", "R"] {
            let points = points(&format!("letter[of={letter}]"), 0.45).unwrap();
            let steps: Vec<f64> = (0..NUM_POINTS)
                .map(|k| (points[k], points[(k + 1) % NUM_POINTS]))
                .map(|(a, b)| (b[0] - a[0]).hypot(b[1] - a[1]))
                .collect();
            let longest = steps.iter().fold(0.0_f64, |a, b| a.max(*b));
            // Corners are cut by a part of a step; the rest of the last step is shorter.
            let even = steps.iter().filter(|step| **step > 0.999 * longest).count();
            assert!(even > NUM_POINTS - 40 && longest < 0.003, "{letter}: {even}, {longest}");
        }
        assert!(points("letter[of=Q]", 1.0).is_err() && points("outline[file=bat.png]", 1.0).is_err());
    }

    #[test]
    fn random_curves_have_no_symmetry() {
        for seed in 0..12 {
            let curve = points(&format!("fourier[seed={seed}]"), 1.0).unwrap();
            let thinned: Vec<[f64; 2]> = centred_by_mean(&curve).into_iter().step_by(20).collect();
            for turn in 0..72 {
                let (sin, cos) = (f64::from(turn) * 5.0).to_radians().sin_cos();
                let turned: Vec<[f64; 2]> =
                    thinned.iter().map(|p| [cos * p[0] - sin * p[1], sin * p[0] + cos * p[1]]).collect();
                let mirrored: Vec<[f64; 2]> = turned.iter().map(|p| [p[0], -p[1]]).collect();
                // The spacing of the thinned points is about .04.
                assert!((5..68).contains(&turn) <= (hausdorff(&turned, &thinned) > 0.1), "seed {seed}, turn {turn}");
                assert!(hausdorff(&mirrored, &thinned) > 0.1, "seed {seed}, mirror {turn}");
            }
        }
    }
}
