//! The result of `estimate`: the JSON object of the contract and the table for people.

use cfpose::estimator::{By, Evidence, Minimised, PriorReport, StageReport, Undetermined};
use cfpose::theta::{Layout, RotationForm};
use cfpose::{Estimate, Pose, Settings};
use serde::Serialize;

use crate::args::{ProblemArgs, name_of};
use crate::inputs::{self, Loaded};
use crate::output::{number, table};

/// The JSON object; every field is always there, null where there is nothing to say.
#[derive(Debug, Serialize)]
pub struct Report {
    schema: &'static str,
    model: String,
    features: String,
    solver: String,
    normalise: String,
    weighting: String,
    preset: String,
    sampling: String,
    seed: u64,
    isa: &'static str,
    num_source: usize,
    num_target: usize,
    theta: Vec<f64>,
    rotation_form: String,
    free: Vec<String>,
    pose: Option<PoseReport>,
    homography: Option<[[f64; 3]; 3]>,
    correspondence: Option<Vec<Option<usize>>>,
    cost: f64,
    status: &'static str,
    usable: bool,
    iterations: usize,
    evaluations: usize,
    starts: usize,
    seconds: f64,
    covariance: Option<Vec<Vec<f64>>>,
    j_statistic: Option<f64>,
    degrees_of_freedom: Option<usize>,
    p_value: Option<f64>,
    noise_sigma: Option<f64>,
    verdict: Option<&'static str>,
    message: String,
    alternatives: Vec<AlternativeReport>,
    warnings: Vec<String>,
    condition: f64,
    /// Share of the target points that were left out as outliers.
    clutter: Option<f64>,
    /// Whether theta is the most likely one for the points rather than the best fit of means.
    refined: bool,
    /// What the likelihood of the points says.
    evidence: Option<Evidence>,
    /// Rows (from 1) of target points that lie far outside and take no part.
    stray: Vec<usize>,
    /// The same of source points.
    stray_source: Vec<usize>,
    /// Directions of theta that the points do not determine.
    undetermined: Vec<Undetermined>,
    /// What became of the prior.
    prior: Option<PriorReport>,
    /// The covariance for turns about the middle of the source and shifts of its image.
    covariance_at_centroid: Option<Vec<Vec<f64>>>,
    /// What each stage of the estimator did.
    stages: Vec<StageReport>,
    /// What theta is the best fit of: means of features (`moments`) or distances between the points (`points`).
    by: By,
    /// What was minimised last: `evaluate --at` of this file gives its cost.
    minimised: Minimised,
}

/// Cut a square matrix into its rows.
fn square(matrix: &[f64]) -> Vec<Vec<f64>> {
    let n = (matrix.len() as f64).sqrt() as usize;
    matrix.chunks_exact(n.max(1)).map(<[f64]>::to_vec).collect()
}

/// What was asked, and of which sets.
pub struct Asked<'a> {
    /// The names of all parts.
    pub settings: &'a Settings,
    /// Layout of theta.
    pub layout: &'a Layout,
    /// How rotations stand in lists of numbers.
    pub form: RotationForm,
    /// Name of the instruction set.
    pub isa: &'static str,
    /// Number of source points.
    pub num_source: usize,
    /// Number of target points.
    pub num_target: usize,
    /// Names of the free tangent directions.
    pub free: &'a [String],
    /// Size of a unit of the feature space in the units of the target file.
    pub target_unit: f64,
    /// The homography of the estimate in the units of the files.
    pub homography: Option<[[f64; 3]; 3]>,
}

impl<'a> Asked<'a> {
    /// Say what was asked of two point files.
    pub fn of(loaded: &'a Loaded, estimate: &Estimate) -> Self {
        Self {
            settings: loaded.estimator.settings(),
            layout: &loaded.estimator.model().layout,
            form: loaded.form,
            isa: loaded.isa.name(),
            num_source: loaded.num_source,
            num_target: loaded.num_target,
            free: &loaded.free,
            target_unit: loaded.target_unit(),
            homography: inputs::homography(loaded, &estimate.theta),
        }
    }
}

/// A pose with its convention.
#[derive(Debug, Serialize)]
pub struct PoseReport {
    convention: &'static str,
    rotation: [[f64; 3]; 3],
    translation: [f64; 3],
    matrix: [[f64; 4]; 4],
}

/// Another theta.
#[derive(Debug, Serialize)]
struct AlternativeReport {
    theta: Vec<f64>,
    pose: Option<PoseReport>,
    cost: f64,
    verdict: Option<&'static str>,
    relative_likelihood: Option<f64>,
}

impl PoseReport {
    /// Describe the pose of a theta, where its model has one.
    pub fn of(layout: &Layout, theta: &[f64], depth: Option<f64>) -> Option<Self> {
        let pose: Pose = inputs::pose(layout, theta, depth)?;
        let matrix = pose.matrix();
        let rotation = [0, 1, 2].map(|i| [matrix[i][0], matrix[i][1], matrix[i][2]]);
        Some(Self { convention: "target_from_source", rotation, translation: pose.translation, matrix })
    }
}

