//! The true pose of a trial: fixed, or drawn anew each time.

use cfpose::entry::{EntryError, Parameters};
use cfpose::theta::rotation_of_euler;
use cfpose_optim::manifold::{multiply3, rotation_exp};
use rand::RngExt;
use rand_chacha::ChaCha12Rng;

use crate::scenario::ScenarioError;

/// Named thetas: Euler angles about x, y, z (R = Rz Ry Rx), then T_bar.
const NAMED: [(&str, [f64; 6]); 2] =
    [("A", [0.1, -0.15, 0.2, 0.1, -0.1, 0.15]), ("B", [0.2, 0.3, -0.25, -0.2, 0.15, 0.3])];

/// Most draws of a pose before the parameters are called impossible.
const MAX_DRAWS: usize = 1000;
/// Least depth of a curve point in a drawn pose.
const MIN_DEPTH: f64 = 0.1;
/// Largest image coordinate of a curve point with `anywhere`: a field of view of 90 degrees.
const MAX_IMAGE: f64 = 1.0;
/// Largest angle of each axis with `random`, radians.
const MAX_ANGLE: f64 = 0.5;
/// Largest tilt with `anywhere`, degrees.
const MAX_TILT_DEG: f64 = 46.0;

/// Which pose is the true one.
///
/// Draws of one attempt, in this order; an attempt that is refused is followed by the next, at most 1000:
/// * `random`: three uniforms, Euler angles about x, y, z within +-.5; three uniforms, T_bar: x and y within +-.25, z in
///   -.1..+.5. Refused while a curve point has a depth of at most .1.
/// * `anywhere`: five uniforms and one more: the turn in the plane (a full one), the azimuth of the tilt axis, the tilt (0 to
///   46 degrees), 1 + T_z in .9..1.8, then x and y of the image of the curve's centre within +-.2. R tilts after it turns.
///   Refused while a curve point has a depth of at most .1 or an image coordinate beyond +-1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Theta {
    /// Euler angles and T_bar.
    Fixed([f64; 6]),
    /// Near the frontal view.
    Random,
    /// Anything a camera with the curve in view can see.
    Anywhere,
}

impl Theta {
    /// Read `A`, `B`, `random`, `anywhere` or six numbers.
    pub(super) fn of(parameters: &Parameters) -> Result<Self, EntryError> {
        let text = parameters.text("theta");
        if let Some((_, theta)) = NAMED.iter().find(|(name, _)| *name == text) {
            return Ok(Theta::Fixed(*theta));
        }
        match text {
            "random" => return Ok(Theta::Random),
            "anywhere" => return Ok(Theta::Anywhere),
            _ => {}
        }
        let numbers: Option<Vec<f64>> =
            text.split_whitespace().map(|word| word.parse().ok().filter(|v: &f64| v.is_finite())).collect();
        let expected = "expected A, B, random, anywhere or six numbers: Euler angles about x, y, z, then T_bar";
        let six = numbers.and_then(|numbers| numbers.try_into().ok());
        six.map(Theta::Fixed).ok_or_else(|| parameters.bad("theta", expected))
    }

    /// Return the pose of a trial as Euler angles and T_bar. A fixed one takes no draw.
    pub(super) fn draw(self, curve: &[[f64; 2]], rng: &mut ChaCha12Rng) -> Result<[f64; 6], ScenarioError> {
        let (attempt, bound): (fn(&mut ChaCha12Rng) -> [f64; 6], f64) = match self {
            Theta::Fixed(theta) => return Ok(theta),
            Theta::Random => (random, f64::INFINITY),
            Theta::Anywhere => (anywhere, MAX_IMAGE),
        };
        (0..MAX_DRAWS).map(|_| attempt(rng)).find(|theta| is_in_view(theta, curve, bound)).ok_or_else(|| {
            let problem =
                format!("none of {MAX_DRAWS} drawn poses has the whole curve in view; choose a smaller scale");
            ScenarioError::Impossible(problem)
        })
    }
}

