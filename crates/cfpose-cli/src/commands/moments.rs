//! `cfpose moments`: sums over points as small files that can be merged in any order.

use std::path::Path;
use std::sync::Arc;

use cfpose::entry::files_of;
use cfpose::moments::{GatherError, GatheredMoments, MAX_DEGREE};
use cfpose::{BuildContext, Execution, Isa, MomentProblem, Points, Registry, block};
use cfpose_lab::Lab;
use cfpose_vision::{FileError, ReadOptions, stream_points};
use serde::Serialize;

use crate::args::{MomentsArgs, Weights, numbers};
use crate::failure::{Failure, is_wrong_name};
use crate::inputs::{num_threads, read_moments, read_options, with_files};
use crate::output::{self, number, table};

/// Distance of the centre from the mean, in spreads of the points, from which digits are lost that a weighted fit reads.
const FAR: f64 = 1e5;

/// Run the command.
///
/// # Errors
/// [`Failure`]: wrong names and flags are usage, files are input.
pub fn run(args: &MomentsArgs, lab: &Lab) -> Result<(), Failure> {
    output::keep_apart(&args.files, &[Some(&args.out), args.json.as_deref()])?;
    output::check_writable(Some(&args.out))?;
    output::check_writable(args.json.as_deref())?;
    let sums = if args.merge { merged(args)? } else { gathered(args, &lab.registry)? };
    let bytes = sums.to_bytes();
    write(&args.out, &bytes)?;
    let summary = Summary::of(&sums, bytes.len());
    output::show(&summary.table(&args.out), args.json.as_deref())?;
    output::write_json(&summary, args.json.as_deref())
}

/// Add moment files.
fn merged(args: &MomentsArgs) -> Result<GatheredMoments, Failure> {
    let first = &args.files[0];
    let mut sums = read_moments(first)?;
    for path in &args.files[1..] {
        sums.merge(&read_moments(path)?).map_err(|error| match error {
            GatherError::Differ { what, first: here, second } => {
                let (path, first) = (path.display(), first.display());
                Failure::input(format!(
                    "{path}: {what} differ: {second}, and {here} in {first}; sums can be added only where they agree"
                ))
            }
            other => Failure::input(format!("{}: {other}", path.display())),
        })?;
    }
    Ok(sums)
}

/// What ends a reading.
enum Ended {
    File(FileError),
    Gather(GatherError),
}

impl From<FileError> for Ended {
    fn from(error: FileError) -> Self {
        Self::File(error)
    }
}

/// Sum over the points of the files, part by part.
fn gathered(args: &MomentsArgs, registry: &Registry) -> Result<GatheredMoments, Failure> {
    let reading = &args.reading;
    let whole = [(reading.thin.is_some(), "--thin"), (reading.weights == Some(Weights::Density), "--weights density")];
    if let Some((_, flag)) = whole.iter().find(|(given, _)| *given) {
        return Err(Failure::usage(format!(
            "{flag} needs all points at once, and moments read them part by part; leave it out"
        )));
    }
    let features = args.features.as_deref().unwrap_or_default();
    let registry = with_files(registry, files_of(features).into_iter(), Path::new(""))?;
    check_name(&registry, features)?;
    let centre = centre(&args.centre)?;
    let execution = execution(args.threads)?;
    let options = ReadOptions { format: reading.format.clone(), ..read_options(reading) };
    let mut sums: Option<GatheredMoments> = None;
    for path in &args.files {
        let fail = |problem: String| Failure::input(format!("{}: {problem}", path.display()));
        let mut first_fault = None;
        let read = stream_points(path, &options, |points: &Points| {
            let points =
                if reading.weights == Some(Weights::None) { &points.clone().with_equal_weights() } else { points };
            if sums.is_none() {
                match begin(args, &registry, features, centre, points.dim()) {
                    Ok(begun) => sums = Some(begun),
                    Err(fault) => first_fault = Some(fault),
                }
            }
            match &mut sums {
                Some(sums) => sums.add(points, &execution).map_err(Ended::Gather),
                // Ends the reading; what is wrong is known.
                None => Err(Ended::Gather(GatherError::TooMany)),
            }
        });
        if let Some(fault) = first_fault {
            return Err(fault);
        }
        let streamed = read.map_err(|ended| match ended {
            Ended::File(error) => error.into(),
            Ended::Gather(error) => fail(error.to_string()),
        })?;
        streamed.notes.iter().for_each(|note| output::note(&format!("note: {}: {note}", path.display())));
    }
    let sums = sums.filter(|sums| sums.weight() > 0.0);
    let sums = sums.ok_or_else(|| Failure::input(format!("{}: no point has a weight", args.files[0].display())))?;
    let moments = sums.moments();
    let (mean, covariance) = (moments.mean(), moments.covariance());
    let spread = (0..sums.dim()).map(|d| covariance[d][d]).sum::<f64>().sqrt();
    let away = (0..sums.dim()).map(|d| (mean[d] - centre[d]).powi(2)).sum::<f64>().sqrt();
    if away > FAR * spread {
        let near = mean[..sums.dim()].iter().map(|x| number(*x)).collect::<Vec<_>>().join(",");
        output::note(&format!(
            "note: the centre is {away:.3e} from the mean of the points, whose spread is {spread:.3e}: digits are lost; give all files --centre near {near}"
        ));
    }
    Ok(sums)
}

