//! Memory that reading takes: at most 64 MiB and 40 times the size of the file, of an image 32 bytes a pixel instead.
//!
//! One test in a process of its own, because it looks at the most memory that the process ever held.

mod common;

use std::path::Path;

use cfpose_vision::{Foreground, ReadOptions, read_points, read_poses};
use common::{gzip, npy, npy_f8, stl, zip};
use image::{DynamicImage, GrayImage, ImageFormat, Luma, Rgba};

/// Return a number of kB from the system's account of this process; none where there is none.
fn status_kb(key: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    status.lines().find_map(|line| line.strip_prefix(key))?.split_whitespace().next()?.parse().ok()
}

/// Return the kB of memory held at most while `work` runs, above what was held before.
fn growth_kb(work: impl FnOnce()) -> Option<u64> {
    std::fs::write("/proc/self/clear_refs", "5").ok()?;
    let before = status_kb("VmRSS:")?;
    work();
    Some(status_kb("VmHWM:")?.saturating_sub(before))
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
        ("a.xyz.gz", gzip(&b"1 2 3 0 0 1\n".repeat(1 << 20))),
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
    if growth_kb(|| ()).is_none() {
        println!("skipped: this system does not tell the memory of a process");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let any = ReadOptions { min_distinct: 0, ..ReadOptions::default() };
    for (name, bytes) in files() {
        let (path, size) = (folder.path().join(name), bytes.len() as u64);
        std::fs::write(&path, bytes).unwrap();
        let mut outcome = String::new();
        let growth = growth_kb(|| outcome = read(&path, &any)).unwrap();
        let limit = 64 * 1024 + 40 * size / 1024;
        println!("{name} of {} kB: {growth} kB of {limit}: {outcome}", size / 1024);
        assert!(growth <= limit, "{name} of {size} bytes takes {growth} kB, more than {limit}: {outcome}");
    }
    let json = [b"[[1".to_vec(), b",1".repeat(2 << 20), b"]]".to_vec()].concat();
    let path = folder.path().join("a.json");
    std::fs::write(&path, &json).unwrap();
    let growth = growth_kb(|| assert!(read_poses(&path).is_err())).unwrap();
    assert!(growth <= 64 * 1024 + 40 * json.len() as u64 / 1024, "poses take {growth} kB");
    for (name, image) in [
        ("white", png(GrayImage::from_pixel(3000, 3000, Luma([255])))),
        ("deep", png(image::ImageBuffer::from_pixel(1500, 1500, Rgba([65_535u16; 4])))),
    ] {
        let path = folder.path().join("a.png");
        std::fs::write(&path, &image).unwrap();
        let pixels = if name == "white" { 9_000_000 } else { 2_250_000 };
        let limit = 64 * 1024 + 32 * pixels / 1024;
        for most in [None, Some(9_000_000)] {
            let options = ReadOptions { max_points: most, foreground: Foreground::Bright, ..ReadOptions::default() };
            let mut outcome = String::new();
            let growth = growth_kb(|| outcome = read(&path, &options)).unwrap();
            println!("{name} image: {growth} kB of {limit}: {outcome}");
            assert!(growth <= limit, "{name} takes {growth} kB, more than {limit}");
        }
    }
}
