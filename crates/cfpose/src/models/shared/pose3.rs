//! What the models of a 3-D pose share: A = R, b = T, half turns of the source, the mirrored tilt of a flat one.

use cfpose_kernel::points::Points;
use cfpose_kernel::scalar::Scalar;

use super::projective::Linear;
use super::scene;

/// A = R, b = T from ambient theta = (R row by row, T): shared by all models of a 3-D pose.
pub fn pose_affine<S: Scalar>(theta: &[S], a: &mut [S], b: &mut [S]) {
    a.copy_from_slice(&theta[..9]);
    b.copy_from_slice(&theta[9..12]);
}

/// y = R M + T.
#[derive(Clone, Copy)]
pub struct Posed;

impl Linear for Posed {
    fn affine<S: Scalar>(&self, theta: &[S], a: &mut [S], b: &mut [S]) {
        pose_affine(theta, a, b);
    }
}

/// Return theta = (R, T, rest) after each half turn of the source about its principal axes, for maps s R M + T.
pub fn half_turned(theta: &[f64], scale: f64, source: &Points) -> Vec<Vec<f64>> {
    scene::half_turns(source)
        .iter()
        .map(|turn| {
            let (rotation, _) = turn.before(&theta[..9], &theta[9..12]);
            let scaled: Vec<f64> = theta[..9].iter().map(|value| scale * value).collect();
            let (_, translation) = turn.before(&scaled, &theta[9..12]);
            [&rotation[..], &translation[..], &theta[12..]].concat()
        })
        .collect()
}

/// Return the mirrored tilt of a flat scene, of equal cost where perspective is weak: y - c -> (I - 2 v v')(y - c) along the
/// line of sight v through the mean c, after the reflection I - 2 n n' in the scene's plane, which leaves it as it is.
pub fn mirrored_tilt(theta: &[f64], mean: [f64; 3], normal: [f64; 3]) -> Option<Vec<f64>> {
    let mut centre = [theta[9], theta[10], theta[11]];
    for i in 0..3 {
        centre[i] += (0..3).map(|k| theta[3 * i + k] * mean[k]).sum::<f64>();
    }
    let size = centre.iter().map(|value| value * value).sum::<f64>().sqrt();
    let sight = centre.map(|value| value / size);
    let reflection = |v: [f64; 3]| {
        let mut m = [0.0; 9];
        for i in 0..3 {
            for k in 0..3 {
                m[3 * i + k] = f64::from(u8::from(i == k)) - 2.0 * v[i] * v[k];
            }
        }
        m
    };
    let half = cfpose_optim::manifold::multiply3(&reflection(sight), &theta[..9]);
    let rotation = cfpose_optim::manifold::multiply3(&half, &reflection(normal));
    let mut other = rotation.to_vec();
    other.extend((0..3).map(|i| centre[i] - (0..3).map(|k| rotation[3 * i + k] * mean[k]).sum::<f64>()));
    other.iter().all(|value| value.is_finite()).then_some(other)
}
