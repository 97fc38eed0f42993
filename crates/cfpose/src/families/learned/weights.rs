//! The file of trained weights: safetensors with metadata that say what the tensors are and where they come from.

use std::collections::BTreeMap;

use safetensors::{Dtype, SafeTensors};
use serde_json::{Map, Value, json};
use sha2::{Digest, Sha256};

/// Value of the metadata key `format`.
pub const FORMAT: &str = "cfpose-weights/1";

/// Largest file that is read, bytes: three orders of magnitude above the weights that ship.
const MAX_BYTES: usize = 64 << 20;

/// Most rows or columns of a tensor.
const MAX_SIDE: usize = 8192;

/// Largest magnitude of a weight: products of two stay far from overflow.
const MAX_WEIGHT: f64 = 1e100;

/// Why bytes are no weights.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum WeightsError {
    /// The container is damaged or is another kind of file.
    #[error("not a safetensors file, or a damaged one: {0}")]
    Container(String),
    /// A metadata entry is missing or wrong.
    #[error("metadata `{key}`: {problem}")]
    Metadata {
        /// Name of the entry.
        key: String,
        /// What is wrong.
        problem: String,
    },
    /// A tensor is missing or wrong.
    #[error("tensor `{name}`: {problem}")]
    Tensor {
        /// Name of the tensor.
        name: String,
        /// What is wrong.
        problem: String,
    },
}

/// A matrix of weights, row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct Matrix {
    /// Number of rows.
    pub rows: usize,
    /// Entries, row by row.
    pub values: Vec<f64>,
}

impl Matrix {
    /// Return the number of columns.
    pub fn columns(&self) -> usize {
        self.values.len() / self.rows.max(1)
    }
}

/// What the weights are.
#[derive(Debug, Clone, PartialEq)]
pub enum Architecture {
    /// f = M g(x) over the features g of another family.
    Linear {
        /// That family, by name.
        basis: String,
        /// Features x features of the basis.
        matrix: Matrix,
        /// Whether, and with which ridge relative to the mean variance, the features are whitened by the target points
        /// ([`whitening_root`](super::whitening_root)).
        ridge: Option<f64>,
    },
    /// a_i cos(w_i.x), then all a_i sin(w_i.x).
    Frequencies {
        /// w, one row a frequency, rad per unit of the normalised feature space.
        frequencies: Matrix,
        /// a.
        amplitudes: Vec<f64>,
    },
    /// M tanh(W x + b): one hidden layer.
    Perceptron {
        /// W, one row a hidden unit.
        hidden: Matrix,
        /// b.
        bias: Vec<f64>,
        /// M, features x hidden units.
        output: Matrix,
    },
}

/// Trained weights of one feature space.
///
/// ```
/// use cfpose::families::learned::{Architecture, Matrix, Weights};
/// let matrix = Matrix { rows: 1, values: vec![0.5, 2.0] };
/// let weights = Weights {
///     dim: 2,
///     architecture: Architecture::Linear { basis: "hermite[degree=1]".into(), matrix, ridge: None },
///     notes: [("seed".to_string(), "7".to_string())].into(),
/// };
/// let bytes = weights.to_bytes();
/// assert_eq!(Weights::from_bytes(&bytes).unwrap(), weights);
/// // One flipped bit of a weight is found.
/// let mut damaged = bytes.clone();
/// *damaged.last_mut().unwrap() ^= 1;
/// assert!(Weights::from_bytes(&damaged).unwrap_err().to_string().contains("digest"));
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Weights {
    /// Dimension of the normalised feature space, 1 to 3.
    pub dim: usize,
    /// What they are.
    pub architecture: Architecture,
    /// Where they come from: `training` (the configuration), `data`, `seed`, ...; any further metadata of the file.
    pub notes: BTreeMap<String, String>,
}

/// Metadata that are not notes.
const KEYS: [&str; 7] = ["format", "kind", "dim", "basis", "ridge", "activation", "digest"];

