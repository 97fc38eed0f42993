//! Sparse matrices: coefficient matrices of families are mostly zeros, and they are applied at every evaluation.

use pulp::{Simd, WithSimd};

use cfpose_kernel::isa::Isa;

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
    pub fn apply(&self, isa: Isa, rows: &[f64], width: usize, out: &mut Vec<f64>) {
        let start = out.len();
        out.resize(start + self.num_rows() * width, 0.0);
        isa.run(Product { matrix: self, rows, width, out: &mut out[start..] });
    }

    /// Return each row as (column, value) pairs.
    pub fn rows(&self) -> impl Iterator<Item = &[(usize, f64)]> {
        self.starts.windows(2).map(|range| &self.entries[range[0]..range[1]])
    }
}

/// A product with a matrix, compiled for each instruction set.
struct Product<'a> {
    matrix: &'a SparseMatrix,
    rows: &'a [f64],
    width: usize,
    out: &'a mut [f64],
}

impl WithSimd for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _simd: S) {
        // Columns in runs of fixed length, so that each sum stays in registers.
        let mut column = 0;
        while column < self.width {
            match self.width - column {
                6.. => column += self.columns::<6>(column),
                3.. => column += self.columns::<3>(column),
                _ => column += self.columns::<1>(column),
            }
        }
    }
}

impl Product<'_> {
    /// Write the columns `first..first + N`; returns N.
    #[inline(always)]
    fn columns<const N: usize>(&mut self, first: usize) -> usize {
        let (width, rows) = (self.width, self.rows);
        for (range, out) in self.matrix.starts.windows(2).zip(self.out.chunks_exact_mut(width)) {
            let mut sum = [0.0; N];
            for (k, factor) in &self.matrix.entries[range[0]..range[1]] {
                let row = &rows[k * width + first..k * width + first + N];
                for j in 0..N {
                    sum[j] += factor * row[j];
                }
            }
            out[first..first + N].copy_from_slice(&sum);
        }
        N
    }
}
