//! Designs, rasters and sequences: from images to poses beyond a reference that is an image.

mod common;

use std::fmt::Write;

use cfpose::homography::apply;
use cfpose_lab::rendered::{CELLS, SEQUENCES, measure, measure_sequence, summarise};
use cfpose_optim::manifold::{rotation_exp, rotation_log};
use cfpose_vision::overlay::to_png;
use cfpose_vision::{Exposure, Patch, coverage, render};
use common::{Desk, data};
use rand::SeedableRng;
use rand_chacha::ChaCha12Rng;
use serde_json::Value;

/// An L with a notch, mm; no symmetry.
const DESIGN: [[f64; 2]; 8] =
    [[0.0, 0.0], [80.0, 0.0], [80.0, 30.0], [52.0, 30.0], [45.0, 48.0], [38.0, 30.0], [25.0, 90.0], [0.0, 90.0]];

fn first_line(out: &str) -> Value {
    serde_json::from_str(out.lines().next().unwrap()).unwrap()
}

/// Return rotation (row by row) and translation of a pose.
fn pose_of(value: &Value) -> ([f64; 9], [f64; 3]) {
    let rows = value["rotation"].as_array().unwrap().iter().flat_map(|row| row.as_array().unwrap());
    let rotation: Vec<f64> = rows.map(|v| v.as_f64().unwrap()).collect();
    let translation: Vec<f64> = value["translation"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    (rotation.try_into().unwrap(), translation.try_into().unwrap())
}

/// Return the angle between two rotations, degrees, and the distance of two places as a share of the second.
fn apart((r, t): &([f64; 9], [f64; 3]), (q, u): &([f64; 9], [f64; 3])) -> (f64, f64) {
    let transposed = [0, 3, 6, 1, 4, 7, 2, 5, 8].map(|k: usize| r[k]);
    let turn = rotation_log(&cfpose_optim::manifold::multiply3(&transposed, q));
    let norm = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    (norm(turn).to_degrees(), norm([t[0] - u[0], t[1] - u[1], t[2] - u[2]]) / norm(*u))
}

#[test]
fn a_design_in_millimetres_is_found_in_a_frame() {
    let desk = Desk::new();
    let points: String = DESIGN.iter().fold(String::new(), |mut text, [x, y]| {
        write!(text, "{},{} ", 2.0 * x, 2.0 * y).unwrap();
        text
    });
    // Half a millimetre a unit.
    desk.write(
        "design.svg",
        format!(r#"<svg xmlns="http://www.w3.org/2000/svg" width="100mm" viewBox="0 0 200 200"><polygon points="{points}"/></svg>"#),
    );
    desk.write("design.csv", DESIGN.iter().map(|[x, y]| format!("{x},{y}\n")).collect::<String>());
    let (rotation, translation) = (rotation_exp(&[0.3, -0.2, 0.4]), [-30.0, -40.0, 260.0]);
    let seen = |p: &[f64; 2]| {
        let at = [0, 1, 2].map(|i: usize| rotation[3 * i] * p[0] + rotation[3 * i + 1] * p[1] + translation[i]);
        [600.0 * at[0] / at[2] + 319.5, 600.0 * at[1] / at[2] + 239.5]
    };
    let patch = Patch { polygon: DESIGN.iter().map(seen).collect(), grey: 40.0 };
    let picture = render(640, 480, &[patch], &Exposure::default(), &mut ChaCha12Rng::seed_from_u64(5));
    desk.write("frame.png", to_png(&picture.to_rgb()).unwrap());
    for design in ["design.svg", "design.csv"] {
        let run =
            desk.run(&format!("register {design} frame.png --camera 600,600,319.5,239.5 --json - --transfer linear"));
        assert_eq!(run.code, 0, "{design}: {}", run.err);
        let line = first_line(&run.out);
        let (degrees, share) = apart(&pose_of(&line["pose"]), &(rotation, translation));
        println!("{design}: {degrees:.3} deg, {:.3} %, {}", 100.0 * share, line["verdict"]);
        assert!(degrees < 0.1 && share < 1e-3, "{design}: {degrees} {share}\n{line}");
        assert_eq!(line["verdict"], "good");
    }
    desk.write("empty.svg", "<svg/>");
    assert!(desk.fails(3, "register empty.svg frame.png").contains("no dark shape"));
    desk.write("broken.csv", "0,0\n1,0\n1,b\n");
    assert!(desk.fails(3, "register broken.csv frame.png").contains("line 3"));
}

/// Return the standard deviations of a place (y, x from the centre of the turn) under the covariance of angle and translation.
fn shift_deviations(covariance: &Value, [y, x]: [f64; 2]) -> [f64; 2] {
    let at = |i: usize, j: usize| covariance[i][j].as_f64().unwrap_or(f64::NAN);
    [(-y, 1), (x, 2)].map(|(arm, k)| (arm * arm * at(0, 0) + 2.0 * arm * at(0, k) + at(k, k)).sqrt())
}

#[test]
fn regions_shifted_by_parts_of_a_pixel_do_not_lock_onto_the_lattice() {
    let desk = Desk::new();
    let outline = |shift: [f64; 2]| -> Vec<[f64; 2]> {
        let ring = (0..400).map(|k| f64::from(k) / 400.0 * std::f64::consts::TAU);
        let radius = |t: f64| 60.0 * (1.0 + 0.2 * (2.0 * t).cos() + 0.12 * (3.0 * t + 0.7).sin());
        ring.map(|t| [110.0 + shift[0] + radius(t) * t.cos(), 110.0 + shift[1] + radius(t) * t.sin()]).collect()
    };
    let write = |name: &str, shift: [f64; 2]| {
        let drawn = coverage(&outline(shift), 220, 220);
        let all = (0..220).flat_map(|y| (0..220).map(move |x| (x, y)));
        let rows = all.map(|(x, y)| (x, y, drawn.at(x, y))).filter(|row| row.2 > 0.0);
        desk.write(
            &format!("{name}.csv"),
            rows.fold("x,y,w\n".to_string(), |text, (x, y, w)| text + &format!("{x},{y},{w:.4}\n")),
        );
        let codes: Vec<u8> = drawn.values().iter().map(|v| if *v > 0.5 { 255 } else { 0 }).collect();
        let shares: Vec<u8> = drawn.values().iter().map(|v| (40.0 + 160.0 * v).round() as u8).collect();
        for (kind, codes) in [("png", codes), ("soft.png", shares)] {
            let picture = cfpose_vision::Picture::from_grey(220, 220, &codes).unwrap();
            desk.write(&format!("{name}.{kind}"), to_png(&picture.to_rgb()).unwrap());
        }
    };
    write("still", [0.0, 0.0]);
    for shift in [[0.25, 0.3], [0.5, 0.3], [0.75, 0.3]] {
        write("moved", shift);
        for (command, kind, limit) in [
            ("estimate --model rigid2 --source still.csv --target moved.csv", "estimate csv", 0.02),
            ("estimate --model rigid2 --source still.png --target moved.png", "estimate png", 0.1),
            ("register still.png moved.png --model rigid2", "register png", 0.1),
            ("register still.soft.png moved.soft.png --model rigid2 --transfer linear", "register soft png", 0.02),
        ] {
            let run = desk.run(&format!("{command} --json -"));
            assert!(run.code == 0 || run.code == 4, "{command}: {}", run.err);
            let value: Value = match command.starts_with("register") {
                true => first_line(&run.out),
                false => serde_json::from_str(&run.out).unwrap(),
            };
            let theta: Vec<f64> = value["theta"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
            let (sine, cosine) = theta[0].sin_cos();
            let centre = [cosine * 110.0 - sine * 110.0 + theta[1], sine * 110.0 + cosine * 110.0 + theta[2]];
            let off = [0, 1].map(|d| (centre[d] - 110.0 - shift[d]).abs());
            let sd = shift_deviations(&value["covariance"], [centre[1] - theta[2], centre[0] - theta[1]]);
            println!("{kind} {shift:?}: {off:.4?} {} sd {sd:.4?}", value["verdict"]);
            assert!(off.iter().all(|v| *v < limit), "{kind} {shift:?}: {off:?}");
            let wide = (0..2).any(|d| off[d] > 4.0 * sd[d]);
            assert!(!(wide && value["verdict"] == "good"), "{kind} {shift:?}: {off:?} with {sd:?} is good");
        }
    }
}

#[test]
fn a_sequence_is_followed_without_segmenting_its_frames() {
    let sequence = SEQUENCES.iter().find(|sequence| sequence.name == "track-bar").unwrap();
    let summary = measure_sequence(sequence, 3).unwrap();
    println!("{summary:?}");
    assert_eq!(summary.lost, 0);
    assert!(summary.mean_px < 0.05, "{summary:?}");
    assert!(summary.followed > 50, "{summary:?}");
}

#[test]
fn blurred_noisy_unevenly_lit_frames_are_registered_to_a_tenth_of_a_pixel() {
    let cell = CELLS.iter().find(|cell| cell.name == "all").unwrap();
    let summary = summarise(&measure(cell, 5, 6));
    println!("{summary:?}");
    assert!(summary.below[1] == 1.0 && summary.median_px < 0.1, "{summary:?}");
    assert_eq!(summary.wrong_but_good, 0);
}

#[test]
#[cfg_attr(not(shared_data), ignore = "no real data: set CFPOSE_DATA to their folder")]
fn given_pairs_are_registered_below_their_limits() {
    let folder = data().join("register");
    let truth: Value = serde_json::from_str(&std::fs::read_to_string(folder.join("truth.json")).unwrap()).unwrap();
    let desk = Desk::new();
    for pair in truth.as_array().unwrap() {
        let name = pair["name"].as_str().unwrap();
        let file = |part: &str| folder.join(format!("{name}_{part}.png")).display().to_string();
        let line = format!("register {} {} --camera 600,600,319.5,239.5 --json -", file("reference"), file("frame"));
        let run = desk.run(&line);
        let found = first_line(&run.out);
        let matrix = |value: &Value| -> [f64; 9] {
            let rows = value.as_array().unwrap().iter().flat_map(|row| row.as_array().unwrap());
            rows.map(|v| v.as_f64().unwrap()).collect::<Vec<_>>().try_into().unwrap()
        };
        let (h, known) = (matrix(&found["homography"]), matrix(&pair["homography"]));
        let places = pair["test_points_px"].as_array().unwrap();
        let errors = places.iter().map(|place| {
            let p = [0, 1].map(|d: usize| place[d].as_f64().unwrap());
            let (a, b) = (apply(&h, p), apply(&known, p));
            (a[0] - b[0]).hypot(a[1] - b[1])
        });
        let error = errors.sum::<f64>() / places.len() as f64;
        println!("{name}: {error:.4} px, {}", found["verdict"]);
        assert!(error < if name.starts_with("hard") { 0.5 } else { 0.3 }, "{name}: {error} px");
    }
}

#[test]
#[cfg_attr(not(shared_data), ignore = "no real data: set CFPOSE_DATA to their folder")]
fn the_dark_squares_of_a_chessboard_are_found_from_a_rough_start() {
    let folder = data().join("opencv_chess");
    let text = std::fs::read_to_string(folder.join("left_intrinsics.yml")).unwrap();
    let list = text.split("extrinsic_parameters").nth(1).unwrap();
    let list = list.split('[').nth(1).unwrap().split(']').next().unwrap();
    let numbers: Vec<f64> = list.split(',').map(|v| v.trim().parse().unwrap()).collect();
    let desk = Desk::new();
    // The squares whose dark ones touch the origin of the calibration, 25 mm, x and y from the first inner corner.
    let squares = (-1..9).flat_map(|i| (-1..6).map(move |j| (i, j))).filter(|(i, j)| (i + j) % 2 == 0);
    let corner = |x: i32, y: i32| format!("{},{}\n", 25 * x, 25 * y);
    let text =
        squares.map(|(i, j)| corner(i, j) + &corner(i + 1, j) + &corner(i + 1, j + 1) + &corner(i, j + 1) + "\n");
    desk.write("squares.csv", text.collect::<String>());
    let (mut within, mut good) = (0, 0);
    for (k, row) in numbers.chunks(6).take(7).enumerate() {
        let truth = (rotation_exp(&[row[0], row[1], row[2]]), [1e3 * row[3], 1e3 * row[4], 1e3 * row[5]]);
        let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
        let start = [
            row[0] + 0.03 * sign,
            row[1] - 0.03,
            row[2] + 0.02,
            truth.1[0] + 3.0,
            truth.1[1] - 3.0 * sign,
            truth.1[2] * (1.0 + 0.015 * sign),
        ];
        let start: Vec<String> = start.iter().map(f64::to_string).collect();
        let run = desk.run(&format!(
            "register squares.csv {} --camera {} --start-pose {} --json -",
            folder.join(format!("left0{}.jpg", k + 1)).display(),
            folder.join("left_intrinsics.yml").display(),
            start.join(",")
        ));
        let line = first_line(&run.out);
        if line["pose"].is_null() {
            println!("left0{}: {}", k + 1, line["warnings"]);
            continue;
        }
        let (degrees, share) = apart(&pose_of(&line["pose"]), &truth);
        println!("left0{}: {degrees:.2} deg, {:.2} %, {}", k + 1, 100.0 * share, line["verdict"]);
        within += usize::from(degrees < 2.0 && share < 0.02);
        good += usize::from(line["verdict"] == "good");
        assert!(line["verdict"] != "good" || (degrees < 2.0 && share < 0.02), "{line}");
    }
    assert!(within >= 6, "{within} of 7, {good} good");
}

#[test]
fn a_pattern_of_one_colour_is_found_by_its_hue() {
    let desk = Desk::new();
    let outline = |shift: [f64; 2]| -> Vec<[f64; 2]> {
        let ring = (0..300).map(|k| f64::from(k) / 300.0 * std::f64::consts::TAU);
        let radius = |t: f64| 50.0 * (1.0 + 0.2 * (2.0 * t).cos() + 0.12 * (3.0 * t + 0.7).sin());
        ring.map(|t| [100.0 + shift[0] + radius(t) * t.cos(), 90.0 + shift[1] + radius(t) * t.sin()]).collect()
    };
    // Red on green of nearly the same brightness, under light that falls off to the right; a blue bar in front of the second one.
    let (red, green, blue) = ([0.42, 0.07, 0.05], [0.08, 0.17, 0.07], [0.05, 0.06, 0.4]);
    let write = |name: &str, shift: [f64; 2], bar: bool| {
        let cover = coverage(&outline(shift), 220, 180);
        let image = image::RgbImage::from_fn(220, 180, |x, y| {
            let w = f64::from(cover.at(x as usize, y as usize));
            let light = 1.0 - 0.3 * f64::from(x) / 220.0;
            let hidden = bar && (60..80).contains(&y) && x < 90;
            let colour = [0, 1, 2].map(|c| if hidden { blue[c] } else { w * red[c] + (1.0 - w) * green[c] });
            image::Rgb(colour.map(|v| (255.0 * cfpose_vision::Transfer::Srgb.code((light * v) as f32)).round() as u8))
        });
        desk.write(name, to_png(&image).unwrap());
    };
    write("still.png", [0.0, 0.0], false);
    write("moved.png", [7.4, -5.3], true);
    let run = desk.run("register still.png moved.png --model rigid2 --hue 0 --transfer srgb --json -");
    let line = first_line(&run.out);
    let theta: Vec<f64> = line["theta"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    let (sine, cosine) = theta[0].sin_cos();
    let centre = [cosine * 100.0 - sine * 90.0 + theta[1], sine * 100.0 + cosine * 90.0 + theta[2]];
    let off = [centre[0] - 107.4, centre[1] - 84.7];
    println!("{off:.4?} {}", line["verdict"]);
    assert!(off.iter().all(|v| v.abs() < 0.05), "{off:?}");
    // With the bar in front the pose is right and called `suspect`, with the reason.
    assert!(line["verdict"] == "good" || line["warnings"][0].as_str().unwrap().contains(" px off "), "{line}");
    // A hue that the reference does not have is said.
    assert!(desk.fails(3, "register still.png moved.png --model rigid2 --hue 280").contains("give another --hue"));
}
