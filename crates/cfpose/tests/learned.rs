//! Weights of trained families: what is refused and why, and that what is accepted is what the file says.

use std::sync::Arc;

use cfpose::check::{Sample, derivatives};
use cfpose::families::learned::{Architecture, Matrix, Weights};
use cfpose::{BuildContext, Execution, Points, Registry};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;

fn random(rows: usize, columns: usize, seed: u64) -> Matrix {
    let mut rng = ChaCha12Rng::seed_from_u64(seed);
    Matrix { rows, values: (0..rows * columns).map(|_| rng.random::<f64>() - 0.5).collect() }
}

fn linear(basis: &str, rows: usize, columns: usize) -> Weights {
    let architecture = Architecture::Linear { basis: basis.to_string(), matrix: random(rows, columns, 1), ridge: None };
    Weights { dim: 3, architecture, notes: [("seed".to_string(), "1".to_string())].into() }
}

fn perceptron() -> Weights {
    let (hidden, output) = (random(9, 3, 2), random(8, 9, 3));
    Weights {
        dim: 3,
        architecture: Architecture::Perceptron { hidden, bias: random(9, 1, 4).values, output },
        notes: [].into(),
    }
}

fn frequencies() -> Weights {
    let architecture = Architecture::Frequencies { frequencies: random(5, 3, 5), amplitudes: random(5, 1, 6).values };
    Weights { dim: 3, architecture, notes: [].into() }
}

/// Build `learned` from bytes in three dimensions.
fn build(bytes: Vec<u8>) -> Result<Box<dyn cfpose::family::DynFamily>, String> {
    let mut registry = Registry::default();
    registry.files.insert("w".to_string(), Arc::from(bytes));
    let context = BuildContext { dim: 3, ..BuildContext::default() };
    registry.family("learned[file=w]", &context).map_err(|error| error.to_string())
}

#[test]
fn damaged_and_truncated_files_are_refused_in_one_line() {
    let whole = linear("hermite[degree=1]", 6, 3).to_bytes();
    assert!(Weights::from_bytes(&whole).is_ok() && whole.len() < 1000);
    for length in 0..whole.len() {
        assert!(Weights::from_bytes(&whole[..length]).is_err(), "{length} bytes");
    }
    for at in 0..whole.len() {
        for bit in [0, 3, 7] {
            let mut damaged = whole.clone();
            damaged[at] ^= 1 << bit;
            // White space behind the header says nothing, and nothing else may be read as the same weights or as others.
            if let Ok(read) = Weights::from_bytes(&damaged) {
                assert_eq!(read, Weights::from_bytes(&whole).unwrap(), "byte {at}, bit {bit}");
            }
        }
    }
    for bytes in [&whole[..9], b"", b"{}", &[0xff; 64]] {
        let message = build(bytes.to_vec()).err().unwrap();
        assert!(message.starts_with("learned: not a safetensors file") && message.lines().count() == 1, "{message}");
    }
}

/// Write a container with metadata and tensors (name, dtype, shape, bytes) as they are given, right or wrong.
fn container(metadata: &[(&str, &str)], tensors: &[(&str, &str, &str, usize)]) -> Vec<u8> {
    let text = |pairs: &[(&str, &str)]| {
        pairs.iter().map(|(key, value)| format!("\"{key}\":\"{value}\"")).collect::<Vec<_>>().join(",")
    };
    let (mut header, mut end) = (format!("{{\"__metadata__\":{{{}}}", text(metadata)), 0);
    for (name, dtype, shape, bytes) in tensors {
        let begin = end;
        end += bytes;
        header += &format!(",\"{name}\":{{\"dtype\":\"{dtype}\",\"shape\":{shape},\"data_offsets\":[{begin},{end}]}}");
    }
    header += "}";
    let mut all = (header.len() as u64).to_le_bytes().to_vec();
    all.extend(header.bytes());
    all.resize(all.len() + end, 0);
    all
}

#[test]
fn hostile_headers_allocate_nothing_and_name_the_reason() {
    let message = |bytes: Vec<u8>| {
        let text = build(bytes).err().unwrap();
        assert_eq!(text.lines().count(), 1, "{text}");
        text
    };
    // A header of 2^63 bytes, tensors of 2^60 entries, offsets beyond the file, products that overflow.
    let mut claimed = u64::MAX.to_le_bytes().to_vec();
    claimed.extend([b' '; 100]);
    assert!(message(claimed).contains("not a safetensors file"));
    let known = [("format", "cfpose-weights/1"), ("kind", "linear"), ("dim", "3")];
    for shape in ["[1152921504606846976,1]", "[18446744073709551615,18446744073709551615]", "[3]", "[-1,3]", "[1e3,2]"]
    {
        assert!(
            message(container(&known, &[("matrix", "F64", shape, 16)])).contains("not a safetensors file"),
            "{shape}"
        );
    }
    let mut short = container(&known, &[("matrix", "F64", "[100,100]", 80_000)]);
    short.truncate(400);
    assert!(message(short).contains("not a safetensors file"));
    let deep = format!("{{\"__metadata__\":{}}}", "[".repeat(200_000));
    let mut bytes = (deep.len() as u64).to_le_bytes().to_vec();
    bytes.extend(deep.bytes());
    assert!(message(bytes).contains("not a safetensors file"));
    // Whole containers of something else.
    assert!(message(container(&[], &[])).contains("metadata `format`: is missing"));
    assert!(
        message(container(&[("format", "other/9")], &[])).contains("`other/9`; this version reads `cfpose-weights/1`")
    );
    assert!(message(container(&known, &[("matrix", "I64", "[1,3]", 24)])).contains("dtype I64; expected F64 or F32"));
    assert!(message(container(&known, &[])).contains("metadata `digest`: is missing"));
    let wrong = [&known[..], &[("digest", "00")]].concat();
    assert!(message(container(&wrong, &[])).contains("the file is damaged"));
}

