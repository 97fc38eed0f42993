//! From images to coverage: thresholds, light, occluders, clipping, bad input.

use cfpose_vision::{
    Exposure, Foreground, Patch, Picture, SegmentError, SegmentOptions, Transfer, contours_of, coverage, render,
    segment,
};
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;

fn ring(centre: [f64; 2], radius: f64) -> Vec<[f64; 2]> {
    let turn = |k: i32| f64::from(k) / 200.0 * std::f64::consts::TAU;
    (0..200).map(|k| [centre[0] + radius * turn(k).cos(), centre[1] + radius * turn(k).sin()]).collect()
}

fn shot(patches: &[Patch], exposure: &Exposure) -> Picture {
    render(320, 240, patches, exposure, &mut ChaCha12Rng::seed_from_u64(5))
}

#[test]
fn coverage_is_that_of_the_polygon_under_uneven_light() {
    let polygon = ring([150.3, 118.8], 60.2);
    let exact = coverage(&polygon, 320, 240);
    let disc = Patch { polygon, grey: 60.0 };
    for gradient in [0.0, 0.4] {
        let exposure = Exposure { gradient, blur: 0.0, noise: 1.0, ..Exposure::default() };
        let found =
            segment(&shot(std::slice::from_ref(&disc), &exposure).light(Transfer::Linear), &SegmentOptions::default())
                .unwrap();
        let pairs = found.coverage.values().iter().zip(exact.values());
        let worst = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(found.dark && worst < 0.08, "gradient {gradient}: {worst}");
        let [contour] = &contours_of(&found.coverage, 0.5)[..] else { panic!("one contour") };
        let radii = contour.places.iter().map(|p| (p[0] - 150.3).hypot(p[1] - 118.8));
        let mean = radii.clone().sum::<f64>() / contour.places.len() as f64;
        assert!((mean - 60.2).abs() < 0.02, "gradient {gradient}: mean radius {mean}");
    }
}

#[test]
fn an_occluder_of_another_grey_is_no_pattern_and_no_background() {
    let disc = Patch { polygon: ring([150.0, 120.0], 60.0), grey: 60.0 };
    let spot = Patch { polygon: ring([190.0, 120.0], 25.0), grey: 128.0 };
    let picture = shot(&[disc, spot], &Exposure::default());
    let options = SegmentOptions { level: Some(0.3), find_others: true, ..SegmentOptions::default() };
    let found = segment(&picture.light(Transfer::Linear), &options).unwrap();
    let others = found.others.unwrap();
    assert!(others[120 * 320 + 190] && !others[120 * 320 + 120] && !others[20 * 320 + 20]);
    assert!((found.level - 0.3).abs() < 0.01, "{}", found.level);
}

#[test]
fn bright_patterns_on_dark_ground_are_found_too() {
    let disc = Patch { polygon: ring([150.0, 120.0], 60.0), grey: 230.0 };
    let picture = shot(&[disc], &Exposure { background: 30.0, ..Exposure::default() });
    let light = picture.light(Transfer::Linear);
    let found = segment(&light, &SegmentOptions::default()).unwrap();
    let area: f64 = found.coverage.values().iter().map(|v| f64::from(*v)).sum();
    assert!(!found.dark && (area / (std::f64::consts::PI * 3600.0) - 1.0).abs() < 0.002, "{area}");
    // Asked for the dark side it is the ground.
    let options = SegmentOptions { foreground: Foreground::Dark, ..SegmentOptions::default() };
    assert!(segment(&light, &options).is_ok_and(|found| found.dark));
}

#[test]
fn what_shows_no_pattern_is_said() {
    let flat = Picture::from_grey(64, 64, &[77; 64 * 64]).unwrap();
    let error = segment(&flat.light(Transfer::Srgb), &SegmentOptions::default()).err();
    assert_eq!(error, Some(SegmentError::OneColour));
    let mut dot = [200; 64 * 64];
    dot[64 * 30 + 30] = 20;
    let dot = Picture::from_grey(64, 64, &dot).unwrap();
    let error = segment(&dot.light(Transfer::Srgb), &SegmentOptions::default()).err();
    assert!(error.is_some(), "a single pixel is no pattern");
    for bytes in [&b""[..], b"GIF89a", b"\x89PNG\r\n\x1a\n"] {
        assert!(Picture::decode(bytes).is_err());
    }
}
