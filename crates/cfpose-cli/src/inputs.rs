//! From arguments and files to an estimator.

mod beforehand;
mod cameras;
mod files;
mod moments;
mod raster;
mod weights;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use cfpose::entry::files_of;
use cfpose::estimator::Pipeline;
use cfpose::free::{Frame, columns, find_columns};
use cfpose::homography::in_file_units;
use cfpose::model::{LinearKind, TargetSide};
use cfpose::theta::{Layout, RotationForm};
use cfpose::{
    BuildContext, BuildError, Estimator, Execution, Isa, Model, Points, PointsError, Pose, Registry, Settings, Start,
};
use cfpose_lab::method::stages;
use cfpose_vision::{Camera, Fault};

use crate::args::{FrameName, ProblemArgs, Reflections};
use crate::failure::{Failure, Kind, is_wrong_name};
use crate::{output, starts};

pub use cameras::camera as read_camera_flag;
pub use files::{read, read_options};
pub use moments::{load as load_moments, read as read_moments};
pub use weights::with_files;

/// A problem built from arguments and files.
pub struct Loaded {
    /// The problem.
    pub estimator: Estimator,
    /// Instruction set.
    pub isa: Isa,
    /// Number of source points.
    pub num_source: usize,
    /// Number of target points.
    pub num_target: usize,
    /// Coordinates in the target file.
    pub target_dim: usize,
    /// Cameras of source and target, where the files hold pixels.
    pub cameras: [Option<Camera>; 2],
    /// Names of the tangent directions that are free, in the order of the Jacobian's columns.
    pub free: Vec<String>,
    /// How rotations stand in lists of numbers.
    pub form: RotationForm,
}

impl Loaded {
    /// Return the size of a unit of the feature space in the units of the target file: pixels for 2-column files of a camera.
    pub fn target_unit(&self) -> f64 {
        self.cameras[1].map_or(1.0, Camera::focal)
    }
}

/// Read the files and build the problem.
///
/// # Errors
/// Wrong names and numbers are usage, files and points are input; names are checked before files are read.
pub fn load(args: &ProblemArgs, registry: &Registry) -> Result<Loaded, Failure> {
    if args.source_moments.is_some() {
        return Err(Failure::usage("--source-moments holds no points; only `cfpose estimate` takes it"));
    }
    let (mut settings, registry) = settings(args, registry)?;
    let registry = &registry;
    let model = registry.model(&args.model, &BuildContext { seed: args.seed, ..BuildContext::default() })?;
    let form = args.rotation;
    let cameras = cameras::read(args)?;
    check_depth(args, &model.layout)?;
    let isa = isa(&args.isa)?;
    let names: Vec<String> = columns(&model.layout).into_iter().map(|column| column.name).collect();
    let free = free_columns(args, &model.layout)?;
    settings.free = args.free.is_some().then(|| free.clone());
    let context = starts::Context { model: &args.model, layout: &model.layout, form, depth: args.depth };
    settings.start = starts::parse(&args.start, &context, registry)?;
    settings.bounds = beforehand::bounds(args, &model.layout)?;
    settings.prior = beforehand::prior(args, &context)?;
    output::check_writable(args.json.as_deref())?;
    let files = files::read_both(args)?;
    let (source, target) = (files[0].points.clone(), files[1].points.clone());
    let (source_dim, target_dim) = (source.dim(), target.dim());
    cameras::check(args, [source_dim, target_dim])?;
    let source = cameras::to_image(source, cameras[0], args.source())?;
    let target = cameras::to_image(target, cameras[1], args.target())?;
    let execution = execution(args.threads, isa, source.len().max(target.len()))?;
    let build = |settings: &Settings| {
        Estimator::new(registry, settings, &source, &target, &execution)
            .map_err(|error| name_file(error, args, &target))
    };
    let is_raster = args
        .sampling
        .given()
        .map_or_else(|| files.iter().all(|f| raster::is_one(&f.points)), |s| s == cfpose::distances::Sampling::Raster);
    if is_raster && args.pipeline.is_none() {
        raster::choose(&mut settings, registry);
    }
    let mut estimator = build(&settings)?;
    if is_raster && args.pipeline.is_none() && args.preset == "auto" {
        settings.pipeline = Some(raster::without_points(estimator.pipeline()));
        estimator = build(&settings)?;
    }
    if let Some(choice) = args.reflections {
        reflect(&mut settings, &estimator, choice, registry)?;
        estimator = build(&settings)?;
    }
    for (file, note) in files.iter().flat_map(|file| file.notes.iter().map(move |note| (file, note))) {
        output::note(&format!("note: {}: {note}", file.path.display()));
    }
    Ok(Loaded {
        estimator,
        isa,
        num_source: source.len(),
        num_target: target.len(),
        target_dim,
        cameras: [cameras[0].filter(|_| source_dim == 2), cameras[1].filter(|_| target_dim == 2)],
        free: free.into_iter().map(|j| names[j].clone()).collect(),
        form,
    })
}

