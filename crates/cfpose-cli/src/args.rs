//! The command line as clap sees it.

use std::path::PathBuf;

use cfpose::theta::RotationForm;
use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};

/// Estimate a pose or another transformation between two point sets without correspondences.
#[derive(Debug, Parser)]
#[command(name = "cfpose", version, propagate_version = true, arg_required_else_help = true)]
#[command(after_help = "exit codes: 0 usable; 2 wrong arguments; 3 bad input; 4 it ran and has no usable result")]
pub struct Arguments {
    /// Command.
    #[command(subcommand)]
    pub command: Command,
}

/// Name of the program that ships with the library.
const SHIPPED: &str = "cfpose";

/// Return the name by which this process was called, without folders and `.exe`.
pub fn program() -> String {
    let called = std::env::args_os().next().map(PathBuf::from);
    let name = called.as_deref().and_then(|path| path.file_stem()).map(|name| name.to_string_lossy().into_owned());
    name.filter(|name| !name.is_empty()).unwrap_or_else(|| SHIPPED.to_string())
}

/// Return the definitions of all commands, under the name by which this process was called: of help, completions and manual.
pub fn command() -> clap::Command {
    let name = program();
    let command = Arguments::command().name(name.clone()).bin_name(&name).display_name(&name);
    if name == SHIPPED { command } else { command.version(concat!("with cfpose ", env!("CARGO_PKG_VERSION"))) }
}

/// Read the arguments of the process.
///
/// # Errors
/// What clap says, to be printed; help and version are such errors too.
pub fn parse() -> Result<Arguments, clap::Error> {
    Arguments::from_arg_matches(&command().try_get_matches()?)
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Simulate, estimate, print a table and draw an overlay: offline, from a seed
    Demo(DemoArgs),
    /// Estimate theta from two point files
    Estimate(EstimateArgs),
    /// Evaluate residual, Jacobian and feature means at one theta, without solving
    Evaluate(EvaluateArgs),
    /// List what can be chosen by name
    List(ListArgs),
    /// Check registered entries: derivatives, conformance, conditioning, speed
    Check(CheckArgs),
    /// Register frames on a reference: images to poses, verdicts and overlays
    Register(RegisterArgs),
    /// Show what of an image is taken for the pattern
    Segment(SegmentArgs),
    /// Measure the registration of images on rendered pairs of known pose
    Cells(CellsArgs),
    /// Compute an experiment or a shard of it
    Run(RunArgs),
    /// Count what is there of a run
    Status(FolderArgs),
    /// Turn the records of all shards into tables
    Merge(FolderArgs),
    /// Print the tables of a run and write its report.html
    Report(FolderArgs),
    /// Train weights of the family `learned`
    Learn(LearnArgs),
    /// Work with pose files
    Pose(PoseArgs),
    /// Write the pages and lists of docs/reference from the tables
    Docs(DocsArgs),
    /// Write the completions of a shell to standard output
    Completions(CompletionsArgs),
    /// Write the manual page, or with --out one for each command
    Man(ManArgs),
}

