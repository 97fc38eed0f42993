//! Random bytes and damaged files: no panic, no memory for what a header merely claims.
//!
//! One test in a process of its own, because it looks at the memory that the process ever asked for.

mod common;

use std::time::Instant;

use cfpose::Points;
use cfpose_vision::{FORMATS, fuzz_one};
use image::{DynamicImage, GrayImage, ImageFormat, Luma};
use proptest::prelude::*;
use proptest::sample::Index;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

/// One small valid file of every format and encoding.
fn seeds() -> Vec<Vec<u8>> {
    let points = Points::from_rows(&[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [-7.5, 8.0, 9.0]]).unwrap();
    let mut seeds: Vec<Vec<u8>> =
        FORMATS.iter().filter_map(|format| format.write).map(|write| write(&points).unwrap()).collect();
    let body: Vec<u8> = (0..9).flat_map(|k| (k as f32).to_le_bytes()).collect();
    let vertex = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
    let list = "element face 2\nproperty list uchar int vertex_indices\n";
    for encoding in ["binary_little_endian", "binary_big_endian"] {
        let header = format!("ply\nformat {encoding} 1.0\n{list}{vertex}end_header\n");
        seeds.push([header.as_bytes(), &[1, 0, 0, 0, 0, 0], &body].concat());
    }
    let pcd = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 3\nHEIGHT 1\nPOINTS 3\nDATA ";
    seeds.push([pcd.as_bytes(), b"binary\n", &body].concat());
    let packed = [&[31][..], &body[..32], &[3], &body[32..]].concat();
    seeds.push([pcd.as_bytes(), b"binary_compressed\n", &[38, 0, 0, 0, 36, 0, 0, 0], &packed].concat());
    seeds.extend([ImageFormat::Png, ImageFormat::Jpeg].map(silhouette));
    let three = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 2.0]];
    seeds.push(common::stl(&[three]));
    seeds.push(b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 2\nendloop\nendfacet\nendsolid\n".to_vec());
    seeds.extend((2..=4).map(|minor| common::las(minor, &[[1, 2, 3], [4, 5, 6]])));
    let doubles = |shape: &str| common::npy_f8(shape, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    seeds.push(doubles("(2, 1, 3)"));
    let item = [1.0f64.to_le_bytes(), 2.0f64.to_le_bytes()].concat();
    seeds.push(common::npy("[('y', '<f4'), ('', '|V4'), ('x', '>f8')]", "(2,)", &item.repeat(2)));
    for deflated in [false, true] {
        seeds.push(common::zip(&[("a.npy", doubles("(2, 3)"))], deflated));
        seeds.push(common::zip(&[("x.npy", doubles("(6,)")), ("y.npy", doubles("(6,)"))], deflated));
    }
    for text in TEXTS {
        seeds.push(text.as_bytes().to_vec());
        seeds.push(common::gzip(text.as_bytes()));
    }
    seeds
}

/// A small image of one figure.
fn silhouette(format: ImageFormat) -> Vec<u8> {
    let image = DynamicImage::from(GrayImage::from_fn(16, 16, |x, y| Luma([if x > 3 && y > 5 { 255 } else { 0 }])));
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

/// Text as other programs write it.
const TEXTS: [&str; 6] = [
    "Points:1 [m],Points:0,Normals:0,Normals:1,id\n1,2,0,1,a\n3,4,1,0,b\n",
    "\u{feff}northing;height;easting;w\r\n1,5;2;3;1\r\n4,25;5;6;0,5\r\nnan;nan;nan;1\r\n",
    "2\n1 2 3 -7 1 2 3\n4 5 6 -7 1 2 3\n",
    "//X Y Z Intensity\n1 2 3 4\n5 6 7 8\n",
    ",\"x, m\",y\n0,1,\"2\"\n1,3,4\n",
    "x\ty\tname\r1\t2\ta b\r3\t4\t\r",
];

/// Pose files of every form.
const POSES: [&str; 5] = [
    "1 0 0 1\n0 1 0 2\n0 0 1 3\n0 0 0 1\n",
    "# time tx ty tz qx qy qz qw\n0.5 1 2 3 0 0 0 1\n1.5 1 2 3 0 0 1 0\n",
    "\u{feff}time,x,y,z,q_w [],q_x [],q_y [],q_z []\r\n1,2,3,4,1,0,0,0\r\n",
    "1 0 0 1 0 1 0 2 0 0 1 3\n",
    "[{\"matrix\": [[1,0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]]}, {\"rotation\": [[1,0,0],[0,1,0],[0,0,1]], \"translation\": [1,2,3], \"time\": 1}]",
];

/// Words that a damaged header may hold.
const WORDS: [&str; 14] = [
    "-1",
    "0",
    "7",
    "255",
    "65535",
    "4294967295",
    "18446744073709551615",
    "1000000000000000",
    "nan",
    "1e400",
    "uchar",
    "list",
    "\n",
    "\u{0}",
];

/// A change of one place.
#[derive(Debug, Clone)]
enum Damage {
    Set(Index, u8),
    Insert(Index, u8),
    Remove(Index, usize),
    Truncate(Index),
    Repeat(Index, usize),
    Word(Index, usize),
}

fn damage() -> impl Strategy<Value = Damage> {
    prop_oneof![
        (any::<Index>(), any::<u8>()).prop_map(|(at, byte)| Damage::Set(at, byte)),
        (any::<Index>(), any::<u8>()).prop_map(|(at, byte)| Damage::Insert(at, byte)),
        (any::<Index>(), 1usize..9).prop_map(|(at, count)| Damage::Remove(at, count)),
        any::<Index>().prop_map(Damage::Truncate),
        (any::<Index>(), 1usize..40).prop_map(|(at, count)| Damage::Repeat(at, count)),
        (any::<Index>(), 0..WORDS.len()).prop_map(|(at, word)| Damage::Word(at, word)),
    ]
}

fn apply(bytes: &mut Vec<u8>, damage: &Damage) {
    if bytes.is_empty() {
        return;
    }
    let len = bytes.len();
    match damage {
        Damage::Set(at, byte) => bytes[at.index(len)] = *byte,
        Damage::Insert(at, byte) => bytes.insert(at.index(len), *byte),
        Damage::Remove(at, count) => drop(bytes.drain(at.index(len)..(at.index(len) + count).min(len))),
        Damage::Truncate(at) => bytes.truncate(at.index(len)),
        Damage::Repeat(at, count) => {
            let start = at.index(len);
            let copy = bytes[start..(start + count).min(len)].to_vec();
            bytes.splice(start..start, copy);
        }
        Damage::Word(at, word) => {
            // In place of the word of the text that stands there.
            let start = at.index(len);
            let end = bytes[start..].iter().position(|b| b.is_ascii_whitespace()).map_or(len, |end| start + end);
            bytes.splice(start..end, WORDS[*word].bytes());
        }
    }
}

/// Return the most memory, in kB, that this process ever had mapped; none where the system does not tell.
fn peak_kb() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    status.lines().find_map(|line| line.strip_prefix("VmPeak:"))?.split_whitespace().next()?.parse().ok()
}

/// Headers that claim what no machine has, each with hardly any data.
fn boasts() -> Vec<Vec<u8>> {
    let npy = |shape: &str| {
        let dict = format!("{{'descr': '<f8', 'fortran_order': True, 'shape': {shape}, }}\n");
        [b"\x93NUMPY\x01\x00", &(dict.len() as u16).to_le_bytes()[..], dict.as_bytes(), &[0; 24]].concat()
    };
    let pcd = |head: &str| format!("FIELDS x\nSIZE 4\nTYPE F\n{head}").into_bytes();
    let mut jpeg = silhouette(ImageFormat::Jpeg);
    // The frame header: marker, length, depth, then height and width.
    let frame = jpeg.windows(2).position(|pair| pair == [0xff, 0xc0]).unwrap();
    jpeg[frame + 5..frame + 9].fill(0xff);
    let mut png = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\0\0\x80\0\0\0\x80\0\x10\x06\0\0\0".to_vec();
    png.extend([0; 40]);
    vec![
        npy("(1000000000000000, 3)"),
        npy("(18446744073709551615, 3)"),
        npy("(99999999999999999999999, 3)"),
        npy(&"(".repeat(60_000)),
        [b"\x93NUMPY\x02\x00", &u32::MAX.to_le_bytes()[..], b"{}"].concat(),
        pcd("POINTS 1000000000000000\nDATA ascii\n1\n"),
        pcd("POINTS 18446744073709551615\nDATA binary\n1234"),
        pcd("WIDTH 18446744073709551615\nHEIGHT 3\nDATA binary\n1234"),
        pcd("COUNT 18446744073709551615\nPOINTS 3\nDATA binary\n1234"),
        pcd("POINTS 1000000000\nDATA binary_compressed\n\u{1}\0\0\0\u{7f}\u{7f}\u{7f}\u{7f}\0"),
        b"ply\nformat binary_little_endian 1.0\nelement a 18446744073709551615\nelement vertex 18446744073709551615\n\
          property list uint double n\nproperty float x\nend_header\n\xff\xff\xff\xff1234"
            .to_vec(),
        b"ply\nformat ascii 1.0\nelement vertex 9\nproperty list uint double n\nproperty float x\nend_header\n\
          18446744073709551615 1 2\n"
            .to_vec(),
        png,
        jpeg,
    ]
}

#[test]
fn no_bytes_make_a_reader_panic_or_take_memory_for_a_claim() {
    let before = peak_kb();
    for boast in boasts() {
        let refused = FORMATS.iter().all(|format| (format.read)(&boast, &Default::default()).is_err());
        assert!(refused, "{:?}", String::from_utf8_lossy(&boast));
        fuzz_one(&[&[127], &boast[..]].concat());
    }
    // More than the default for a long run: CFPOSE_FUZZ_CASES=1000000.
    let cases = std::env::var("CFPOSE_FUZZ_CASES").ok().and_then(|text| text.parse().ok()).unwrap_or(200_000u32);
    let config = Config { cases: cases / 10, failure_persistence: None, ..Config::default() };
    let rng = || TestRng::deterministic_rng(RngAlgorithm::ChaCha);
    let random = prop::collection::vec(any::<u8>(), 0..300);
    TestRunner::new_with_rng(config.clone(), rng())
        .run(&random, |bytes| {
            fuzz_one(&bytes);
            Ok(())
        })
        .unwrap();
    let mut seeds = seeds();
    for seed in &seeds {
        let gzipped = seed.starts_with(&[0x1f, 0x8b]);
        let read = FORMATS.iter().filter(|format| (format.read)(seed, &Default::default()).is_ok()).count();
        assert!(read >= 1 || gzipped, "a seed is a valid file: {:?}", String::from_utf8_lossy(seed));
    }
    seeds.extend(common::CAMERAS.map(|(_, text)| text.as_bytes().to_vec()));
    seeds.extend(POSES.map(|text| text.as_bytes().to_vec()));
    let damaged = (0..seeds.len(), any::<u8>(), prop::collection::vec(damage(), 1..5));
    let slowest = std::cell::Cell::new(0.0f64);
    let mut runner = TestRunner::new_with_rng(Config { cases, ..config }, rng());
    let run = runner.run(&damaged, |(seed, choice, damages)| {
        let mut bytes = seeds[seed].clone();
        damages.iter().for_each(|damage| apply(&mut bytes, damage));
        let start = Instant::now();
        fuzz_one(&[&[choice], &bytes[..]].concat());
        slowest.set(slowest.get().max(start.elapsed().as_secs_f64()));
        Ok(())
    });
    run.unwrap();
    let slowest = slowest.get();
    println!("{cases} damaged files; the slowest took {slowest:.3} s in all readers");
    assert!(slowest < 1.0, "{slowest} s");
    if let (Some(before), Some(after)) = (before, peak_kb()) {
        assert!(after - before < 64 * 1024, "memory grew from {before} to {after} kB");
    }
}
