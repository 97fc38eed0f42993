//! Files that contradict themselves are refused, each for what it says twice or too much.

mod common;

use common::{gzip, las, npy_f8, read, stl, zip};

fn refused(name: &str, bytes: impl AsRef<[u8]>, why: &str) {
    match read(name, bytes) {
        Ok(file) => panic!("{name} is read as {} points in place of: {why}", file.points.len()),
        Err(message) => assert!(message.contains(why), "{name}: {message} in place of: {why}"),
    }
}

const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nend_header\n";
const PCD: &str = "VERSION 0.7\nFIELDS x y\nSIZE 4 4\nTYPE F F\nCOUNT 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\n";

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

#[test]
fn bytes_after_the_last_point() {
    let more = |bytes: &[u8]| [bytes, &[1, 2, 3]].concat();
    let good = npy_f8("(2, 2)", &[1.0, 2.0, 3.0, 4.0]);
    assert!(read("a.npy", &good).is_ok());
    refused("a.npy", more(&good), "3 bytes after the last point");
    refused("a.npy", [good.clone(), vec![0; 16]].concat(), "the header claims 2 rows, but more follow");
    refused("a.npy", [good.clone(), good.clone()].concat(), "the header claims 2 rows, but more follow");
    let pcd = [format!("{PCD}DATA binary\n").as_bytes(), &floats(&[1.0, 2.0, 3.0, 4.0])].concat();
    assert!(read("a.pcd", &pcd).is_ok() && read("a.pcd", [&pcd[..], b"\n"].concat()).is_ok());
    refused("a.pcd", more(&pcd), "3 bytes after the last point");
    let packed = [&[15u8][..], &floats(&[1.0, 3.0, 2.0, 4.0])].concat();
    let pcd = [format!("{PCD}DATA binary_compressed\n").as_bytes(), &[17, 0, 0, 0, 16, 0, 0, 0], &packed].concat();
    assert!(read("a.pcd", &pcd).is_ok());
    refused("a.pcd", more(&pcd), "3 bytes after the last point");
    let ply = PLY.replace("ascii", "binary_little_endian");
    refused("a.ply", more(&[ply.as_bytes(), &floats(&[1.0, 2.0, 3.0, 4.0])].concat()), "but more follow");
    let facet = stl(&[[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]);
    assert!(read("a.stl", &facet).is_ok());
    refused("a.stl", more(&facet), "3 bytes after the last point");
    refused("a.stl", &facet[..120], "the header claims 1 facets, the file holds 0");
    for minor in 0..=4 {
        let scan = las(minor, &[[1, 2, 3], [4, 5, 6]]);
        refused("a.las", more(&scan), "3 bytes after the last point");
        refused("a.las", &scan[..scan.len() - 1], "the header claims 2 points, the file holds 1");
    }
    let packed = gzip(b"1 2\n3 4\n");
    refused("a.xyz.gz", more(&packed), "the compressed data are damaged");
    refused("a.xyz.gz", &packed[..packed.len() - 3], "the compressed data are damaged");
    let archive = zip(&[("a.npy", good)], true);
    refused("a.npz", more(&archive), "bytes follow the directory");
    let mut broken = archive.clone();
    broken[60] ^= 1;
    refused("a.npz", broken, "the compressed data are damaged");
    refused("a.obj", "v 1 2 3 4 5\nv 1 2 3\n", "a vertex of 5 numbers");
}

#[test]
fn what_a_header_says_twice() {
    refused(
        "a.ply",
        PLY.replace("format ascii 1.0\n", "format ascii 1.0\nformat binary_big_endian 1.0\n"),
        "line 3: the header names the format twice",
    );
    refused(
        "a.ply",
        PLY.replace("element", "element vertex 2\nproperty int q\nelement"),
        "names the element \"vertex\" twice",
    );
    refused("a.ply", PLY.replace("float y", "float x") + "1 2\n3 4\n", "names x twice");
    for (line, keyword) in [
        ("POINTS 3", "POINTS"),
        ("WIDTH 2", "WIDTH"),
        ("FIELDS a b", "FIELDS"),
        ("SIZE 4 4", "SIZE"),
        ("COUNT 1 1", "COUNT"),
    ] {
        refused(
            "a.pcd",
            format!("{PCD}{line}\nDATA ascii\n1 2\n3 4\n"),
            &format!("the header has two lines {keyword}"),
        );
    }
    refused(
        "a.pcd",
        PCD.replace("POINTS 2", "POINTS 2 2") + "DATA ascii\n1 2\n3 4\n",
        "gives POINTS 2 numbers in place of one",
    );
    refused("a.pcd", PCD.replace("WIDTH 2\n", "") + "DATA ascii\n1 2\n3 4\n", "gives HEIGHT without WIDTH");
    refused("a.pcd", PCD.replace("HEIGHT 1\n", "") + "DATA ascii\n1 2\n3 4\n", "gives WIDTH without HEIGHT");
    refused("a.pts", "3\n1 2 3\n4 5 6\n", "the header claims 3 rows, the file holds 2");
    refused("a.pts", "1\n1 2 3\n4 5 6\n", "line 3: the header claims 1 rows, but more follow");
    refused("a.pts", "2\n2\n1 2 3\n4 5 6\n", "line 3: 3 columns, but the rows above have 1");
    refused("a.csv", "x [m],x [ft],y\n1,2,3\n4,5,6\n", "names x twice");
    refused("a.csv", "x,X\n1,2\n4,5\n", "names x twice");
    refused("a.csv", "y,z\n1,2\n4,5\n", "names y and no x");
    let mut scan = las(4, &[[1, 2, 3], [4, 5, 6]]);
    scan[107] = 1;
    refused("a.las", scan, "counts 1 points, and 2");
}

#[test]
fn values_outside_their_type() {
    let ply = |kind: &str, row: &str| format!("{}1 2\n{row}\n", PLY.replace("float x", &format!("{kind} x")));
    refused("a.ply", ply("uchar", "256 2"), "line 8: x is 256, which the type uint8 of the header cannot hold");
    refused("a.ply", ply("char", "-129 2"), "x is -129, which the type int8");
    refused("a.ply", ply("int", "1.5 2"), "x is 1.5, which the type int32");
    refused("a.ply", ply("uint", "-1 2"), "x is -1, which the type uint32");
    refused("a.ply", ply("short", "nan 2"), "x is nan, which the type int16");
    refused("a.ply", ply("float", "1e39 2"), "x is 1e39, which the type float32");
    assert!(read("a.ply", ply("double", "1e39 2")).is_ok());
    refused("a.ply", ply("list uchar float", "1 5 2"), "gives x as a list");
    let list = PLY.replace("end", "property list uchar int n\nend") + "1 2 300";
    refused("a.ply", list + &" 0".repeat(300) + "\n3 4 0\n", "the length of \"n\" is 300, which the type uint8");
    let pcd = |kind: &str| {
        format!("{}DATA ascii\n1 2\n-3 300\n", PCD.replace("TYPE F F", kind).replace("SIZE 4 4", "SIZE 2 1"))
    };
    refused("a.pcd", pcd("TYPE U U"), "x is -3, which the type uint16");
    refused("a.pcd", pcd("TYPE I U"), "y is 300, which the type uint8");
}

#[test]
fn line_ends_and_letters() {
    let alone = "a carriage return stands alone among other line ends; save the file with one kind of line end";
    refused("a.csv", "1\r2\r3\r4\n", &format!("line 1: {alone}"));
    refused("a.csv", "1,2\r\n3,4\r5,6\n", &format!("line 2: {alone}"));
    refused("a.obj", "v 1 2 3\nv 4 5 6\rv 7 8 9\n", &format!("line 2: {alone}"));
    refused("a.ply", format!("{PLY}1 2\r3 4\n"), &format!("line 7: {alone}"));
    refused("a.pcd", format!("{PCD}DATA ascii\n1 2\n3\r4\n"), &format!("line 11: {alone}"));
    refused(
        "a.obj",
        "v 1 2 3\nV 4 5 6\nv 7 8 9\n",
        "line 2: the keyword V is not supported; write keywords in lower case",
    );
    refused(
        "a.csv",
        "1,5;2\n2.5;3\n",
        "line 2: x is \"2.5\", but numbers above have decimal commas; write decimals with a point",
    );
    refused("a.csv", "1.5;2\n2,5;3\n", "line 2: x is \"2,5\", not a number; write decimals with a point");
    refused("a.csv", "1;2\n3,4\n", "line 2: 1 column, but the rows above have 2");
    refused("a.obj", "v 1 2 3 0\nv 1 2 3\n", "line 1: a vertex at infinity");
    refused(
        "a.stl",
        "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nendloop\nendfacet\nendsolid\n",
        "line 6: the facet has fewer than three corners",
    );
    refused("a.stl", "solid a\nfacet normal 0 0 1\n", "the file ends before endsolid");
    refused("a.stl", "solid a\nvertex 1 2\n", "line 2: 2 columns, but the format asks for 3");
    refused("a.stl", "solid a\nfoo\n", "line 2: this is no line of an stl file");
    let laz = |at: usize, value: u8| {
        let mut scan = las(2, &[[1, 2, 3], [4, 5, 6]]);
        scan[at] = value;
        scan
    };
    refused("a.laz", laz(104, 0x83), "a compressed (laz) point record is not supported; decompress it");
    refused("a.las", laz(104, 99), "names the point format 99");
    refused("a.las", laz(105, 19), "19 bytes; it has at least 34");
    refused("a.las", laz(25, 9), "las version 1.9 is not supported");
    let mut scale = laz(137, 0xf0);
    scale[138] = 0x7f;
    refused("a.las", scale, "gives the scale [inf, 0.5, 0.5]");
}