/// A tensor as it is stored: name, shape, little-endian bytes.
type Stored = (&'static str, Vec<usize>, Vec<u8>);

impl Weights {
    /// Read weights. Memory is taken in proportion to the bytes that are there, whatever their header claims.
    ///
    /// # Errors
    /// [`WeightsError`] for anything that is not whole, finite and as its metadata say.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, WeightsError> {
        if bytes.len() > MAX_BYTES {
            let problem = format!("{} bytes, and weights have at most {MAX_BYTES}", bytes.len());
            return Err(WeightsError::Container(problem));
        }
        let container = |error: safetensors::SafeTensorError| WeightsError::Container(error.to_string());
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(container)?;
        let tensors = SafeTensors::deserialize(bytes).map_err(container)?;
        let metadata: BTreeMap<String, String> = header.metadata().clone().unwrap_or_default().into_iter().collect();
        let reader = Reader { tensors, metadata };
        reader.expect("format", FORMAT)?;
        reader.check_digest()?;
        let dim = match reader.text("dim")? {
            "1" => 1,
            "2" => 2,
            "3" => 3,
            other => return Err(wrong("dim", format!("`{other}`; expected 1, 2 or 3"))),
        };
        let architecture = reader.architecture(dim)?;
        let mut notes = reader.metadata;
        notes.retain(|key, _| !KEYS.contains(&key.as_str()));
        Ok(Self { dim, architecture, notes })
    }

    /// Write weights: the same bytes for the same weights.
    ///
    /// The header is written here because the container's own writer puts metadata into a random order.
    pub fn to_bytes(&self) -> Vec<u8> {
        let (mut metadata, tensors) = self.stored();
        let views = tensors.iter().map(|(name, shape, data)| (*name, "F64", shape.as_slice(), data.as_slice()));
        metadata.insert("digest".to_string(), digest(&metadata, views));
        let mut header = Map::new();
        header.insert("__metadata__".to_string(), json!(metadata));
        let mut begin = 0;
        for (name, shape, data) in &tensors {
            let end = begin + data.len();
            header.insert((*name).to_string(), json!({ "dtype": "F64", "shape": shape, "data_offsets": [begin, end] }));
            begin = end;
        }
        let mut text = Value::Object(header).to_string();
        // The tensors begin at a multiple of 8 bytes.
        while !text.len().is_multiple_of(8) {
            text.push(' ');
        }
        let mut bytes = (text.len() as u64).to_le_bytes().to_vec();
        bytes.extend(text.as_bytes());
        tensors.iter().for_each(|(_, _, data)| bytes.extend(data));
        bytes
    }

    /// Return metadata without the digest, and the tensors by name.
    fn stored(&self) -> (BTreeMap<String, String>, Vec<Stored>) {
        let mut metadata = self.notes.clone();
        let mut set = |key: &str, value: &str| {
            metadata.insert(key.to_string(), value.to_string());
        };
        set("format", FORMAT);
        set("dim", &self.dim.to_string());
        let data = |values: &[f64]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
        let matrix = |m: &Matrix| (vec![m.rows, m.columns()], data(&m.values));
        let list = |values: &[f64]| (vec![values.len()], data(values));
        let (kind, mut parts) = match &self.architecture {
            Architecture::Linear { basis, matrix: m, ridge } => {
                set("basis", basis);
                if let Some(ridge) = ridge {
                    set("ridge", &ridge.to_string());
                }
                ("linear", vec![("matrix", matrix(m))])
            }
            Architecture::Frequencies { frequencies, amplitudes } => {
                ("frequencies", vec![("amplitudes", list(amplitudes)), ("frequencies", matrix(frequencies))])
            }
            Architecture::Perceptron { hidden, bias, output } => {
                set("activation", "tanh");
                let parts = vec![
                    ("hidden.bias", list(bias)),
                    ("hidden.weight", matrix(hidden)),
                    ("output.weight", matrix(output)),
                ];
                ("perceptron", parts)
            }
        };
        set("kind", kind);
        parts.sort_by_key(|part| part.0);
        (metadata, parts.into_iter().map(|(name, (shape, bytes))| (name, shape, bytes)).collect())
    }
}

fn wrong(key: &str, problem: impl Into<String>) -> WeightsError {
    WeightsError::Metadata { key: key.to_string(), problem: problem.into() }
}

/// Return SHA-256 over all metadata but the digest as `key=value` lines in the order of the keys, then every tensor in the order of
/// the names: a line `name dtype shape` and its bytes.
fn digest<'a>(
    metadata: &BTreeMap<String, String>,
    tensors: impl Iterator<Item = (&'a str, &'a str, &'a [usize], &'a [u8])>,
) -> String {
    let mut hash = Sha256::new();
    for (key, value) in metadata.iter().filter(|(key, _)| *key != "digest") {
        hash.update(format!("{key}={value}\n"));
    }
    for (name, dtype, shape, data) in tensors {
        let shape: Vec<String> = shape.iter().map(usize::to_string).collect();
        hash.update(format!("{name} {dtype} {}\n", shape.join("x")));
        hash.update(data);
    }
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// A container that is whole.
struct Reader<'a> {
    tensors: SafeTensors<'a>,
    metadata: BTreeMap<String, String>,
}

