//! Files in memory for the tests of readers.

#![allow(dead_code)]

use std::io::Write;

use cfpose_vision::{PointFile, ReadOptions, read_points};

/// Read bytes from a file of the given name; an error without the folder.
pub fn read_with(name: &str, bytes: impl AsRef<[u8]>, options: &ReadOptions) -> Result<PointFile, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes.as_ref()).unwrap();
    read_points(&path, options).map_err(|error| {
        let message = error.to_string();
        let line = message.strip_prefix(&format!("{}/{name}: ", folder.path().display()));
        line.expect("the message names the file").to_string()
    })
}

/// Read with default options.
pub fn read(name: &str, bytes: impl AsRef<[u8]>) -> Result<PointFile, String> {
    read_with(name, bytes, &ReadOptions::default())
}

/// Return the points as rows.
pub fn rows(file: &PointFile) -> Vec<Vec<f64>> {
    (0..file.points.len()).map(|k| file.points.point(k)[..file.points.dim()].to_vec()).collect()
}

/// Compress as gzip.
pub fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// Make an npy file of a header's entries and data.
pub fn npy(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let dict = format!("{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}\n");
    [b"\x93NUMPY\x01\x00", &(dict.len() as u16).to_le_bytes()[..], dict.as_bytes(), data].concat()
}

/// Make an npy file of doubles.
pub fn npy_f8(shape: &str, values: &[f64]) -> Vec<u8> {
    let data: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    npy("'<f8'", shape, &data)
}

/// Make a zip archive of named files, stored or deflated.
pub fn zip(files: &[(&str, Vec<u8>)], deflated: bool) -> Vec<u8> {
    let (mut bytes, mut directory) = (Vec::new(), Vec::new());
    for (name, content) in files {
        let mut crc = flate2::Crc::new();
        crc.update(content);
        let mut encoder = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::default());
        encoder.write_all(content).unwrap();
        let packed = if deflated { encoder.finish().unwrap() } else { content.clone() };
        let method = if deflated { 8u16 } else { 0 };
        let local = bytes.len() as u32;
        let common = |extra: u16| {
            let mut head = [20u16, 0, method, 0, 0].iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
            for value in [crc.sum(), packed.len() as u32, content.len() as u32] {
                head.extend(value.to_le_bytes());
            }
            head.extend((name.len() as u16).to_le_bytes());
            head.extend(extra.to_le_bytes());
            head
        };
        // As numpy, an extra field of 20 bytes before the data.
        bytes.extend([b"PK\x03\x04", &common(20)[..], name.as_bytes(), &[0; 20], &packed].concat());
        let tail = [&[0; 10][..], &local.to_le_bytes(), name.as_bytes()].concat();
        directory.extend([b"PK\x01\x02\x14\x00", &common(0)[..], &tail].concat());
    }
    let (count, start) = (files.len() as u16, bytes.len() as u32);
    let mut end = b"PK\x05\x06\0\0\0\0".to_vec();
    end.extend([count.to_le_bytes(), count.to_le_bytes()].concat());
    end.extend([(directory.len() as u32).to_le_bytes(), start.to_le_bytes()].concat());
    end.extend([0, 0]);
    [bytes, directory, end].concat()
}

/// Make a las file of version 1.`minor` with points in units of 0.5 from (10, 20, 30).
pub fn las(minor: u8, points: &[[i32; 3]]) -> Vec<u8> {
    let (size, format, stride) = [(227, 0, 20), (227, 1, 28), (227, 3, 34), (235, 4, 57), (375, 6, 30)][minor as usize];
    let mut bytes = vec![0u8; size];
    bytes[..4].copy_from_slice(b"LASF");
    (bytes[24], bytes[25], bytes[104]) = (1, minor, format);
    bytes[94..96].copy_from_slice(&(size as u16).to_le_bytes());
    bytes[96..100].copy_from_slice(&(size as u32 + 2).to_le_bytes());
    bytes[105..107].copy_from_slice(&(stride as u16).to_le_bytes());
    bytes[107..111].copy_from_slice(&(points.len() as u32).to_le_bytes());
    for (axis, offset) in [10.0f64, 20.0, 30.0].into_iter().enumerate() {
        bytes[131 + 8 * axis..139 + 8 * axis].copy_from_slice(&0.5f64.to_le_bytes());
        bytes[155 + 8 * axis..163 + 8 * axis].copy_from_slice(&offset.to_le_bytes());
    }
    if minor == 4 {
        bytes[247..255].copy_from_slice(&(points.len() as u64).to_le_bytes());
    }
    bytes.extend([0; 2]);
    for point in points {
        let start = bytes.len();
        bytes.extend(point.iter().flat_map(|v| v.to_le_bytes()));
        bytes.resize(start + stride, 7);
    }
    bytes
}

