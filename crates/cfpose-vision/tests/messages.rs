//! What a user reads when a file is bad: one line with the place, what is wrong and what to do.

use std::path::Path;

use cfpose_vision::{ReadOptions, read_points};

/// Read bytes from a file of the given name and return the message without the folder.
fn message(name: &str, bytes: &[u8]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    let error = read_points(&path, &ReadOptions::default()).unwrap_err().to_string();
    error.strip_prefix(&format!("{}/", folder.path().display())).expect("the message names the file").to_string()
}

fn check(name: &str, bytes: impl AsRef<[u8]>, expected: &str) {
    assert_eq!(message(name, bytes.as_ref()), format!("{name}: {expected}"));
}

#[test]
fn files_that_are_not_there_or_not_point_files() {
    let read = |name: &str| read_points(Path::new(name), &ReadOptions::default()).unwrap_err().to_string();
    assert_eq!(read("nowhere/a.csv"), "nowhere/a.csv: there is no such file; check the name and the folder");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("folder.ply");
    std::fs::create_dir(&path).unwrap();
    assert!(
        read(path.to_str().unwrap()).ends_with("not a file of points but a folder or a device; name a regular file")
    );
    assert!(
        read("a.OBJJ")
            .starts_with("a.OBJJ: no format has the extension \"objj\" (did you mean \"obj\"?); known are csv, txt")
    );
    assert!(read("cloud").starts_with("cloud: no format has the extension \"\"; known are csv, txt"));
    assert!(read("mesh.dxf").starts_with("mesh.dxf: no format has the extension \"dxf\""));
}

#[test]
fn every_format_refuses_an_empty_file_and_one_point() {
    for format in cfpose_vision::FORMATS {
        for extension in format.extensions {
            check(&format!("a.{extension}"), "", "the file is empty; a point file has one row a point");
        }
    }
    check("a.csv", "# nothing\n\n", "the file holds no points; give one row a point");
    check("a.csv", "x,y\n", "the file holds no points; give one row a point");
    check("a.obj", "# nothing\nf 1 2 3\n", "the file holds no points; give one row a point");
    check("a.csv", "1,2\n", "only 1 distinct point(s); an estimate needs at least 2");
    check("a.csv", "1,2\n1,2\n1,2\n", "only 1 distinct point(s); an estimate needs at least 2");
    check("a.csv", "x,w\n1,0\n2,0\n", "all weights are zero");
}

#[test]
fn rows_of_text() {
    check("a.csv", "1,2\n3,nan\n", "line 2: y is NaN, not a finite number; remove or repair this row");
    check("a.txt", "1 2\n-inf 3\n", "line 2: x is -inf, not a finite number; remove or repair this row");
    let columns = "line 4: 3 columns, but the rows above have 2; give every row the same number of columns";
    check("a.csv", "# two\n1,2\n\n3,4,5\n", columns);
    let columns = "line 2: 3 columns, but the header names 2; give every row the same number of columns";
    check("a.csv", "x,y\n3,4,5\n", columns);
    let dimension = "line 1: 4 columns; points have 1, 2 or 3 columns and, if a header names it, a column w of weights; \
                     choose them with --columns 1,2,3";
    check("a.xyz", "1 2 3 4\n", dimension);
    check("a.csv", "1,2\n3,four\n", "line 2: y is \"four\", not a number; a comment starts with #");
    check("a.csv", "1,2\n3,,\n", "line 2: y is \"\", not a number; fill it in or remove the row");
    let twice = "line 1: x is \"1,500,5\", not a number; write decimals with a point";
    check("a.csv", "1,500,5;2\n3;4\n", twice);
    check("a.csv", "x,w\n1,1\n2,-1\n", "line 3: weight w is -1; weights are finite and not negative");
    check(
        "a.csv",
        "w\n1\n",
        "line 2: the header names a weight and no coordinate; write the file again with a tool that knows the format",
    );
    check(
        "a.csv",
        "x,z\n1,2\n",
        "line 2: the header names x and z and no y; write the file again with a tool that knows the format",
    );
    check(
        "a.csv",
        "x,x\n1,2\n",
        "line 2: the header names x twice; write the file again with a tool that knows the format",
    );
    check(
        "a.csv",
        "\u{feff}1,2\n\u{1b}[31m,2\n",
        "line 2: x is \"\\u{1b}[31m\", not a number; a comment starts with #",
    );
    check("a.csv", b"\xff\xfe1\0,\x002\0\n\0", "UTF-16 text is not supported; save the file as UTF-8");
    check(
        "a.obj",
        "v 1 2 3\nv 1 2\n",
        "line 2: 2 columns, but the format asks for 3; give every row the same number of columns",
    );
    check("a.obj", "v 1 2 3\nv 1 2 nan\n", "line 2: z is NaN, not a finite number; remove or repair this row");
}

