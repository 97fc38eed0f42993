//! Bodies: general ones, and those whose pose their surface determines in part only.

use std::f64::consts::TAU;

use cfpose_optim::manifold::{multiply3, rotation_exp};
use rand::RngExt;
use rand_chacha::ChaCha12Rng;

use crate::sampling::chosen;
use crate::scenario::Determined;
use crate::shapes::{Star, direction};

/// A kind of body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::scenarios) enum Kind {
    /// A star-shaped surface without symmetry.
    Star,
    /// A triaxial ellipsoid with one bump: nearly symmetric.
    Bump,
    /// A cylinder with a small handle.
    Cup,
    /// A surface of revolution.
    Revolution,
    /// The surface of a box with three different edges.
    Box,
    /// The surface of a cube.
    Cube,
    /// A flat star-shaped outline, filled: thickness 0.
    Plate,
    /// A sphere: no turn is determined. This kind and the next ones are not drawn where any body is asked for.
    Sphere,
    /// The side of a cylinder.
    Cylinder,
    /// A torus.
    Torus,
    /// A filled circle: a plane that ends.
    Disk,
    /// A circle.
    Ring,
    /// A piece of a straight line.
    Rod,
}

/// A body of radius about 1.
pub(in crate::scenarios) struct Body {
    pub kind: Kind,
    star: Star,
    /// Numbers that fix its proportions.
    size: [f64; 3],
}

impl Body {
    /// Draw a body: the kind, then a seed, then three proportions.
    pub fn draw(rng: &mut ChaCha12Rng) -> Self {
        let kinds = [
            (Kind::Star, 60),
            (Kind::Bump, 8),
            (Kind::Cup, 8),
            (Kind::Revolution, 8),
            (Kind::Box, 4),
            (Kind::Cube, 4),
            (Kind::Plate, 8),
        ];
        Self::of(chosen(&kinds, rng), rng)
    }

    /// Draw a body of a kind.
    pub fn of(kind: Kind, rng: &mut ChaCha12Rng) -> Self {
        let star = Star::new(rng.random_range(1000..1_000_000));
        Self { kind, star, size: std::array::from_fn(|_| rng.random()) }
    }

    /// Draw points of the surface.
    pub fn sample(&self, count: usize, rng: &mut ChaCha12Rng) -> Vec<[f64; 3]> {
        (0..count).map(|_| self.point(rng)).collect()
    }

    fn point(&self, rng: &mut ChaCha12Rng) -> [f64; 3] {
        let [a, b, c] = self.size;
        match self.kind {
            Kind::Star => self.star.point(direction(rng)),
            Kind::Bump => {
                let u = direction(rng);
                let bump = 0.15 + 0.25 * c;
                let radius = 1.0 + bump * (12.0 * (0.6 * u[0] + 0.64 * u[1] + 0.48 * u[2] - 1.0)).exp();
                [radius * u[0], (0.7 + 0.2 * a) * radius * u[1], (0.4 + 0.2 * b) * radius * u[2]]
            }
            Kind::Cup => {
                // The handle has a twentieth to a tenth of the points.
                if rng.random::<f64>() < 0.05 + 0.05 * a {
                    let (angle, around) = (std::f64::consts::PI * rng.random::<f64>(), TAU * rng.random::<f64>());
                    let radius = 0.25 + 0.05 * around.cos();
                    return [0.5 + radius * angle.sin(), 0.05 * around.sin(), 0.1 + radius * angle.cos()];
                }
                let (angle, height) = (TAU * rng.random::<f64>(), rng.random_range(-0.6..0.6));
                let radius = 0.5 * (1.0 - 0.2 * b * (height + 0.6));
                [radius * angle.cos(), radius * angle.sin(), height]
            }
            Kind::Revolution => {
                let (angle, height) = (TAU * rng.random::<f64>(), rng.random_range(-0.9..0.9_f64));
                let radius = 0.3 + 0.15 * a + 0.2 * b * (3.0 * height).sin() + 0.1 * c * height;
                [radius * angle.cos(), radius * angle.sin(), height]
            }
            Kind::Box => box_point([0.8, 0.35 + 0.25 * a, 0.15 + 0.15 * b], rng),
            Kind::Cube => box_point([0.55; 3], rng),
            Kind::Plate => {
                let angle = TAU * rng.random::<f64>();
                let radius = rng.random::<f64>().sqrt()
                    * (0.6 + 0.2 * (2.0 * angle + TAU * a).cos() + 0.15 * (3.0 * angle + TAU * b).cos());
                [radius * angle.cos(), radius * angle.sin(), 0.0]
            }
            Kind::Sphere => direction(rng),
            Kind::Cylinder => {
                let (angle, half) = (TAU * rng.random::<f64>(), 0.4 + 0.4 * b);
                [0.5 * angle.cos(), 0.5 * angle.sin(), rng.random_range(-half..half)]
            }
            Kind::Torus => {
                let (angle, tube) = (TAU * rng.random::<f64>(), 0.15 + 0.15 * a);
                // Uniform on the surface: the outside of the tube has more of it.
                let around = loop {
                    let around = TAU * rng.random::<f64>();
                    if rng.random::<f64>() < 1.0 - tube + tube * around.cos() {
                        break around;
                    }
                };
                let radius = 1.0 - tube + tube * around.cos();
                [radius * angle.cos(), radius * angle.sin(), tube * around.sin()]
            }
            Kind::Disk => {
                let (angle, radius) = (TAU * rng.random::<f64>(), rng.random::<f64>().sqrt());
                [radius * angle.cos(), radius * angle.sin(), 0.0]
            }
            Kind::Ring => {
                let angle = TAU * rng.random::<f64>();
                [angle.cos(), angle.sin(), 0.0]
            }
            Kind::Rod => [0.0, 0.0, rng.random_range(-1.0..1.0)],
        }
    }

