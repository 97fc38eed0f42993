//! Free and fixed parameters: the adapter of the 3-DoF and 4-DoF experiments (IV.C).
//!
//! Tangent columns are numbered as theta's blocks are, a rotation having three (rx, ry, rz). Where one or two of these are
//! free they are the Euler angles of R = Rz Ry Rx and the fixed ones keep the start's value; where all are free they are the
//! usual right perturbation R exp(w).

use std::sync::Arc;

use cfpose_optim::manifold::{Manifold, Product};
use cfpose_optim::masked::Masked;

use crate::entry::{BuildError, EntryError};
use crate::geometry::theta::{BlockKind, Layout};

mod euler;

/// Whose axes the names of free parameters mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Frame {
    /// x right, y down, z forward: `rx ry rz tx ty tz`.
    #[default]
    Camera,
    /// A ground robot whose camera looks at a wall, x forward, y left, z up: `x y z roll pitch yaw`.
    ///
    /// Forward is the camera's z, left its -x, up its -y; so yaw turns about the camera's y, pitch about x, roll about z, and
    /// x, y, z move along tz, tx, ty. The 3-DoF experiment `yaw,x,y` is `ry,tz,tx`, the 4-DoF one adds `ty`.
    Robot,
}

impl std::str::FromStr for Frame {
    type Err = EntryError;

    fn from_str(text: &str) -> Result<Self, EntryError> {
        match text {
            "camera" => Ok(Frame::Camera),
            "robot" => Ok(Frame::Robot),
            _ => Err(EntryError::BadValue {
                key: "frame".to_string(),
                value: text.to_string(),
                problem: "expected camera or robot".to_string(),
            }),
        }
    }
}

/// Robot names and what they are in the camera frame.
const ROBOT: [(&str, &str); 6] =
    [("x", "tz"), ("y", "tx"), ("z", "ty"), ("roll", "rz"), ("pitch", "rx"), ("yaw", "ry")];

/// One tangent column of a layout.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Name: `rx`, `tx`, `scale`, `coefficients_3`, ...
    pub name: String,
    /// Index of its block.
    pub block: usize,
    /// Index within the block.
    pub index: usize,
}

/// Name all tangent columns of a layout, in order.
///
/// ```
/// use cfpose::{free, theta::Layout};
/// let names: Vec<String> = free::columns(&Layout::pose3()).into_iter().map(|column| column.name).collect();
/// assert_eq!(names, ["rx", "ry", "rz", "tx", "ty", "tz"]);
/// ```
pub fn columns(layout: &Layout) -> Vec<Column> {
    let mut all = Vec::new();
    for (block, description) in layout.blocks().iter().enumerate() {
        let count = description.kind.manifold().tangent();
        let moving =
            matches!(description.kind, BlockKind::Vector(_)) && description.name == "translation" && count <= 3;
        for index in 0..count {
            let name = match description.kind {
                BlockKind::Rotation => format!("r{}", ["x", "y", "z"][index]),
                _ if moving => format!("t{}", ["x", "y", "z"][index]),
                _ if count == 1 => description.name.to_string(),
                _ => format!("{}_{}", description.name, index + 1),
            };
            all.push(Column { name, block, index });
        }
    }
    all
}

/// Find the tangent columns of the named parameters; a block's name frees the whole block.
///
/// ```
/// use cfpose::free::{Frame, find_columns};
/// use cfpose::theta::Layout;
/// let pose = Layout::pose3();
/// assert_eq!(find_columns(&pose, &["ry", "tx", "tz"], Frame::Camera).unwrap(), [1, 3, 5]);
/// assert_eq!(find_columns(&pose, &["yaw", "x", "y"], Frame::Robot).unwrap(), [1, 3, 5]);
/// assert_eq!(find_columns(&pose, &["rotation"], Frame::Camera).unwrap(), [0, 1, 2]);
/// ```
///
/// # Errors
/// [`BuildError::Data`] that lists the names of this layout, for an unknown name or none at all.
pub fn find_columns(layout: &Layout, names: &[&str], frame: Frame) -> Result<Vec<usize>, BuildError> {
    let all = columns(layout);
    let mut chosen = Vec::new();
    for given in names {
        let translated = ROBOT.iter().find(|(robot, _)| frame == Frame::Robot && robot == given);
        let name = translated.map_or(*given, |(_, camera)| *camera);
        let of_name = |column: &Column| column.name == name || layout.blocks()[column.block].name == name;
        let found: Vec<usize> = (0..all.len()).filter(|j| of_name(&all[*j])).collect();
        if found.is_empty() {
            return Err(unknown(given, &all, frame));
        }
        chosen.extend(found);
    }
    if chosen.is_empty() {
        return Err(unknown("", &all, frame));
    }
    chosen.sort_unstable();
    chosen.dedup();
    Ok(chosen)
}

fn unknown(given: &str, all: &[Column], frame: Frame) -> BuildError {
    let mut known: Vec<&str> = all.iter().map(|column| column.name.as_str()).collect();
    if frame == Frame::Robot && known.contains(&"ry") {
        known = ROBOT.iter().map(|(robot, _)| *robot).collect();
    }
    let problem = format!("`{given}` is no parameter of this model; it has {}", known.join(", "));
    BuildError::Data { name: "free parameters".to_string(), problem }
}

/// Return the manifold on which only the given tangent columns move (indices from 0; others are ignored out of range).
pub fn manifold(layout: &Layout, free: &[usize]) -> Product {
    let mut start = 0;
    let factors = layout.blocks().iter().map(|block| -> Arc<dyn Manifold> {
        let whole = block.kind.manifold();
        let mut inside: Vec<usize> =
            free.iter().filter(|j| (start..start + whole.tangent()).contains(*j)).map(|j| j - start).collect();
        inside.sort_unstable();
        inside.dedup();
        start += whole.tangent();
        if inside.len() == whole.tangent() {
            whole
        } else if matches!(block.kind, BlockKind::Rotation) && !inside.is_empty() {
            Arc::new(euler::EulerAngles { free: inside })
        } else {
            let mask: Vec<bool> = (0..whole.tangent()).map(|j| inside.contains(&j)).collect();
            Arc::new(Masked::new(whole, &mask))
        }
    });
    Product::new(factors.collect())
}
