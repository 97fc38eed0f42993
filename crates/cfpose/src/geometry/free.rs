//! Free and fixed parameters: the adapter of the 3-DoF and 4-DoF experiments (IV.C).
//!
//! Tangent columns are numbered as theta's blocks are, a rotation having three (rx, ry, rz). Where one or two of these are
//! free they are the Euler angles of R = Rz Ry Rx and the fixed ones keep the start's value; where all are free they are the
//! usual right perturbation R exp(w).

use std::sync::Arc;

use cfpose_optim::manifold::{Manifold, Product};
use cfpose_optim::masked::Masked;

use crate::entry::{BuildError, EntryError};
use crate::geometry::theta::{BlockKind, Layout, euler_of_rotation, rotation_of_euler};

mod euler;
mod sphere;

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

/// A choice of free parameters and the theta that gives the fixed ones their values: `--free` and `--start` as one thing.
///
/// What is fixed keeps the value of `base`: of a vector the coordinate itself, of a rotation R = Rz Ry Rx the Euler angle, of a
/// unit vector the component along the fixed tangent directions at `base` (which is 0 there).
///
/// ```
/// use cfpose::free::Freedom;
/// use cfpose::theta::{Layout, RotationForm};
/// let pose = Layout::pose3();
/// let list = |numbers: &[f64; 6]| pose.from_list(numbers, RotationForm::Vector).unwrap();
/// let yaw = Freedom::new(&pose, &[2, 3], &pose.neutral());
/// let held = yaw.hold(&list(&[0.3, -0.2, 0.9, 1.0, 2.0, 3.0]));
/// let angles = cfpose::theta::euler_of_rotation(&held);
/// assert_eq!(angles[..2], [0.0, 0.0]);
/// assert!(angles[2] > 0.8);
/// assert_eq!(held[9..], [1.0, 0.0, 0.0]);
/// ```
#[derive(Debug, Clone)]
pub struct Freedom {
    blocks: Vec<Held>,
    manifold: Product,
}

/// One block of theta and what of it is free.
#[derive(Debug, Clone)]
struct Held {
    kind: BlockKind,
    /// Free tangent columns of the block, ascending.
    free: Vec<usize>,
    /// Ambient coordinates that the fixed part has.
    base: Vec<f64>,
}

impl Freedom {
    /// Free the tangent columns `free` (indices from 0 over all blocks; others are ignored out of range); everything else keeps
    /// its value at `base` (ambient).
    pub fn new(layout: &Layout, free: &[usize], base: &[f64]) -> Self {
        let (mut column, mut rest) = (0, base);
        let mut blocks = Vec::new();
        for block in layout.blocks() {
            let whole = block.kind.manifold();
            let range = column..column + whole.tangent();
            let mut inside: Vec<usize> = free.iter().filter(|j| range.contains(*j)).map(|j| j - column).collect();
            inside.sort_unstable();
            inside.dedup();
            column = range.end;
            let (own, tail) = rest.split_at(whole.ambient());
            rest = tail;
            blocks.push(Held { kind: block.kind.clone(), free: inside, base: own.to_vec() });
        }
        let manifold = Product::new(blocks.iter().map(Held::manifold).collect());
        Self { blocks, manifold }
    }

    /// Return the same freedom with the fixed values of another theta (ambient).
    #[must_use]
    pub fn at(&self, base: &[f64]) -> Self {
        let (mut blocks, mut rest) = (self.blocks.clone(), base);
        for block in &mut blocks {
            let (own, tail) = rest.split_at(block.base.len());
            rest = tail;
            block.base = own.to_vec();
        }
        let manifold = Product::new(blocks.iter().map(Held::manifold).collect());
        Self { blocks, manifold }
    }

    /// Return the manifold on which only the free columns move.
    pub fn manifold(&self) -> &Product {
        &self.manifold
    }

    /// Return the theta nearest to a given one (ambient; numbers after the layout's own are copied) whose fixed parts have the
    /// values of the base, to the last bit.
    pub fn hold(&self, theta: &[f64]) -> Vec<f64> {
        let (mut out, mut rest) = (Vec::with_capacity(theta.len()), theta);
        for block in &self.blocks {
            let (own, tail) = rest.split_at(block.base.len());
            rest = tail;
            out.extend(block.hold(own));
        }
        out.extend(rest);
        out
    }

    /// Say whether `theta` has the fixed values of the base, up to rounding.
    pub fn admits(&self, theta: &[f64]) -> bool {
        self.hold(theta).iter().zip(theta).all(|(a, b)| (a - b).abs() < 1e-6)
    }

    /// Return the Euler angles (0, 1, 2 for x, y, z) that are free where some but not all of the rotation is, with the ambient
    /// rotation of the base.
    pub fn turns(&self) -> Option<(&[usize], &[f64])> {
        let partial = |block: &&Held| matches!(block.kind, BlockKind::Rotation) && block.free.len() < 3;
        self.blocks.iter().find(partial).map(|block| (block.free.as_slice(), block.base.as_slice()))
    }
}

impl Held {
    fn is_whole(&self) -> bool {
        self.free.len() == self.kind.manifold().tangent()
    }

    fn manifold(&self) -> Arc<dyn Manifold> {
        let whole = self.kind.manifold();
        match self.kind {
            _ if self.is_whole() => whole,
            BlockKind::Rotation if !self.free.is_empty() => Arc::new(euler::EulerAngles { free: self.free.clone() }),
            BlockKind::Direction(_) if !self.free.is_empty() => Arc::new(self.great_sphere()),
            _ => {
                let mask: Vec<bool> = (0..whole.tangent()).map(|j| self.free.contains(&j)).collect();
                Arc::new(Masked::new(whole, &mask))
            }
        }
    }

    fn great_sphere(&self) -> sphere::GreatSphere {
        sphere::GreatSphere::new(&self.base, &self.free)
    }

    /// Give the fixed part of a block the values of the base.
    fn hold(&self, theta: &[f64]) -> Vec<f64> {
        if self.is_whole() {
            return theta.to_vec();
        }
        if self.free.is_empty() {
            return self.base.clone();
        }
        let mut held = theta.to_vec();
        match self.kind {
            BlockKind::Rotation => {
                let (mut angles, base) = (euler_of_rotation(theta), euler_of_rotation(&self.base));
                (0..3).filter(|axis| !self.free.contains(axis)).for_each(|axis| angles[axis] = base[axis]);
                held.copy_from_slice(&rotation_of_euler(&angles));
            }
            BlockKind::Direction(_) => self.great_sphere().project(&mut held),
            _ => {
                let fixed = |j: &usize| !self.free.contains(j);
                (0..theta.len()).filter(fixed).for_each(|j| held[j] = self.base[j]);
            }
        }
        held
    }
}
