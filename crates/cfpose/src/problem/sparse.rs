//! Sparse matrices: coefficient matrices of families are mostly zeros, and they are applied at every evaluation.

/// A matrix in compressed rows.
pub(super) struct SparseMatrix {
    starts: Vec<usize>,
    entries: Vec<(usize, f64)>,
}

impl SparseMatrix {
    /// Compress a dense matrix (row by row) of `width` columns.
    pub fn new(dense: &[f64], width: usize) -> Self {
        let (mut starts, mut entries) = (vec![0], Vec::new());
        for row in dense.chunks_exact(width) {
            entries.extend(row.iter().copied().enumerate().filter(|(_, value)| *value != 0.0));
            starts.push(entries.len());
        }
        Self { starts, entries }
    }

    /// Append self * rows, where `rows` has `width` columns.
    pub fn apply(&self, rows: &[f64], width: usize, out: &mut Vec<f64>) {
        for range in self.starts.windows(2) {
            let start = out.len();
            out.resize(start + width, 0.0);
            for (k, factor) in &self.entries[range[0]..range[1]] {
                for (value, entry) in out[start..].iter_mut().zip(&rows[k * width..(k + 1) * width]) {
                    *value += factor * entry;
                }
            }
        }
    }

    /// Return each row as (column, value) pairs.
    pub fn rows(&self) -> impl Iterator<Item = &[(usize, f64)]> {
        self.starts.windows(2).map(|range| &self.entries[range[0]..range[1]])
    }
}
