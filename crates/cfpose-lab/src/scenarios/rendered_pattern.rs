//! Two rendered images of a plane pattern, segmented into weighted points.

use cfpose::entry::ParameterSpec;
use cfpose::entry::{EntryError, Parameters};
use cfpose::{Points, Side};
use cfpose_vision::registration::{Pattern, View};
use cfpose_vision::{SegmentOptions, segment};
use rand_chacha::ChaCha12Rng;

use crate::rendered::{CELLS, RenderedCell, draw_from};
use crate::scenario::{Scenario, ScenarioEntry, ScenarioError, Success, Trial};

/// Reference and frame of a condition of `cfpose cells`, as the blocks of pixels that the registration of images begins with: their
/// centroids on the plane z = 1, weighted by coverage. The start is the identity.
///
/// Random draws of a trial: those of `rendered::draw_from`.
struct RenderedPattern(RenderedCell);

impl Scenario for RenderedPattern {
    fn model(&self) -> &str {
        "plane-bearing[relation=plane,area=on]"
    }

    fn trial(&self, rng: &mut ChaCha12Rng) -> Result<Trial, ScenarioError> {
        let drawn = draw_from(&self.0, rng);
        let transfer = self.0.exposure.transfer;
        let options = SegmentOptions { find_others: true, ..SegmentOptions::default() };
        let impossible = |problem: &dyn std::fmt::Display| ScenarioError::Impossible(problem.to_string());
        let reference = segment(&drawn.reference.light(transfer), &SegmentOptions::default());
        let reference = reference.map_err(|error| impossible(&error))?;
        let frame = segment(&drawn.frame.light(transfer), &options).map_err(|error| impossible(&error))?;
        let of = |side: Side| move |problem| ScenarioError::Points { side, problem };
        let pattern = Pattern::new(&reference, drawn.camera).map_err(of(Side::Source))?;
        let view = View::new(&frame, drawn.camera).map_err(of(Side::Target))?;
        let [source, target]: [Points; 2] = [pattern.points[1].clone(), view.points[1].clone()];
        let start = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0].to_vec();
        let success = Success::Parts { angle: 1.0_f64.to_radians(), translation: 0.02 };
        Ok(Trial::new(source, target, drawn.truth, success).with_start(start))
    }
}

pub(super) const ENTRY: ScenarioEntry = ScenarioEntry {
    name: "rendered-pattern",
    summary: "rendered 640 x 480 images of a plane pattern, segmented: what registration of images begins with; success below 1 deg and .02",
    parameters: &[ParameterSpec {
        name: "cell",
        default: "clean25",
        meaning: "condition, as `cfpose cells` names it: clean45, noise12, defocus3, motion12, light40, hard, cut20, ..",
    }],
    source: "sections III.C.2 and IV.C; docs/vision.md",
    build: |parameters: &Parameters| {
        let cell = CELLS.iter().find(|cell| cell.name == parameters.text("cell"));
        let known = || format!("expected one of {}", CELLS.iter().map(|cell| cell.name).collect::<Vec<_>>().join(", "));
        let cell: Result<&RenderedCell, EntryError> = cell.ok_or_else(|| parameters.bad("cell", &known()));
        Ok(Box::new(RenderedPattern(*cell?)))
    },
};
