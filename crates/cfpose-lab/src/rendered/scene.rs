//! One trial: a shape, a pose, two images.

use cfpose::homography::{Intrinsics, apply, in_file_units};
use cfpose_optim::manifold::{multiply3, rotation_exp};
use cfpose_vision::{Camera, Exposure, Patch, Picture, coverage, render};
use rand::RngExt;
use rand_chacha::ChaCha12Rng;

use super::cells::RenderedCell;
use super::shapes;
use crate::seed::{data_stream, fnv1a};

/// Size of the images and their camera.
pub(super) const SIZE: [usize; 2] = [640, 480];
pub(super) const CAMERA: Intrinsics = Intrinsics { fx: 600.0, fy: 600.0, cx: 319.5, cy: 239.5 };

/// What is hidden in the frame, or lies beside the pattern.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Hidden {
    /// Nothing.
    Nothing,
    /// A half plane of a grey hides this share of the pattern.
    Cut {
        /// Share of the pattern's area.
        share: f64,
        /// Light, 0 to 255.
        grey: f64,
    },
    /// Ellipses of a grey hide this share of the pattern.
    Blob {
        /// Share of the pattern's area.
        share: f64,
        /// Light, 0 to 255.
        grey: f64,
    },
    /// 10 to 40 % of the outline lie outside the image.
    OutOfView,
    /// Ellipses of the pattern's own grey lie beside it and touch it, this share of its area.
    Clutter {
        /// Share of the pattern's area.
        share: f64,
    },
    /// The pattern has four greys; scattered ellipses of several greys hide this share of it.
    Greys {
        /// Share of the pattern's area.
        share: f64,
    },
}

/// Two images and the truth about them.
#[derive(Debug, Clone)]
pub struct RenderedTrial {
    /// The pattern seen from the front.
    pub reference: Picture,
    /// The pattern under the pose.
    pub frame: Picture,
    /// Camera of both.
    pub camera: Camera,
    /// Rotation row by row and translation over depth: ambient theta of `plane-bearing`.
    pub truth: Vec<f64>,
    /// Homography between the images, pixels.
    pub homography: [f64; 9],
    /// Places in pixels of the reference: 200 inside and 200 on the outline.
    pub test_places: Vec<[f64; 2]>,
    /// Share of the pattern's area that the frame does not show.
    pub hidden: f64,
}

/// Draw a trial of a cell from its name, a seed and its number.
pub fn draw(cell: &RenderedCell, seed: u64, number: u64) -> RenderedTrial {
    draw_from(cell, &mut data_stream(seed ^ fnv1a(cell.name.as_bytes()), number))
}

