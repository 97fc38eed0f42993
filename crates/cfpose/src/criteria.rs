//! Every threshold that decides something in an estimate, in one place.
//!
//! A criterion has a default, a unit, a meaning and a reason; `docs/method.md` shows the table that [`Criteria::table`] returns.
//! Reasons with counts come from `cargo run --release -p cfpose-lab --example criteria`; "chosen" and "a budget" say that nothing
//! was measured.
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

impl Criteria {
    /// Say whether neighbouring points miss a shape together by so much that a better one is looked for: from their `coherence` (a share of
    /// a variance) and the `noise` that was fitted (sizes of the target).
    pub fn is_misfit(&self, coherence: f64, noise: f64) -> bool {
        coherence > self.misfit && coherence.sqrt() * noise > self.misfit_length
    }

    /// Say whether they miss it together by so much that an answer is suspect.
    pub fn is_doubtful(&self, coherence: f64, noise: f64) -> bool {
        let length = coherence.sqrt() * noise;
        coherence > self.misfit && length > self.doubtful_length
            || coherence > self.doubtful[0] && length > self.doubtful[1] && noise < self.doubtful_noise
    }
}

criteria! {
    /// p-value of J below which a fit is suspect.
    p_suspect: f64 = 1e-3, "probability",
        "2 false alarms in 160 right answers, 0 misses in 160 wrong ones; smaller than a test's usual level, because models are idealised";
    /// Probability of J below which the means do not have the last word: the likelihood of the points is polished instead.
    p_agrees: f64 = 0.01, "probability",
        "costs time in 1 of 100 right answers; a bias by outliers that were left out shows in J before it shows in distances";
    /// Share of the residuals' variance that neighbouring residuals have in common, above which a fit is misplaced.
    coherent: f64 = 0.35, "share",
        "0 false alarms in 160, 116 misses in 160: it notices a misplaced shape that a large noise estimate hides from J; blind below about 300 points";
    /// Share of the source that no target point explains, above which the sets overlap only in part.
    partial: f64 = 0.12, "share",
        "0 false alarms in 160, 145 misses in 160: it notices missing parts, not other shapes";
    /// Share of outliers above which a fit is suspect whatever else agrees.
    max_clutter: f64 = 0.45, "share",
        "0 false alarms in 160, 158 misses in 160: beyond about half of the points another structure may be the larger one";
    /// Coordinates of points for each feature mean, below which the statistics are not informative.
    informative: f64 = 2.0, "ratio",
        "0 false alarms in 160 sets of 1000 points and more: a handful of points can match any means";
    /// Thetas closer than this are one (tangent norm: radians, units of the source).
    same_theta: f64 = 0.05, "tangent norm",
        "half of the error that counts as success; screened starts and modes closer than this lead to one answer";
    /// Cost of a candidate, relative to the best, up to which it explains the data as well where there is no statistic.
    equal_factor: f64 = 4.0, "ratio of costs",
        "chosen: where there is no statistic, costs of noisy mirrored solutions differ by a small factor";
    /// Cost below which candidates are equal whatever their ratio.
    equal_floor: f64 = 1e-16, "cost",
        "rounding, for features of order 1";
    /// Standard deviation of the noise that a stage begins with.
    first_noise: f64 = 0.0125, "normalised units",
        "between b_p = .002 and .03 of the planar simulation; the solve moves it in a few steps";
    /// Standard deviation of the noise that S is computed with at least.
    least_noise: f64 = 0.00125, "normalised units",
        "identical sets would give S = 0; it also bounds what J can refuse";
    /// Relative deviation of the noise variance up to which the weighted fit knows it; else distances along normals say it.
    noise_known: f64 = 0.2, "share",
        "a fifth of the variance changes J by a fifth at most";
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
        "below the median squared distance of independent samples, about .4 to .7 of spacing^2";
    /// Share of the squared noise that is added to that.
    gap_noise: f64 = 0.65, "share of noise^2",
        "the median of a chi-square variable of 2 or 3 degrees of freedom is .69 to .79 of its mean";
    /// Relative difference of the numbers of points up to which hidden spacings count as the same points.
    equal_counts: f64 = 0.03, "share",
        "chosen: files of the same points lose a few rows, not more";
    /// Distance along normals, in spacings, beyond which a fit is too far off to show its sampling.
    near_sampling: f64 = 3.0, "spacings",
        "chosen: closer fits are aligned first, by 6 steps with a shrinking reach";
    /// Costs of screened starts, relative to the best, above which a start is not tried once a better one is accepted.
    clearly_worse: f64 = 3.0, "ratio of costs",
        "chosen: mirror images of flat patterns differ by less";
    /// Proposed starts that are screened for each one that is kept.
    screened: usize = 4, "starts",
        "a budget: 300 rotations, 32 screened, 8 kept";
    /// Global starts that lead the means somewhere before the points are asked.
    first_global: usize = 2, "starts",
        "a budget: a failed start is cheaper to replace than outliers are to find";
    /// Points of each side that the means are led somewhere on where there are more than twice as many, before the points are asked; all of them
    /// are used where those lead to. 0: never.
    explored: usize = 20_000, "points",
        "a budget: the modes are compared on far fewer";
    /// Perturbations of a given start in turn: standard deviations of the rotation, and of lengths in sizes of the source.
    perturb: [f64; 3] = [0.2, 0.2, 0.4], "radians",
        "a budget: twice near, then farther";
    /// Distance from the mapped source beyond which a target point is an outlier.
    reject: f64 = 3.3, "standard deviations",
        "one normal residual in 1000 is lost";
    /// Nats by which another mode has to be behind.
    mode_nats: f64 = 8.0, "nats",
        "set on the hunt: a mode that is closer may be the true one";
    /// Standard deviations by which another mode has to be behind: a lead of many small differences may be chance.
    mode_deviations: f64 = 3.0, "standard deviations",
        "Vuong's test; equal poses of symmetric shapes, sampled anew, stay below";
    /// Share of the target that the most likely mode leaves unexplained, from which on the source is looked for in the rest.
    another: f64 = 0.3, "share of the target",
        "two copies leave a half each; below a third the rest holds no whole copy";
    /// Starts of the points' likelihood that are aligned to the end.
    aligned: usize = 40, "starts",
        "a budget";
    /// Aligned starts that ascend the coarse likelihood: in any case, and at most while they are about as good.
    ascended: [usize; 2] = [6, 30], "starts",
        "a budget";
    /// Modes that are polished: in any case, and at most while they are about as good.
    polished: [usize; 2] = [6, 30], "modes",
        "a budget: a cube has 24";
    /// Nats (of the coarse likelihood) behind the best up to which a mode is about as good.
    about_as_good: f64 = 12.0, "nats",
        "chosen: symmetric poses of a new sample differ by chance";
    /// Points of the coarse likelihood: source, target.
    coarse_points: [usize; 2] = [300, 150], "points",
        "a budget";
    /// Points of the likelihood that compares modes: source, target.
    fine_points: [usize; 2] = [1000, 400], "points",
        "a budget; nats are those of so many points";
    /// Deviation of a direction under the smoothed likelihood from which on it is walked along.
    weak: f64 = 0.01, "radians, sizes of the source",
        "a body of revolution without noise has .017 to .06; a walk along a determined direction costs two ascents";
    /// Expected number of thetas as good by chance (base 10 logarithm) above which a fit is suspect.
    false_alarms: f64 = -3.0, "log10",
        "one in a thousand estimates of unrelated points";
    /// Deviation of theta above which a fit is suspect.
    deviation: f64 = 0.05, "radians, sizes of the source",
        "half of the error that counts as success: none of 40 answers that only this forbade was wrong in two hunts of 400";
    /// Share of the source that the target does not explain, above which a fit is suspect.
    unseen: f64 = 0.1, "share",
        "set on the hunt";
    /// Share of either side that the other does not explain, up to which the rest is enough where the next mode is far behind and the noise
    /// small: what is seen can only be this part.
    unseen_clear: f64 = 0.4, "share",
        "a mirrored body that lacks its bump explains .78 of the source and .58 of the target, and is wrong";
    /// Deviations by which the next mode is behind where a part is enough.
    clear_deviations: f64 = 6.0, "standard deviations",
        "in two hunts of 400 wrong modes of a part were 4.1 to 5.2 ahead, right ones 3.3 to 75; of 1300 other trials one was 7.5 ahead, a misfit";
    /// Noise up to which a part is enough.
    clear_noise: f64 = 0.02, "sizes of the target",
        "of 1600 curves with missing arcs and noise of .015 to .09 two that are .107 and .117 off would be good with .034, with .029 and .033";
    /// Noise up to which outliers may be a part that only the target shows.
    lacking_noise: f64 = 0.018, "sizes of the target",
        "4 of 96 curves that lack 20 or 30 % of the target's are .10 to .18 off, with a noise of .019 to .026: it hides where they end";
    /// Noise above which a fit is suspect: shapes that differ by less explain each other.
    most_noise: f64 = 0.1, "sizes of the target",
        "of 1302 answers of six hunts that are good without it three have more, one of them .38 off";
    /// Share of the variance of the distances along normals that neighbouring target points have in common, from which on they count as a
    /// misfit, if ..
    misfit: f64 = 0.2, "share",
        "set on the hunts: of 470 right and good answers the largest with a length above .006 has .17, a mirrored star that was good .24";
    /// .. what they have in common is longer than this: below it is the shape between its points.
    misfit_length: f64 = 0.01, "sizes of the target",
        "as above";
    /// A misfit longer than this makes an answer suspect.
    doubtful_length: f64 = 0.002, "sizes of the target",
        "2 wrong answers with missing arcs have .0029 and .0083, no right one of 1100 that are good has more than .002";
    /// Share of the variance as above, and length of what they have in common, from which on together an answer is suspect.
    doubtful: [f64; 2] = [0.13, 0.005], "share, sizes of the target",
        "curves stretched over an arc that they lack have .14 and .19, .011 and .007 long; of 340 right and good answers beside noise one has as much, and is 2.6 times too certain";
    /// .. up to this noise: a larger one reaches over the bends of a shape, and neighbours miss it together without a fault.
    doubtful_noise: f64 = 0.05, "sizes of the target",
        "right answers have up to .15 at a noise of .065";
    /// Clusters of the target that `ransac` leaves out in turn.
    clusters: usize = 8, "clusters",
        "a budget: a blob of 5 % or more falls into one or two of them";
    /// Hypotheses of `ransac` that leave two clusters out.
    cluster_pairs: usize = 8, "hypotheses",
        "a budget: for blobs that fall into two clusters";
    /// Points of the first subset of a coarse-to-fine stage.
    first_subset: usize = 256, "points",
        "four blocks: fewer cost the same";
    /// Growth from one subset to the next, at least and at most.
    subset_growth: [f64; 2] = [4.0, 64.0], "ratio",
        "each subset costs at most a quarter of the next";
    /// Target points that a fit is aligned by before its sampling is asked.
    refine_points: usize = 500, "points",
        "a budget";
}
