//! Losses that a second-order cone program takes as they are.

/// What is summed over the residuals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Loss {
    /// 1/2 r^2.
    Squares,
    /// |r|.
    Absolute,
    /// 1/2 r^2 up to |r| = scale, `scale * |r| - 1/2 scale^2` beyond.
    Huber {
        /// Residual at which the loss turns linear, > 0.
        scale: f64,
    },
}

impl Loss {
    /// Return the sum over the residuals.
    pub fn objective(self, residual: &[f64]) -> f64 {
        match self {
            Loss::Squares => 0.5 * residual.iter().map(|r| r * r).sum::<f64>(),
            Loss::Absolute => residual.iter().map(|r| r.abs()).sum(),
            Loss::Huber { scale } => {
                let one = |r: &f64| if r.abs() <= scale { 0.5 * r * r } else { scale * (r.abs() - 0.5 * scale) };
                residual.iter().map(one).sum()
            }
        }
    }

    /// Return the derivative of the loss of one residual.
    pub fn slope(self, residual: f64) -> f64 {
        match self {
            Loss::Squares => residual,
            Loss::Absolute => {
                if residual == 0.0 {
                    0.0
                } else {
                    residual.signum()
                }
            }
            Loss::Huber { scale } => residual.clamp(-scale, scale),
        }
    }
}
