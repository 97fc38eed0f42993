//! Memory that reading takes: at most 64 MiB and 40 times the size of the file, of an image 32 bytes a pixel instead.
//!
//! Each file is read by a process of its own, whose most memory is looked at.

mod common;

use std::path::Path;
use std::process::Command;

use cfpose_vision::{Foreground, ReadOptions, read_points, read_poses};
use common::{gzip, npy, npy_f8, stl, zip};
use image::{DynamicImage, GrayImage, ImageFormat, Luma, Rgba};

/// Return a number of kB from the system's account of this process; none where there is none.
fn status_kb(key: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    status.lines().find_map(|line| line.strip_prefix(key))?.split_whitespace().next()?.parse().ok()
}

/// The variables that make this test, in a process of its own, read one file.
const FILE: &str = "CFPOSE_MEMORY_FILE";
const MOST: &str = "CFPOSE_MEMORY_MOST_POINTS";

/// Read the file that the process was started for, and print the most memory that the process held.
fn read_one(path: &Path) {
    let outcome = if path.extension().is_some_and(|extension| extension == "json") {
        format!("{:?}", read_poses(path).map(|poses| poses.len()).map_err(|error| error.to_string()))
    } else {
        let most = std::env::var(MOST).ok().and_then(|most| most.parse().ok());
        let foreground = Foreground::Bright;
        read(path, &ReadOptions { min_distinct: 0, max_points: most, foreground, ..ReadOptions::default() })
    };
    println!("\npeak {} {outcome}", status_kb("VmHWM:").unwrap_or_default());
}

/// Return the kB of memory that a process holds at most that reads a file, and what comes of it.
fn peak_kb(path: &Path, most: Option<usize>) -> (u64, String) {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", "reading_takes_memory_in_proportion_to_the_file", "--nocapture"]).env(FILE, path);
    if let Some(most) = most {
        command.env(MOST, most.to_string());
    }
    let output = command.output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let line = text.lines().find_map(|line| line.strip_prefix("peak ")).unwrap_or_else(|| panic!("{text}"));
    let (peak, outcome) = line.split_once(' ').unwrap();
    (peak.parse().unwrap(), outcome.to_string())
}

fn png(image: impl Into<DynamicImage>) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.into().write_to(&mut bytes, ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// Files that hold much, or unpack to much, for their size.
fn files() -> Vec<(&'static str, Vec<u8>)> {
    let packed_pcd = {
        // LZF: one literal, then copies of 264 bytes from one back.
        let body = [&[0u8, 0][..], &[0xe0, 255, 0].repeat(400_000)].concat();
        let size = 1 + 264 * 400_000u32;
        let header = format!("FIELDS x\nSIZE 1\nTYPE U\nPOINTS {size}\nDATA binary_compressed\n");
        [header.as_bytes(), &(body.len() as u32).to_le_bytes(), &size.to_le_bytes(), &body].concat()
    };
    let facet = |k: u32| [0, 1, 2].map(|c| [k as f32, c as f32, (k / 7) as f32]);
    let bytes_npy = |count: usize| npy("'|i1'", &format!("({count},)"), &vec![1; count]);
    vec![
        ("a.xyz", b"1\n".repeat(3 << 20)),
        ("a.xyz", b"\n".repeat(6 << 20)),
        ("a.csv", [b"a,".repeat(3 << 20), b"a\n1,2\n".to_vec()].concat()),
        ("a.csv", [b"1,".repeat(3 << 20), b"1\n".to_vec()].concat()),
        ("a.csv", [b"x,y,z,nx,ny,nz,w\n".to_vec(), b"0,0,1,1,0,0,1\n".repeat(300_000)].concat()),
        ("a.npy", bytes_npy(4 << 20)),
        ("a.pcd", [b"FIELDS".to_vec(), b" a".repeat(2 << 20), b"\nSIZE 1\n".to_vec()].concat()),
        (
            "a.ply",
            [b"ply\nformat ascii 1.0\n".to_vec(), b"element a 1\n".to_vec(), b"property char a\n".repeat(200_000)]
                .concat(),
        ),
        ("a.obj", b"v 1 1 1\n".repeat(500_000)),
        ("a.stl", stl(&(0..100_000).map(facet).collect::<Vec<_>>())),
        ("a.xyz.gz", gzip(&b"1\n".repeat(40 << 20))),
        ("a.xyz.gz", gzip(&b"1 2 3\n".repeat(2 << 20))),
        ("a.npy.gz", gzip(&bytes_npy(12 << 20))),
        ("a.npz", zip(&[("a.npy", bytes_npy(12 << 20))], true)),
        ("a.npz", zip(&[("a.npy", [npy_f8("(8000000,)", &[]), vec![0; 64_000_000]].concat())], true)),
        ("a.npz", zip(&[("a.npy", bytes_npy(4 << 20))], false)),
        ("a.pcd", packed_pcd),
    ]
}

fn read(path: &Path, options: &ReadOptions) -> String {
    match read_points(path, options) {
        Ok(file) => format!("{} points", file.points.len()),
        Err(error) => error.to_string().rsplit('/').next().unwrap_or_default().chars().take(90).collect(),
    }
}

#[test]
fn reading_takes_memory_in_proportion_to_the_file() {
    if let Some(path) = std::env::var_os(FILE) {
        return read_one(Path::new(&path));
    }
    if status_kb("VmHWM:").is_none() {
        println!("skipped: this system does not tell the memory of a process");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let check = |name: &str, bytes: &[u8], limit: u64, most: Option<usize>| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let (peak, outcome) = peak_kb(&path, most);
        println!("{name} of {} kB: {peak} kB of {limit}: {outcome}", bytes.len() / 1024);
        assert!(peak <= limit, "{name} of {} bytes takes {peak} kB, more than {limit}: {outcome}", bytes.len());
    };
    let json = [b"[[1".to_vec(), b",1".repeat(2 << 20), b"]]".to_vec()].concat();
    for (name, bytes) in files().into_iter().chain([("a.json", json)]) {
        check(name, &bytes, 64 * 1024 + 40 * bytes.len() as u64 / 1024, None);
    }
    for (name, image, pixels) in [
        ("white.png", png(GrayImage::from_pixel(3000, 3000, Luma([255]))), 9_000_000),
        ("deep.png", png(image::ImageBuffer::from_pixel(1500, 1500, Rgba([65_535u16; 4]))), 2_250_000),
    ] {
        for most in [None, Some(pixels)] {
            check(name, &image, 64 * 1024 + 32 * pixels as u64 / 1024, most);
        }
    }
}