const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nend_header\n";

#[test]
fn rows_and_headers_of_ply() {
    let truncated = "it is truncated or its header is wrong";
    check(
        "a.ply",
        format!("{PLY}1 2\n3 4\n"),
        &format!("the header claims 3 elements of \"vertex\", the file holds 2; {truncated}"),
    );
    check(
        "a.ply",
        format!("{PLY}1 2\n3 nan\n5 6\n"),
        "line 8: y is NaN, not a finite number; remove or repair this row",
    );
    check("a.ply", format!("{PLY}1 2\n3 x\n5 6\n"), "line 8: y is \"x\", not a number; a comment starts with #");
    let columns = "line 8: 1 column, but the header names 2; give every row the same number of columns";
    check("a.ply", format!("{PLY}1 2\n3\n5 6\n"), columns);
    let more = "the header claims 3 elements of \"vertex\", but more follow; write the number that the file holds into the header";
    check("a.ply", format!("{PLY}1 2\n3 4\n5 6\n\n7 8\n"), &format!("line 11: {more}"));
    let rewrite = "write the file again with a tool that knows the format";
    check("a.ply", "plywood\n", &format!("the header does not begin with the line \"ply\"; {rewrite}"));
    check("a.ply", "ply\nformat ascii 1.0\n", &format!("the header has no end_header; {rewrite}"));
    check("a.ply", "ply\nelement vertex -1\n", &format!("line 2: the header counts \"-1\" elements; {rewrite}"));
    check(
        "a.ply",
        "ply\nproperty quad x\n",
        &format!("line 2: the header has the line \"property quad x\"; {rewrite}"),
    );
    check(
        "a.ply",
        "ply\nformat ascii 1.0\nelement face 0\nend_header\n",
        &format!("the header names no element vertex; {rewrite}"),
    );
    check("a.ply", PLY.replace("float x", "float u"), &format!("the header names no vertex property x; {rewrite}"));
    let advice = "write ascii, binary_little_endian or binary_big_endian";
    check("a.ply", PLY.replace("ascii", "zip"), &format!("line 2: the ply format \"zip\" is not supported; {advice}"));
}

#[test]
fn truncated_and_boasting_binary_ply() {
    let header = PLY.replace("ascii", "binary_little_endian");
    let body: Vec<u8> = [1f32, 2.0, 3.0, 4.0, 5.0, f32::NAN].iter().flat_map(|value| value.to_le_bytes()).collect();
    let file = |header: &str, bytes: usize| [header.as_bytes(), &body[..bytes]].concat();
    let truncated = "it is truncated or its header is wrong";
    check(
        "a.ply",
        file(&header, 23),
        &format!("the header claims 3 elements of \"vertex\", the file holds 2; {truncated}"),
    );
    let more = "the header claims 2 elements of \"vertex\", but more follow; write the number that the file holds into the header";
    check("a.ply", file(&header.replace("vertex 3", "vertex 2"), 24), &format!("row 3: {more}"));
    check("a.ply", file(&header, 24), "row 3: y is NaN, not a finite number; remove or repair this row");
    // None of these may loop over, or allocate for, what the header claims.
    for claimed in ["1000000000000000", "18446744073709551615"] {
        let claims = format!("the header claims {claimed} elements of \"vertex\", the file holds 3; {truncated}");
        check("a.ply", file(&header.replace("vertex 3", &format!("vertex {claimed}")), 24), &claims);
        let lists = format!("vertex {claimed}\nproperty list uchar uint n");
        // The lists of the first two rows are empty, the third's length is a byte of the number 5.
        let claims = format!("the header claims {claimed} elements of \"vertex\", the file holds 2; {truncated}");
        check("a.ply", file(&header.replace("vertex 3", &lists), 24), &claims);
        let nothing = file(&header.replace("element", &format!("element nothing {claimed}\nelement")), 24);
        check("a.ply", nothing, "row 3: y is NaN, not a finite number; remove or repair this row");
        let ascii = format!("{PLY}1 2\n").replace("vertex 3", &format!("vertex {claimed}"));
        check(
            "a.ply",
            ascii,
            &format!("the header claims {claimed} elements of \"vertex\", the file holds 1; {truncated}"),
        );
    }
}

