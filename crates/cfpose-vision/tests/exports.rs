//! Rows and columns as other programs export them.

mod common;

use cfpose::{Attribute, Points};
use cfpose_vision::{Invalid, ReadOptions, read_mesh, read_points, read_poses};
use common::{gzip, las, npy, npy_f8, read, read_with, rows, stl, zip};

fn columns(list: &[&str]) -> ReadOptions {
    ReadOptions { columns: list.iter().map(|name| name.to_string()).collect(), ..ReadOptions::default() }
}

const XYZ: [[f64; 3]; 2] = [[1.0, 2.0, 3.0], [4.0, 5.5, -6.0]];

/// A header for the coordinates in the order y, z, x, with a column that is none at the end.
fn shuffled(header: &str) -> String {
    format!("{header}\n2,3,1,9\n5.5,-6,4,9\n")
}

#[test]
fn columns_are_found_by_names_with_units_and_words_around_them() {
    for header in [
        "y,z,x,label",
        "Y [m],Z [m],X [m],intensity",
        "northing,height,easting,id",
        "Northing (m),Elevation (m),Easting (m),code",
        "Points:1,Points:2,Points:0,Normals:0",
        "points_1,points_2,points_0,time",
        "pos_y,pos_z,pos_x,r",
        "position.y,position.z,position.x,velocity.x",
        "Y Coordinate,Z Coordinate,X Coordinate,Red",
        "x2,x3,x1,t",
        "V2,V3,V1,label",
        "y,elevation,x,return",
        "\"y, m\",\"z, m\",\"x, m\",\"n\"",
        "y_mm,z_mm,x_mm,w_mm",
    ] {
        let file = read("a.csv", shuffled(header)).unwrap_or_else(|error| panic!("{header}: {error}"));
        assert_eq!(rows(&file), XYZ, "{header}");
        assert!(file.points.is_uniform() && file.notes.len() == 1, "{header}: {:?}", file.notes);
        assert!(file.notes[0].starts_with("columns not read: "), "{:?}", file.notes);
    }
    for (header, expected) in [
        ("v,u", [[1.0, 2.0], [3.0, 4.0]]),
        ("row,col", [[1.0, 2.0], [3.0, 4.0]]),
        ("pixel_y [px],pixel_x [px]", [[1.0, 2.0], [3.0, 4.0]]),
        ("b,a", [[1.0, 2.0], [3.0, 4.0]]),
    ] {
        assert_eq!(rows(&read("a.csv", format!("{header}\n2,1\n4,3\n")).unwrap()), expected, "{header}");
    }
}

#[test]
fn names_that_say_nothing_are_refused_with_a_choice_that_works() {
    for (header, names) in [
        ("lat,lon,alt", "lat, lon, alt"),
        ("foo,bar,baz", "foo, bar, baz"),
        ("target_x,target_y,target_z", "target_x, target_y, target_z"),
        ("range,azimuth,elevation_angle", "range, azimuth, elevation_angle"),
        ("x,y,depth", "x, y, depth"),
        ("easting,northing,down", "easting, northing, down"),
        ("x1,y1,x2", "x1, y1, x2"),
        ("p1,p2,q3", "p1, p2, q3"),
        ("x4294967295,x1,x2", "x4294967295, x1, x2"),
    ] {
        let text = format!("{header}\n1,2,3\n4,5.5,-6\n");
        let message = read("a.csv", &text).map(|file| rows(&file));
        let expected =
            format!("line 2: the columns {names} do not say which are coordinates; choose them with --columns 1,2,3");
        assert_eq!(message.unwrap_err(), expected);
        assert_eq!(rows(&read_with("a.csv", &text, &columns(&["1", "2", "3"])).unwrap()), XYZ, "{header}");
    }
    // What is offered holds numbers.
    let message = read("a.csv", "name,foo,bar\nA,1,2\nB,3,4\n").unwrap_err();
    assert!(message.ends_with("--columns 2,3"), "{message}");
    let message = read("a.csv", "A,1,2,3\nB,3,4,5\n").unwrap_err();
    assert!(message.ends_with("--columns 2,3,4"), "{message}");
    let message = read("a.csv", "u,v,w\n1,2,3\n4,5.5,-6\n").unwrap_err();
    assert!(message.contains("--columns u,v,w or --columns u,v --weight-column w"), "{message}");
    assert_eq!(rows(&read_with("a.csv", "u,v,w\n1,2,3\n4,5.5,-6\n", &columns(&["u", "v", "w"])).unwrap()), XYZ);
}

