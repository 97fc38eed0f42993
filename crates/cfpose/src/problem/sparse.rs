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

    /// Return the number of rows.
    pub fn num_rows(&self) -> usize {
        self.starts.len() - 1
    }

    /// Append self * rows, where `rows` has `width` columns.
    pub fn apply(&self, rows: &[f64], width: usize, out: &mut Vec<f64>) {
        let start = out.len();
        out.resize(start + self.num_rows() * width, 0.0);
        let out = &mut out[start..];
        // Columns in runs of fixed length, so that each sum stays in registers.
        let mut column = 0;
        while column < width {
            column += match width - column {
                6.. => self.apply_columns::<6>(rows, width, column, out),
                3.. => self.apply_columns::<3>(rows, width, column, out),
                _ => self.apply_columns::<1>(rows, width, column, out),
            };
        }
    }

    /// Write the columns `first..first + N` of self * rows; returns N.
    fn apply_columns<const N: usize>(&self, rows: &[f64], width: usize, first: usize, out: &mut [f64]) -> usize {
        for (range, out) in self.starts.windows(2).zip(out.chunks_exact_mut(width)) {
            let mut sum = [0.0; N];
            for (k, factor) in &self.entries[range[0]..range[1]] {
                let row = &rows[k * width + first..k * width + first + N];
                for j in 0..N {
                    sum[j] += factor * row[j];
                }
            }
            out[first..first + N].copy_from_slice(&sum);
        }
        N
    }

    /// Return each row as (column, value) pairs.
    pub fn rows(&self) -> impl Iterator<Item = &[(usize, f64)]> {
        self.starts.windows(2).map(|range| &self.entries[range[0]..range[1]])
    }
}
