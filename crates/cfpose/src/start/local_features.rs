//! Local features of the shape: poses that several matched regions agree on. A part that both sides show is enough.

use super::{StartContext, StartEntry, StartStrategy, inhomogeneous};
use crate::distances::consistent::{Match, agreed};
use crate::distances::spin::{SpinImage, spin_images};
use crate::entry::ParameterSpec;
use crate::error::{Error, Side};
use crate::model::LinearKind;
use cfpose_kernel::points::Points;

/// Points of each side that are looked at.
const LOOKED_AT: usize = 4000;
/// Regions of the source and of the target.
const REGIONS: [usize; 2] = [400, 800];
/// Most similar regions of the target that each region of the source is matched with.
const MATCHES: usize = 3;

struct LocalFeatures {
    radius: f64,
    keep: usize,
}

impl StartStrategy for LocalFeatures {
    fn name(&self) -> &'static str {
        "local-features"
    }

    /// Regions are matched by their spin images, a pose is proposed for each large set of matches that one rigid motion explains.
    fn starts(&self, context: &StartContext<'_>) -> Result<Vec<Vec<f64>>, Error> {
        let Some(group) = context.model.linear.as_ref().filter(|group| group.kind == LinearKind::Rotation) else {
            let problem =
                "start `local-features` needs a rigid motion of the plane or of space; use pca, grid or a theta";
            return Err(Error::Unsupported(problem.into()));
        };
        let side = |side: Side, points: &Points| {
            let points = inhomogeneous(side, points, group.dim)?;
            let mut rng = crate::streams::stream(context.seed, "local features");
            crate::distances::sampling::draw(&points, LOOKED_AT, &mut rng)
                .map_err(|problem| Error::Points { side, problem })
        };
        let (source, target) = (side(Side::Source, context.source)?, side(Side::Target, context.target)?);
        // Of parts of one shape the smaller one is closer to what both show.
        let size = spread(&source).min(spread(&target));
        let radius = self.radius * size;
        let regions = [spin_images(&source, REGIONS[0], radius), spin_images(&target, REGIONS[1], radius)];
        let matches = matches(&regions[0], &regions[1]);
        let poses = agreed(&matches, group.dim, size, self.keep);
        Ok(poses.iter().map(|(a, b)| (group.theta)(a, b)).collect())
    }
}

/// Return the root mean square distance from the mean.
fn spread(points: &Points) -> f64 {
    let c = points.covariance();
    (c[0][0] + c[1][1] + c[2][2]).sqrt()
}

/// Match each region of the source with the most similar ones of the target.
fn matches<'a>(source: &'a [SpinImage], target: &'a [SpinImage]) -> Vec<Match<'a>> {
    let mut all = Vec::new();
    for from in source {
        let mut similar: Vec<(f64, &SpinImage)> = target.iter().map(|to| (from.squared_distance(to), to)).collect();
        similar.sort_by(|a, b| a.0.total_cmp(&b.0));
        all.extend(similar.into_iter().take(MATCHES).map(|(_, to)| Match { from, to }));
    }
    all
}

pub(super) const ENTRY: StartEntry = StartEntry {
    name: "local-features",
    summary: "poses that matched regions agree on (spin images, second-order consistency): parts that both sides show are enough; rigid motions",
    parameters: &[
        ParameterSpec {
            name: "radius",
            default: "0.5",
            meaning: "radius of a region in root mean square radii of the smaller set, above 0, at most 10",
        },
        ParameterSpec { name: "keep", default: "20", meaning: "number of poses that are proposed at most, 1 to 1000" },
    ],
    source: "Johnson and Hebert 1999; Chen et al. 2022 (SC2-PCR)",
    build: |parameters| {
        Ok(Box::new(LocalFeatures {
            radius: parameters.number("radius", "a number above 0, at most 10", |v| v > 0.0 && v <= 10.0)?,
            keep: parameters.count("keep", 1, 1000)?,
        }))
    },
};
