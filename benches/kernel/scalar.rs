//! The scalar chain rule: `bearing3` x `trig18` on plain numbers with num-dual, point by point.
//!
//! A 3 x 6 Jacobian of the model by dual vectors, derivatives of the six functions by plain duals, their product. What a careful
//! program does without lanes.

use num_dual::{Derivative, Dual64, DualNum, DualSVec64};

use crate::hand::{Hand, HandSums};

/// Sum over all points.
pub fn scalar_chain_rule(case: &Hand<'_>) -> HandSums {
    let mut out = HandSums { value: [0.0; 18], jacobian: [[0.0; 6]; 18] };
    let seed = |value: f64, j: usize| {
        let mut eps = [0.0; 6];
        eps[j] = 1.0;
        DualSVec64::<6>::new(value, Derivative::some(eps.into()))
    };
    let zero = DualSVec64::<6>::from(0.0);
    let w = [seed(0.0, 0), seed(0.0, 1), seed(0.0, 2)];
    // R (I + [w]): exact to first order at w = 0.
    let skew = [[zero, -w[2], w[1]], [w[2], zero, -w[0]], [-w[1], w[0], zero]];
    let mut rotation = [zero; 9];
    for i in 0..3 {
        for k in 0..3 {
            rotation[3 * i + k] = zero + case.rotation[3 * i + k];
            for l in 0..3 {
                rotation[3 * i + k] += skew[l][k] * case.rotation[3 * i + l];
            }
        }
    }
    let translation = [0, 1, 2].map(|i| seed(case.translation[i], 3 + i));
    for n in 0..case.columns[0].len() {
        let mut y = translation;
        for i in 0..3 {
            for k in 0..3 {
                y[i] += rotation[3 * i + k] * case.columns[k][n];
            }
        }
        let inverse = (y[0] * y[0] + y[1] * y[1] + y[2] * y[2]).sqrt().recip();
        for q in 0..3 {
            let x = (y[q] * inverse - case.mean[q]) * case.scale[q];
            let slopes = x.eps.0.map_or([0.0; 6], |eps| eps.data.0[0]);
            let t = Dual64::new(x.re, 1.0);
            let (sine, cosine) = (t * std::f64::consts::PI).sin_cos();
            let functions = [t, sine, t * cosine, t * t, sine * sine, cosine];
            for i in 0..6 {
                out.value[6 * q + i] += functions[i].re;
                for j in 0..6 {
                    out.jacobian[6 * q + i][j] += functions[i].eps * slopes[j];
                }
            }
        }
    }
    out
}
