//! Linear assignment: the one-to-one correspondence of least total squared distance.

/// Assign each row of a cost matrix (rows x columns, row by row, rows <= columns, finite) a column of its own so that the
/// total cost is least.
///
/// Shortest augmenting paths with dual variables, O(rows^2 columns).
///
/// Source: Jonker and Volgenant, A shortest augmenting path algorithm for dense and sparse linear assignment problems,
/// Computing 38 (1987); the rectangular form of Crouse 2016. *Differs from source*: no initial column reduction.
///
/// ```
/// let cost = [4.0, 1.0, 3.0, 2.0, 0.0, 5.0, 3.0, 2.0, 2.0];
/// assert_eq!(cfpose::distances::assign(&cost, 3), Some(vec![1, 0, 2]));
/// ```
///
/// Returns `None` when the length is no multiple of `columns`, when there are more rows than columns, or for a NaN.
pub fn assign(cost: &[f64], columns: usize) -> Option<Vec<usize>> {
    let rows = cost.len().checked_div(columns)?;
    if rows * columns != cost.len() || rows > columns || cost.iter().any(|value| value.is_nan()) {
        return None;
    }
    let mut search = Search {
        cost,
        columns,
        row_dual: vec![0.0; rows],
        column_dual: vec![0.0; columns],
        row_of: vec![None; columns],
        column_of: vec![None; rows],
    };
    (0..rows).for_each(|row| search.augment(row));
    search.column_of.into_iter().collect()
}

/// Dual variables and the partial assignment.
struct Search<'a> {
    cost: &'a [f64],
    columns: usize,
    row_dual: Vec<f64>,
    column_dual: Vec<f64>,
    row_of: Vec<Option<usize>>,
    column_of: Vec<Option<usize>>,
}

impl Search<'_> {
    /// Find the shortest path of reduced costs from a free row to a free column (Dijkstra) and flip it.
    fn augment(&mut self, free_row: usize) {
        let mut length = vec![f64::INFINITY; self.columns];
        let mut previous_row = vec![free_row; self.columns];
        let mut done = vec![false; self.columns];
        let (mut row, mut reached) = (free_row, 0.0);
        let sink = loop {
            let mut nearest = None;
            for column in (0..self.columns).filter(|column| !done[*column]) {
                let reduced = self.cost[row * self.columns + column] - self.row_dual[row] - self.column_dual[column];
                if reached + reduced < length[column] {
                    length[column] = reached + reduced;
                    previous_row[column] = row;
                }
                // Among equal lengths a free column ends the search.
                let better = nearest.is_none_or(|best: usize| {
                    length[column] < length[best]
                        || length[column] == length[best]
                            && self.row_of[column].is_none()
                            && self.row_of[best].is_some()
                });
                if better {
                    nearest = Some(column);
                }
            }
            let Some(column) = nearest else { return };
            reached = length[column];
            done[column] = true;
            match self.row_of[column] {
                Some(next) => row = next,
                None => break column,
            }
        };
        self.row_dual[free_row] += reached;
        for column in (0..self.columns).filter(|column| done[*column]) {
            if let Some(owner) = self.row_of[column] {
                self.row_dual[owner] += reached - length[column];
            }
            self.column_dual[column] -= reached - length[column];
        }
        let mut column = sink;
        loop {
            let row = previous_row[column];
            self.row_of[column] = Some(row);
            match self.column_of[row].replace(column) {
                Some(next) if row != free_row => column = next,
                _ => return,
            }
        }
    }
}
