//! Whether a theta is to be trusted, and its covariance.

use cfpose_optim::LeastSquares;
use cfpose_optim::covariance::covariance;

use super::bend::STEEPEST;
use super::problem::EdgeProblem;
use super::quality::{Quality, error_of};
use super::registrar::{Outlined, Registrar};
use super::sight::Sight;

/// Two thetas whose residuals differ by less than this factor are not told apart.
const APART: f64 = 2.0;

/// Share of the visible contour with an edge below which nothing was found.
const LOST: f64 = 0.2;

/// Least share of the whole contour with an edge, for `good`.
pub(super) const SUPPORT: f64 = 0.6;

/// The same of steps between greys: their greys on both sides are looked at.
pub(super) const SUPPORT_OF_GREYS: f64 = 0.45;

/// Pixels by which an edge is wrong whatever the noise: the grid, 8 bits, the search.
pub(super) const FLOOR: f64 = 0.02;

/// Pixels over which the shifts of neighbouring edges by blur are alike.
const ALIKE: f64 = 40.0;

/// Shift of a blurred edge that is left, per squared deviation of the blur, 1 / pixels.
const BENT: f64 = 0.0003;

/// Error of the levels of pattern and background, which moves all edges alike, per squared noise of one pixel: pixels are told apart and
/// cut off at both ends of the scale by values that have the noise in them.
const LEVEL: f64 = 1.0;

/// Verdict on a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameVerdict {
    /// One theta explains the frame.
    Good,
    /// Several thetas explain it nearly as well.
    Ambiguous,
    /// The best theta does not explain it, or only a small part of it.
    Suspect,
    /// There is none.
    Lost,
}

impl FrameVerdict {
    /// Return the name as it stands in results.
    pub fn name(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Ambiguous => "ambiguous",
            Self::Suspect => "suspect",
            Self::Lost => "lost",
        }
    }

    /// Say whether there is a theta.
    pub fn usable(self) -> bool {
        self != Self::Lost
    }

    /// Say whether a theta explains the frame, alone or beside another one.
    pub fn accepted(self) -> bool {
        matches!(self, Self::Good | Self::Ambiguous)
    }

    /// Decide, and say why where it is not `Good`. `rival` is the ratio of the second best residual to the best, `support` the least share
    /// of the whole contour.
    pub(super) fn of(quality: &Quality, accepted: bool, rival: Option<f64>, support: f64) -> (Self, Option<String>) {
        let seen = quality.share * quality.visible;
        let edges = format!("{:.0} % of the visible contour has an edge in the frame", 100.0 * quality.share);
        match rival.filter(|ratio| *ratio < APART) {
            _ if quality.share < LOST => (Self::Lost, Some(format!("no pattern: only {edges}"))),
            _ if !accepted => {
                let regions = 100.0 * quality.frame_explained.min(quality.reference_explained);
                let off =
                    format!("{:.3} px off in the middle, {:.3} expected of noise", quality.median, quality.expected);
                let why =
                    format!("the pattern does not explain the frame: {edges}, {off}; regions agree by {regions:.0} %");
                (Self::Suspect, Some(why))
            }
            Some(ratio) => (
                Self::Ambiguous,
                Some(format!("another theta fits nearly as well: its edges are {ratio:.2} times as far off")),
            ),
            None if seen < support => {
                let why =
                    format!("only {:.0} % of the contour is seen ({:.0} % wanted)", 100.0 * seen, 100.0 * support);
                (Self::Suspect, Some(why))
            }
            None => (Self::Good, None),
        }
    }
}

impl Registrar {
    /// Return the covariance of the tangent step, from the noise of both images: every edge is off by noise / slope, neighbours within
    /// 2 pixels alike. Fixed parameters have no column.
    pub(super) fn covariance(&self, outlined: &Outlined, view: &Sight, theta: &[f64], quality: &Quality) -> Vec<f64> {
        let manifold = self.manifold_at(theta);
        let m = manifold.tangent();
        let none = || vec![f64::NAN; m * m];
        let Some(found) = self.search(outlined, view, theta, 3.0) else { return none() };
        let focal = view.camera.focal();
        let factors: Vec<f64> = found.distances.iter().map(|d| if d.abs() < 1.5 { focal } else { 0.0 }).collect();
        let rows = factors.len();
        let random = match view.field.is_greys() {
            false => quality.expected,
            // Small steps are less sure than large ones.
            true => {
                let with: Vec<usize> = (0..rows).filter(|i| factors[*i] > 0.0).collect();
                let square = with.iter().map(|i| error_of(outlined, view, &found, *i).powi(2)).sum::<f64>();
                (square / with.len().max(1) as f64).sqrt().hypot(0.75 * outlined.deviation)
            }
        };
        let problem =
            EdgeProblem { mapper: &outlined.places, manifold, edges: found.edges, normals: found.normals, factors };
        let (mut residual, mut jacobian) = (vec![0.0; rows], vec![0.0; rows * m]);
        problem.jacobian(theta, &mut residual, &mut jacobian);
        if jacobian.iter().any(|v| !v.is_finite()) {
            return none();
        }
        let [noise, blur] = [view.alike, ALIKE].map(|pixels| (pixels / outlined.spacing).max(1.0));
        let random = random.powi(2) * noise + FLOOR.powi(2);
        let level = LEVEL * view.pixel_noise.powi(2) * quality.blur / STEEPEST;
        let variance = random + ((BENT * quality.blur.powi(2)).powi(2) + level.powi(2) + view.shift.powi(2)) * blur;
        covariance(rows, m, &jacobian, variance, 1e-10).map_or_else(none, |c| c.matrix)
    }
}