/// Let start strategies propose reflections or not: the strategy that is named, or the one of the pipeline.
///
/// # Errors
/// Usage where no strategy chooses between reflections and others.
fn reflect(
    settings: &mut Settings,
    estimator: &Estimator,
    choice: Reflections,
    registry: &Registry,
) -> Result<(), Failure> {
    let group = estimator.model().linear.as_ref().map(|group| group.kind);
    if group != Some(LinearKind::General) {
        let problem = "--reflections has no effect, the maps of model";
        return Err(Failure::usage(format!("{problem} `{}` are no general affine maps; leave it out", settings.model)));
    }
    let allow = choice == Reflections::Allow;
    let chosen = |name: &str| {
        let spec = cfpose::start::with_reflections(&registry.starts, name, allow);
        let given =
            cfpose::entry::parse_spec(name).is_ok_and(|(_, given)| given.iter().any(|(key, _)| key == "reflections"));
        if spec != name {
            return Ok(spec);
        }
        let problem = if given { "says itself whether there are" } else { "proposes no" };
        Err(Failure::usage(format!(
            "--reflections has no effect, start `{name}` {problem} reflections; leave it out, or give --start whitened-affine"
        )))
    };
    match &settings.start {
        Some(Start::Named(name)) => settings.start = Some(Start::Named(chosen(name)?)),
        Some(Start::Given(_)) => {
            return Err(Failure::usage("--reflections has no effect beside a theta in --start; leave one of them out"));
        }
        None => {
            let mut pipeline = estimator.pipeline().clone();
            pipeline.global_start = Some(chosen(pipeline.global_start.as_deref().unwrap_or("identity"))?);
            settings.pipeline = Some(pipeline);
        }
    }
    Ok(())
}

/// Read the stages of an estimator.
fn pipeline(path: &Path) -> Result<Pipeline, Failure> {
    let text = std::fs::read_to_string(path)
        .map_err(|error| Failure::input(format!("{}: {}", path.display(), Fault::from(error))))?;
    stages::read(&text, &path.display().to_string()).map_err(|error| Failure::input(error.to_string()))
}

/// Return all files that the arguments of a problem name as inputs.
pub fn named(args: &ProblemArgs) -> Vec<PathBuf> {
    let mut all = vec![args.source().to_path_buf(), args.target().to_path_buf(), PathBuf::from(args.start.trim())];
    all.extend(args.pipeline.clone());
    all.extend([&args.source_moments, &args.target_moments].into_iter().flatten().cloned());
    all.extend(cameras::files(args).into_iter().map(Path::to_path_buf));
    all
}

/// Resolve the preset, let flags win over it, and look up every name, in a registry that holds the files they ask for.
fn settings(args: &ProblemArgs, registry: &Registry) -> Result<(Settings, Registry), Failure> {
    let mut settings = Settings::preset(&args.preset, &args.model)?;
    settings.features.clone_from(&args.features);
    settings.solver.clone_from(&args.solver);
    settings.normaliser.clone_from(&args.normalise);
    settings.weighting.clone_from(&args.weighting);
    settings.seed = args.seed;
    settings.sampling = args.sampling.given();
    if let Some(path) = &args.pipeline {
        let pipeline = pipeline(path)?;
        stages::check(&pipeline, registry)
            .map_err(|problem| Failure::input(format!("{}: {problem}", path.display())))?;
        settings.pipeline = Some(pipeline);
    }
    let stages = settings.pipeline.iter().flat_map(|pipeline| &pipeline.stages).map(|stage| stage.features.as_str());
    let files = stages.chain(settings.features.as_deref()).flat_map(files_of);
    let registry = with_files(registry, files, Path::new(""))?;
    // What the preset leaves open is looked up when the model is known.
    if let Some(features) = &settings.features {
        match registry.family(features, &BuildContext::default()) {
            Err(error) if is_wrong_name(&error) => return Err(error.into()),
            _ => {} // what depends on data is built with them
        }
    }
    if let Some(solver) = &settings.solver {
        registry.solver(solver)?;
    }
    if let Some(weighting) = &settings.weighting {
        registry.weighting(weighting)?;
    }
    if let Some(normaliser) = &settings.normaliser {
        registry.normaliser(normaliser)?;
    }
    Ok((settings, registry))
}

