//! Every kind of bad input ends with its exit code and one clear line.

mod common;

use common::{Desk, cloud};
use insta::assert_snapshot;

const RIGID: &str = "estimate --model rigid3 --target good.csv --source";

fn desk() -> Desk {
    let desk = Desk::new();
    desk.write_rows("good.csv", &cloud(50, 1));
    desk
}

#[test]
fn text_files() {
    let desk = desk();
    desk.write("empty.csv", "");
    assert_snapshot!(desk.fails(3, &format!("{RIGID} empty.csv")), @"error: empty.csv: the file is empty; a point file has one row a point");
    desk.write("nan.csv", "x,y,z\n1,2,3\n4,nan,6\n7,8,9\n");
    assert_snapshot!(desk.fails(3, &format!("{RIGID} nan.csv")), @"error: nan.csv: line 3: y is NaN, not a finite number; remove or repair this row");
    desk.write("one.xyz", "1 2 3\n");
    assert_snapshot!(desk.fails(3, &format!("{RIGID} one.xyz")), @"error: one.xyz: only 1 distinct point(s); an estimate needs at least 2");
    desk.write("ragged.txt", "1 2 3\n4 5\n");
    assert_snapshot!(desk.fails(3, &format!("{RIGID} ragged.txt")), @"error: ragged.txt: line 2: 2 columns, but the rows above have 3; give every row the same number of columns");
    desk.write("wide.csv", "1,2,3,4\n5,6,7,8\n");
    assert_snapshot!(desk.fails(3, &format!("{RIGID} wide.csv")), @"error: wide.csv: line 1: 4 columns; points have 1, 2 or 3 columns and, if a header names it, a column w of weights; choose them with --columns 1,2,3");
    desk.write("flat.csv", "1,2\n3,4\n5,6\n");
    assert_snapshot!(desk.fails(3, &format!("{RIGID} flat.csv")), @"error: flat.csv: source points have 2 coordinates, model `rigid3` takes 3; give points of 3, or a model for 2");
    desk.write("equal.csv", "1,2,3\n1,2,3\n1,2,3\n");
    assert_snapshot!(desk.fails(3, &format!("{RIGID} equal.csv")), @"error: equal.csv: only 1 distinct point(s); an estimate needs at least 2");
    desk.write("word.csv", "1,2,3\n4,five,6\n");
    assert_snapshot!(desk.fails(3, &format!("{RIGID} word.csv")), @r#"error: word.csv: line 2: y is "five", not a number; a comment starts with #"#);
    assert_snapshot!(desk.fails(3, &format!("{RIGID} absent.csv")), @"error: absent.csv: there is no such file; check the name and the folder");
    assert_snapshot!(desk.fails(3, "estimate --model rigid3 --source good.csv --target equal.csv"), @"error: equal.csv: only 1 distinct point(s); an estimate needs at least 2");
    desk.write("line.csv", "1,2,3\n2,4,6\n3,6,9\n");
    let line = "estimate --model rigid3 --source good.csv --target line.csv --normalise whiten";
    assert_snapshot!(desk.fails(3, line), @"error: line.csv: normaliser `whiten`: the target points have no spread in some direction; use more points or another normaliser");
}

#[test]
fn sizes_that_no_arithmetic_holds_and_rays_without_a_direction() {
    let desk = desk();
    for (file, scale, expected) in [
        ("huge.csv", "e200", "a coordinate of size 3e200 overflows when it is squared; rescale the file"),
        ("tiny.csv", "e-200", "the points lie within 2e-200, which underflows when it is squared; rescale the file"),
    ] {
        desk.write(file, format!("1{scale},0,0\n3{scale},0,0\n2{scale},0,1{scale}\n"));
        for line in [format!("{RIGID} {file}"), RIGID.replace("good.csv", file) + " good.csv"] {
            assert_eq!(desk.fails(3, &line), format!("error: {file}: {expected}"));
        }
    }
    desk.write("rays.csv", "0,0,1\n0.1,0.2,1\n0,0,0\n0.3,0.1,1\n");
    let line = "estimate --model bearing3 --source good.csv --target rays.csv";
    assert_eq!(desk.fails(3, line), "error: rays.csv: point 3: the ray 0 0 0 has no direction; remove it");
    desk.write("none.txt", "# no pose\n");
    for file in ["none.txt", "empty.txt"] {
        desk.write("empty.txt", "");
        let expected = format!("error: {file}: the file holds no pose; give 4x4, 3x4, TUM or KITTI rows, or JSON");
        assert_eq!(desk.fails(3, &format!("pose convert {file} --to tum")), expected);
    }
}

#[test]
fn binary_files() {
    let desk = desk();
    let header = |count: &str| {
        format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {count}\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
        )
    };
    let body = |points: usize| (0..3 * points).flat_map(|i| (i as f32).to_le_bytes()).collect::<Vec<u8>>();
    desk.write("cut.ply", [header("4").into_bytes(), body(3), vec![0, 0]].concat());
    assert_snapshot!(desk.fails(3, &format!("{RIGID} cut.ply")), @r#"error: cut.ply: the header claims 4 elements of "vertex", the file holds 3; it is truncated or its header is wrong"#);
    desk.write("claims.ply", [header("1000000000000000").into_bytes(), body(10)].concat());
    assert_snapshot!(desk.fails(3, &format!("{RIGID} claims.ply")), @r#"error: claims.ply: the header claims 1000000000000000 elements of "vertex", the file holds 10; it is truncated or its header is wrong"#);
    desk.write("claims.pcd", "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 9\nHEIGHT 1\nPOINTS 9\nDATA ascii\n1 2 3\n");
    assert_snapshot!(desk.fails(3, &format!("{RIGID} claims.pcd")), @"error: claims.pcd: the header claims 9 points, the file holds 1; it is truncated or its header is wrong");
    desk.write("noise.npy", [0x93_u8, b'N', b'U', b'M', b'P', b'Y', 9, 9, 1]);
    assert_snapshot!(desk.fails(3, &format!("{RIGID} noise.npy")), @"error: noise.npy: the header is cut off; write the file again with a tool that knows the format");
    desk.write("empty.obj", "# nothing\n");
    assert_snapshot!(desk.fails(3, &format!("{RIGID} empty.obj")), @"error: empty.obj: the file holds no points; give one row a point");
    assert_snapshot!(desk.fails(3, &format!("{RIGID} good.cvs")), @r#"error: good.cvs: no format has the extension "cvs" (did you mean "csv"?); known are csv, txt, xyz, asc, tsv, pts, ply, obj, stl, pcd, las, laz, npy, npz, png, jpg, jpeg"#);
    assert_snapshot!(desk.fails(3, &format!("{RIGID} .")), @r#"error: .: no format has the extension ""; known are csv, txt, xyz, asc, tsv, pts, ply, obj, stl, pcd, las, laz, npy, npz, png, jpg, jpeg"#);
}

#[test]
fn starts_and_poses() {
    let desk = desk();
    let line = format!("{RIGID} good.csv");
    assert_snapshot!(desk.fails(3, &format!("{line} --start absent.txt")), @"error: absent.txt: there is no such file; check the name and the folder");
    for flag in ["--pipeline absent.toml", "--prior absent.json", "--features learned[file=absent.json]"] {
        let said = desk.fails(3, &format!("{line} {flag}"));
        assert!(said.ends_with(": there is no such file; check the name and the folder"), "{said}");
    }
    desk.write("short.txt", "1 2 3 4\n");
    assert_snapshot!(desk.fails(3, &format!("{line} --start short.txt")), @"error: short.txt: theta needs 6 numbers (rotation 3 + translation 3), found 4");
    desk.write("scaled.txt", "2 0 0 0\n0 2 0 0\n0 0 2 0\n0 0 0 1\n");
    assert_snapshot!(desk.fails(3, &format!("{line} --start scaled.txt")), @"error: scaled.txt: line 1: the 3x3 part is no rotation (orthonormal, determinant 1); give 4x4, 3x4, TUM or KITTI rows, or JSON");
    assert_snapshot!(desk.fails(3, "pose convert scaled.txt --to tum"), @"error: scaled.txt: line 1: the 3x3 part is no rotation (orthonormal, determinant 1); give 4x4, 3x4, TUM or KITTI rows, or JSON");
    assert_snapshot!(desk.fails(2, &format!("{line} --start 1,2,3")), @"error: --start: theta needs 6 numbers (rotation 3 + translation 3), found 3");
    assert_snapshot!(desk.fails(2, &format!("{line} --start=1,2,inf,0,0,0")), @"error: --start: number 3 of theta is inf, not a finite number");
}

/// Tables grow: the nearest name comes first, others may follow.
#[test]
fn unknown_names_suggest_known_ones() {
    let desk = desk();
    let line = "estimate --source good.csv --target good.csv --model";
    let cases = [
        ("rigid33", "model `rigid33`; did you mean rigid3", "models"),
        ("rigid3 --features trig81", "family `trig81`; did you mean trig18", "families"),
        ("rigid3 --solver levenberg", "solver `levenberg`; did you mean levenberg-marquardt", "solvers"),
        ("rigid3 --normalise whitened", "normaliser `whitened`; did you mean whiten", "normalisers"),
        ("rigid3 --weighting identiy", "weighting `identiy`; did you mean identity", "weightings"),
        ("rigid3 --preset papper", "preset `papper`; did you mean auto or paper", "presets"),
    ];
    for (arguments, begin, table) in cases {
        let message = desk.fails(2, &format!("{line} {arguments}"));
        assert!(message.starts_with(&format!("error: unknown {begin}")), "{message}");
        assert!(message.ends_with(&format!("?; `cfpose list {table}` shows all")), "{message}");
        assert_eq!(desk.run(&format!("list {table}")).code, 0);
    }
    let line = format!("{line} rigid3");
    assert_snapshot!(desk.fails(2, &format!("{line} --features hermite[deg=3]")), @"error: family `hermite` has no parameter `deg`; did you mean degree or kind or scale?");
    assert_snapshot!(desk.fails(2, &format!("{line} --features hermite[degree=99]")), @"error: parameter `degree` = `99`: expected a whole number from 1 to 8");
    assert_snapshot!(desk.fails(2, &format!("{line} --features hermite[degree=3")), @"error: cannot read `hermite[degree=3`: the bracket is not closed at the end; write name or name[key=value,key=value]");
    let start = desk.fails(2, &format!("{line} --start pcaa"));
    assert!(start.starts_with("error: --start `pcaa` is no strategy (`cfpose list starts`)"), "{start}");
    assert!(start.contains("did you mean pca"), "{start}");
    let check = desk.fails(2, "check rigid4");
    assert!(check.starts_with("error: `rigid4` is no model, family or solver; did you mean rigid"), "{check}");
    let isa = desk.fails(2, &format!("{line} --isa avx9"));
    assert!(isa.starts_with("error: instruction set `avx9` is not available here; use auto, "), "{isa}");
    for (line, suggestion) in
        [("estimat", "'estimate'"), ("list model", "'models'"), ("list models --jsn -", "'--json'")]
    {
        let run = desk.run(line);
        assert!(run.code == 2 && run.err.contains(suggestion), "{}", run.err);
    }
}

#[test]
fn arguments_that_do_not_fit_together() {
    let desk = desk();
    desk.write("p.csv", "1\n2\n3\n");
    let line = format!("{RIGID} good.csv");
    assert_snapshot!(desk.fails(2, &format!("{line} --preset paper --features coordinates")), @"error: 3 feature function(s) cannot determine 6 unknowns; use a larger family or fix parameters");
    assert_snapshot!(desk.fails(2, &format!("{line} --camera 1,2,3")), @"error: --camera is `1,2,3`; give fx,fy,cx,cy in pixels, focal lengths above 0");
    assert_snapshot!(desk.fails(2, &format!("{line} --camera 0,1,0,0")), @"error: --camera is `0,1,0,0`; give fx,fy,cx,cy in pixels, focal lengths above 0");
    assert_snapshot!(desk.fails(2, &format!("{line} --depth 2")), @"error: --depth does not apply to model `rigid3`, whose translation is in the units of the files; leave it out");
    assert_snapshot!(desk.fails(2, &format!("{line} --free rx,w")), @"error: --free: `w` is no parameter of this model; it has rx, ry, rz, tx, ty, tz");
    assert_snapshot!(desk.fails(2, &format!("{line} --transformed-out x.dwg")), @r#"error: --transformed-out: no format has the extension "dwg" (did you mean "jpg"?); known are csv, txt, xyz, asc, tsv, pts, ply, obj, stl, pcd, las, laz, npy, npz, png, jpg, jpeg"#);
    let gain = "estimate --model gain1 --source p.csv --target p.csv";
    assert_snapshot!(desk.fails(2, &format!("{gain} --start pca")), @"error: start `pca` needs a rigid motion, similarity or affine map; use identity, grid or a theta");
    assert_snapshot!(desk.fails(2, &format!("{gain} --pose-out pose.txt")), @"error: --pose-out: model `gain1` has no pose; use --json");
    assert_snapshot!(desk.fails(2, "evaluate --model gain1 --source p.csv --target p.csv --at one"), @"error: --at `one` is no list of numbers");
    let run = desk.run(&format!("{gain} --json absent/r.json"));
    assert_eq!(run.code, 3);
    assert!(run.err.starts_with("error: absent/r.json: "), "{}", run.err);
}

#[test]
fn a_run_without_a_usable_result_still_writes_its_json() {
    let desk = Desk::new();
    // The start puts a point into the camera's centre: its ray does not exist.
    desk.write("p.csv", "0,0,1\n1,0,2\n0,1,3\n1,1,1\n0.5,0.2,1\n0.1,0.7,2\n");
    desk.write("q.csv", "0,0\n0.1,0.2\n0.2,0.3\n0.4,0.1\n0.3,0.5\n0.6,0.2\n");
    let line = "estimate --model bearing3 --preset paper --source p.csv --target q.csv --start=0,0,0,0,0,-1 --json -";
    let run = desk.run(line);
    assert_eq!(run.code, 4, "{}{}", run.out, run.err);
    let result: serde_json::Value = serde_json::from_str(&run.out).unwrap();
    assert_eq!((&result["usable"], &result["verdict"]), (&false.into(), &"failed".into()));
    assert_eq!(result["status"], "numerical-failure");
    assert_eq!(result["cost"], serde_json::Value::Null);
    assert!(run.err.contains("error: no usable result: numerical-failure"), "{}", run.err);
    // Neither a pose nor points come out, nor is what is there overwritten.
    desk.write("old.txt", "before");
    let line = line.replace("--json -", "--json r.json --pose-out old.txt --transformed-out new.csv");
    assert_eq!(desk.run(&line).code, 4);
    assert_eq!((desk.read("old.txt").as_str(), desk.path("new.csv").exists()), ("before", false));
    assert!(desk.read("r.json").contains("\"usable\":false"));
}
