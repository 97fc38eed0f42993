//! The conditions.

use cfpose_vision::{Exposure, Transfer};

use super::scene::Hidden;

/// One condition.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RenderedCell {
    /// Name.
    pub name: &'static str,
    /// Largest tilt, degrees.
    pub tilt: f64,
    /// Radius of the pattern in the reference, pixels.
    pub radius: f64,
    /// Largest turn in the plane, degrees.
    pub turn: f64,
    /// Largest shift across the line of sight, depths.
    pub shift: f64,
    /// What happens to the frame's light.
    pub exposure: Exposure,
    /// What is hidden, or beside the pattern.
    pub hidden: Hidden,
    /// Tangent columns of `plane-bearing` that move, those of `--free`.
    pub free: &'static [usize],
}

/// All columns: a camera that moves freely.
pub(super) const ALL: &[usize] = &[0, 1, 2, 3, 4, 5];

/// A mobile robot before a wall: yaw, sideways and ahead (section IV.B).
pub(super) const ON_WHEELS: &[usize] = &[1, 3, 5];

/// A flying robot that holds itself level: its height too.
pub(super) const LEVEL: &[usize] = &[1, 3, 4, 5];

const CALM: Exposure = Exposure {
    background: 200.0,
    gradient: 0.0,
    motion: 0.0,
    blur: 0.7,
    noise: 2.0,
    gain: 1.0,
    transfer: Transfer::Linear,
};

/// A photograph in the open: light from one side, sRGB, unsteady hands.
const OUTDOOR: Exposure = Exposure { gradient: 0.3, motion: 4.0, noise: 4.0, transfer: Transfer::Srgb, ..CALM };

const fn complete(name: &'static str, tilt: f64, exposure: Exposure) -> RenderedCell {
    RenderedCell { name, tilt, turn: 25.0, radius: 150.0, shift: 0.08, exposure, hidden: Hidden::Nothing, free: ALL }
}

const fn occluded(name: &'static str, hidden: Hidden) -> RenderedCell {
    RenderedCell { name, tilt: 25.0, turn: 25.0, radius: 150.0, shift: 0.08, exposure: CALM, hidden, free: ALL }
}

/// All conditions: those of docs/vision.md.
pub const CELLS: &[RenderedCell] = &[
    complete("clean25", 25.0, CALM),
    complete("clean45", 45.0, CALM),
    complete("srgb45", 45.0, Exposure { transfer: Transfer::Srgb, ..CALM }),
    complete("noise12", 25.0, Exposure { noise: 12.0, ..CALM }),
    complete("defocus3", 25.0, Exposure { blur: 3.0, ..CALM }),
    complete("motion12", 25.0, Exposure { motion: 12.0, ..CALM }),
    complete("light40", 25.0, Exposure { gradient: 0.4, ..CALM }),
    complete("hard", 45.0, Exposure { noise: 8.0, blur: 2.0, gradient: 0.3, motion: 6.0, ..CALM }),
    complete("all", 45.0, Exposure { noise: 12.0, blur: 3.0, gradient: 0.4, motion: 12.0, ..CALM }),
    complete("bright", 25.0, Exposure { gain: 1.5, ..CALM }),
    RenderedCell { radius: 72.0, shift: 0.2, ..complete("radius72", 25.0, CALM) },
    RenderedCell { radius: 36.0, shift: 0.25, ..complete("radius36", 25.0, CALM) },
    occluded("cut10", Hidden::Cut { share: 0.1, grey: 200.0 }),
    occluded("cut20", Hidden::Cut { share: 0.2, grey: 200.0 }),
    occluded("cut30", Hidden::Cut { share: 0.3, grey: 200.0 }),
    occluded("cut40", Hidden::Cut { share: 0.4, grey: 200.0 }),
    occluded("cut50", Hidden::Cut { share: 0.5, grey: 200.0 }),
    occluded("grey20", Hidden::Cut { share: 0.2, grey: 128.0 }),
    occluded("blob20", Hidden::Blob { share: 0.2, grey: 128.0 }),
    RenderedCell { shift: 0.35, ..occluded("out", Hidden::OutOfView) },
    occluded("clutter20", Hidden::Clutter { share: 0.2 }),
    occluded("greys0", Hidden::Greys { share: 0.0 }),
    occluded("greys20", Hidden::Greys { share: 0.2 }),
    occluded("greys30", Hidden::Greys { share: 0.3 }),
    RenderedCell { free: ON_WHEELS, ..complete("wheels", 45.0, CALM) },
    RenderedCell { free: LEVEL, ..complete("level", 45.0, CALM) },
    RenderedCell { turn: 180.0, ..complete("anywhere", 60.0, CALM) },
    RenderedCell { exposure: OUTDOOR, ..occluded("outdoor", Hidden::Greys { share: 0.1 }) },
];