/// What defines a problem: two files and the parts of the method.
#[derive(Debug, Args)]
pub struct ProblemArgs {
    /// Transformation model
    #[arg(long, value_name = "M")]
    pub model: String,
    /// Source points P: csv, txt, xyz, ply, obj, stl, pcd, las, npy, ..; - is standard input
    #[arg(long, value_name = "FILE", allow_hyphen_values = true)]
    pub source: PathBuf,
    /// Target points Q
    #[arg(long, value_name = "FILE", allow_hyphen_values = true)]
    pub target: PathBuf,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub reading: ReadingArgs,
    /// Sets everything that is not given: auto or paper
    #[arg(long, value_name = "NAME", default_value = "auto")]
    pub preset: String,
    /// Feature family
    #[arg(long, value_name = "F")]
    pub features: Option<String>,
    /// Solver
    #[arg(long, value_name = "S")]
    pub solver: Option<String>,
    /// Normaliser
    #[arg(long, value_name = "N")]
    pub normalise: Option<String>,
    /// Weighting
    #[arg(long, value_name = "W")]
    pub weighting: Option<String>,
    /// How the two sets sample their shape; auto finds out by distances between the points
    #[arg(long, value_name = "HOW", default_value = "auto")]
    pub sampling: Sampling,
    /// Stages of the estimator from a TOML file, instead of those of the preset
    #[arg(long, value_name = "FILE")]
    pub pipeline: Option<PathBuf>,
    /// auto, identity, pca, grid, a file, or the numbers of theta
    #[arg(long, value_name = "START", default_value = "auto", allow_hyphen_values = true)]
    pub start: String,
    /// Every 2-column file holds pixels of this camera: fx,fy,cx,cy, or a file (OpenCV, ROS, Kalibr, JSON)
    #[arg(long, value_name = "FX,FY,CX,CY|FILE", allow_hyphen_values = true)]
    pub camera: Option<String>,
    /// The source file holds pixels of this camera
    #[arg(long, value_name = "CAMERA", allow_hyphen_values = true)]
    pub source_camera: Option<String>,
    /// The target file holds pixels of this camera
    #[arg(long, value_name = "CAMERA", allow_hyphen_values = true)]
    pub target_camera: Option<String>,
    /// Depth of the plane: turns translations in depths into its unit
    #[arg(long, value_name = "D", allow_hyphen_values = true)]
    pub depth: Option<f64>,
    /// Only these parameters move: rx,ry,rz,tx,ty,tz; the others stay as --start gives them
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub free: Option<Vec<String>>,
    /// Whose axes the names of --free mean: camera, or robot (x y z roll pitch yaw of a robot whose camera looks ahead)
    #[arg(long, value_name = "FRAME", default_value = "camera")]
    pub frame: FrameName,
    /// Whether start strategies may propose reflections of affine maps
    #[arg(long, value_name = "allow|forbid")]
    pub reflections: Option<Reflections>,
    /// How rotations stand in lists of numbers: vector, euler (x, y, z with R = Rz Ry Rx), euler-ORDER, quaternion
    #[arg(long, value_name = "FORM", default_value = "vector", value_parser = rotation_form)]
    pub rotation: RotationForm,
    /// Seed of everything random
    #[arg(long, value_name = "K", default_value_t = 0)]
    pub seed: u64,
    /// Threads, all processors when not given; the result does not depend on it
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Instruction set: auto, avx512, avx2 or baseline
    #[arg(long, value_name = "ISA", default_value = "auto")]
    pub isa: String,
    /// Write the result as JSON to a file, or to standard output for -
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<PathBuf>,
}

/// How point files are read.
#[derive(Debug, Default, Args)]
#[command(next_help_heading = "Reading of both files")]
pub struct ReadingArgs {
    /// The coordinates: 1 to 3 columns by name, or by number from 1
    #[arg(long, value_name = "A,B[,C]", value_delimiter = ',')]
    pub columns: Vec<String>,
    /// The weight: a column by name, or by number from 1; w when not given
    #[arg(long, value_name = "W")]
    pub weight_column: Option<String>,
    /// Format of standard input, of pipes and of files without a known extension; else of both files
    #[arg(long, value_name = "F")]
    pub format: Option<String>,
    /// Rows that are not finite; when not given, rows without any coordinate are skipped and others refused
    #[arg(long, value_name = "skip|refuse")]
    pub invalid: Option<InvalidRows>,
    /// Most points of a file
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub max_points: Option<u64>,
    /// Keep one point in each cell of this size (units of the file), or, with auto, of cells that leave about 20000 points
    #[arg(long, value_name = "SIZE|auto")]
    pub thin: Option<Thin>,
    /// Weights of the points: those of the file, by density (the length or area that each point stands for), or none
    #[arg(long, value_name = "file|density|none")]
    pub weights: Option<Weights>,
    /// Largest grey value of a mask that still is dark, 0 to 255, or otsu
    #[arg(long, value_name = "T|otsu")]
    pub threshold: Option<cfpose_vision::Threshold>,
    /// Side of the threshold that is the region of a mask; found by the border when not given
    #[arg(long, value_name = "dark|bright")]
    pub foreground: Option<Side>,
}

/// How many points of a file are kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Thin {
    /// About 20000.
    Auto,
    /// One in each cell of this size.
    Cells(f64),
}

impl std::str::FromStr for Thin {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let size = text.parse::<f64>().ok().filter(|size| *size > 0.0 && size.is_finite());
        size.map(Self::Cells).ok_or_else(|| "expected a size above 0, such as --thin 0.05, or auto".to_string())
    }
}

/// Where weights come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Weights {
    /// The file, 1 where it has none.
    File,
    /// The length or area that each point stands for.
    Density,
    /// All are 1.
    None,
}

/// What happens to rows that are not finite.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum InvalidRows {
    /// They are skipped.
    Skip,
    /// They are an error.
    Refuse,
}

/// A side of the threshold of a mask.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Side {
    /// At or below it.
    Dark,
    /// Above it.
    Bright,
}

