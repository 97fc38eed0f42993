//! Random bytes and damaged files: no panic, no memory for what a header merely claims.
//!
//! One test in a process of its own, because it looks at the memory that the process ever asked for.

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
    let image = DynamicImage::from(GrayImage::from_fn(16, 16, |x, y| Luma([if x > 3 && y > 5 { 255 } else { 0 }])));
    for format in [ImageFormat::Png, ImageFormat::Jpeg] {
        let mut bytes = std::io::Cursor::new(Vec::new());
        image.write_to(&mut bytes, format).unwrap();
        seeds.push(bytes.into_inner());
    }
    seeds
}

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
    let mut jpeg = seeds().pop().unwrap();
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
    let config = Config { cases: 20_000, failure_persistence: None, ..Config::default() };
    let rng = || TestRng::deterministic_rng(RngAlgorithm::ChaCha);
    let random = prop::collection::vec(any::<u8>(), 0..300);
    TestRunner::new_with_rng(config.clone(), rng())
        .run(&random, |bytes| {
            fuzz_one(&bytes);
            Ok(())
        })
        .unwrap();
    let seeds = seeds();
    for seed in &seeds {
        let read = FORMATS.iter().filter(|format| (format.read)(seed, &Default::default()).is_ok()).count();
        assert!(read >= 1, "a seed is a valid file: {:?}", String::from_utf8_lossy(seed));
    }
    let damaged = (0..seeds.len(), any::<u8>(), prop::collection::vec(damage(), 1..5));
    let mut runner = TestRunner::new_with_rng(Config { cases: 200_000, ..config }, rng());
    let run = runner.run(&damaged, |(seed, choice, damages)| {
        let mut bytes = seeds[seed].clone();
        damages.iter().for_each(|damage| apply(&mut bytes, damage));
        fuzz_one(&[&[choice], &bytes[..]].concat());
        Ok(())
    });
    run.unwrap();
    if let (Some(before), Some(after)) = (before, peak_kb()) {
        assert!(after - before < 64 * 1024, "memory grew from {before} to {after} kB");
    }
}