const PCD: &str = "VERSION 0.7\nFIELDS x y\nSIZE 4 4\nTYPE F F\nCOUNT 1 1\nWIDTH 3\nHEIGHT 1\nPOINTS 3\n";

#[test]
fn rows_and_headers_of_pcd() {
    let truncated = "it is truncated or its header is wrong";
    let rewrite = "write the file again with a tool that knows the format";
    let ascii = format!("{PCD}DATA ascii\n1 2\n");
    check("a.pcd", &ascii, &format!("the header claims 3 points, the file holds 1; {truncated}"));
    let nan = "line 11: y is NaN, not a finite number; remove or repair this row";
    check("a.pcd", format!("{ascii}3 nan\n5 6\n"), nan);
    let columns = "line 11: 3 columns, but the header names 2; give every row the same number of columns";
    check("a.pcd", format!("{ascii}3 4 5\n"), columns);
    let body: Vec<u8> = [1f32, 2.0, 3.0, f32::INFINITY, 5.0, 6.0].iter().flat_map(|v| v.to_le_bytes()).collect();
    let binary = |header: &str, bytes: usize| [header.as_bytes(), b"DATA binary\n", &body[..bytes]].concat();
    check("a.pcd", binary(PCD, 24), "row 2: y is inf, not a finite number; remove or repair this row");
    check("a.pcd", binary(PCD, 23), &format!("the header claims 3 points, the file holds 2; {truncated}"));
    let boast = PCD.replace("POINTS 3", "POINTS 1000000000000000").replace("WIDTH 3", "WIDTH 1000000000000000");
    check(
        "a.pcd",
        binary(&boast, 24),
        &format!("the header claims 1000000000000000 points, the file holds 3; {truncated}"),
    );
    let packed = [PCD.as_bytes(), b"DATA binary_compressed\n\x09\0\0\0\xff\xff\xff\x7f1234"].concat();
    check("a.pcd", packed, &format!("the header claims 9 compressed bytes, the file holds 4; {truncated}"));
    let packed = [PCD.as_bytes(), b"DATA binary_compressed\n\x04\0\0\0\xff\xff\xff\x7f\x02abc"].concat();
    check("a.pcd", packed, &format!("the header does not agree with the compressed data; {rewrite}"));
    let more = "the header claims 3 points, but more follow; write the number that the file holds into the header";
    check("a.pcd", format!("{PCD}DATA ascii\n1 2\n3 4\n\n5 6\n7 8\n"), &format!("line 14: {more}"));
    let fewer = PCD.replace("POINTS 3", "POINTS 2").replace("WIDTH 3", "WIDTH 2");
    check("a.pcd", binary(&fewer, 24), &more.replace('3', "2"));
    let differ = format!("line 9: the header gives POINTS 2, but WIDTH 3 x HEIGHT 1 are 3; {rewrite}");
    check("a.pcd", PCD.replace("POINTS 3", "POINTS 2") + "DATA ascii\n1 2\n3 4\n", &differ);
    check("a.pcd", PCD, &format!("the header has no line DATA; {rewrite}"));
    check("a.pcd", "plywood\n", &format!("line 1: the header has the line \"plywood\"; {rewrite}"));
    check("a.pcd", PCD.replace("x y", "u v") + "DATA ascii\n", &format!("the header names no field x; {rewrite}"));
    let differ = format!("line 9: the header gives FIELDS, SIZE, TYPE and COUNT in different numbers; {rewrite}");
    check("a.pcd", PCD.replace("x y", "x y z") + "DATA ascii\n", &differ);
    let advice = "write ascii, binary or binary_compressed";
    check("a.pcd", format!("{PCD}DATA zip\n"), &format!("line 9: DATA \"zip\" is not supported; {advice}"));
    let advice = "write F of 4 or 8 bytes";
    let half = PCD.replace("SIZE 4 4", "SIZE 4 2") + "DATA ascii\n";
    check("a.pcd", half, &format!("line 9: TYPE \"F\" of SIZE \"2\" is not supported; {advice}"));
}

