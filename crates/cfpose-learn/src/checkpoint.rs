//! What a stopped training goes on from: the parameters after every round.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use cfpose_lab::LabError;
use cfpose_lab::seed::fnv1a;
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};

use crate::error::LearnError;

/// Parameters after each round of one configuration.
pub struct Checkpoint {
    path: PathBuf,
    /// Hash of the configuration, which its parameters belong to.
    fingerprint: String,
    /// Parameters, round by round.
    pub rounds: Vec<Vec<f64>>,
}

impl Checkpoint {
    /// Begin at nothing.
    pub fn new(path: &Path, configuration: &str) -> Self {
        let fingerprint = format!("{:016x}", fnv1a(configuration.as_bytes()));
        Self { path: path.to_path_buf(), fingerprint, rounds: Vec::new() }
    }

    /// Take what the file holds; a file that is not there holds nothing.
    ///
    /// # Errors
    /// [`LearnError::Checkpoint`] for a file of another configuration, or a damaged one.
    pub fn resume(mut self) -> Result<Self, LearnError> {
        let bytes = match std::fs::read(&self.path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(self),
            Err(source) => return Err(LabError::Io { path: self.path, action: "read", source }.into()),
        };
        let refuse = |problem: String| LearnError::Checkpoint { path: self.path.clone(), problem };
        let damaged = |error: safetensors::SafeTensorError| refuse(format!("is no checkpoint: {error}; delete it"));
        let (_, header) = SafeTensors::read_metadata(&bytes).map_err(damaged)?;
        let known = header.metadata().as_ref().and_then(|m| m.get("fingerprint"));
        if known != Some(&self.fingerprint) {
            return Err(refuse("belongs to another configuration; delete it or train into another file".to_string()));
        }
        let tensors = SafeTensors::deserialize(&bytes).map_err(damaged)?;
        for round in 0..tensors.len() {
            let view = tensors.tensor(&format!("round-{round}")).map_err(damaged)?;
            let values: Vec<f64> = view.data().as_chunks().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
            if view.dtype() != Dtype::F64 || values.iter().any(|v| !v.is_finite()) {
                return Err(refuse("holds something other than finite numbers; delete it".to_string()));
            }
            self.rounds.push(values);
        }
        Ok(self)
    }

    /// Add the parameters of a round and write the file, first beside it, so that it is whole at every moment.
    ///
    /// # Errors
    /// [`LearnError::File`].
    pub fn push(&mut self, parameters: Vec<f64>) -> Result<(), LearnError> {
        self.rounds.push(parameters);
        let data: Vec<Vec<u8>> =
            self.rounds.iter().map(|round| round.iter().flat_map(|v| v.to_le_bytes()).collect()).collect();
        let broken = |error: safetensors::SafeTensorError| LearnError::Data(format!("checkpoint: {error}"));
        let views: Vec<(String, TensorView<'_>)> = data
            .iter()
            .enumerate()
            .map(|(i, bytes)| Ok((format!("round-{i}"), TensorView::new(Dtype::F64, vec![bytes.len() / 8], bytes)?)))
            .collect::<Result<_, _>>()
            .map_err(broken)?;
        let metadata = HashMap::from([("fingerprint".to_string(), self.fingerprint.clone())]);
        let bytes = safetensors::serialize(views, Some(metadata)).map_err(broken)?;
        write(&self.path, &bytes)
    }

    /// Remove the file.
    pub fn remove(&self) {
        // What is left over is refused or resumed the next time.
        let _ = std::fs::remove_file(&self.path);
    }
}

/// Write a file beside its place and move it there.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), LearnError> {
    let fault = |source| LabError::Io { path: path.to_path_buf(), action: "write", source };
    let beside = path.with_extension("part");
    std::fs::write(&beside, bytes).map_err(fault)?;
    Ok(std::fs::rename(&beside, path).map_err(fault)?)
}