/// Arguments of `estimate`.
#[derive(Debug, Args)]
pub struct EstimateArgs {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub problem: ProblemArgs,
    /// Write the pose: .json, .tum, .kitti, else a 4x4 matrix
    #[arg(long, value_name = "FILE")]
    pub pose_out: Option<PathBuf>,
    /// Draw both sets before and after, and the residuals: .svg or .png
    #[arg(long, value_name = "FILE")]
    pub plot: Option<PathBuf>,
    /// Write the transformed source points in the units of the target file
    #[arg(long, value_name = "FILE")]
    pub transformed_out: Option<PathBuf>,
    /// Report the correspondence also for 1000 points and more: of nearest points, or one to one (up to 1000 points)
    #[arg(long, value_name = "HOW", num_args = 0..=1, require_equals = true, default_missing_value = "nearest")]
    pub correspondence: Option<Matching>,
    /// End after so many seconds (set-up not counted) with the best so far, which is never `good`
    #[arg(long, value_name = "SECS", value_parser = seconds)]
    pub deadline: Option<std::time::Duration>,
    /// Print every iteration
    #[arg(long, short)]
    pub verbose: bool,
}

/// Arguments of `evaluate`.
#[derive(Debug, Args)]
pub struct EvaluateArgs {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub problem: ProblemArgs,
    /// The numbers of theta
    #[arg(long, value_name = "THETA", allow_hyphen_values = true)]
    pub at: String,
}

/// Arguments of `list`.
#[derive(Debug, Args)]
pub struct ListArgs {
    /// What to list
    pub kind: ListKind,
    /// Write JSON to a file, or to standard output for -
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<PathBuf>,
}

/// How images are segmented.
#[derive(Debug, Args)]
#[command(next_help_heading = "Segmentation")]
pub struct LookArgs {
    /// How code values stand for light; found from the symmetry of the edges when not given
    #[arg(long, value_name = "auto|srgb|linear", default_value = "auto")]
    pub transfer: TransferName,
    /// Reflectance that separates pattern and background, as a share of the background's
    #[arg(long, value_name = "SHARE")]
    pub threshold: Option<f32>,
    /// Whether the pattern is darker or brighter than its background; found by the border when not given
    #[arg(long, value_name = "dark|bright")]
    pub foreground: Option<Side>,
}

/// Transfer functions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum TransferName {
    /// To be found out.
    Auto,
    /// IEC 61966-2-1.
    Srgb,
    /// Code values are proportional to light.
    Linear,
}

impl TransferName {
    /// Return what the user says, `None` where it is to be found out.
    pub fn given(self) -> Option<cfpose_vision::Transfer> {
        match self {
            TransferName::Auto => None,
            TransferName::Srgb => Some(cfpose_vision::Transfer::Srgb),
            TransferName::Linear => Some(cfpose_vision::Transfer::Linear),
        }
    }
}

/// Arguments of `register`.
#[derive(Debug, Args)]
pub struct RegisterArgs {
    /// Image of the pattern seen from the front: PNG or JPEG
    #[arg(value_name = "REFERENCE")]
    pub reference: PathBuf,
    /// Images, folders of images, or - for names on standard input
    #[arg(value_name = "FRAME", required = true)]
    pub frames: Vec<PathBuf>,
    /// Camera of frames and reference: fx,fy,cx,cy, or a file (OpenCV, ROS, Kalibr, JSON)
    #[arg(long, value_name = "FX,FY,CX,CY|FILE", allow_hyphen_values = true)]
    pub camera: Option<String>,
    /// Camera of the reference, where it is another one
    #[arg(long, value_name = "CAMERA", allow_hyphen_values = true)]
    pub reference_camera: Option<String>,
    /// Transformation model: plane-bearing with a camera and homography without one when not given
    #[arg(long, value_name = "M")]
    pub model: Option<String>,
    /// Only these parameters move: rx,ry,rz,tx,ty,tz
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub free: Option<Vec<String>>,
    /// Whose axes the names of --free mean: camera, or robot (x y z roll pitch yaw of a robot whose camera looks ahead)
    #[arg(long, value_name = "FRAME", default_value = "camera")]
    pub frame: FrameName,
    /// Theta from which the first frame begins, and the values of fixed parameters; the identity when not given
    #[arg(long, value_name = "NUMBERS", allow_hyphen_values = true)]
    pub start: Option<String>,
    /// Size of the pattern, the larger of width and height: translations come in its unit, else in depths of the reference
    #[arg(long, value_name = "MM", value_parser = positive)]
    pub size: Option<f64>,
    /// Frames a second: times of the results; else names that are numbers, else numbers of the frames
    #[arg(long, value_name = "F", value_parser = positive)]
    pub fps: Option<f64>,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub look: LookArgs,
    /// Folder of overlays, contact sheet, poses.tum and frames.csv
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Write one line of JSON a frame to a file, or to standard output for -
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<PathBuf>,
    /// Fail if a frame is not good
    #[arg(long)]
    pub strict: bool,
    /// Seed of the disturbed starts
    #[arg(long, value_name = "K", default_value_t = 0)]
    pub seed: u64,
}