/// Draw a trial from a stream: shape, inner shapes, pose, noise of the reference, what is hidden, light, noise, test places.
pub fn draw_from(cell: &RenderedCell, rng: &mut ChaCha12Rng) -> RenderedTrial {
    let greys = matches!(cell.hidden, Hidden::Greys { .. });
    let outline = shapes::draw(rng, cell.radius / CAMERA.fx);
    let patches = if greys { four_greys(rng, &outline) } else { vec![(outline.clone(), 60.0)] };
    let background = if greys { 220.0 } else { 200.0 };
    let truth = pose(rng, cell, &outline);
    let homography = homography_of(&truth);
    let still = Exposure { background, ..Exposure::default() };
    let paint = |h: &[f64; 9]| -> Vec<Patch> {
        let seen = |p: &[f64; 2]| apply(h, pixel(*p));
        patches.iter().map(|(q, grey)| Patch { polygon: q.iter().map(seen).collect(), grey: *grey }).collect()
    };
    let transfer = cell.exposure.transfer;
    let reference = render(
        SIZE[0],
        SIZE[1],
        &paint(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        &Exposure { transfer, ..still },
        rng,
    );
    let mut scene = paint(&homography);
    let whole = scene[0].polygon.clone();
    let hidden = hide(rng, cell.hidden, &whole, &mut scene);
    let frame = render(SIZE[0], SIZE[1], &scene, &Exposure { background, ..cell.exposure }, rng);
    let test_places = test_places(rng, &outline);
    let camera = Camera::new(CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy).unwrap_or(Camera::IDENTITY);
    RenderedTrial { reference, frame, camera, truth, homography, test_places, hidden }
}

/// Return the pixel of a place of the plane z = 1.
pub(super) fn pixel(place: [f64; 2]) -> [f64; 2] {
    [place[0] * CAMERA.fx + CAMERA.cx, place[1] * CAMERA.fy + CAMERA.cy]
}

/// Return the homography in pixels of a pose (R, T over depth) of the plane z = 1.
pub(super) fn homography_of(theta: &[f64]) -> [f64; 9] {
    let mut h = [0.0; 9];
    h.copy_from_slice(&theta[..9]);
    (0..3).for_each(|i| h[3 * i + 2] += theta[9 + i]);
    in_file_units(&h, Some(&CAMERA), Some(&CAMERA)).unwrap_or(h)
}

/// Draw a pose under which the outline lies in the image, or 10 to 40 % of it outside.
fn pose(rng: &mut ChaCha12Rng, cell: &RenderedCell, outline: &[[f64; 2]]) -> Vec<f64> {
    loop {
        let direction = rng.random_range(0.0..std::f64::consts::TAU);
        let tilt = rng.random_range(0.0..cell.tilt).to_radians();
        let turn = rng.random_range(-cell.turn..cell.turn).to_radians();
        let moves = |column: usize| cell.free.contains(&column);
        let tilted = match moves(0) {
            true => rotation_exp(&[tilt * direction.cos(), tilt * direction.sin(), 0.0]),
            false => rotation_exp(&[0.0, tilt * direction.sin(), 0.0]),
        };
        let turn = if moves(2) { turn } else { 0.0 };
        let rotation = multiply3(&tilted, &rotation_exp(&[0.0, 0.0, turn]));
        let mut across = || rng.random_range(-cell.shift..cell.shift);
        let (x, y) = (across(), across());
        let y = if moves(4) { y } else { 0.0 };
        let centre = [x, y, 1.0 + rng.random_range(-0.3..0.3)];
        let mut theta = rotation.to_vec();
        theta.extend((0..3).map(|i| centre[i] - rotation[3 * i + 2]));
        let h = homography_of(&theta);
        let inside = |p: &[f64; 2]| {
            let [u, v] = apply(&h, pixel(*p));
            u > 4.0 && v > 4.0 && u < SIZE[0] as f64 - 5.0 && v < SIZE[1] as f64 - 5.0
        };
        let share = outline.iter().filter(|p| inside(p)).count() as f64 / outline.len() as f64;
        let wanted = match cell.hidden {
            Hidden::OutOfView => (0.6..0.9).contains(&share),
            _ => share == 1.0,
        };
        if wanted {
            return theta;
        }
    }
}

/// Draw three star shapes of other greys on the pattern.
fn four_greys(rng: &mut ChaCha12Rng, outline: &[[f64; 2]]) -> Vec<(Vec<[f64; 2]>, f64)> {
    let mut patches = vec![(outline.to_vec(), 60.0)];
    for (grey, angle, radius) in [(105.0, 0.3_f64, 0.075), (150.0, 2.4, 0.065), (190.0, 4.5, 0.06)] {
        let star = shapes::star(rng, radius);
        let moved = star.iter().map(|p| [p[0] + 0.1 * angle.cos(), p[1] + 0.1 * angle.sin()]);
        patches.push((moved.collect(), grey));
    }
    patches
}

/// Draw places: 200 inside the outline and 200 on it, in pixels of the reference.
fn test_places(rng: &mut ChaCha12Rng, outline: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let bound = outline.iter().flatten().fold(0.0_f64, |a, b| a.max(b.abs()));
    let mut places: Vec<[f64; 2]> = outline.iter().step_by((outline.len() / 200).max(1)).take(200).copied().collect();
    while places.len() < 400 {
        let place = [rng.random_range(-bound..bound), rng.random_range(-bound..bound)];
        if shapes::contains(outline, place) {
            places.push(place);
        }
    }
    places.into_iter().map(pixel).collect()
}

/// Add what hides the pattern; return the share of its area that is hidden.
fn hide(rng: &mut ChaCha12Rng, hidden: Hidden, whole: &[[f64; 2]], scene: &mut Vec<Patch>) -> f64 {
    let cover = coverage(whole, SIZE[0], SIZE[1]);
    let pixels: Vec<[usize; 2]> =
        (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| [x, y])).filter(|[x, y]| cover.at(*x, *y) > 0.5).collect();
    let total: f64 = cover.values().iter().map(|v| f64::from(*v)).sum();
    match hidden {
        Hidden::Nothing => 0.0,
        Hidden::OutOfView => 1.0 - total / area(whole),
        Hidden::Cut { share, grey } => {
            let (sine, cosine) = rng.random_range(0.0..std::f64::consts::TAU).sin_cos();
            let mut along: Vec<f64> = pixels.iter().map(|[x, y]| *x as f64 * cosine + *y as f64 * sine).collect();
            along.sort_by(f64::total_cmp);
            let at = along[((1.0 - share) * (along.len() - 1) as f64) as usize];
            let corner = |far: f64, side: f64| [far * cosine - side * sine, far * sine + side * cosine];
            let polygon = vec![
                corner(at, -2000.0),
                corner(at + 2000.0, -2000.0),
                corner(at + 2000.0, 2000.0),
                corner(at, 2000.0),
            ];
            scene.push(Patch { polygon, grey });
            share
        }
        Hidden::Blob { share, grey } => {
            let radius = (total * share / std::f64::consts::PI / 6.0).sqrt() * 1.1;
            scatter(rng, &cover, &pixels, share * total, |rng| (radius * rng.random_range(0.7..1.2), grey), scene)
        }
        Hidden::Greys { share } => {
            let draw = |rng: &mut ChaCha12Rng| {
                let radius = rng.random_range(6.0..22.0);
                (radius, [20.0, 128.0, 170.0, 235.0][rng.random_range(0..4)])
            };
            scatter(rng, &cover, &pixels, share * total, draw, scene)
        }
        Hidden::Clutter { share } => clutter(rng, &cover, share * total, scene),
    }
}

