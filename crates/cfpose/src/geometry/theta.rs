//! The layout of theta: named blocks, their manifold, and the forms in which people write them.

use std::sync::Arc;

use cfpose_optim::manifold::{Euclidean, Manifold, Product, Rotation3, UnitSphere};

mod angle;
mod form;

pub use angle::Angle;
pub use form::{EulerOrder, RotationForm, euler_of_rotation, rotation_of_euler};

/// What one block of theta is.
#[derive(Debug, Clone)]
pub enum BlockKind {
    /// A rotation in SO(3), stored as its matrix (9 numbers row by row), tangent 3.
    Rotation,
    /// A plane angle in radians, kept in -pi..pi, tangent 1.
    Angle,
    /// A vector of n numbers, tangent n.
    Vector(usize),
    /// A unit vector of n numbers, tangent n - 1.
    Direction(usize),
    /// Any other manifold; lists hold its ambient coordinates.
    Custom(Arc<dyn Manifold>),
}

/// One named block of theta.
#[derive(Debug, Clone)]
pub struct ThetaBlock {
    /// Name: `rotation`, `translation`, ...
    pub name: &'static str,
    /// Unit for documents: `rad`, `source units`, ...
    pub unit: &'static str,
    /// Kind.
    pub kind: BlockKind,
}

/// A list of numbers that is no theta.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ThetaError {
    /// Wrong count.
    #[error("theta needs {expected} numbers ({layout}), found {found}")]
    Count {
        /// Numbers needed.
        expected: usize,
        /// Numbers found.
        found: usize,
        /// The layout in words.
        layout: String,
    },
    /// NaN or infinity.
    #[error("number {position} of theta is {value}, not a finite number")]
    NotFinite {
        /// Position from 1.
        position: usize,
        /// Value.
        value: f64,
    },
    /// A direction or quaternion of norm 0.
    #[error("the {name} of theta has norm 0")]
    ZeroNorm {
        /// Name of the block.
        name: &'static str,
    },
}

/// The layout of theta of one model.
///
/// ```
/// use cfpose::theta::{BlockKind, Layout, RotationForm};
/// let pose = Layout::new(&[("rotation", "rad", BlockKind::Rotation), ("translation", "", BlockKind::Vector(3))]);
/// let theta = pose.from_list(&[0.0, 0.0, 0.5, 1.0, 2.0, 3.0], RotationForm::Vector).unwrap();
/// assert_eq!(theta.len(), 12); // the matrix, then the translation
/// let back = pose.to_list(&theta, RotationForm::Vector);
/// assert!((back[2] - 0.5).abs() < 1e-15);
/// ```
#[derive(Debug, Clone)]
pub struct Layout {
    blocks: Vec<ThetaBlock>,
    manifold: Product,
}

impl Layout {
    /// Make a layout from (name, unit, kind) in order.
    pub fn new(blocks: &[(&'static str, &'static str, BlockKind)]) -> Self {
        let blocks: Vec<ThetaBlock> =
            blocks.iter().map(|(name, unit, kind)| ThetaBlock { name, unit, kind: kind.clone() }).collect();
        let manifold = Product::new(blocks.iter().map(|block| block.kind.manifold()).collect());
        Self { blocks, manifold }
    }

    /// Rotation and translation: SO(3) x R^3.
    pub fn pose3() -> Self {
        Self::new(&[("rotation", "rad", BlockKind::Rotation), ("translation", "source units", BlockKind::Vector(3))])
    }

    /// Return the blocks.
    pub fn blocks(&self) -> &[ThetaBlock] {
        &self.blocks
    }

    /// Check the length and the values of an ambient theta.
    ///
    /// # Errors
    /// [`ThetaError::Count`] and [`ThetaError::NotFinite`].
    pub fn check_ambient(&self, theta: &[f64]) -> Result<(), ThetaError> {
        use cfpose_optim::manifold::Manifold;
        let expected = self.manifold.ambient();
        if theta.len() != expected {
            let names: Vec<&str> = self.blocks.iter().map(|block| block.name).collect();
            let layout = format!("ambient coordinates of {}", names.join(", "));
            return Err(ThetaError::Count { expected, found: theta.len(), layout });
        }
        match theta.iter().position(|v| !v.is_finite()) {
            Some(index) => Err(ThetaError::NotFinite { position: index + 1, value: theta[index] }),
            None => Ok(()),
        }
    }

    /// Return the product manifold.
    pub fn manifold(&self) -> &Product {
        &self.manifold
    }