    /// Say what the surface determines.
    pub fn determined(&self) -> Determined {
        match self.kind {
            Kind::Star | Kind::Bump | Kind::Cup => Determined::Theta,
            // A flat plate lies on itself turned about an axis in it only when its outline is symmetric; its two sides are not
            // told apart by a reflection, which is no rotation.
            Kind::Plate => Determined::Theta,
            Kind::Revolution | Kind::Sphere | Kind::Cylinder | Kind::Torus | Kind::Disk | Kind::Ring | Kind::Rod => {
                Determined::ButADirection
            }
            Kind::Box | Kind::Cube => Determined::OneOfSeveral,
        }
    }

    /// Return rotations (row by row) that map the body onto itself; of a body of revolution 720 turns, of a sphere some from all sides.
    pub fn symmetries(&self) -> Vec<[f64; 9]> {
        let identity = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        let about = |axis: usize, angle: f64| {
            let mut vector = [0.0; 3];
            vector[axis] = angle;
            rotation_exp(&vector)
        };
        match self.kind {
            Kind::Revolution => (0..720).map(|k| about(2, TAU * f64::from(k) / 720.0)).collect(),
            Kind::Cylinder | Kind::Torus | Kind::Disk | Kind::Ring | Kind::Rod => {
                let turns = (0..720).map(|k| about(2, TAU * f64::from(k) / 720.0));
                turns.flat_map(|turn| [turn, multiply3(&turn, &about(0, 0.5 * TAU))]).collect()
            }
            // A turn about z, then the axis anywhere: at most 4 degrees from every rotation.
            Kind::Sphere => {
                let (steps, count) = (60, 1500);
                let turn = |k: usize| about(2, TAU * k as f64 / steps as f64);
                let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
                let tilt = |k: usize| {
                    let height = 1.0 - (2 * k + 1) as f64 / count as f64;
                    let (across, around) = (height.acos(), golden * k as f64);
                    rotation_exp(&[-across * around.sin(), across * around.cos(), 0.0])
                };
                let all = (0..count).flat_map(|k| (0..steps).map(move |at| (k, at)));
                std::iter::once(identity).chain(all.map(|(k, at)| multiply3(&tilt(k), &turn(at)))).collect()
            }
            Kind::Box => std::iter::once(identity).chain((0..3).map(|axis| about(axis, 0.5 * TAU))).collect(),
            Kind::Cube => {
                let mut all = vec![identity];
                // The group is generated by quarter turns.
                let mut next = 0;
                while next < all.len() {
                    for axis in 0..3 {
                        let turned = multiply3(&about(axis, 0.25 * TAU), &all[next]);
                        let is_new = |r: &[f64; 9]| r.iter().zip(&turned).any(|(x, y)| (x - y).abs() > 0.1);
                        if all.iter().all(is_new) {
                            all.push(turned);
                        }
                    }
                    next += 1;
                }
                all
            }
            _ => vec![identity],
        }
    }
}

/// Draw a point of the surface of a box with these half edges.
fn box_point(half: [f64; 3], rng: &mut ChaCha12Rng) -> [f64; 3] {
    let area = |axis: usize| half[(axis + 1) % 3] * half[(axis + 2) % 3];
    let mut left = rng.random::<f64>() * (area(0) + area(1) + area(2));
    let mut axis = 0;
    while axis < 2 && left > area(axis) {
        left -= area(axis);
        axis += 1;
    }
    let side = if rng.random::<f64>() < 0.5 { -1.0 } else { 1.0 };
    std::array::from_fn(|d| half[d] * if d == axis { side } else { rng.random_range(-1.0..1.0) })
}