/// Put the name of the file before an error about its points.
pub fn name_file(error: cfpose::Error, args: &ProblemArgs, target: &Points) -> Failure {
    // What the reader accepted is finite, so the model made a value that is not.
    if let cfpose::Error::Points { side: cfpose::Side::Target, problem: PointsError::NotFinite { row, .. } } = &error {
        let is_zero = row.checked_sub(1).is_some_and(|k| k < target.len() && target.point(k) == [0.0; 3]);
        let problem = if is_zero && target.dim() == 3 {
            "the ray 0 0 0 has no direction; remove it"
        } else {
            "the model maps this point to no finite feature; remove it or rescale the file"
        };
        return Failure::input(format!("{}: point {row}: {problem}", args.target().display()));
    }
    let path = match &error {
        cfpose::Error::Points { side: cfpose::Side::Source, .. }
        | cfpose::Error::Data { side: cfpose::Side::Source, .. }
        | cfpose::Error::PointDimension { side: cfpose::Side::Source, .. } => Some(args.source()),
        // A model is built from the source: control points.
        cfpose::Error::Build(BuildError::Data { name, .. }) if args.model.starts_with(name.as_str()) => {
            Some(args.source())
        }
        cfpose::Error::Points { .. }
        | cfpose::Error::Data { .. }
        | cfpose::Error::PointDimension { .. }
        | cfpose::Error::Normalise { .. } => Some(args.target()),
        _ => None,
    };
    match path {
        Some(path) => Failure { kind: Kind::Input, error: anyhow::anyhow!("{}: {error}", path.display()) },
        None => error.into(),
    }
}

/// Say whether translations are counted in depths of a plane or in distances to it.
pub fn has_depth(layout: &Layout) -> bool {
    layout.blocks().iter().any(|block| ["depths", "plane distances"].contains(&block.unit))
}

fn check_depth(args: &ProblemArgs, layout: &Layout) -> Result<(), Failure> {
    match args.depth {
        Some(depth) if !(depth.is_finite() && depth > 0.0) => {
            Err(Failure::usage(format!("--depth is {depth}; the depth of the plane is a number above 0")))
        }
        Some(_) if !has_depth(layout) => Err(Failure::usage(format!(
            "--depth does not apply to model `{}`, whose translation is in the units of the files; leave it out",
            args.model
        ))),
        _ => Ok(()),
    }
}

/// Find an instruction set of this machine.
///
/// # Errors
/// Usage, with the names that are available.
pub fn isa(name: &str) -> Result<Isa, Failure> {
    Isa::by_name(name).ok_or_else(|| {
        let names: Vec<&str> = Isa::available().into_iter().map(Isa::name).collect();
        Failure::usage(format!("instruction set `{name}` is not available here; use auto, {}", names.join(", ")))
    })
}

/// Return the number of threads, all processors when none is given.
pub fn num_threads(given: Option<u16>) -> usize {
    given.map_or_else(|| std::thread::available_parallelism().map_or(1, usize::from), usize::from)
}

/// Choose where sums are computed; small sets stay on the calling thread.
///
/// # Errors
/// Usage, when the operating system does not give that many threads.
pub fn execution(threads: Option<u16>, isa: Isa, num_points: usize) -> Result<Execution, Failure> {
    // More threads than chunks of points would only wait.
    let wanted = num_threads(threads).min(num_points.div_ceil(cfpose::means::CHUNK));
    if wanted < 2 {
        return Ok(Execution { isa, pool: None });
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(wanted).build();
    let pool = pool.map_err(|error| Failure::usage(format!("--threads {wanted}: {error}; ask for fewer")))?;
    Ok(Execution { isa, pool: Some(Arc::new(pool)) })
}

/// Return the tangent columns of `--free`, ascending; all when none are given.
fn free_columns(args: &ProblemArgs, layout: &Layout) -> Result<Vec<usize>, Failure> {
    let Some(given) = &args.free else { return Ok((0..columns(layout).len()).collect()) };
    let frame = match args.frame {
        FrameName::Camera => Frame::Camera,
        FrameName::Robot => Frame::Robot,
    };
    let names: Vec<&str> = given.iter().map(|name| name.trim()).collect();
    find_columns(layout, &names, frame).map_err(|error| match error {
        BuildError::Data { problem, .. } => Failure::usage(format!("--free: {problem}")),
        other => Failure::usage(format!("--free: {other}")),
    })
}

/// Return the homography of a theta in the units of the files, last entry 1; `None` where the model has none.
pub fn homography(loaded: &Loaded, theta: &[f64]) -> Option<[[f64; 3]; 3]> {
    let matrix = loaded.estimator.homography(theta)?;
    let [source, target] = loaded.cameras.map(|camera| camera.map(|camera| camera.intrinsics()));
    let h = in_file_units(&matrix, source.as_ref(), target.as_ref())?;
    Some([0, 1, 2].map(|i| [h[3 * i], h[3 * i + 1], h[3 * i + 2]]))
}

/// Say whether the model maps source points to where the target points are.
pub fn maps_to_target(model: &Model) -> bool {
    matches!(model.target, TargetSide::Fixed(_))
}

/// Return the pose of a theta, its translation in the unit of `depth` where the model counts in depths; `None` where the
/// model has no pose.
pub fn pose(layout: &Layout, theta: &[f64], depth: Option<f64>) -> Option<Pose> {
    let pose = Pose::of_theta(layout, theta)?;
    let scale = depth.unwrap_or(1.0);
    Some(Pose { translation: pose.translation.map(|value| value * scale), ..pose })
}