#[test]
fn weights_that_contradict_themselves_are_refused() {
    let message = |weights: Weights| build(weights.to_bytes()).err().unwrap();
    let with = |matrix: Matrix| {
        let mut weights = linear("hermite[degree=1]", 6, 3);
        weights.architecture = Architecture::Linear { basis: "hermite[degree=1]".to_string(), matrix, ridge: None };
        message(weights)
    };
    for bad in [f64::NAN, f64::INFINITY, 1e200] {
        let mut matrix = random(6, 3, 1);
        matrix.values[4] = bad;
        assert!(with(matrix).contains("tensor `matrix`: entry 5 is"), "{bad}");
    }
    assert!(with(random(6, 4, 1)).contains("`matrix` has 4 columns, its basis 3 functions"));
    assert!(with(Matrix { rows: 0, values: Vec::new() }).contains("shape [0, 0]"));
    assert!(message(linear("hermit[degree=1]", 6, 3)).contains("did you mean hermite"));
    assert!(message(linear("learned[file=w]", 6, 3)).contains("is itself learned"));
    assert!(message(linear("quadrature-blur[family=random-fourier[count=4096],nodes=9]", 6, 3)).contains("learned: "));
    let mut flat = frequencies();
    flat.dim = 2;
    assert!(message(flat).contains("tensor `frequencies`: 3 columns; expected 2"));
    let mut short = perceptron();
    if let Architecture::Perceptron { bias, .. } = &mut short.architecture {
        bias.pop();
    }
    assert!(message(short).contains("tensor `hidden.bias`: 8 entries; expected 9"));
    // Two dimensions do not serve a feature space of three, and bytes that nobody read are no weights.
    let mut two = linear("hermite[degree=1]", 6, 2);
    two.dim = 2;
    assert_eq!(message(two), "learned: the family does not exist in 3 dimension(s)");
    let absent = Registry::default().family("learned[file=x]", &BuildContext::default()).err().unwrap().to_string();
    assert!(absent.contains("`x` was not read"), "{absent}");
}

#[test]
fn trained_functions_are_what_the_file_says_with_exact_derivatives() {
    let x = [0.3, -0.2, 0.5];
    let weights = linear("hermite[degree=2]", 7, 9);
    let basis = Registry::default().family("hermite[degree=2]", &BuildContext::default()).unwrap().features(&x);
    let Architecture::Linear { matrix, .. } = &weights.architecture else { panic!() };
    let features = build(weights.to_bytes()).unwrap().features(&x);
    for (i, row) in matrix.values.chunks(9).enumerate() {
        let expected: f64 = row.iter().zip(&basis).map(|(a, b)| a * b).sum();
        assert!((features[i] - expected).abs() < 1e-14);
    }
    let Architecture::Frequencies { frequencies: w, amplitudes } = frequencies().architecture else { panic!() };
    let features = build(frequencies().to_bytes()).unwrap().features(&x);
    let phase: f64 = (0..3).map(|q| w.values[q] * x[q]).sum();
    assert!((features[0] - amplitudes[0] * phase.cos()).abs() < 1e-14);
    assert!((features[5] - amplitudes[0] * phase.sin()).abs() < 1e-14);
    let mut registry = Registry::default();
    for (name, weights) in [("l", weights), ("f", frequencies()), ("p", perceptron())] {
        registry.files.insert(name.to_string(), Arc::from(weights.to_bytes()));
    }
    for name in ["learned[file=l]", "learned[file=f]", "learned[file=p]", "learned", "learned[kind=frequencies]"] {
        for model in ["rigid3", "plane-bearing", "rigid2"] {
            let Ok(sample) = Sample::draw(&registry, model, 120, 0.4, 3) else { panic!("{model}") };
            let Ok(Some(problem)) = sample.problem(&registry, name, &Execution::default()) else { continue };
            let report = derivatives(&problem, &sample.theta);
            assert!(report.finite_difference < 1e-6 && report.oracle < 1e-12, "{name} {model}: {report:?}");
        }
    }
}

#[test]
fn whitening_by_the_target_makes_means_uncorrelated() {
    let mut weights = linear("hermite[degree=2]", 7, 9);
    if let Architecture::Linear { ridge, .. } = &mut weights.architecture {
        *ridge = Some(0.0);
    }
    let mut rng = ChaCha12Rng::seed_from_u64(9);
    let rows: Vec<[f64; 3]> = (0..300).map(|_| std::array::from_fn(|_| rng.random::<f64>() - 0.4)).collect();
    let target = Points::from_rows(&rows).unwrap();
    let mut registry = Registry::default();
    registry.files.insert("w".to_string(), Arc::from(weights.to_bytes()));
    let context = BuildContext { dim: 3, target: Some(&target), ..BuildContext::default() };
    let family = registry.family("learned[file=w]", &context).unwrap();
    let covariance = cfpose::families::learned::feature_covariance(family.as_ref(), &target);
    for (at, value) in covariance.iter().enumerate() {
        assert!((value - f64::from(u8::from(at / 7 == at % 7))).abs() < 1e-8, "{at}: {value}");
    }
    let without = BuildContext { target: None, ..context };
    let message = registry.family("learned[file=w]", &without).err().unwrap().to_string();
    assert!(message.contains("follow the target points"), "{message}");
}