#[test]
fn chosen_columns_and_weights_are_those_that_were_named() {
    let text = "id,x,a b,W,y\n7,1,2,.5,3\n8,4,5,.25,6\n";
    let chosen = read_with("a.csv", text, &columns(&["A B", "5", "x"])).unwrap();
    assert_eq!(rows(&chosen), [[2.0, 3.0, 1.0], [5.0, 6.0, 4.0]]);
    assert_eq!(
        (chosen.points.weights(), &chosen.columns[..]),
        (&[0.5, 0.25][..], &["a b", "y", "x", "W"].map(String::from)[..])
    );
    let weight = ReadOptions { weight_column: Some("id".into()), ..ReadOptions::default() };
    assert_eq!(read_with("a.csv", text, &weight).unwrap().points.weights(), [7.0, 8.0]);
    let plain = ReadOptions { weight_column: Some("4".into()), ..columns(&["1", "2"]) };
    assert_eq!(read_with("a.xyz", "1 2 3 4\n5 6 7 8\n", &plain).unwrap().points.weights(), [4.0, 8.0]);
    let refused = |options: &ReadOptions| read_with("a.csv", text, options).unwrap_err();
    assert_eq!(refused(&columns(&["q"])), "line 2: there is no column \"q\"; the file names id, x, a b, W, y");
    assert_eq!(refused(&columns(&["9"])), "line 2: there is no column \"9\"; the file names id, x, a b, W, y");
    assert_eq!(refused(&columns(&["x", "2"])), "line 2: the column \"2\" is chosen twice; name each column once");
    assert!(refused(&columns(&["1", "2", "3", "5"])).contains("4 columns; points have 1, 2 or 3"));
    // The same in other formats.
    let ply = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float s\nproperty float x\nproperty float t\nend_header\n1 2 3\n4 5 6\n";
    assert_eq!(rows(&read_with("a.ply", ply, &columns(&["t", "s"])).unwrap()), [[3.0, 1.0], [6.0, 4.0]]);
    let pcd = "FIELDS a b\nSIZE 4 4\nTYPE F F\nPOINTS 2\nDATA ascii\n1 2\n4 5\n";
    assert_eq!(rows(&read_with("a.pcd", pcd, &columns(&["b", "a"])).unwrap()), [[2.0, 1.0], [5.0, 4.0]]);
    let wide = npy_f8("(2, 4)", &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
    assert_eq!(rows(&read_with("a.npy", &wide, &columns(&["4", "1"])).unwrap()), [[4.0, 1.0], [8.0, 5.0]]);
    assert!(read("a.npy", &wide).is_err());
    assert_eq!(
        rows(&read_with("a.obj", "v 1 2 3\nv 4 5 6\n", &columns(&["z", "1"])).unwrap()),
        [[3.0, 1.0], [6.0, 4.0]]
    );
}

#[test]
fn normals_are_kept_and_everything_else_is_named_as_not_read() {
    let normal = |points: &Points| match points.attribute("normal") {
        Some(Attribute::Vector(columns)) => columns.clone(),
        other => panic!("{other:?}"),
    };
    let expected = vec![vec![0.0, 1.0], vec![0.0, 0.0], vec![1.0, 0.0]];
    let csv = "x,y,z,nx,ny,nz,intensity\n1,2,3,0,0,1,7\n4,5.5,-6,1,0,0,8\n";
    let ply = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float nx\nproperty float ny\nproperty float nz\nproperty uchar red\n\
               property float x\nproperty float y\nproperty float z\nend_header\n0 0 1 200 1 2 3\n1 0 0 9 4 5.5 -6\n";
    let pcd = "FIELDS x y z normal_x normal_y normal_z curvature\nSIZE 4 4 4 4 4 4 4\nTYPE F F F F F F F\nWIDTH 2\nHEIGHT 1\n\
               DATA ascii\n1 2 3 0 0 1 .1\n4 5.5 -6 1 0 0 .2\n";
    for (name, text, left) in [("a.csv", csv, "intensity"), ("a.ply", ply, "red"), ("a.pcd", pcd, "curvature")] {
        let file = read(name, text).unwrap();
        assert_eq!((rows(&file), normal(&file.points)), (XYZ.map(Vec::from).to_vec(), expected.clone()), "{name}");
        assert_eq!(file.notes, [format!("columns not read: {left}")]);
    }
    let broken = read("a.csv", csv.replace(",1,0,0,8", ",0,0,0,8")).unwrap();
    assert!(broken.points.attribute("normal").is_none());
    assert_eq!(broken.notes[1], "normals are not read: 1 of 2 are zero or not finite");
    assert!(read("a.csv", csv.replace("nz", "curvature")).unwrap().points.attribute("normal").is_none());
}

#[test]
fn text_as_instruments_and_spreadsheets_write_it() {
    for (name, text) in [
        ("a.pts", "2\n1 2 3\n4 5.5 -6\n"),
        ("a.pts", "2\n1 2 3 -77 10 20 30\n4 5.5 -6 -70 1 2 3\n"),
        ("a.xyz", "2\n1 2 3\n4 5.5 -6\n"),
        ("a.asc", "//X Y Z\n1 2 3\n4 5.5 -6\n"),
        ("a.asc", "//X Y Z\n2\n1 2 3\n4 5.5 -6\n"),
        ("a.asc", "//Z Y X Intensity\n3 2 1 9\n-6 5.5 4 9\n"),
        ("a.txt", "% x y z\n1 2 3\n4 5.5 -6\n"),
        ("a.txt", "1,0 2 3\n4 5,5 -6\n"),
        ("a.csv", "x;y;z\n1;2;3\n4;5,5;-6\n"),
        ("a.csv", "1,0\t2,0\t3,0\n4,0\t5,5\t-6,0\n"),
        ("a.csv", "\"x\",\"y\",\"z\"\n\"1\",\"2\",\"3\"\n\"4\",\"5,5\",\"-6\"\n"),
        ("a.tsv", "x\ty\tname\tz\n1\t2\tA B\t3\n4\t5.5\t\t-6\n"),
        ("a.csv", "x,y,z\nm,m,m\n1,2,3\n4,5.5,-6\n"),
        ("a.csv", ",x,y,z\n0,1,2,3\n1,4,5.5,-6\n"),
        ("a.csv", ",0,1,2\n0,1,2,3\n1,4,5.5,-6\n"),
        ("a.csv", "x,y,z,label\n1,2,3,\n4,5.5,-6,b\n"),
        ("a.csv", "x;y;z;\n1;2;3;\n4;5.5;-6;\n"),
        ("a.txt", "X [m]  Y [m]  Z [m]\n1 2 3\n4 5.5 -6\n"),
        ("a.csv", "x,y,z\r1,2,3\r4,5.5,-6\r"),
        ("a.csv", "x,y,z\r\n1,2,3\n4,5.5,-6\r\n"),
        ("a.csv", "\u{feff}x,y,z\n1,2,3\n4,5.5,-6\n"),
        ("a.obj", "\u{feff}v 1 2 3\nv 4 5.5 -6\n"),
        ("a.obj", "v 2 4 6 2\nv 4 5.5 -6 1\n"),
        ("a.obj", "v 1 2 3 .5 .5 .5\rv 4 5.5 -6\r"),
        (
            "a.ply",
            "\u{feff}ply\r\nformat ascii 1.0\r\nelement vertex 2\r\nproperty float x\r\nproperty float y\r\n\
                   property float z\r\nend_header\r\n1 2 3\r\n4 5.5 -6\r\n",
        ),
    ] {
        let file = read(name, text).unwrap_or_else(|error| panic!("{text:?}: {error}"));
        assert_eq!(rows(&file), XYZ, "{text:?}");
        let packed = read(&format!("{name}.gz"), gzip(text.as_bytes())).unwrap();
        assert_eq!((packed.points, packed.format), (file.points, file.format), "{text:?}");
    }
    // One column of whole numbers counts nothing.
    assert_eq!(rows(&read("a.txt", "2\n7\n9\n").unwrap()), [[2.0], [7.0], [9.0]]);
}

#[test]
fn rows_without_a_point_are_skipped_and_counted() {
    let organised =
        "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 2\nHEIGHT 2\nDATA ascii\n1 2 3\nnan nan nan\n4 5.5 -6\n1 2 nan\n";
    let f8 = npy_f8("(3, 3)", &[1.0, 2.0, 3.0, f64::NAN, f64::NAN, f64::NAN, 4.0, 5.5, -6.0]);
    for (name, bytes, skipped) in [
        ("a.csv", b"x,y,z,w\n1,2,3,1\nnan,nan,nan,nan\n4,5.5,-6,1\n".to_vec(), 1),
        ("a.pcd", organised.as_bytes().to_vec(), 2),
        ("a.npy", f8, 1),
        ("a.obj", b"v 1 2 3\nv nan nan nan\nv 4 5.5 -6\n".to_vec(), 1),
    ] {
        let file = read(name, &bytes).unwrap();
        assert_eq!((rows(&file), file.skipped), (XYZ.map(Vec::from).to_vec(), skipped), "{name}");
        let rows = 2 + skipped;
        assert_eq!(
            file.notes[0],
            format!(
                "{skipped} of {rows} rows have no finite coordinates and are skipped; --invalid refuse makes them an error"
            )
        );
        let refuse = ReadOptions { invalid: Invalid::Refuse, ..ReadOptions::default() };
        let message = read_with(name, &bytes, &refuse).unwrap_err();
        assert!(message.contains("x is NaN, not a finite number; remove or repair this row"), "{message}");
    }
    // A row that lost one coordinate is damaged, unless the user says that it may go.
    let damaged = "x,y,z\n1,2,3\n1,,3\n1,NA,3\n1,inf,3\n4,5.5,-6\n";
    assert!(read("a.csv", damaged).unwrap_err().starts_with("line 3: y is \"\", not a number"));
    let skip = ReadOptions { invalid: Invalid::Skip, ..ReadOptions::default() };
    let file = read_with("a.csv", damaged, &skip).unwrap();
    assert_eq!((rows(&file), file.skipped), (XYZ.map(Vec::from).to_vec(), 3));
    // A flat cloud has no missing points of one coordinate.
    let flat = organised.replace("WIDTH 2\nHEIGHT 2", "WIDTH 4\nHEIGHT 1");
    assert!(read("a.pcd", flat).unwrap_err().contains("z is NaN"));
}

#[test]
fn arrays_of_numpy_in_their_forms() {
    let values = XYZ.as_flattened();
    for shape in ["(2, 1, 3)", "(1, 2, 3)", "(2, 3)", "(1, 2, 1, 3)", "(2L, 3L)"] {
        assert_eq!(rows(&read("a.npy", npy_f8(shape, values)).unwrap()), XYZ, "{shape}");
    }
    assert!(read("a.npy", npy_f8("(1, 1, 2, 3)", values)).is_ok());
    let message = read("a.npy", npy_f8("(2, 2, 2)", &[0.0; 8])).unwrap_err();
    assert!(message.ends_with("save array.reshape(-1, array.shape[-1]), one row a point"), "{message}");
    let halves: Vec<u8> =
        [0x3c00u16, 0x4000, 0x4200, 0x4400, 0x4580, 0xc600].iter().flat_map(|h| h.to_le_bytes()).collect();
    assert_eq!(rows(&read("a.npy", npy("'<f2'", "(2, 3)", &halves)).unwrap()), XYZ);
    let item = |[x, y, z]: [f64; 3]| {
        [&(z as f32).to_le_bytes()[..], &[7, 7], &x.to_be_bytes(), &y.to_le_bytes(), &[1, 0]].concat()
    };
    let structured = "[('z', '<f4'), ('', '|V2'), ('x', '>f8'), ('y', '<f8'), ('label', '<u2')]";
    let file = read("a.npy", npy(structured, "(2,)", &XYZ.map(item).concat())).unwrap();
    assert_eq!(
        (rows(&file), &file.notes[..]),
        (XYZ.map(Vec::from).to_vec(), &["columns not read: label".to_string()][..])
    );
    let sub: Vec<u8> = XYZ.iter().flat_map(|row| row.map(|v| (v as f32).to_le_bytes()).concat()).collect();
    assert_eq!(rows(&read("a.npy", npy("[('pos', '<f4', (3,))]", "(2,)", &sub)).unwrap()), XYZ);
    for deflated in [false, true] {
        let one = zip(&[("arr_0.npy", npy_f8("(2, 3)", values))], deflated);
        assert_eq!(rows(&read("a.npz", &one).unwrap()), XYZ);
        let column = |axis: usize| npy_f8("(2,)", &[XYZ[0][axis], XYZ[1][axis]]);
        let three =
            [("y.npy", column(1)), ("x.npy", column(0)), ("z.npy", column(2)), ("K.npy", npy_f8("(3, 3)", &[0.0; 9]))];
        let file = read("a.npz", zip(&three, deflated)).unwrap();
        assert_eq!(
            (rows(&file), &file.notes[..]),
            (XYZ.map(Vec::from).to_vec(), &["arrays not read: K".to_string()][..])
        );
        let named = [("points.npy", npy_f8("(2, 3)", values)), ("colors.npy", npy_f8("(2, 3)", values))];
        assert_eq!(rows(&read("a.npz", zip(&named, deflated)).unwrap()), XYZ);
        let unclear = [("a.npy", npy_f8("(2, 3)", values)), ("b.npy", npy_f8("(2, 3)", values))];
        assert!(read("a.npz", zip(&unclear, deflated)).unwrap_err().contains("several arrays (a, b)"));
    }
}

#[test]
fn scans_and_meshes() {
    for minor in 0..=4 {
        let file = read("a.las", las(minor, &[[-18, -36, -54], [-12, -29, -72]])).unwrap();
        assert_eq!(rows(&file), XYZ, "version 1.{minor}");
    }
    let facets =
        [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0], [1.0, 1.0, 0.5], [0.0, 1.0, 0.0]]];
    let mut ascii = "solid part\n".to_string();
    for facet in facets {
        ascii += "  facet normal 0 0 1\n    outer loop\n";
        facet.iter().for_each(|c: &[f32; 3]| ascii += &format!("      vertex {} {} {}\n", c[0], c[1], c[2]));
        ascii += "    endloop\n  endfacet\n";
    }
    ascii += "endsolid part\n";
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.5]];
    let folder = tempfile::tempdir().unwrap();
    for bytes in [stl(&facets), ascii.clone().into_bytes(), ascii.to_uppercase().into_bytes()] {
        assert_eq!(rows(&read("a.stl", &bytes).unwrap()), corners);
        let path = folder.path().join("a.stl");
        std::fs::write(&path, &bytes).unwrap();
        assert_eq!(read_mesh(&path).unwrap().triangles, [[0, 1, 2], [1, 3, 2]]);
    }
}

