//! Where the points of a cloud come from: a star-shaped surface drawn from a seed, or a file.

use std::path::{Path, PathBuf};

use cfpose::entry::{EntryError, Parameters};
use cfpose_optim::manifold::norm3;
use cfpose_vision::{Mesh, read_mesh};
use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

use crate::scenario::ScenarioError;
use crate::seed::data_stream;

/// The Stanford bunny in the folder of real data.
const BUNNY: &str = "bunny/stanford-bunny.obj";

/// What the parameter `shape` says.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Source {
    /// A surface drawn from a seed.
    Seed(u64),
    /// A file of points or of a mesh.
    File(PathBuf),
}

impl Source {
    /// Read a seed, `bunny` or the name of a file (with a dot or slash).
    pub(crate) fn of(parameters: &Parameters) -> Result<Self, EntryError> {
        let text = parameters.text("shape");
        if let Ok(seed) = text.parse() {
            return Ok(Source::Seed(seed));
        }
        match text {
            "bunny" => Ok(Source::File(PathBuf::from(BUNNY))),
            // A number with a dot is a mistyped seed.
            file if file.contains(['.', '/']) && file.parse::<f64>().is_err() => Ok(Source::File(PathBuf::from(file))),
            _ => Err(parameters.bad("shape", "expected a whole number >= 0, bunny, or a file such as cloud.ply")),
        }
    }

    /// Find the file, in `folder`, then in the folder of real data.
    pub(crate) fn path(&self, folder: &Path) -> Option<PathBuf> {
        let Source::File(name) = self else { return None };
        find_file(folder, name)
    }

    /// Make the shape; a file is looked up in `folder`, then in the folder of real data.
    pub(crate) fn load(&self, folder: &Path) -> Result<Shape, ScenarioError> {
        match self {
            Source::Seed(seed) => Ok(Shape::Star(Star::new(*seed))),
            Source::File(name) => {
                let path = self.path(folder).ok_or_else(|| no_file("shape", name))?;
                let mesh = read_mesh(&path).map_err(|error| ScenarioError::File(error.to_string()))?;
                Surface::new(mesh).map(Shape::Surface).ok_or_else(|| {
                    ScenarioError::File(format!("{}: the points have no extent; give a shape", path.display()))
                })
            }
        }
    }
}

/// Return the folder of real data: `CFPOSE_DATA`, or `../shared/data`.
fn data_folder() -> PathBuf {
    std::env::var_os("CFPOSE_DATA").map_or_else(|| PathBuf::from("../shared/data"), PathBuf::from)
}

/// Find a file in `folder`, then in the folder of real data.
pub(crate) fn find_file(folder: &Path, name: &Path) -> Option<PathBuf> {
    [folder.join(name), data_folder().join(name)].into_iter().find(|path| path.is_file())
}

/// Say that a file of a parameter is in neither folder.
pub(crate) fn no_file(parameter: &str, name: &Path) -> ScenarioError {
    let (name, data) = (name.display(), data_folder());
    let data = data.display();
    ScenarioError::File(format!(
        "{parameter}: there is no file {name} beside the experiment or in {data}; set CFPOSE_DATA to the folder of real data"
    ))
}

/// A shape of radius 1 that points are drawn from.
pub(crate) enum Shape {
    Star(Star),
    Surface(Surface),
}

impl Shape {
    /// Return the largest sample, if there is one.
    pub(crate) fn max_points(&self) -> Option<usize> {
        match self {
            Shape::Surface(surface) if surface.areas.is_empty() => Some(surface.mesh.vertices.len()),
            _ => None,
        }
    }

    /// Draw points. Draws: per point three normals (star) or three uniforms (mesh: triangle, then place in it); for points
    /// without faces the first steps of a Fisher-Yates permutation from the front.
    pub(crate) fn sample(&self, count: usize, rng: &mut ChaCha12Rng) -> Vec<[f64; 3]> {
        match self {
            Shape::Star(star) => (0..count).map(|_| star.point(direction(rng))).collect(),
            Shape::Surface(surface) if surface.areas.is_empty() => surface.vertices(count, rng),
            Shape::Surface(surface) => (0..count).map(|_| surface.point(rng)).collect(),
        }
    }
}

/// Number of bumps of a star.
const NUM_BUMPS: usize = 6;

