//! Every threshold that decides something in an estimate, in one place.
//!
//! A criterion has a default, a unit, a meaning and a reason; `docs/method.md` shows the table that [`Criteria::table`] returns.
//! Criteria are part of a [`Pipeline`](crate::estimator::Pipeline), so a pipeline file may change them under `[criteria]`.

use serde::{Deserialize, Serialize};

/// One line of the table of criteria.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Criterion {
    /// Name, as a pipeline file writes it.
    pub name: String,
    /// Value.
    pub value: String,
    /// Unit of the value.
    pub unit: &'static str,
    /// What is decided.
    pub meaning: String,
    /// Why this value: what was measured, or what it follows from.
    pub reason: &'static str,
}

macro_rules! criteria {
    ($($(#[doc = $meaning:literal])+ $name:ident: $kind:ty = $default:expr, $unit:literal, $reason:literal;)+) => {
        /// The thresholds of an estimate.
        ///
        /// ```
        /// use cfpose::Criteria;
        /// let strict = Criteria { p_suspect: 0.01, ..Criteria::default() };
        /// let row = strict.table().into_iter().find(|row| row.name == "p-suspect").unwrap();
        /// assert_eq!((row.value.as_str(), row.unit), ("0.01", "probability"));
        /// ```
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(rename_all = "kebab-case", default, deny_unknown_fields)]
        pub struct Criteria {
            $(
                $(#[doc = $meaning])+
                #[doc = concat!("\nUnit: ", $unit, ". Reason: ", $reason)]
                pub $name: $kind,
            )+
        }

        impl Default for Criteria {
            fn default() -> Self {
                Self { $($name: $default,)+ }
            }
        }

        impl Criteria {
            /// Return all criteria with their values, in the order of their declaration.
            pub fn table(&self) -> Vec<Criterion> {
                vec![$(Criterion {
                    name: stringify!($name).replace('_', "-"),
                    value: format!("{:?}", self.$name),
                    unit: $unit,
                    meaning: [$($meaning),+].concat().trim().to_string(),
                    reason: $reason,
                },)+]
            }
        }
    };
}

criteria! {
    /// p-value of J below which a fit is suspect.
    p_suspect: f64 = 1e-3, "probability",
        "smaller than a test's usual level, because the models are idealised: 16 of 2400 clean planar trials below .01";
    /// Share of the residuals' variance that neighbouring residuals have in common, above which a fit is misplaced.
    coherent: f64 = 0.35, "share",
        "noise alone gives about 0, a misplaced shape nearly 1; blind below about 300 points";
    /// Share of the source that no target point explains, above which the sets overlap only in part.
    partial: f64 = 0.12, "share",
        "overlap of .5 is noticed in all of 50 clouds; the coarse spacing of thinned curves leaves up to .05 unexplained";
    /// Share of outliers above which a fit is suspect whatever else agrees.
    max_clutter: f64 = 0.45, "share",
        "beyond about half of the points, another structure may be the larger one";
    /// Coordinates of points for each feature mean, below which the statistics are not informative.
    informative: f64 = 2.0, "ratio",
        "a handful of points can match any means; asymptotic J is 11 % too high at 120 points";
    /// Thetas closer than this are one (tangent norm: radians, units of the source).
    same_theta: f64 = 0.05, "tangent norm",
        "twice the largest reported standard deviation of a good planar estimate; half of the error that counts as success";
    /// Cost of a candidate, relative to the best, up to which it explains the data as well where there is no statistic.
    equal_factor: f64 = 4.0, "ratio of costs",
        "mirrored solutions of noisy patterns differ by less than 2 in 100 of 100 draws";
    /// Cost below which candidates are equal whatever their ratio.
    equal_floor: f64 = 1e-16, "cost",
        "rounding, for features of order 1";
    /// Standard deviation of the noise that a stage begins with.
    first_noise: f64 = 0.0125, "normalised units",
        "between b_p = .002 and .03 of the planar simulation; the solve moves it in a few steps";
    /// Standard deviation of the noise that S is computed with at least.
    least_noise: f64 = 0.00125, "normalised units",
        "identical sets would give S = 0";
    /// Relative deviation of the noise variance up to which the weighted fit knows it; else distances along normals say it.
    noise_known: f64 = 0.2, "share",
        "a fifth of the variance changes J by a fifth of its degrees of freedom at most";
    /// Relative deviation of the variance up to which a full noise covariance is reported.
    noise_reported: f64 = 0.5, "share",
        "half of the variance is a quarter of the standard deviation";
    /// Negative noise variance in reported standard deviations beyond which the model of the noise is refused.
    noise_negative: f64 = 2.0, "standard deviations",
        "at the boundary a variance is negative by chance; beyond two deviations it hides a misfit";
    /// Share of mutual nearest neighbours above which two sets are the same points.
    mutual: f64 = 0.75, "share",
        "nearly 1 for the same points with small noise, about .5 for independent samples";
    /// Squared noise over squared spacing up to which the spacing is visible.
    visible: f64 = 0.5, "ratio",
        "above it the noise decides who is nearest, and distances say nothing about the sampling";
    /// Share of the squared spacing that the squared median distance of independent samples exceeds.
    gap_spacing: f64 = 0.4, "share of spacing^2",
        "the median squared distance of independent samples is .69 spacing^2 on a curve, .44 on a surface";
    /// Share of the squared noise that is added to that.
    gap_noise: f64 = 0.65, "share of noise^2",
        "the median of a chi-square variable with 2 or 3 degrees of freedom over its mean is .69 to .79";
    /// Relative difference of the numbers of points up to which hidden spacings count as the same points.
    equal_counts: f64 = 0.03, "share",
        "files of the same points lose a few rows, not more";
    /// Distance along normals, in spacings, beyond which a fit is too far off to show its sampling.
    near_sampling: f64 = 3.0, "spacings",
        "closer fits are moved onto the shape first: 6 steps of closest points on 500 points";
    /// Evidence that a refinement gains: its standard deviations relative to those of the means, at most.
    refine_gain: f64 = 1.5, "ratio",
        "a refinement whose own covariance is not smaller made 109 of 109 same-point estimates worse";
    /// Noise in spacings below which it does not change who is nearest.
    refine_spacing: f64 = 0.5, "spacings",
        "half the spacing: the nearest point is then the true neighbour on the shape";
    /// A refinement is tried where the noise seems to be below so many times its limit.
    refine_nearly: f64 = 4.0, "ratio",
        "a pose that is still off adds its misfit to the noise; the limit is asked again afterwards";
    /// Share of nearest distances that are equal, above which a set is a lattice and closest points would lock onto it.
    lattice: f64 = 0.5, "share",
        "half of a raster's distances are the pixel's; of random points fewer than 1 in 1000 agree to 1e-6";
    /// Costs of screened starts, relative to the best, above which a start is not tried once a better one is accepted.
    clearly_worse: f64 = 3.0, "ratio of costs",
        "mirror images of flat patterns differ by less";
    /// Proposed starts that are screened for each one that is kept.
    screened: usize = 4, "starts",
        "300 rotations, 32 solved, 8 kept: 240 of 240 planar trials without a start";
    /// Global starts that are tried before outliers are suspected.
    first_global: usize = 2, "starts",
        "a failed start is cheaper to replace than outliers are to find";
    /// Perturbations of a given start in turn: standard deviations of the rotation, and of lengths in sizes of the source.
    perturb: [f64; 3] = [0.2, 0.2, 0.4], "radians",
        "twice near, then farther: 239 of 240 planar trials from b_i = 1";
    /// Hypotheses that are questioned for outliers.
    questioned: usize = 3, "hypotheses",
        "the fourth was never the best in 600 trials with outliers";
    /// Points of the coarse fit of a mixture: source, target.
    mixture_points: [usize; 2] = [400, 1000], "points",
        "a start of the fit on all points";
    /// Standard deviation that a mixture begins with.
    mixture_sigma: f64 = 0.15, "normalised units",
        "wide enough for a pose .1 off, then annealed";
    /// Points of the coarse trimmed fit: source, target.
    trimmed_points: [usize; 2] = [1000, 400], "points",
        "a start of the fit on all points";
    /// Distance from the mapped source beyond which a target point is an outlier.
    reject: f64 = 3.3, "standard deviations",
        "one normal residual in 1000 is lost";
    /// Rotations that the search for partial overlap begins from.
    overlap_starts: usize = 160, "starts",
        "about 30 degrees apart: the basin of trimmed closest points";
    /// Points of that search: source, target.
    overlap_points: [usize; 2] = [600, 250], "points",
        "20 of 25 clouds with half missing, as with twice as many";
    /// Poses of that search that are refined with all points.
    overlap_finalists: usize = 6, "poses",
        "the seventh was never the best in 50 clouds";
    /// Distance up to which a point has a partner on the other side.
    overlap_reach: f64 = 1.5, "spacings",
        "independent samples are closer in 95 of 100 points";
    /// Gain in partners that a pose of partial overlap needs.
    overlap_gain: f64 = 1.02, "ratio",
        "less is within the scatter of the count";
    /// Rounds of choosing partners and estimating again.
    overlap_rounds: usize = 2, "rounds",
        "the third changed no pose by more than its standard deviation";
    /// Clusters of the target that `ransac` leaves out in turn.
    clusters: usize = 8, "clusters",
        "a blob of 5 % or more falls into one or two of them";
    /// Hypotheses of `ransac` that leave two clusters out.
    cluster_pairs: usize = 8, "hypotheses",
        "a blob that falls into two clusters is left out with 25 % by these and those of one";
    /// Points of the first subset of a coarse-to-fine stage.
    first_subset: usize = 256, "points",
        "four blocks: fewer cost the same";
    /// Growth from one subset to the next, at least and at most.
    subset_growth: [f64; 2] = [4.0, 64.0], "ratio",
        "each subset costs at most a quarter of the next";
    /// Target points of the first steps of a refinement by closest points.
    refine_points: usize = 500, "points",
        "until it stands; all points then take 3 steps";
}
