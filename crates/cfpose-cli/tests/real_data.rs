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