/// Look a family up by its name; what depends on its dimension is built with the points.
fn check_name(registry: &Registry, features: &str) -> Result<(), Failure> {
    match registry.family(features, &BuildContext::default()) {
        Err(error) if is_wrong_name(&error) => Err(error.into()),
        _ => Ok(()),
    }
}

/// Begin the sums that a family needs in so many dimensions: to twice its degree.
fn begin(
    args: &MomentsArgs,
    registry: &Registry,
    features: &str,
    centre: [f64; 3],
    dim: usize,
) -> Result<GatheredMoments, Failure> {
    let family = registry.family(features, &BuildContext { dim, ..BuildContext::default() })?;
    let degree = family.monomials(dim).and_then(|all| all.iter().map(|e| e.iter().sum::<usize>()).max());
    let Some(degree) = degree.filter(|degree| 2 * degree <= MAX_DEGREE) else {
        let known = "monomial, hermite, legendre, chebyshev, coordinates, learned";
        return Err(Failure::usage(format!(
            "--features {features}: moments serve polynomials of a degree up to {}, such as {known}",
            MAX_DEGREE / 2
        )));
    };
    let sums = GatheredMoments::new(dim, 2 * degree, centre, features);
    if let Some(name) = &args.model {
        check_model(name, registry, family.into(), dim, degree)?;
    }
    Ok(sums)
}

/// Refuse a model that cannot use moments of points of so many coordinates.
fn check_model(
    name: &str,
    registry: &Registry,
    family: Arc<dyn cfpose::family::DynFamily>,
    dim: usize,
    degree: usize,
) -> Result<(), Failure> {
    let model = registry.model(name, &BuildContext::default())?;
    let expected = model.source.point_dim();
    if expected != dim {
        return Err(Failure::input(format!(
            "the points have {dim} coordinates, model `{name}` takes {expected}; give points of {expected}, or a model for {dim}"
        )));
    }
    let probe = Points::from_columns(vec![vec![0.0, 1.0]; dim]).map_err(Failure::input)?;
    let mut sums = GatheredMoments::new(dim, 2 * degree, [0.0; 3], "");
    sums.add(&probe, &Execution::default()).map_err(Failure::input)?;
    let moments = sums.moments();
    let (transform, sides) = (block::Transform::identity(), [&moments, &moments]);
    MomentProblem::of_moments(Arc::new(model), family, transform, sides, Execution::default())
        .map(drop)
        .map_err(|error| Failure::usage(format!("--model {name}: {error}")))
}

/// Read the place that the sums are about.
fn centre(text: &str) -> Result<[f64; 3], Failure> {
    let list = numbers(text).filter(|list| list.len() <= 3 && list.iter().all(|x| x.is_finite()));
    let list = list.ok_or_else(|| {
        Failure::usage(format!("--centre {text}: give one to three numbers, such as 500000,4000000,0"))
    })?;
    Ok(std::array::from_fn(|d| list.get(d).copied().unwrap_or(0.0)))
}

/// Choose where sums are computed.
fn execution(threads: Option<u16>) -> Result<Execution, Failure> {
    let wanted = num_threads(threads);
    let isa = Isa::detect();
    if wanted < 2 {
        return Ok(Execution { isa, pool: None });
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(wanted).build();
    let pool = pool.map_err(|error| Failure::usage(format!("--threads {wanted}: {error}; ask for fewer")))?;
    Ok(Execution { isa, pool: Some(Arc::new(pool)) })
}

/// Write the file under another name first: a job that is killed leaves no half of it.
fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let fail = |error: std::io::Error| Failure::input(format!("{}: {error}", path.display()));
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(format!(".{}.part", std::process::id()));
    let part = path.with_file_name(name);
    std::fs::write(&part, bytes).and_then(|()| std::fs::rename(&part, path)).map_err(|error| {
        let _ = std::fs::remove_file(&part);
        fail(error)
    })
}

/// What the file holds.
#[derive(Debug, Serialize)]
struct Summary {
    schema: &'static str,
    points: u64,
    effective_points: f64,
    dim: usize,
    degree: usize,
    features: String,
    centre: Vec<f64>,
    mean: Vec<f64>,
    covariance: Vec<Vec<f64>>,
    bytes: usize,
}

impl Summary {
    fn of(sums: &GatheredMoments, bytes: usize) -> Self {
        let (dim, moments) = (sums.dim(), sums.moments());
        let covariance = moments.covariance();
        Self {
            schema: "cfpose.moments/1",
            points: sums.count(),
            effective_points: sums.effective(),
            dim,
            degree: sums.degree(),
            features: sums.label().to_string(),
            centre: sums.centre()[..dim].to_vec(),
            mean: moments.mean()[..dim].to_vec(),
            covariance: covariance[..dim].iter().map(|row| row[..dim].to_vec()).collect(),
            bytes,
        }
    }

    fn table(&self, path: &Path) -> String {
        let list = |values: &[f64]| values.iter().map(|x| number(*x)).collect::<Vec<_>>().join(" ");
        let spread: Vec<f64> = (0..self.dim).map(|d| self.covariance[d][d].max(0.0).sqrt()).collect();
        let rows = [
            ("points", self.points.to_string()),
            ("for", self.features.clone()),
            ("degree", format!("{} in {} dimension(s)", self.degree, self.dim)),
            ("centre", list(&self.centre)),
            ("mean", list(&self.mean)),
            ("spread", list(&spread)),
            ("file", format!("{}, {} bytes", path.display(), self.bytes)),
        ];
        table(&[], &rows.map(|(name, value)| vec![name.to_string(), value]))
    }
}
