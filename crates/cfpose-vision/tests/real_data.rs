//! Point files as they are found in the world; ignored where the data folder is absent (`build.rs` looks for it).

use std::path::{Path, PathBuf};

use cfpose_vision::{PointFile, ReadOptions, read_points, write_points};

/// Return the data folder.
fn data() -> PathBuf {
    let default = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    std::env::var_os("CFPOSE_DATA").map_or(default, PathBuf::from)
}

fn read(path: &Path) -> PointFile {
    read_points(path, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
#[cfg_attr(not(shared_data), ignore = "no real data: set CFPOSE_DATA to their folder")]
fn point_files_have_the_points_and_columns_that_their_sources_state() {
    let data = data();
    let expected = [
        ("bunny/stanford-bunny.obj", 35_947, 3),
        ("bunny/bun_zipper_res3.ply", 1_889, 3),
        ("bunny/bunny_397.pcd", 397, 3),
        ("small_gicp_lidar/source.ply", 69_792, 3),
        ("small_gicp_lidar/target.ply", 69_088, 3),
        ("teaser_bench/benchmark_1/src.ply", 10, 3),
        ("teaser_bench/benchmark_2/dst.ply", 10, 3),
        ("fish_face/fish_source.txt", 91, 2),
        ("fish_face/gmmreg_fish_X.txt", 98, 2),
        ("fish_face/gmmreg_fish_X_nohead.txt", 78, 2),
        ("fish_face/gmmreg_fish_Y_notail.txt", 79, 2),
        ("lpm_2d/2D_oneBox.csv", 361, 2),
        ("lpm_2d/2D_twoBoxes.csv", 361, 2),
    ];
    for (name, len, dim) in expected {
        let file = read(&data.join(name));
        assert_eq!((file.points.len(), file.points.dim(), file.points.is_uniform()), (len, dim, true), "{name}");
    }
    let first = read(&data.join("bunny/bun_zipper_res3.ply")).points.point(0);
    assert_eq!(first, [-0.0369122, 0.127512, 0.00276757]);
    assert_eq!(read(&data.join("lpm_2d/2D_oneBox.csv")).points.point(0)[..2], [0.533677, 1.01599]);
}

#[test]
#[cfg_attr(not(shared_data), ignore = "no real data: set CFPOSE_DATA to their folder")]
fn silhouettes_are_their_region_and_keep_its_size_when_scaled_and_turned() {
    let data = data();
    let region = |name: String| read(&data.join("mpeg7_shapes").join(name)).points;
    // Length from second moments: the fourth root of the covariance's determinant scales with the figure.
    let length = |name: String| {
        let c = region(name).covariance();
        (c[0][0] * c[1][1] - c[0][1] * c[1][0]).powf(0.25)
    };
    for (class, pixels) in [("bat", 89_600), ("key", 28_424), ("camel", 44_137)] {
        let reference = format!("Part-A/1-Scale/{class}-1.png");
        assert_eq!(region(reference.clone()).len(), pixels);
        assert_eq!(region(format!("Part-A/1-Scale/{class}-2.png")).len(), 4 * pixels, "{class}: scale 2");
        let unit = length(reference);
        for (index, scale) in [(2, 2.0), (3, 0.3), (4, 0.25), (5, 0.2)] {
            let found = length(format!("Part-A/1-Scale/{class}-{index}.png")) / unit;
            assert!((found / scale - 1.0).abs() < 0.006, "{class}: {scale} is {found}");
        }
        for turned in 2..=6 {
            let found = length(format!("Part-A/2-Rotation/{class}-{turned}.png")) / unit;
            assert!((found - 1.0).abs() < 1e-3, "{class}-{turned}: {found}");
        }
    }
}

#[test]
#[cfg_attr(not(shared_data), ignore = "no real data: set CFPOSE_DATA to their folder")]
fn a_scan_survives_every_writer() {
    let data = data();
    let points = read(&data.join("small_gicp_lidar/source.ply")).points;
    let folder = tempfile::tempdir().unwrap();
    for format in cfpose_vision::FORMATS.iter().filter(|format| format.write.is_some()) {
        let path = folder.path().join(format!("scan.{}", format.extensions[0]));
        write_points(&path, &points).unwrap();
        assert_eq!(read(&path).points, points, "{}", format.name);
    }
}