/// Make a binary stl file.
pub fn stl(facets: &[[[f32; 3]; 3]]) -> Vec<u8> {
    let mut bytes = vec![0u8; 80];
    bytes.extend((facets.len() as u32).to_le_bytes());
    for facet in facets {
        bytes.extend([0; 12]);
        bytes.extend(facet.as_flattened().iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

/// Camera files as the programs write them that calibrate: 460.5, 457.25, 367.0, 248.5 with a lens, by name.
pub const CAMERAS: [(&str, &str); 9] = [
    (
        "opencv.yaml",
        "%YAML:1.0\n---\ncalibration_time: \"Tue 3 Mar 2020 10:11:12\"\nimage_width: 752\nimage_height: 480\nflags: 0\n\
         camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 4.605e+02, 0., 367., 0., 4.5725e+02, 2.485e+02, 0., 0., 1. ]\n\
         distortion_coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n   data: [ -2.8e-01, 7.e-02, 2.e-04, 1.7e-05, 0. ]\n\
         avg_reprojection_error: 2.3e-01\n",
    ),
    (
        "opencv.xml",
        "<?xml version=\"1.0\"?>\n<opencv_storage>\n<image_width>752</image_width>\n<camera_matrix type_id=\"opencv-matrix\">\n  <rows>3</rows>\n\
         <cols>3</cols>\n  <dt>d</dt>\n  <data>\n    460.5 0. 367. 0. 457.25\n    248.5 0. 0. 1.</data></camera_matrix>\n\
         <distortion_coefficients type_id=\"opencv-matrix\"><rows>1</rows><cols>5</cols><dt>d</dt><data>\n\
         -2.8e-01 7.e-02 2.e-04 1.7e-05 0.</data></distortion_coefficients>\n</opencv_storage>\n",
    ),
    (
        "camera_info.yaml",
        "image_width: 752\nimage_height: 480\ncamera_name: left\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [460.5, 0, 367, 0, 457.25, 248.5, 0, 0, 1]\n",
    ),
    (
        "topic.yaml",
        "header:\n  seq: 1\n  frame_id: \"cam\"\nheight: 480\nwidth: 752\ndistortion_model: \"plumb_bob\"\n\
         D: [-0.28, 0.07, 0.0002, 0.000017, 0.0]\nK: [460.5, 0.0, 367.0, 0.0, 457.25, 248.5, 0.0, 0.0, 1.0]\n\
         R: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]\nP: [460.5, 0.0, 367.0, 0.0, 0.0, 457.25, 248.5, 0.0, 0.0, 0.0, 1.0, 0.0]\n---\n",
    ),
    (
        "camchain.yaml",
        "cam0:\n  cam_overlaps: []\n  camera_model: pinhole\n  distortion_coeffs: [-0.28, 0.07, 0.0002, 1.7e-05]\n  distortion_model: radtan\n  intrinsics: [460.5, 457.25, 367.0, 248.5]\n  resolution: [752, 480]\n  rostopic: /cam0/image_raw\n",
    ),
    (
        "orb.yaml",
        "%YAML:1.0\n\n# Camera Parameters\nCamera.type: \"PinHole\"\nCamera.fx: 460.5\nCamera.fy: 457.25\nCamera.cx: 367.0\nCamera.cy: 248.5\n\n\
         Camera.k1: -0.28\nCamera.k2: 0.07\nCamera.p1: 0.0002\nCamera.p2: 1.7e-05\n",
    ),
    (
        "own.json",
        "{\"fx\": 460.5, \"fy\": 457.25, \"cx\": 367, \"cy\": 248.5, \"distortion_model\": \"plumb_bob\", \"distortion\": [-0.28, 0.07, 0.0002, 1.7e-5]}",
    ),
    (
        "matrix.json",
        "{\"camera_matrix\": [[460.5, 0, 367], [0, 457.25, 248.5], [0, 0, 1]], \"dist_coeff\": [[-0.28, 0.07, 0.0002, 0.000017, 0]]}",
    ),
    (
        "pair.yaml",
        "cam0:\n  camera_model: pinhole\n  intrinsics: [460.5, 457.25, 367.0, 248.5]\n  distortion_model: radtan\n  distortion_coeffs: [-0.28, 0.07, 0.0002, 1.7e-05]\ncam1:\n  camera_model: pinhole\n  intrinsics: [458.0, 456.0, 379.0, 255.0]\n  distortion_model: equidistant\n  distortion_coeffs: [-0.01, 0.02, -0.015, 0.003]\n  T_cn_cnm1:\n  - [1.0, 0.0, 0.0, -0.1]\n",
    ),
];