impl Report {
    /// Gather what the contract asks for; `correspondence` counts from 0, `None` for a source point without a partner.
    pub fn new(
        args: &ProblemArgs,
        asked: &Asked<'_>,
        estimate: &Estimate,
        correspondence: Option<Vec<Option<usize>>>,
        seconds: f64,
    ) -> Self {
        let (settings, last, layout) = (asked.settings, &estimate.minimised.stage, asked.layout);
        let list = |theta: &[f64]| layout.to_list(theta, asked.form);
        let statistics = estimate.statistics.as_ref();
        let alternatives = estimate.alternatives.iter().map(|other| AlternativeReport {
            theta: list(&other.theta),
            pose: PoseReport::of(layout, &other.theta, args.depth),
            cost: other.cost,
            verdict: other.verdict.map(cfpose::Verdict::name),
            relative_likelihood: other.relative_likelihood,
        });
        Self {
            schema: "cfpose.estimate/2",
            model: settings.model.clone(),
            features: last.features.clone(),
            solver: last.solver.clone().unwrap_or_default(),
            normalise: last.normaliser.clone().unwrap_or_default(),
            weighting: last.weighting.clone(),
            preset: settings.preset.clone(),
            sampling: estimate.sampling.map_or_else(|| name_of(args.sampling), str::to_string),
            seed: settings.seed,
            isa: asked.isa,
            num_source: asked.num_source,
            num_target: asked.num_target,
            theta: list(&estimate.theta),
            rotation_form: asked.form.name(),
            free: asked.free.to_vec(),
            pose: PoseReport::of(layout, &estimate.theta, args.depth),
            homography: asked.homography,
            correspondence: correspondence
                .map(|list| list.into_iter().map(|index| index.map(|index| index + 1)).collect()),
            cost: estimate.outcome.cost,
            status: estimate.outcome.status.name(),
            usable: estimate.usable(),
            iterations: estimate.iterations,
            evaluations: estimate.evaluations,
            starts: estimate.starts,
            seconds,
            covariance: statistics.map(|s| square(&s.covariance)),
            j_statistic: statistics.map(|s| s.j_statistic),
            degrees_of_freedom: statistics.map(|s| s.degrees_of_freedom),
            p_value: statistics.map(|s| s.p_value),
            noise_sigma: statistics.and_then(|s| s.noise_sigma).map(|sigma| sigma * asked.target_unit),
            verdict: estimate.verdict.map(cfpose::Verdict::name),
            message: estimate.outcome.message.clone(),
            alternatives: alternatives.collect(),
            warnings: estimate.warnings.clone(),
            condition: estimate.conditioning.condition,
            clutter: estimate.clutter,
            refined: estimate.refined,
            evidence: estimate.evidence,
            stray: estimate.stray[1].clone(),
            stray_source: estimate.stray[0].clone(),
            undetermined: estimate.undetermined.clone(),
            prior: estimate.prior,
            covariance_at_centroid: statistics.and_then(|s| s.covariance_at_centroid.as_deref()).map(square),
            stages: estimate.stages.clone(),
            by: estimate.by,
            minimised: estimate.minimised.clone(),
        }
    }

    /// Write the table for people.
    pub fn table(&self, asked: &Asked<'_>, estimate: &Estimate) -> String {
        let layout = asked.layout;
        let mut rows = vec![
            vec!["model".into(), self.model.clone()],
            vec![
                "method".into(),
                format!("{}, {}, {}, {}", self.features, self.normalise, self.weighting, self.solver),
            ],
            vec!["points".into(), format!("{} source, {} target", self.num_source, self.num_target)],
        ];
        let list = layout.to_list(&estimate.theta, asked.form);
        let mut rest = list.as_slice();
        for block in layout.blocks() {
            let rotation = matches!(block.kind, cfpose::theta::BlockKind::Rotation);
            let (part, tail) = rest.split_at(block.kind.list_len(asked.form));
            rest = tail;
            let unit = if rotation && asked.form == RotationForm::Quaternion { "w x y z" } else { block.unit };
            let numbers: Vec<String> = part.iter().map(|value| number(*value)).collect();
            let unit = if unit == "1" { String::new() } else { format!(" ({unit})") };
            rows.push(vec![block.name.into(), numbers.join(" ") + &unit]);
        }
        let work = format!(
            "{} start(s), {} iterations, {} evaluations, {:.3} s",
            self.starts, self.iterations, self.evaluations, self.seconds
        );
        rows.push(vec!["cost".into(), number(self.cost)]);
        rows.push(vec!["status".into(), format!("{} ({})", self.status, self.message)]);
        rows.push(vec!["work".into(), work]);
        if let Some(verdict) = self.verdict {
            rows.push(vec!["verdict".into(), verdict.into()]);
        }
        if let Some(evidence) = &self.evidence {
            let second = match evidence.second_mode_nats {
                nats if nats.is_finite() => format!("next mode {nats:.0} nats behind"),
                _ => "no other mode".to_string(),
            };
            let unseen = [evidence.unseen_source, evidence.unseen_target].map(|share| 100.0 * share);
            rows.push(vec![
                "evidence".into(),
                format!(
                    "by chance 10^{:.0}, {second}, unseen: source {:.0} %, target {:.0} %",
                    evidence.log10_false_alarms, unseen[0], unseen[1]
                ),
            ]);
        }
        if let (Some(j), Some(dof), Some(p)) = (self.j_statistic, self.degrees_of_freedom, self.p_value) {
            rows.push(vec!["J".into(), format!("{} with {dof} degrees of freedom, p = {}", number(j), number(p))]);
        }
        if let Some(prior) = &self.prior {
            let (square, dof, p) = (number(prior.chi_square), prior.degrees_of_freedom, number(prior.p_value));
            let used = if prior.used { "joined" } else { "left out" };
            rows.push(vec![
                "prior".into(),
                format!("{used}: chi-square {square} with {dof} degrees of freedom, p = {p}"),
            ]);
        }
        if let Some(sigma) = self.noise_sigma {
            rows.push(vec!["noise".into(), number(sigma)]);
        }
        if !self.alternatives.is_empty() {
            let costs: Vec<String> = self.alternatives.iter().map(|other| number(other.cost)).collect();
            rows.push(vec!["other costs".into(), costs.join(" ")]);
        }
        rows.extend(self.warnings.iter().map(|warning| vec!["warning".into(), warning.clone()]));
        table(&[], &rows)
    }
}
