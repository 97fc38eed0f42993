//! The Stanford bunny, sampled twice and moved by a full rotation.

mod common;

use common::{Desk, apply, data, degrees_between, pose_of, random_pose};

#[test]
#[cfg_attr(not(shared_data), ignore = "no real data: set CFPOSE_DATA to their folder")]
fn the_bunny_finds_its_coarse_copy_from_any_rotation() {
    let folder = data().join("bunny");
    let desk = Desk::new();
    let fine = folder.join("stanford-bunny.obj");
    let coarse = cfpose_vision::read_points(&folder.join("bun_zipper_res3.ply"), &Default::default()).unwrap().points;
    let rows: Vec<Vec<f64>> = (0..coarse.len()).map(|k| coarse.point(k).to_vec()).collect();
    for seed in 0..10 {
        let truth = random_pose(seed, 1.0);
        desk.write_rows("q.csv", &apply(&truth, &rows));
        let line = format!(
            "estimate --model rigid3 --source {} --target q.csv --features hermite[degree=3,kind=total] --start pca",
            fine.display()
        );
        let result = desk.json(&line);
        let degrees = degrees_between(&pose_of(&result["pose"]), &truth);
        println!("seed {seed}: {degrees:.3} deg in {:.3} s", result["seconds"].as_f64().unwrap());
        assert!(degrees < 6.0, "seed {seed}: {degrees} deg");
    }
}

#[test]
#[cfg_attr(not(shared_data), ignore = "no real data: set CFPOSE_DATA to their folder")]
fn a_search_over_yaw_alone_finds_any_yaw() {
    let points = cfpose_vision::read_points(&data().join("cases/yaw_source.csv"), &Default::default()).unwrap().points;
    let all: Vec<Vec<f64>> = (0..points.len()).map(|k| points.point(k).to_vec()).collect();
    // Two independent samples of one shape, 1500 points a side.
    let (source, other): (Vec<_>, Vec<_>) = all.into_iter().enumerate().partition(|(k, _)| k % 2 == 0);
    let rows = |part: Vec<(usize, Vec<f64>)>| part.into_iter().take(1500).map(|(_, row)| row).collect::<Vec<_>>();
    let (source, other) = (rows(source), rows(other));
    assert_eq!((source.len(), other.len()), (1500, 1500));
    let desk = Desk::new();
    desk.write_rows("p.csv", &source);
    for seed in 0..12 {
        let yaw = std::f64::consts::TAU * (f64::from(seed) * 0.618_034).fract() - std::f64::consts::PI;
        let truth = common::euler_pose([0.0, 0.0, yaw], [0.3, -0.2, 0.1 * f64::from(seed)]);
        desk.write_rows("q.csv", &apply(&truth, &other));
        let result = desk.json("estimate --model rigid3 --source p.csv --target q.csv --free rz,tx,ty,tz");
        let degrees = degrees_between(&pose_of(&result["pose"]), &truth);
        println!("yaw {:.1} deg: {degrees:.3} deg off, {}", yaw.to_degrees(), result["verdict"]);
        assert!(degrees < 1.0, "yaw {yaw}: {degrees} deg");
        assert_eq!((&result["theta"][0], &result["theta"][1]), (&0.0.into(), &0.0.into()));
    }
}