/// Arguments of `segment`.
#[derive(Debug, Args)]
pub struct SegmentArgs {
    /// Image: PNG or JPEG
    #[arg(value_name = "IMAGE")]
    pub image: PathBuf,
    /// The image is a reference: nothing hides the pattern
    #[arg(long)]
    pub reference: bool,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub look: LookArgs,
    /// Folder of coverage.png, mask.png, contour.png and coverage.csv
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Write JSON to a file, or to standard output for -
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<PathBuf>,
}

/// Read a number above 0.
fn positive(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|v: &f64| v.is_finite() && *v > 0.0).ok_or_else(|| "expected a number above 0".to_string())
}

/// Arguments of `cells`.
#[derive(Debug, Args)]
pub struct CellsArgs {
    /// Conditions; all when not given
    #[arg(value_name = "CELL")]
    pub names: Vec<String>,
    /// Pairs of a condition
    #[arg(long, value_name = "N", default_value_t = 20)]
    pub trials: u64,
    /// Seed of the pairs
    #[arg(long, value_name = "K", default_value_t = 1)]
    pub seed: u64,
    /// Write the images and truth.json to a folder instead of registering them
    #[arg(long, value_name = "DIR")]
    pub export: Option<PathBuf>,
    /// Write every pair as JSON to a file, or to standard output for -
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<PathBuf>,
}

/// Arguments of `check`.
#[derive(Debug, Args)]
pub struct CheckArgs {
    /// A model, family or solver; all when not given
    pub name: Option<String>,
    /// Check models and families on these points instead of random ones
    #[arg(long, value_name = "FILE")]
    pub on: Option<PathBuf>,
    /// Seed of the random points and thetas
    #[arg(long, value_name = "K", default_value_t = 0)]
    pub seed: u64,
    /// Instruction set: auto, avx512, avx2 or baseline
    #[arg(long, value_name = "ISA", default_value = "auto")]
    pub isa: String,
    /// Write JSON to a file, or to standard output for -
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<PathBuf>,
}

/// Arguments of `demo`.
#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Folder of the figure and the points
    #[arg(long, value_name = "DIR", default_value = "cfpose-demo")]
    pub out: PathBuf,
    /// What is simulated
    #[arg(long, value_name = "NAME", default_value = "planar-curve[curve=heart,b_i=0.1,b_p=0.01]")]
    pub scenario: String,
    /// Seed of the simulation
    #[arg(long, value_name = "K", default_value_t = 1)]
    pub seed: u64,
    /// Write JSON to a file, or to standard output for -
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<PathBuf>,
}

/// Arguments of `run`.
#[derive(Debug, Args)]
pub struct RunArgs {
    /// Experiment file
    #[arg(value_name = "EXPERIMENT.toml")]
    pub experiment: PathBuf,
    /// Folder of the results, out/EXPERIMENT when not given
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Trials of every cell instead of the file's
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub trials: Option<u32>,
    /// Compute part I of N, I from 0; auto takes both from the job array's environment, auto/N only the number of the task
    #[arg(long, value_name = "I/N|auto|auto/N")]
    pub shard: Option<String>,
    /// Keep the records that are there and compute the missing ones; trials may have risen, cells and methods been added
    #[arg(long)]
    pub resume: bool,
    /// Threads over trials, all processors when not given; the result does not depend on it
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Instruction set: auto, avx512, avx2 or baseline; the same for all shards
    #[arg(long, value_name = "ISA", default_value = "auto")]
    pub isa: String,
    /// Print what would be computed and stop
    #[arg(long)]
    pub dry: bool,
    /// Compute one trial again and write its point files into the folder's only-KEY; keys stand in results.csv
    #[arg(long, value_name = "KEY", conflicts_with_all = ["shard", "resume", "dry"])]
    pub only: Option<String>,
    /// Write JSON to a file, or to standard output for -
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<PathBuf>,
}