/// An array of doubles of the given header.
fn npy(dict: &str, values: &[f64]) -> Vec<u8> {
    let data: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    [b"\x93NUMPY\x01\x00", &(dict.len() as u16).to_le_bytes()[..], dict.as_bytes(), &data].concat()
}

#[test]
fn rows_and_headers_of_npy() {
    let dict = |descr: &str, shape: &str| format!("{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}\n");
    let f8 = |shape: &str, values: &[f64]| npy(&dict("'<f8'", shape), values);
    let truncated = "it is truncated or its header is wrong";
    let rewrite = "write the file again with a tool that knows the format";
    let resave = "save it with numpy.save(name, array.astype(float)), one row a point";
    let nan = "row 2: x is NaN, not a finite number; remove or repair this row";
    check("a.npy", f8("(2, 2)", &[1.0, 2.0, f64::NAN, 4.0]), nan);
    for claimed in ["3", "1000000000000000", "18446744073709551615"] {
        let claims = format!("the header claims {claimed} rows, the file holds 2; {truncated}");
        check("a.npy", f8(&format!("({claimed}, 2)"), &[1.0, 2.0, 3.0, 4.0, 5.0]), &claims);
    }
    check("a.npy", f8("(2, 9)", &[]), "the shape (2, 9) is not supported; save the transposed array, one row a point");
    check("a.npy", f8("(9, 4)", &[]), "the shape (9, 4) is not supported; choose columns with --columns 1,2,3");
    check("a.npy", f8("()", &[1.0]), &format!("the shape () is not supported; {resave}"));
    check("a.npy", f8("(0, 3)", &[]), "the file holds no points; give one row a point");
    check("a.npy", npy(&dict("'<c16'", "(2,)"), &[]), &format!("the dtype \"<c16\" is not supported; {resave}"));
    let record = format!("the dtype \"[('x', '<c8')], 'fortran_order': False, ...\" is not supported; {resave}");
    check("a.npy", npy(&dict("[('x', '<c8')]", "(2,)"), &[]), &record);
    check("a.npy", "\u{93}NUMPY", &format!("the header does not begin with \\x93NUMPY; {rewrite}"));
    check("a.npy", b"\x93NUMPY\x02\x00\xff\xff\xff\xff{", &format!("the header is cut off; {rewrite}"));
    check(
        "a.npy",
        npy("{'descr': '<f8'}", &[]),
        &format!("the header does not say whether fortran_order is True; {rewrite}"),
    );
}

#[test]
fn images() {
    let truncated = "it is truncated or its header is wrong";
    check("a.png", "GIF89a", "the image cannot be decoded: it is neither PNG nor JPEG; save it again as PNG");
    check("a.png", b"\x89PNG\r\n\x1a\n", "the image cannot be decoded: it is cut off; save it again as PNG");
    check("a.jpg", b"\xff\xd8\xff\xe0", "the image cannot be decoded: it is cut off; save it again as PNG");
    let claim = |side: [u8; 4]| [b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR", &side[..], &side, &[1, 0, 0, 0, 0]].concat();
    let claims =
        format!("the header claims 2147483647 x 2147483647 pixels, the file holds at most 239424; {truncated}");
    check("a.png", claim([0x7f, 255, 255, 255]), &claims);
    let image = image::GrayImage::from_pixel(20, 20, image::Luma([200]));
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    let bytes = bytes.into_inner();
    let message = "no pixel is foreground, that is at most grey 127; choose the other side with --foreground bright or another \
                   threshold with --threshold";
    check("a.png", &bytes, message);
    let cut = message_of_cut_png(&bytes);
    assert!(
        cut.starts_with("a.png: the image cannot be decoded: ") && cut.ends_with("; save it again as PNG"),
        "{cut}"
    );
    assert_eq!(cut.lines().count(), 1);
}

fn message_of_cut_png(bytes: &[u8]) -> String {
    message("a.png", &bytes[..bytes.len() - 20])
}