impl Reader<'_> {
    fn text(&self, key: &str) -> Result<&str, WeightsError> {
        self.metadata.get(key).map(String::as_str).ok_or_else(|| wrong(key, "is missing"))
    }

    fn expect(&self, key: &str, expected: &str) -> Result<(), WeightsError> {
        match self.text(key)? {
            found if found == expected => Ok(()),
            found => Err(wrong(key, format!("`{found}`; this version reads `{expected}`"))),
        }
    }

    /// Compare the digest with the content.
    fn check_digest(&self) -> Result<(), WeightsError> {
        let mut views: Vec<_> = self.tensors.iter().collect();
        views.sort_by(|a, b| a.0.cmp(b.0));
        let mut plain = Vec::new();
        for (name, view) in &views {
            let dtype = match view.dtype() {
                Dtype::F64 => "F64",
                Dtype::F32 => "F32",
                other => return Err(tensor(name, format!("dtype {other:?}; expected F64 or F32"))),
            };
            plain.push((*name, dtype, view.shape(), view.data()));
        }
        let found = digest(&self.metadata, plain.into_iter());
        if self.text("digest")? == found {
            return Ok(());
        }
        Err(wrong("digest", format!("does not belong to this content, whose SHA-256 is {found}: the file is damaged")))
    }

    /// Return the finite values of a tensor with `sides` dimensions, and its first side.
    fn values(&self, name: &str, sides: usize) -> Result<Matrix, WeightsError> {
        let view = self.tensors.tensor(name).map_err(|_| tensor(name, "is missing"))?;
        let shape = view.shape();
        if shape.len() != sides || shape.iter().any(|side| !(1..=MAX_SIDE).contains(side)) {
            let problem = format!("shape {shape:?}; expected {sides} side(s), each 1 to {MAX_SIDE}");
            return Err(tensor(name, problem));
        }
        let values: Vec<f64> = match view.dtype() {
            Dtype::F64 => view.data().as_chunks().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect(),
            _ => view.data().as_chunks().0.iter().map(|bytes| f64::from(f32::from_le_bytes(*bytes))).collect(),
        };
        match values.iter().position(|v| !(v.is_finite() && v.abs() <= MAX_WEIGHT)) {
            Some(at) => Err(tensor(name, format!("entry {} is {}; weights are finite", at + 1, values[at]))),
            None => Ok(Matrix { rows: shape[0], values }),
        }
    }

    /// Return the ridge, where there is one.
    fn ridge(&self) -> Result<Option<f64>, WeightsError> {
        let Some(text) = self.metadata.get("ridge") else { return Ok(None) };
        let ridge = text.parse().ok().filter(|v: &f64| *v >= 0.0 && *v <= 1e6);
        ridge.map(Some).ok_or_else(|| wrong("ridge", format!("`{text}`; expected a number from 0 to 1e6")))
    }

    /// Read the tensors of the kind, and refuse any other.
    fn architecture(&self, dim: usize) -> Result<Architecture, WeightsError> {
        let kind = self.text("kind")?;
        let (names, architecture): (&[&str], _) = match kind {
            "linear" => {
                let (basis, matrix) = (self.text("basis")?.to_string(), self.values("matrix", 2)?);
                (&["matrix"], Architecture::Linear { basis, matrix, ridge: self.ridge()? })
            }
            "frequencies" => {
                let (frequencies, amplitudes) = (self.values("frequencies", 2)?, self.values("amplitudes", 1)?.values);
                same("frequencies", "columns", frequencies.columns(), dim)?;
                same("amplitudes", "entries", amplitudes.len(), frequencies.rows)?;
                (&["frequencies", "amplitudes"], Architecture::Frequencies { frequencies, amplitudes })
            }
            "perceptron" => {
                self.expect("activation", "tanh")?;
                let (hidden, bias) = (self.values("hidden.weight", 2)?, self.values("hidden.bias", 1)?.values);
                let output = self.values("output.weight", 2)?;
                same("hidden.weight", "columns", hidden.columns(), dim)?;
                same("hidden.bias", "entries", bias.len(), hidden.rows)?;
                same("output.weight", "columns", output.columns(), hidden.rows)?;
                let names = &["hidden.weight", "hidden.bias", "output.weight"];
                (names, Architecture::Perceptron { hidden, bias, output })
            }
            other => return Err(wrong("kind", format!("`{other}`; expected linear, frequencies or perceptron"))),
        };
        match self.tensors.iter().find(|(name, _)| !names.contains(name)) {
            Some((name, _)) => Err(tensor(name, format!("kind {kind} has no such tensor"))),
            None => Ok(architecture),
        }
    }
}

fn tensor(name: &str, problem: impl Into<String>) -> WeightsError {
    WeightsError::Tensor { name: name.to_string(), problem: problem.into() }
}

fn same(name: &str, what: &str, found: usize, expected: usize) -> Result<(), WeightsError> {
    if found == expected { Ok(()) } else { Err(tensor(name, format!("{found} {what}; expected {expected}"))) }
}
