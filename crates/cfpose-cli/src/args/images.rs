//! Arguments of the commands that work on images.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::{FrameName, Side};

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
    /// Hue of the pattern, degrees (0 red, 120 green, 240 blue): images are looked at through the colour filter that tells it best from the
    /// reference's background
    #[arg(long, value_name = "DEGREES", value_parser = hue)]
    pub hue: Option<f32>,
    /// Largest distance from the hue, degrees
    #[arg(long, value_name = "DEGREES", value_parser = hue, default_value_t = 40.0)]
    pub hue_width: f32,
}

/// Read an angle from 0 to 360 degrees.
fn hue(text: &str) -> Result<f32, String> {
    let read = text.parse().ok().filter(|v| (0.0..=360.0).contains(v));
    read.ok_or_else(|| "expected degrees from 0 to 360".to_string())
}

impl LookArgs {
    /// Return the hue that was given.
    pub fn hue(&self) -> Option<cfpose_vision::Hue> {
        self.hue.map(|degrees| cfpose_vision::Hue { degrees, width: self.hue_width })
    }
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
    /// Image of the pattern seen from the front (PNG, JPEG), or its design: SVG, or polygons in mm (csv, txt)
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
    /// Pose from which the first frame begins: rotation vector (rad) and translation of the pattern's frame in the camera's, as they are
    /// written in poses
    #[arg(long, value_name = "RX,RY,RZ,TX,TY,TZ", allow_hyphen_values = true, conflicts_with = "start")]
    pub start_pose: Option<String>,
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
