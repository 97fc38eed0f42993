//! Where the results of frames go: JSON lines, a table, a folder of pictures, poses and rows.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

use cfpose_vision::overlay::{colour_of, contact_sheet, draw_line, to_png};
use cfpose_vision::{PoseFormat, StampedPose};
use image::RgbImage;
use serde_json::Value;

use super::line::Line;
use super::{Done, Setup};
use crate::failure::Failure;
use crate::output;

/// Width to which overlays are kept for the contact sheet, pixels.
const KEPT: u32 = 240;

/// Most overlays that are kept.
const MOST: usize = 400;

/// Open outputs.
pub(super) struct Outputs {
    folder: Option<PathBuf>,
    lines: Option<File>,
    standard: bool,
    poses: Option<File>,
    rows: Option<File>,
    small: Vec<RgbImage>,
    table: Vec<Vec<String>>,
}

impl Outputs {
    /// Make the folder and open the files.
    ///
    /// # Errors
    /// What the operating system says, with the file's name.
    pub fn open(folder: Option<&Path>, json: Option<&Path>) -> Result<Self, Failure> {
        let create =
            |path: PathBuf| File::create(&path).map_err(|error| Failure::input(format!("{}: {error}", path.display())));
        let standard = output::is_standard(json);
        let lines = json.filter(|_| !standard).map(|path| create(path.to_path_buf())).transpose()?;
        let mut outputs = Self {
            folder: folder.map(Path::to_path_buf),
            lines,
            standard,
            poses: None,
            rows: None,
            small: Vec::new(),
            table: Vec::new(),
        };
        if let Some(folder) = folder {
            let overlays = folder.join("overlay");
            std::fs::create_dir_all(&overlays)
                .map_err(|error| Failure::input(format!("{}: {error}", overlays.display())))?;
            outputs.poses = Some(create(folder.join("poses.tum"))?);
            let mut rows = create(folder.join("frames.csv"))?;
            writeln!(rows, "frame,time,verdict,residual_px,visible_share,second_tilt_ratio,tx,ty,tz,rx,ry,rz,seconds")?;
            outputs.rows = Some(rows);
        }
        Ok(outputs)
    }

    /// Write a frame, at once.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn frame(&mut self, setup: &Setup, line: &Line, done: Option<&Done>) -> Result<(), Failure> {
        let text = serde_json::to_string(&line.value).map_err(Failure::input)?;
        if self.standard {
            output::print(&text)?;
        }
        if let Some(file) = &mut self.lines {
            writeln!(file, "{text}")?;
            file.flush()?;
        }
        self.row(line)?;
        self.overlay(setup, line, done)?;
        let number = |value: f64| if value.is_finite() { format!("{value:.3}") } else { "-".into() };
        self.table.push(vec![
            line.name.clone(),
            line.verdict().name().into(),
            number(line.residual),
            number(100.0 * line.visible),
            line.value["second_tilt_ratio"].as_f64().map_or_else(|| "-".into(), number),
            line.value["warnings"][0].as_str().unwrap_or("").into(),
        ]);
        Ok(())
    }

    fn row(&mut self, line: &Line) -> Result<(), Failure> {
        if let (Some(file), Some(pose)) = (&mut self.poses, line.pose) {
            let text = PoseFormat::Tum.write(&[StampedPose { time: Some(line.time), pose }]);
            file.write_all(text.as_bytes())?;
            file.flush()?;
        }
        let Some(file) = &mut self.rows else { return Ok(()) };
        let v = &line.value;
        let field = |value: &Value| if value.is_null() { String::new() } else { value.to_string() };
        let list = |values: &[f64]| values.iter().map(|v| format!("{v:?}")).collect::<Vec<_>>().join(",");
        let pose = line.pose.map_or_else(
            || ",,,,,".to_string(),
            |pose| {
                let turn = cfpose_optim::manifold::rotation_log(&pose.rotation);
                format!("{},{}", list(&pose.translation), list(&turn))
            },
        );
        let name = if line.name.contains([',', '"']) { format!("{:?}", line.name) } else { line.name.clone() };
        writeln!(
            file,
            "{name},{},{},{},{},{},{pose},{}",
            line.time,
            line.verdict().name(),
            field(&v["residual_px"]),
            field(&v["visible_share"]),
            field(&v["second_tilt_ratio"]),
            field(&v["seconds"])
        )?;
        Ok(file.flush()?)
    }

    /// Draw the contour under the pose and, for poses, the axes of the pattern at its centre.
    fn overlay(&mut self, setup: &Setup, line: &Line, done: Option<&Done>) -> Result<(), Failure> {
        let (Some(folder), Some(done)) = (&self.folder, done) else { return Ok(()) };
        let mut image = done.picture.to_rgb();
        let theta = &done.found.theta;
        let places = setup.registrar.outline_in(&setup.pattern, done.camera, theta);
        let longest = 6.0 * setup.pattern.outline.spacing + 6.0;
        draw_line(&mut image, &places, longest, colour_of(line.verdict()));
        if let Some(pose) = line.pose {
            axes(&mut image, setup, done, &pose);
        }
        let stem =
            Path::new(&line.name).file_stem().map_or_else(|| "frame".into(), |s| s.to_string_lossy().into_owned());
        let path = folder.join("overlay").join(format!("{stem}.png"));
        let bytes = to_png(&image).map_err(|fault| Failure::input(format!("{}: {fault}", path.display())))?;
        std::fs::write(&path, bytes).map_err(|error| Failure::input(format!("{}: {error}", path.display())))?;
        if self.small.len() < MOST {
            let tall = (image.height() * KEPT / image.width().max(1)).max(1);
            self.small.push(image::imageops::resize(&image, KEPT, tall, image::imageops::FilterType::Triangle));
        }
        Ok(())
    }

    /// Write what needs all frames.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn finish(self, json: Option<&Path>) -> Result<(), Failure> {
        if let Some(folder) = self.folder.filter(|_| !self.small.is_empty()) {
            let path = folder.join("contact.png");
            let bytes = to_png(&contact_sheet(&self.small))
                .map_err(|fault| Failure::input(format!("{}: {fault}", path.display())))?;
            std::fs::write(&path, bytes).map_err(|error| Failure::input(format!("{}: {error}", path.display())))?;
        }
        let header = ["frame", "verdict", "residual px", "visible %", "second tilt", ""];
        output::show(&output::table(&header, &self.table), json)
    }
}

/// Draw the axes of the pattern at its centre, a third of its size long: x red, y green, z blue.
fn axes(image: &mut RgbImage, setup: &Setup, done: &Done, pose: &cfpose::Pose) {
    let depth = setup.units.depth;
    let mean = setup.pattern.points[0].mean();
    let covariance = setup.pattern.points[0].covariance();
    let length = (covariance[0][0] + covariance[1][1]).sqrt() * depth;
    let origin = setup.units.origin;
    let centre = [mean[0] * depth - origin[0], mean[1] * depth - origin[1], depth - origin[2]];
    let seen = |p: [f64; 3]| {
        let y = pose.apply(p);
        if y[2] > 0.0 { done.camera.pixel_of([y[0] / y[2], y[1] / y[2]]) } else { [f64::NAN; 2] }
    };
    for (axis, colour) in [[220, 40, 40], [40, 160, 40], [40, 80, 230]].into_iter().enumerate() {
        let mut tip = centre;
        tip[axis] += if axis == 2 { -length } else { length };
        draw_line(image, &[seen(centre), seen(tip)], 4000.0, colour);
    }
}