fn between(rng: &mut ChaCha12Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

fn random(rng: &mut ChaCha12Rng) -> [f64; 6] {
    let angles: [f64; 3] = std::array::from_fn(|_| between(rng, -MAX_ANGLE, MAX_ANGLE));
    let [x, y] = [0, 1].map(|_| between(rng, -0.25, 0.25));
    [angles[0], angles[1], angles[2], x, y, between(rng, -0.1, 0.5)]
}

fn anywhere(rng: &mut ChaCha12Rng) -> [f64; 6] {
    use std::f64::consts::PI;
    let (turn, azimuth) = (between(rng, -PI, PI), between(rng, -PI, PI));
    let tilt = between(rng, 0.0, MAX_TILT_DEG.to_radians());
    let depth = between(rng, 0.9, 1.8);
    let centre = [0, 1].map(|_| between(rng, -0.2, 0.2));
    let tilted = rotation_exp(&[tilt * azimuth.cos(), tilt * azimuth.sin(), 0.0]);
    let r = multiply3(&tilted, &rotation_exp(&[0.0, 0.0, turn]));
    // The centre (0, 0, 1) of the curve lies at depth r33 + T_z.
    let z = r[8] + depth - 1.0;
    let [x, y, angle_z] = angles_of(&r);
    [x, y, angle_z, z * centre[0] - r[2], z * centre[1] - r[5], depth - 1.0]
}

/// Return the Euler angles about x, y, z with R = Rz Ry Rx; the angle about y is away from +-90 degrees at the tilts drawn.
fn angles_of(r: &[f64; 9]) -> [f64; 3] {
    [r[7].atan2(r[8]), (-r[6]).atan2(r[7].hypot(r[8])), r[3].atan2(r[0])]
}

fn is_in_view(theta: &[f64; 6], curve: &[[f64; 2]], bound: f64) -> bool {
    let r = rotation_of_euler(&theta[..3]);
    curve.iter().all(|p| {
        let [x, y, z] = [0, 1, 2].map(|i| r[3 * i] * p[0] + r[3 * i + 1] * p[1] + r[3 * i + 2] + theta[3 + i]);
        z > MIN_DEPTH && x.abs() <= bound * z && y.abs() <= bound * z
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::curves;
    use crate::seed::data_stream;

    fn draws(theta: Theta, scale: f64) -> Vec<[f64; 6]> {
        let curve = curves::points("heart", scale).unwrap();
        (0..400).map(|stream| theta.draw(&curve, &mut data_stream(9, stream)).unwrap()).collect()
    }

    /// Smallest and largest of one value over all draws.
    fn range(draws: &[[f64; 6]], value: impl Fn(&[f64; 6]) -> f64) -> (f64, f64) {
        draws.iter().map(value).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)))
    }

    #[test]
    fn random_poses_fill_their_box() {
        let draws = draws(Theta::Random, 0.45);
        for (i, (low, high)) in
            [(-0.5, 0.5), (-0.5, 0.5), (-0.5, 0.5), (-0.25, 0.25), (-0.25, 0.25), (-0.1, 0.5)].into_iter().enumerate()
        {
            let (least, most) = range(&draws, |theta| theta[i]);
            let margin = 0.05 * (high - low);
            assert!(
                (low..low + margin).contains(&least) && (high - margin..=high).contains(&most),
                "{i} {least} {most}"
            );
        }
    }

    #[test]
    fn poses_from_anywhere_turn_fully_tilt_to_46_degrees_and_keep_the_curve_in_view() {
        let draws = draws(Theta::Anywhere, 0.45);
        let rotation = |theta: &[f64; 6]| rotation_of_euler(&theta[..3]);
        let tilt = range(&draws, |theta| rotation(theta)[8].clamp(-1.0, 1.0).acos().to_degrees());
        assert!(tilt.0 < 3.0 && (43.0..46.0 + 1e-9).contains(&tilt.1), "{tilt:?}");
        let depth = range(&draws, |theta| 1.0 + theta[5]);
        assert!((0.9..0.93).contains(&depth.0) && (1.75..=1.8).contains(&depth.1), "{depth:?}");
        let turn = range(&draws, |theta| theta[2]);
        assert!(turn.0 < -3.0 && turn.1 > 3.0, "{turn:?}");
        let curve = curves::points("heart", 0.45).unwrap();
        for theta in &draws {
            assert!(is_in_view(theta, &curve, MAX_IMAGE));
            // The camera stands before the plane: 1 + e3' R' T > 0.
            let r = rotation(theta);
            assert!(1.0 + r[2] * theta[3] + r[5] * theta[4] + r[8] * theta[5] > 0.0);
            let centre = [0, 1].map(|i| (r[3 * i + 2] + theta[3 + i]) / (r[8] + theta[5]));
            assert!(centre.iter().all(|x| x.abs() <= 0.2 + 1e-12), "{centre:?}");
        }
    }

    #[test]
    fn a_curve_that_no_pose_shows_is_refused_in_words() {
        let curve = curves::points("heart", 9.0).unwrap();
        let problem = Theta::Anywhere.draw(&curve, &mut data_stream(1, 1)).unwrap_err().to_string();
        assert_eq!(problem, "none of 1000 drawn poses has the whole curve in view; choose a smaller scale");
    }
}
