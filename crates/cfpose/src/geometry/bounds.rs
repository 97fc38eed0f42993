//! Bounds on named parameters: what is known beforehand about single coordinates of theta.
//!
//! Parameters are numbered and named as in [`free`](super::free): of a vector the coordinate itself, of a rotation R = Rz Ry Rx its
//! Euler angles (ry within 90 degrees, unless its bounds say otherwise), of a turn in the plane its angle. A retraction that ends outside is moved inside, so no iterate of any solver leaves
//! the bounds.

use std::sync::Arc;

use cfpose_optim::manifold::Manifold;
use num_dual::HyperDual64;
use rand::RngExt;

use crate::entry::BuildError;
use crate::geometry::free::{self, columns};
use crate::geometry::theta::{BlockKind, Layout, euler_of_rotation, rotation_of_euler};
use crate::streams::stream;

/// An interval for one parameter; infinities mean no bound on that side. Angles are in radians, and an interval may pass pi.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bound {
    /// Tangent column, from 0, as [`find_columns`](super::free::find_columns) counts.
    pub column: usize,
    /// Least value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
}

/// Bounds on some parameters of a layout.
///
/// ```
/// use cfpose::bounds::{Bound, Bounds};
/// use cfpose::theta::{Layout, RotationForm};
/// let pose = Layout::pose3();
/// // The depth between .5 and 3, the turn about z within 30 degrees.
/// let bounds = [Bound { column: 5, low: 0.5, high: 3.0 }, Bound { column: 2, low: -0.52, high: 0.52 }];
/// let bounds = Bounds::new(&pose, &bounds)?;
/// let mut theta = pose.from_list(&[0.0, 0.0, 1.0, 0.1, 0.2, 4.0], RotationForm::Vector)?;
/// assert_eq!(bounds.violated(&theta), [2, 5]);
/// bounds.clip(&mut theta);
/// assert!(bounds.violated(&theta).is_empty());
/// assert_eq!(theta[9..], [0.1, 0.2, 3.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Bounds {
    blocks: Vec<Bounded>,
    names: Vec<String>,
}

/// One block of theta with the bounds on its coordinates.
#[derive(Debug, Clone)]
struct Bounded {
    kind: BlockKind,
    /// First tangent column.
    first: usize,
    /// By coordinate within the block.
    intervals: Vec<(usize, Interval)>,
}

#[derive(Debug, Clone, Copy)]
struct Interval {
    low: f64,
    high: f64,
    is_angle: bool,
}

/// A parameter at its bound lies within this share of its size (radians for angles) of it.
const AT_BOUND: f64 = 1e-9;
/// Rounding of an angle that was read off a rotation matrix.
const ROUNDING: f64 = 1e-12;

impl Interval {
    /// Return the nearest value inside.
    fn nearest(&self, value: f64) -> f64 {
        let turn = std::f64::consts::TAU;
        if !self.is_angle {
            return value.clamp(self.low, self.high);
        }
        if self.high - self.low >= turn {
            return value;
        }
        // The representative that is nearest to the middle of the interval, or to its only end.
        let middle = match (self.low.is_finite(), self.high.is_finite()) {
            (true, true) => 0.5 * (self.low + self.high),
            (true, false) => self.low.max(0.0),
            _ => self.high.min(0.0),
        };
        let around = value - turn * ((value - middle) / turn).round();
        if around >= self.low && around <= self.high { value } else { around.clamp(self.low, self.high) }
    }

    /// Say by how much a value lies outside.
    fn excess(&self, value: f64) -> f64 {
        (self.nearest(value) - value).abs()
    }

    /// Say whether a value lies at an end.
    fn is_at_end(&self, value: f64) -> bool {
        let near = |end: f64| {
            let turns = if self.is_angle { ((value - end) / std::f64::consts::TAU).round() } else { 0.0 };
            let off = value - end - turns * std::f64::consts::TAU;
            end.is_finite() && off.abs() <= AT_BOUND * end.abs().max(1.0)
        };
        near(self.low) || near(self.high)
    }
}

impl Bounds {
    /// Make bounds of a layout.
    ///
    /// # Errors
    /// [`BuildError::Data`] for a column out of range, an empty interval, and parameters without a coordinate of their own (directions
    /// on a sphere).
    pub fn new(layout: &Layout, bounds: &[Bound]) -> Result<Self, BuildError> {
        let all = columns(layout);
        let refuse = |problem: String| BuildError::Data { name: "bounds".to_string(), problem };
        let mut blocks: Vec<Bounded> = Vec::new();
        let mut first = 0;
        for block in layout.blocks() {
            blocks.push(Bounded { kind: block.kind.clone(), first, intervals: Vec::new() });
            first += block.kind.manifold().tangent();
        }
        for bound in bounds {
            let column =
                all.get(bound.column).ok_or_else(|| refuse(format!("there is no parameter {}", bound.column)))?;
            let is_interval = bound.low <= bound.high && bound.low < f64::INFINITY && bound.high > f64::NEG_INFINITY;
            if !is_interval {
                return Err(refuse(format!("{} has no value between {} and {}", column.name, bound.low, bound.high)));
            }
            let block = &mut blocks[column.block];
            if matches!(block.kind, BlockKind::Direction(_)) {
                return Err(refuse(format!(
                    "{} is a direction on a sphere: it has no coordinate to bound",
                    column.name
                )));
            }
            let is_angle = Self::is_angle(layout, bound.column);
            block.intervals.push((column.index, Interval { low: bound.low, high: bound.high, is_angle }));
        }
        Ok(Self { blocks, names: all.into_iter().map(|column| column.name).collect() })
    }

