//! Arguments of what defines a problem, and of the commands that solve and evaluate it.

use std::path::{Path, PathBuf};
use std::time::Duration;

use cfpose::theta::RotationForm;
use clap::{Args, ValueEnum};

use super::ReadingArgs;

/// What defines a problem: two files and the parts of the method.
#[derive(Debug, Args)]
pub struct ProblemArgs {
    /// Transformation model
    #[arg(long, value_name = "M")]
    pub model: String,
    /// Source points P: csv, txt, xyz, ply, obj, stl, pcd, las, npy, ..; - is standard input
    #[arg(long, value_name = "FILE", allow_hyphen_values = true, required_unless_present = "source_moments")]
    pub source: Option<PathBuf>,
    /// Target points Q
    #[arg(long, value_name = "FILE", allow_hyphen_values = true, required_unless_present = "target_moments")]
    pub target: Option<PathBuf>,
    /// Instead of source points their moments, as `moments` wrote them; verdict suspect at most
    #[arg(long, value_name = "FILE.cfm", requires = "target_moments", conflicts_with_all = ["source", "target"])]
    pub source_moments: Option<PathBuf>,
    /// Instead of target points their moments
    #[arg(long, value_name = "FILE.cfm", requires = "source_moments", conflicts_with_all = ["source", "target"])]
    pub target_moments: Option<PathBuf>,
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
    /// Where parameters may be: tz=0.5..3,rz=-30deg..30deg (names as --free lists them; rotations by Euler angles, R = Rz Ry Rx)
    #[arg(long, value_name = "NAME=LOW..HIGH", value_delimiter = ',', allow_hyphen_values = true)]
    pub bounds: Option<Vec<String>>,
    /// What is known beforehand: JSON with "theta", "rotation_form", "covariance", such as another result; joined with the data
    #[arg(long, value_name = "FILE")]
    pub prior: Option<PathBuf>,
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

impl ProblemArgs {
    /// Return the file of the source: its points, else its moments.
    pub fn source(&self) -> &Path {
        self.source.as_deref().or(self.source_moments.as_deref()).unwrap_or(Path::new(""))
    }

    /// Return the file of the target: its points, else its moments.
    pub fn target(&self) -> &Path {
        self.target.as_deref().or(self.target_moments.as_deref()).unwrap_or(Path::new(""))
    }
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
    pub deadline: Option<Duration>,
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
    /// The pixels of two regions.
    Raster,
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
            Sampling::Raster => Some(Known::Raster),
        }
    }
}

/// Read the form of rotations.
fn rotation_form(text: &str) -> Result<RotationForm, String> {
    text.parse().map_err(|error: cfpose::entry::EntryError| error.to_string())
}

/// Parse a time limit: seconds above 0, at most 1e9.
fn seconds(text: &str) -> Result<Duration, String> {
    let value = text.parse::<f64>().ok().filter(|value| *value > 0.0 && *value <= 1e9);
    value
        .map(Duration::from_secs_f64)
        .ok_or_else(|| "expected seconds above 0, at most 1e9, such as --deadline 0.5".to_string())
}