/// Arguments of `learn`.
#[derive(Debug, Args)]
pub struct LearnArgs {
    /// Training file
    #[arg(value_name = "CONFIG.toml")]
    pub config: PathBuf,
    /// File of the weights, CONFIG.safetensors in this folder when not given
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Seed instead of the file's
    #[arg(long, value_name = "K")]
    pub seed: Option<u64>,
    /// Go on from the checkpoint of a stopped training
    #[arg(long)]
    pub resume: bool,
    /// Threads, all processors when not given; the result does not depend on it
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
}

/// Arguments of `status`, `merge` and `report`.
#[derive(Debug, Args)]
pub struct FolderArgs {
    /// Folder that `run` wrote, or a folder of such folders
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// Write JSON to a file, or to standard output for -
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<PathBuf>,
}

/// Arguments of `docs`.
#[derive(Debug, Args)]
pub struct DocsArgs {
    /// Write nothing; fail where a file differs from the tables
    #[arg(long)]
    pub check: bool,
    /// Folder of the project
    #[arg(long, value_name = "DIR", default_value = ".")]
    pub root: PathBuf,
}

/// Arguments of `completions`.
#[derive(Debug, Args)]
pub struct CompletionsArgs {
    /// Shell
    pub shell: clap_complete::Shell,
}

/// Arguments of `man`.
#[derive(Debug, Args)]
pub struct ManArgs {
    /// Folder of the pages
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// Arguments of `pose`.
#[derive(Debug, Args)]
pub struct PoseArgs {
    /// What to do.
    #[command(subcommand)]
    pub command: PoseCommand,
}

/// The commands of `pose`.
#[derive(Debug, Subcommand)]
pub enum PoseCommand {
    /// Convert poses (4x4, 3x4, TUM, KITTI, JSON) to standard output
    Convert {
        /// File of poses
        file: PathBuf,
        /// Form to write
        #[arg(long)]
        to: PoseTarget,
    },
}

/// Forms of pose files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum PoseTarget {
    /// 4x4 matrices
    Matrix,
    /// time tx ty tz qx qy qz qw
    Tum,
    /// 3x4 row by row
    Kitti,
    /// JSON with the convention
    Json,
}

/// The tables of `list`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[allow(missing_docs)]
pub enum ListKind {
    Models,
    Families,
    Solvers,
    Normalisers,
    Weightings,
    Starts,
    Scenarios,
    Curves,
    Objectives,
    Presets,
    Formats,
}

/// How points are matched after the fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Matching {
    /// Each source point with the nearest target point.
    Nearest,
    /// No target point twice, least total squared distance.
    OneToOne,
}

/// Whose axes the names of free parameters mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum FrameName {
    /// x right, y down, z forward
    Camera,
    /// x forward, y left, z up
    Robot,
}

/// Whether affine starts of negative determinant are proposed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Reflections {
    /// They are.
    Allow,
    /// They are not.
    Forbid,
}

/// How two point sets sample their shape.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Sampling {
    /// To be found out.
    Auto,
    /// The same points.
    Same,
    /// One set is a sub-set of the other.
    Thinned,
    /// Two samples of one shape.
    Independent,
}

impl Sampling {
    /// Return what the user says, `None` where it is to be found out.
    pub fn given(self) -> Option<cfpose::distances::Sampling> {
        use cfpose::distances::Sampling as Known;
        match self {
            Sampling::Auto => None,
            Sampling::Same => Some(Known::Same),
            Sampling::Thinned => Some(Known::Thinned),
            Sampling::Independent => Some(Known::Independent),
        }
    }
}

/// Read the form of rotations.
fn rotation_form(text: &str) -> Result<RotationForm, String> {
    text.parse().map_err(|error: cfpose::entry::EntryError| error.to_string())
}

/// Return the name of a value as it stands on the command line.
pub fn name_of<V: ValueEnum>(value: V) -> String {
    value.to_possible_value().map(|possible| possible.get_name().to_string()).unwrap_or_default()
}

/// Split a text at commas, semicolons and blanks and read every part as a number; `None` when one is none.
pub fn numbers(text: &str) -> Option<Vec<f64>> {
    let parts = text.split(|c: char| c == ',' || c == ';' || c.is_whitespace()).filter(|part| !part.is_empty());
    let list: Result<Vec<f64>, _> = parts.map(str::parse).collect();
    list.ok().filter(|list| !list.is_empty())
}

/// Parse a time limit: seconds above 0, at most 1e9.
fn seconds(text: &str) -> Result<std::time::Duration, String> {
    let value = text.parse::<f64>().ok().filter(|value| *value > 0.0 && *value <= 1e9);
    value
        .map(std::time::Duration::from_secs_f64)
        .ok_or_else(|| "expected seconds above 0, at most 1e9, such as --deadline 0.5".to_string())
}