    /// Say whether a tangent column of a layout is an angle, bounded in radians.
    pub fn is_angle(layout: &Layout, column: usize) -> bool {
        let kind = |column: &free::Column| &layout.blocks()[column.block].kind;
        let all = columns(layout);
        all.get(column).is_some_and(|column| matches!(kind(column), BlockKind::Rotation | BlockKind::Angle))
    }

    /// Return the tangent columns whose bounds theta (ambient) violates, ascending.
    pub fn violated(&self, theta: &[f64]) -> Vec<usize> {
        self.columns_that(theta, |interval, value| {
            interval.excess(value) > if interval.is_angle { ROUNDING } else { 0.0 }
        })
    }

    /// Return the names of the parameters that lie at a bound.
    pub fn reached(&self, theta: &[f64]) -> Vec<&str> {
        self.columns_that(theta, Interval::is_at_end).into_iter().map(|column| self.names[column].as_str()).collect()
    }

    /// Return the name of a tangent column.
    pub fn name(&self, column: usize) -> &str {
        &self.names[column]
    }

    fn columns_that(&self, theta: &[f64], holds: impl Fn(&Interval, f64) -> bool) -> Vec<usize> {
        let (mut found, mut rest) = (Vec::new(), theta);
        for block in &self.blocks {
            let (own, tail) = rest.split_at(block.kind.manifold().ambient());
            rest = tail;
            if !block.intervals.is_empty() {
                let values = block.coordinates(own);
                let mine = block.intervals.iter().filter(|(at, interval)| holds(interval, values[*at]));
                found.extend(mine.map(|(at, _)| block.first + at));
            }
        }
        found.sort_unstable();
        found.dedup();
        found
    }

    /// Move what lies outside to the nearest value inside, coordinate by coordinate; numbers after the layout's own stay.
    pub fn clip(&self, theta: &mut [f64]) {
        self.change(theta, |interval, value| interval.nearest(value));
    }

    /// Give what lies outside a value inside: drawn evenly where both ends are known, else the nearest. For starts.
    pub fn draw_inside(&self, theta: &mut [f64], seed: u64, number: usize) {
        let mut rng = stream(seed, &format!("inside-{number}"));
        self.change(theta, |interval, value| {
            let share: f64 = rng.random();
            let is_closed = interval.low.is_finite() && interval.high.is_finite();
            match interval.excess(value) > 0.0 {
                true if is_closed => interval.low + share * (interval.high - interval.low),
                true => interval.nearest(value),
                false => value,
            }
        });
    }

    fn change(&self, theta: &mut [f64], mut new: impl FnMut(&Interval, f64) -> f64) {
        let mut rest = theta;
        for block in &self.blocks {
            let (own, tail) = rest.split_at_mut(block.kind.manifold().ambient());
            rest = tail;
            if block.intervals.is_empty() {
                continue;
            }
            let before = block.coordinates(own);
            let mut values = before.clone();
            block.intervals.iter().for_each(|(at, interval)| values[*at] = new(interval, values[*at]));
            // A rotation inside keeps its last bit.
            if values == before {
                continue;
            }
            match block.kind {
                BlockKind::Rotation => own.copy_from_slice(&rotation_of_euler(&[values[0], values[1], values[2]])),
                _ => own.copy_from_slice(&values),
            }
        }
    }
}

impl Bounded {
    /// Return the coordinates of a block that bounds are on. A rotation has the Euler angles with |ry| <= 90 degrees, unless ry is bound to
    /// others: then the list of the two with less outside.
    fn coordinates(&self, own: &[f64]) -> Vec<f64> {
        if !matches!(self.kind, BlockKind::Rotation) {
            return own.to_vec();
        }
        let pi = std::f64::consts::PI;
        let angles = euler_of_rotation(own);
        let is_steep = |interval: &Interval| {
            interval.low.is_finite()
                && interval.high.is_finite()
                && interval.low.abs().max(interval.high.abs()) > 0.5 * pi
        };
        if !self.intervals.iter().any(|(at, interval)| *at == 1 && is_steep(interval)) {
            return angles.to_vec();
        }
        let other = [angles[0] + pi, pi - angles[1], angles[2] + pi];
        let outside =
            |angles: &[f64; 3]| self.intervals.iter().map(|(at, interval)| interval.excess(angles[*at])).sum::<f64>();
        if outside(&other) < outside(&angles) - ROUNDING { other.to_vec() } else { angles.to_vec() }
    }
}

