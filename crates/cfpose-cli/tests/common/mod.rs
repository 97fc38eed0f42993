//! Running the program in a folder of its own, and the files it reads there.
#![allow(dead_code, missing_docs)] // every test file uses its own part

use std::path::{Path, PathBuf};
use std::process::Command;

use cfpose::theta::{RotationForm, rotation_of_euler};
use cfpose::{Pose, PoseError};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;
use serde_json::Value;

/// A folder with files in which the program runs.
pub struct Desk {
    folder: tempfile::TempDir,
}

/// What the program printed and how it ended.
#[derive(Debug)]
pub struct Run {
    pub code: i32,
    pub out: String,
    pub err: String,
}

impl Desk {
    pub fn new() -> Self {
        Self { folder: tempfile::tempdir().expect("a temporary folder") }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), content).expect("a file in the temporary folder");
    }

    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).expect("a file that the program wrote")
    }

    /// Write points as csv; every digit counts.
    pub fn write_rows(&self, name: &str, rows: &[Vec<f64>]) {
        let line = |row: &Vec<f64>| row.iter().map(|v| format!("{v:?}")).collect::<Vec<_>>().join(",") + "\n";
        self.write(name, rows.iter().map(line).collect::<String>());
    }

    /// Run the program with a command line split at blanks; `~` stands for a blank inside an argument.
    pub fn run(&self, line: &str) -> Run {
        let arguments = line.split_whitespace().map(|argument| argument.replace('~', " "));
        let output = Command::new(env!("CARGO_BIN_EXE_cfpose"))
            .args(arguments)
            .current_dir(self.folder.path())
            .output()
            .expect("the program starts");
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("UTF-8");
        let code = output.status.code().expect("no signal ends the program");
        Run { code, out: text(output.stdout), err: text(output.stderr) }
    }

    /// Run a command that must succeed and return the JSON it writes alone on standard output.
    pub fn json(&self, line: &str) -> Value {
        let run = self.run(&format!("{line} --json -"));
        assert_eq!(run.code, 0, "{line}\n{}", run.err);
        serde_json::from_str(&run.out).unwrap_or_else(|error| panic!("{error}\n{}", run.out))
    }

    /// Run a command that must fail with the code and return its one line of standard error.
    pub fn fails(&self, code: i32, line: &str) -> String {
        let run = self.run(line);
        assert_eq!(run.code, code, "{line}\n{}\n{}", run.out, run.err);
        assert_eq!(run.err.trim_end().lines().count(), 1, "{}", run.err);
        assert_eq!(run.out, "");
        run.err.trim_end().to_string()
    }
}

/// Return random points of a lopsided solid that no rotation maps to itself.
pub fn cloud(count: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut rng = ChaCha12Rng::seed_from_u64(seed);
    let mut point = || {
        let [a, b, c] = [0; 3].map(|_| rng.random::<f64>());
        vec![2.0 * a * a, b * b * b + 0.3 * a, 0.5 * c * c * (0.4 + a)]
    };
    (0..count).map(|_| point()).collect()
}

pub fn shuffle(rows: &mut [Vec<f64>], seed: u64) {
    let mut rng = ChaCha12Rng::seed_from_u64(seed);
    for k in (1..rows.len()).rev() {
        rows.swap(k, rng.random_range(0..=k));
    }
}

/// Return a rotation drawn evenly from SO(3) and a translation of that size.
pub fn random_pose(seed: u64, size: f64) -> Pose {
    let mut rng = ChaCha12Rng::seed_from_u64(seed);
    // A uniform quaternion by rejection from the cube.
    let quaternion = loop {
        let q = [0; 4].map(|_| 2.0 * rng.random::<f64>() - 1.0);
        let norm2: f64 = q.iter().map(|v| v * v).sum();
        if norm2 > 0.01 && norm2 < 1.0 {
            break q;
        }
    };
    let translation = [0; 3].map(|_| size * (2.0 * rng.random::<f64>() - 1.0));
    let layout = cfpose::theta::Layout::pose3();
    let list = [quaternion.as_slice(), &translation].concat();
    let theta = layout.from_list(&list, RotationForm::Quaternion).expect("a pose");
    Pose::of_theta(&layout, &theta).expect("a pose")
}

pub fn euler_pose(angles: [f64; 3], translation: [f64; 3]) -> Pose {
    Pose { rotation: rotation_of_euler(&angles), translation }
}

pub fn apply(pose: &Pose, rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
    rows.iter().map(|row| pose.apply([row[0], row[1], row[2]]).to_vec()).collect()
}

/// Return the pose of a result.
pub fn pose_of(result: &Value) -> Pose {
    assert_eq!(result["convention"], "target_from_source");
    let numbers = |value: &Value| -> Vec<f64> { serde_json::from_value(value.clone()).expect("numbers") };
    let rotation: Vec<f64> = (0..3).flat_map(|i| numbers(&result["rotation"][i])).collect();
    let translation = numbers(&result["translation"]);
    for i in 0..3 {
        let row = numbers(&result["matrix"][i]);
        assert_eq!((&row[..3], row[3]), (&rotation[3 * i..3 * i + 3], translation[i]));
    }
    Pose { rotation: rotation.try_into().expect("9 numbers"), translation: translation.try_into().expect("3 numbers") }
}

pub fn degrees_between(a: &Pose, b: &Pose) -> f64 {
    PoseError::between(a, b).angle.to_degrees()
}

/// Return the folder of real data.
pub fn data() -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    std::env::var_os("CFPOSE_DATA").map_or(root, PathBuf::from)
}