/// A star-shaped surface: x = radius(u) (1, .8, .6) u over unit directions u, with
/// radius(u) = 1 + sum_b height_b exp(sharpness_b (u . centre_b - 1)), scaled to largest norm 1 on a fixed set of directions.
///
/// Six bumps of different height (.2 to .6), sharpness (2 to 8) and random centre leave no symmetry. Drawn from ChaCha12
/// of the shape's own seed (stream "cloud3"): per bump the centre (three normals), the height, the sharpness.
pub(crate) struct Star {
    bumps: Vec<([f64; 3], f64, f64)>,
    scale: f64,
}

impl Star {
    pub(crate) fn new(seed: u64) -> Self {
        let mut rng = data_stream(seed, u64::from_be_bytes(*b"cloud3\0\0"));
        let bumps = (0..NUM_BUMPS)
            .map(|_| (direction(&mut rng), 0.2 + 0.4 * rng.random::<f64>(), 2.0 + 6.0 * rng.random::<f64>()))
            .collect();
        let mut star = Self { bumps, scale: 1.0 };
        let largest = (0..4000).map(|_| norm3(&star.point(direction(&mut rng)))).fold(0.0, f64::max);
        star.scale = 1.0 / largest;
        star
    }

    /// Return the surface point in direction u.
    pub(crate) fn point(&self, u: [f64; 3]) -> [f64; 3] {
        let bump = |(centre, height, sharpness): &([f64; 3], f64, f64)| {
            let cosine: f64 = (0..3).map(|i| u[i] * centre[i]).sum();
            height * (sharpness * (cosine - 1.0)).exp()
        };
        let radius = self.scale * (1.0 + self.bumps.iter().map(bump).sum::<f64>());
        [radius * u[0], 0.8 * radius * u[1], 0.6 * radius * u[2]]
    }
}

/// Draw a direction uniform on the sphere: three normals, divided by their norm.
pub(crate) fn direction(rng: &mut ChaCha12Rng) -> [f64; 3] {
    loop {
        let v: [f64; 3] = std::array::from_fn(|_| rng.sample(StandardNormal));
        let norm = norm3(&v);
        if norm > 1e-9 {
            return v.map(|x| x / norm);
        }
    }
}

/// The mesh or cloud of a file, its centroid (of the area, without faces of the points) at 0, its farthest vertex at 1.
pub(crate) struct Surface {
    mesh: Mesh,
    /// Sums of the triangles' areas up to each; empty without faces.
    areas: Vec<f64>,
}

impl Surface {
    /// Centre, scale and measure; `None` for points that are all equal.
    fn new(mut mesh: Mesh) -> Option<Self> {
        let corners = |mesh: &Mesh, k: usize| mesh.triangles[k].map(|vertex| mesh.vertices[vertex]);
        let areas: Vec<f64> = (0..mesh.triangles.len()).map(|k| area(corners(&mesh, k))).collect();
        let total: f64 = areas.iter().sum();
        let (mut centre, mut weight) = ([0.0; 3], 0.0);
        let mut add = |point: [f64; 3], w: f64| {
            weight += w;
            centre = std::array::from_fn(|d| centre[d] + w * point[d]);
        };
        if total > 0.0 {
            for (k, area) in areas.iter().enumerate() {
                corners(&mesh, k).into_iter().for_each(|corner| add(corner, area / 3.0));
            }
        } else {
            mesh.vertices.iter().for_each(|vertex| add(*vertex, 1.0));
        }
        let centre = centre.map(|x| x / weight);
        mesh.vertices.iter_mut().for_each(|v| *v = std::array::from_fn(|d| v[d] - centre[d]));
        let radius = mesh.vertices.iter().map(norm3).fold(0.0, f64::max);
        if !(radius > 0.0 && radius.is_finite()) {
            return None;
        }
        mesh.vertices.iter_mut().for_each(|v| *v = v.map(|x| x / radius));
        let mut sum = 0.0;
        let sums = areas.iter().map(|area| {
            sum += area;
            sum
        });
        Some(Self { areas: if total > 0.0 { sums.collect() } else { Vec::new() }, mesh })
    }