#[test]
fn a_format_can_be_named_for_pipes_and_other_names() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cloud.dat");
    std::fs::write(&path, "1 2 3\n4 5.5 -6\n").unwrap();
    let named = |name: &str| ReadOptions { format: Some(name.to_string()), ..ReadOptions::default() };
    assert_eq!(rows(&read_points(&path, &named("XYZ")).unwrap()), XYZ);
    let message = read_points(&path, &named("xyzz")).unwrap_err().to_string();
    assert!(message.contains("no format has the extension \"xyzz\" (did you mean \"xyz\"?)"), "{message}");
    std::fs::write(&path, gzip(b"1 2 3\n4 5.5 -6\n")).unwrap();
    assert_eq!(rows(&read_points(&path, &named("xyz")).unwrap()), XYZ);
}

#[test]
fn the_header_of_a_pose_file_says_where_the_quaternion_stands() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.txt");
    let poses = |text: &str| {
        std::fs::write(&path, text).unwrap();
        let poses = read_poses(&path).map_err(|error| error.to_string())?;
        Ok::<_, String>((poses[0].time, poses[0].pose.translation, poses[0].pose.rotation[5].round()))
    };
    // A quarter turn about x: entry 6 of R is -1; read in another order it would be another rotation.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let expected = Ok((Some(0.5), [1.0, 2.0, 3.0], -1.0));
    for text in [
        format!("0.5 1 2 3 {half} 0 0 {half}\n"),
        format!("# timestamp tx ty tz qx qy qz qw\n0.5 1 2 3 {half} 0 0 {half}\n"),
        format!("# TUM: time tx ty tz qw qx qy qz\n0.5 1 2 3 {half} {half} 0 0\n"),
        format!("\u{feff}time,x,y,z,qw,qx,qy,qz\r\n0.5,1,2,3,{half},{half},0,0\r\n"),
        format!("qw qx qy qz tx ty tz t\n{half} {half} 0 0 1 2 3 0.5\n"),
        format!(
            "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z [],v_RS_R_x [m s^-1]\n\
             0.5,1,2,3,{half},{half},0,0,9\n"
        ),
        format!(
            "position.x;position.y;position.z;orientation.x;orientation.y;orientation.z;orientation.w;stamp\r1;2;3;{half};0;0;{half};0.5\r"
        ),
    ] {
        assert_eq!(poses(&text), expected, "{text}");
    }
    let no_time = poses(&format!("qx qy qz qw x y z\n{half} 0 0 {half} 1 2 3\n")).unwrap();
    assert_eq!(no_time, (None, [1.0, 2.0, 3.0], -1.0));
    assert!(poses("time x y z qx qy qz\n0 1 2 3 0 0 0\n").unwrap_err().contains("only a part of x y z qx qy qz qw"));
    assert!(poses("time x y z qw qx qy qz\n0 1 2 3\n").unwrap_err().contains("4 numbers, but the header names 8"));
    assert!(poses("1 0 0 0\r0 1 0 0\n0 0 1 0\n").unwrap_err().contains("line 1: a carriage return stands alone"));
}