fn area(polygon: &[[f64; 2]]) -> f64 {
    let pieces = (0..polygon.len()).map(|k| (polygon[k], polygon[(k + 1) % polygon.len()]));
    pieces.map(|(a, b)| (a[0] * b[1] - b[0] * a[1]) / 2.0).sum::<f64>().abs().max(1.0)
}

/// Put ellipses on the pattern until an area is hidden; return the share.
fn scatter(
    rng: &mut ChaCha12Rng,
    cover: &cfpose_vision::Raster,
    pixels: &[[usize; 2]],
    wanted: f64,
    mut draw: impl FnMut(&mut ChaCha12Rng) -> (f64, f64),
    scene: &mut Vec<Patch>,
) -> f64 {
    let mut hidden = vec![0.0f32; cover.values().len()];
    let total: f64 = cover.values().iter().map(|v| f64::from(*v)).sum();
    let mut sum = 0.0;
    for _ in 0..400 {
        if sum >= wanted {
            break;
        }
        let [x, y] = pixels[rng.random_range(0..pixels.len())];
        let (radius, grey) = draw(rng);
        let flat = rng.random_range(0.4..1.0);
        let angle = rng.random_range(0.0..std::f64::consts::PI);
        let polygon = shapes::ellipse([x as f64, y as f64], [radius, radius * flat], angle);
        let own = coverage(&polygon, cover.width(), cover.height());
        hidden.iter_mut().zip(own.values()).for_each(|(h, v)| *h = h.max(*v));
        sum = hidden.iter().zip(cover.values()).map(|(h, c)| f64::from(h * c)).sum();
        scene.push(Patch { polygon, grey });
    }
    sum / total
}

/// Put ellipses of the pattern's grey beside it until they have an area.
fn clutter(rng: &mut ChaCha12Rng, cover: &cfpose_vision::Raster, wanted: f64, scene: &mut Vec<Patch>) -> f64 {
    let mut beside = vec![0.0f32; cover.values().len()];
    let mut sum = 0.0;
    for _ in 0..40 {
        if sum >= wanted {
            break;
        }
        let radius = rng.random_range(12.0..40.0);
        let centre = [rng.random_range(0.0..SIZE[0] as f64), rng.random_range(0.0..SIZE[1] as f64)];
        let radii = [radius, radius * rng.random_range(0.5..1.0)];
        let polygon = shapes::ellipse(centre, radii, rng.random_range(0.0..std::f64::consts::PI));
        let own = coverage(&polygon, cover.width(), cover.height());
        let (mut inside, mut all) = (0usize, 0usize);
        for (_, c) in own.values().iter().zip(cover.values()).filter(|(v, _)| **v > 0.0) {
            all += 1;
            inside += usize::from(*c > 0.5);
        }
        // Mostly beside the pattern: less than 30 % on it.
        if (inside as f64) < 0.3 * all as f64 {
            beside.iter_mut().zip(own.values()).for_each(|(b, v)| *b = b.max(*v));
            sum = beside.iter().zip(cover.values()).filter(|(_, c)| **c < 0.5).map(|(b, _)| f64::from(*b)).sum();
            scene.push(Patch { polygon, grey: 60.0 });
        }
    }
    0.0
}
