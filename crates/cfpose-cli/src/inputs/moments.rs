//! Moment files, and an estimator on two of them.

use std::path::Path;

use cfpose::free::columns;
use cfpose::from_moments::MomentEstimator;
use cfpose::moments::GatheredMoments;
use cfpose::{BuildContext, Isa, Registry};
use cfpose_vision::Fault;

use super::{execution, free_columns, isa, settings};
use crate::args::ProblemArgs;
use crate::failure::{Failure, Kind};
use crate::{output, starts};

/// Bytes of a moment file, at most: 970 sums of at most 275 bytes, and a label.
const MOST_BYTES: u64 = 1 << 20;

/// An estimator built from arguments and moment files.
pub struct LoadedMoments {
    /// The estimator.
    pub estimator: MomentEstimator,
    /// Instruction set.
    pub isa: Isa,
    /// Number of points, source and target.
    pub counts: [usize; 2],
    /// Names of the tangent directions that are free.
    pub free: Vec<String>,
}

/// Read a moment file.
///
/// # Errors
/// Input: no such file, another content, damage.
pub fn read(path: &Path) -> Result<GatheredMoments, Failure> {
    let fail = |problem: String| Failure::input(format!("{}: {problem}", path.display()));
    let refused = |error| fail(Fault::from(error).to_string());
    let size = std::fs::metadata(path).map_err(refused)?.len();
    if size > MOST_BYTES {
        return Err(fail(format!("this is no moment file: {size} bytes are more than any has")));
    }
    let bytes = std::fs::read(path).map_err(refused)?;
    GatheredMoments::from_bytes(&bytes).map_err(|error| fail(error.to_string()))
}

/// Read both moment files and build the estimator; names are checked before files are read.
///
/// # Errors
/// Wrong names and what needs points are usage, files are input.
pub fn load(args: &ProblemArgs, registry: &Registry) -> Result<LoadedMoments, Failure> {
    for (flag, given) in [("--bounds", args.bounds.is_some()), ("--prior", args.prior.is_some())] {
        if given {
            return Err(Failure::usage(format!("{flag} needs points, which moments do not hold; leave it out")));
        }
    }
    let (mut settings, registry) = settings(args, registry)?;
    let model = registry.model(&args.model, &BuildContext { seed: args.seed, ..BuildContext::default() })?;
    let isa = isa(&args.isa)?;
    let names: Vec<String> = columns(&model.layout).into_iter().map(|column| column.name).collect();
    let free = free_columns(args, &model.layout)?;
    settings.free = args.free.is_some().then(|| free.clone());
    let context = starts::Context { model: &args.model, layout: &model.layout, form: args.rotation, depth: args.depth };
    settings.start = starts::parse(&args.start, &context, &registry)?;
    output::check_writable(args.json.as_deref())?;
    let (source, target) = (read(args.source())?, read(args.target())?);
    let execution = execution(Some(1), isa, 1)?;
    let estimator =
        MomentEstimator::new(&registry, &settings, &source, &target, &execution).map_err(|error| name(error, args))?;
    let counts = [&source, &target].map(|sums| usize::try_from(sums.count()).unwrap_or(usize::MAX));
    Ok(LoadedMoments { estimator, isa, counts, free: free.into_iter().map(|j| names[j].clone()).collect() })
}

/// Put the name of the file before an error about its moments.
fn name(error: cfpose::Error, args: &ProblemArgs) -> Failure {
    let path = match &error {
        cfpose::Error::Points { side, .. }
        | cfpose::Error::Data { side, .. }
        | cfpose::Error::PointDimension { side, .. } => match side {
            cfpose::Side::Source => args.source(),
            cfpose::Side::Target => args.target(),
        },
        cfpose::Error::Normalise { .. } => args.target(),
        _ => return error.into(),
    };
    Failure { kind: Kind::Input, error: anyhow::anyhow!("{}: {error}", path.display()) }
}