/// A manifold whose retraction stays inside bounds.
#[derive(Debug)]
pub(crate) struct Inside {
    pub inner: Arc<dyn Manifold>,
    pub bounds: Arc<Bounds>,
}

impl Manifold for Inside {
    fn ambient(&self) -> usize {
        self.inner.ambient()
    }

    fn tangent(&self) -> usize {
        self.inner.tangent()
    }

    fn retract(&self, theta: &[f64], step: &[f64], out: &mut [f64]) {
        self.inner.retract(theta, step, out);
        self.bounds.clip(out);
    }

    fn local(&self, from: &[f64], to: &[f64], step: &mut [f64]) {
        self.inner.local(from, to, step);
    }

    fn lift2(&self, theta: &[f64], step: &[HyperDual64], out: &mut [HyperDual64]) {
        self.inner.lift2(theta, step, out);
    }

    fn basis(&self, theta: &[f64], out: &mut [f64]) {
        self.inner.basis(theta, out);
    }

    fn differential(&self, theta: &[f64], step: &[f64], out: &mut [f64]) {
        self.inner.differential(theta, step, out);
    }

    fn extent(&self, theta: &[f64], out: &mut [f64]) {
        self.inner.extent(theta, out);
    }

    fn project(&self, theta: &mut [f64]) {
        self.inner.project(theta);
        self.bounds.clip(theta);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::theta::RotationForm;

    fn bounds(list: &[(usize, f64, f64)]) -> Bounds {
        let all: Vec<Bound> =
            list.iter().map(|(column, low, high)| Bound { column: *column, low: *low, high: *high }).collect();
        Bounds::new(&Layout::pose3(), &all).unwrap()
    }

    fn pose(angles: [f64; 3], translation: [f64; 3]) -> Vec<f64> {
        [&rotation_of_euler(&angles)[..], &translation].concat()
    }

    #[test]
    fn clipping_ends_inside_and_leaves_what_is_inside_alone() {
        let narrow = bounds(&[(0, -0.1, 0.1), (1, -0.2, 0.3), (2, 3.0, 3.5), (3, f64::NEG_INFINITY, 0.0)]);
        for k in 0..200 {
            let turn = |step: f64| (f64::from(k) * step).rem_euclid(6.0) - 3.0;
            let mut theta = pose([turn(0.71), 0.5 * turn(1.3), turn(2.9)], [turn(0.37), turn(0.9), turn(1.7)]);
            let given = theta.clone();
            let was_inside = narrow.violated(&theta).is_empty();
            narrow.clip(&mut theta);
            assert!(narrow.violated(&theta).is_empty(), "{k}: {:?}", euler_of_rotation(&theta));
            assert_eq!(was_inside, theta == given);
            assert_eq!(theta[10..], given[10..]);
            let mut drawn = given;
            narrow.draw_inside(&mut drawn, 4, k as usize);
            assert!(narrow.violated(&drawn).is_empty());
        }
    }

    #[test]
    fn an_interval_may_pass_pi_and_a_pitch_may_pass_a_right_angle() {
        let behind = bounds(&[(2, 3.0, 3.5)]);
        assert!(behind.violated(&pose([0.0, 0.0, -3.1], [0.0; 3])).is_empty());
        assert_eq!(behind.violated(&pose([0.0, 0.0, -2.0], [0.0; 3])), [2]);
        // R = Ry(1.8) has the Euler angles (pi, pi - 1.8, pi) too.
        let steep = bounds(&[(1, 1.7, 2.0), (0, -0.1, 0.1)]);
        assert!(steep.violated(&pose([0.0, 1.8, 0.0], [0.0; 3])).is_empty());
        assert_eq!(steep.reached(&pose([0.0, 1.7, 0.0], [0.0; 3])), ["ry"]);
    }

    #[test]
    fn nonsense_is_refused() {
        let layout = Layout::pose3();
        let refused = |column, low, high| Bounds::new(&layout, &[Bound { column, low, high }]).unwrap_err().to_string();
        assert!(refused(9, 0.0, 1.0).contains("no parameter"));
        assert!(refused(3, 2.0, 1.0).contains("tx has no value between 2 and 1"));
        assert!(refused(3, f64::NAN, 1.0).contains("tx"));
        let theta = layout.from_list(&[0.0; 6], RotationForm::Vector).unwrap();
        assert!(Bounds::new(&layout, &[]).unwrap().violated(&theta).is_empty());
    }
}