    /// Return the neutral theta: identity rotations, zero vectors, first axis for directions.
    pub fn neutral(&self) -> Vec<f64> {
        let mut theta = Vec::new();
        for block in &self.blocks {
            match &block.kind {
                BlockKind::Rotation => theta.extend([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
                BlockKind::Angle => theta.push(0.0),
                BlockKind::Vector(n) => theta.extend(std::iter::repeat_n(0.0, *n)),
                BlockKind::Direction(n) => theta.extend((0..*n).map(|i| if i == 0 { 1.0 } else { 0.0 })),
                BlockKind::Custom(manifold) => {
                    let mut part = vec![0.0; manifold.ambient()];
                    if let Some(first) = part.first_mut() {
                        *first = 1.0;
                    }
                    manifold.project(&mut part);
                    theta.extend(part);
                }
            }
        }
        theta
    }

    /// Return the number of entries of a list in the given rotation form.
    pub fn list_len(&self, form: RotationForm) -> usize {
        self.blocks.iter().map(|block| block.kind.list_len(form)).sum()
    }

    /// Describe a list of numbers: `rotation 3 + translation 3`.
    pub fn describe(&self, form: RotationForm) -> String {
        let parts: Vec<String> =
            self.blocks.iter().map(|block| format!("{} {}", block.name, block.kind.list_len(form))).collect();
        parts.join(" + ")
    }

    /// Name each entry of a list, for table headers: `rotation_1`, ...
    pub fn list_names(&self, form: RotationForm) -> Vec<String> {
        let mut names = Vec::new();
        for block in &self.blocks {
            let n = block.kind.list_len(form);
            names.extend((1..=n).map(|i| if n == 1 { block.name.to_string() } else { format!("{}_{i}", block.name) }));
        }
        names
    }

    /// Convert a list of numbers into ambient theta; directions and quaternions are normalised.
    ///
    /// # Errors
    /// [`ThetaError`] for a wrong count, a number that is not finite, or a direction of norm 0.
    pub fn from_list(&self, list: &[f64], form: RotationForm) -> Result<Vec<f64>, ThetaError> {
        let expected = self.list_len(form);
        if list.len() != expected {
            return Err(ThetaError::Count { expected, found: list.len(), layout: self.describe(form) });
        }
        if let Some(index) = list.iter().position(|v| !v.is_finite()) {
            return Err(ThetaError::NotFinite { position: index + 1, value: list[index] });
        }
        let mut theta = Vec::with_capacity(self.manifold.ambient());
        let mut rest = list;
        for block in &self.blocks {
            let (part, tail) = rest.split_at(block.kind.list_len(form));
            rest = tail;
            let unit_needed = matches!(block.kind, BlockKind::Direction(_))
                || matches!(block.kind, BlockKind::Rotation) && form == RotationForm::Quaternion;
            if unit_needed && part.iter().all(|v| *v == 0.0) {
                return Err(ThetaError::ZeroNorm { name: block.name });
            }
            match &block.kind {
                BlockKind::Rotation => theta.extend(form.matrix(part)),
                BlockKind::Vector(_) => theta.extend(part),
                BlockKind::Direction(n) => {
                    let mut unit = part.to_vec();
                    UnitSphere(n - 1).project(&mut unit);
                    theta.extend(unit);
                }
                BlockKind::Angle | BlockKind::Custom(_) => {
                    let mut point = part.to_vec();
                    block.kind.manifold().project(&mut point);
                    theta.extend(point);
                }
            }
        }
        Ok(theta)
    }

    /// Convert ambient theta into a list of numbers.
    pub fn to_list(&self, theta: &[f64], form: RotationForm) -> Vec<f64> {
        let mut list = Vec::new();
        let mut rest = theta;
        for block in &self.blocks {
            let (part, tail) = rest.split_at(block.kind.manifold().ambient());
            rest = tail;
            match block.kind {
                BlockKind::Rotation => list.extend(form.list(part)),
                _ => list.extend(part),
            }
        }
        list
    }

    /// Return the ambient range of the first block of that name.
    pub fn range(&self, name: &str) -> Option<std::ops::Range<usize>> {
        let mut start = 0;
        for block in &self.blocks {
            let end = start + block.kind.manifold().ambient();
            if block.name == name {
                return Some(start..end);
            }
            start = end;
        }
        None
    }
}

impl BlockKind {
    /// Return the manifold of the block.
    pub fn manifold(&self) -> Arc<dyn Manifold> {
        match self {
            BlockKind::Rotation => Arc::new(Rotation3),
            BlockKind::Angle => Arc::new(Angle),
            BlockKind::Vector(n) => Arc::new(Euclidean(*n)),
            BlockKind::Direction(n) => Arc::new(UnitSphere(n - 1)),
            BlockKind::Custom(manifold) => Arc::clone(manifold),
        }
    }

    /// Return the number of entries of the block in a list.
    pub fn list_len(&self, form: RotationForm) -> usize {
        match (self, form) {
            (BlockKind::Rotation, form) => form.num_entries(),
            (BlockKind::Angle, _) => 1,
            (BlockKind::Vector(n) | BlockKind::Direction(n), _) => *n,
            (BlockKind::Custom(manifold), _) => manifold.ambient(),
        }
    }
}