    /// Draw a point uniform on the area: a triangle by its area, then barycentric coordinates (1 - s, s (1 - t), s t) with
    /// s the root of a uniform.
    fn point(&self, rng: &mut ChaCha12Rng) -> [f64; 3] {
        let total = self.areas.last().copied().unwrap_or(0.0);
        let chosen = total * rng.random::<f64>();
        let triangle = self.areas.partition_point(|sum| *sum <= chosen).min(self.areas.len() - 1);
        let (s, t) = (rng.random::<f64>().sqrt(), rng.random::<f64>());
        let [a, b, c] = self.mesh.triangles[triangle].map(|vertex| self.mesh.vertices[vertex]);
        std::array::from_fn(|d| (1.0 - s) * a[d] + s * (1.0 - t) * b[d] + s * t * c[d])
    }

    /// Draw vertices without replacement.
    fn vertices(&self, count: usize, rng: &mut ChaCha12Rng) -> Vec<[f64; 3]> {
        let mut order: Vec<usize> = (0..self.mesh.vertices.len()).collect();
        for k in 0..count {
            let other = rng.random_range(k..order.len());
            order.swap(k, other);
        }
        order[..count].iter().map(|index| self.mesh.vertices[*index]).collect()
    }
}

fn area([a, b, c]: [[f64; 3]; 3]) -> f64 {
    let (u, v): ([f64; 3], [f64; 3]) = (std::array::from_fn(|d| b[d] - a[d]), std::array::from_fn(|d| c[d] - a[d]));
    0.5 * norm3(&[u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mesh_is_sampled_by_its_area() {
        // Two squares of side 1 and 3 in the plane z = 0, the large one of four triangles, with a degenerate triangle.
        let vertices = [[0., 0.], [1., 0.], [1., 1.], [0., 1.], [2., 0.], [5., 0.], [5., 3.], [2., 3.], [3.5, 1.5]];
        let mesh = Mesh {
            vertices: vertices.map(|[x, y]| [x, y, 0.0]).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3], [0, 0, 1], [4, 5, 8], [5, 6, 8], [6, 7, 8], [7, 4, 8]],
        };
        let surface = Surface::new(mesh).unwrap();
        let [origin, unit, corner] = [0, 1, 6].map(|k| surface.mesh.vertices[k]);
        assert!(surface.mesh.vertices.iter().all(|v| norm3(v) <= 1.0 + 1e-15));
        let scale = unit[0] - origin[0];
        let mut rng = data_stream(1, 2);
        let points: Vec<[f64; 3]> = (0..20_000).map(|_| surface.point(&mut rng)).collect();
        let small = points.iter().filter(|p| p[0] < origin[0] + 1.5 * scale).count() as f64 / 20_000.0;
        assert!((small - 0.1).abs() < 4.0 * (0.09_f64 / 20_000.0).sqrt(), "{small}");
        // The area's centroid is the mean of the sample; the large square is filled evenly.
        for d in 0..2 {
            let mean = points.iter().map(|p| p[d]).sum::<f64>() / 20_000.0;
            assert!(mean.abs() < 0.02, "{mean}");
        }
        let inside = |p: &&[f64; 3]| p[0] > corner[0] - scale && p[1] > corner[1] - scale;
        let ninth = points.iter().filter(inside).count() as f64 / 20_000.0;
        assert!((ninth - 0.1).abs() < 4.0 * (0.09_f64 / 20_000.0).sqrt(), "{ninth}");
    }

    #[test]
    fn a_cloud_is_drawn_without_replacement() {
        let vertices: Vec<[f64; 3]> = (0..50).map(|k| [f64::from(k), f64::from(k * k), 1.0]).collect();
        let surface = Surface::new(Mesh { vertices, triangles: Vec::new() }).unwrap();
        let shape = Shape::Surface(surface);
        assert_eq!(shape.max_points(), Some(50));
        let mut xs: Vec<f64> = shape.sample(50, &mut data_stream(3, 4)).iter().map(|p| p[0]).collect();
        xs.sort_by(f64::total_cmp);
        xs.dedup();
        assert_eq!(xs.len(), 50);
        assert_ne!(shape.sample(10, &mut data_stream(3, 4)), shape.sample(10, &mut data_stream(3, 5)));
        let equal = Mesh { vertices: vec![[1.0; 3]; 4], triangles: vec![[0, 1, 2]] };
        assert!(Surface::new(equal).is_none());
    }
}
