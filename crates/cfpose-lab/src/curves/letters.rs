//! Outlines of letters, drawn by hand: corners and long straight pieces, which no curve of a training has.

use cfpose::entry::{EntryError, ParameterSpec};

use super::{Curve, CurveEntry, along};

/// Corners of each letter in order, closed; units are arbitrary, y points up.
const LETTERS: &[(&str, &[[f64; 2]])] = &[
    ("F", &[[0., 0.], [2., 0.], [2., 4.], [5., 4.], [5., 6.], [2., 6.], [2., 8.], [6., 8.], [6., 10.], [0., 10.]]),
    (
        "G",
        &[
            [6., 7.],
            [8., 8.],
            [6.5, 9.5],
            [4., 10.],
            [1.5, 9.],
            [0.2, 7.],
            [0., 5.],
            [0.3, 2.8],
            [1.8, 0.8],
            [4., 0.],
            [6.5, 0.4],
            [8., 1.5],
            [8., 5.],
            [4.5, 5.],
            [4.5, 3.5],
            [6., 3.5],
            [6., 2.3],
            [4., 1.9],
            [2.4, 3.],
            [2., 5.],
            [2.4, 7.],
            [4., 8.1],
        ],
    ),
    (
        "J",
        &[
            [4., 10.],
            [4., 3.],
            [3.6, 2.2],
            [2.8, 2.],
            [2.1, 2.3],
            [1.8, 3.2],
            [0., 3.],
            [0.5, 1.2],
            [1.7, 0.2],
            [3., 0.],
            [4.7, 0.5],
            [5.7, 1.6],
            [6., 3.],
            [6., 10.],
        ],
    ),
    (
        "K",
        &[
            [0., 0.],
            [2., 0.],
            [2., 3.2],
            [3., 4.3],
            [5.2, 0.],
            [7.6, 0.],
            [4.4, 5.8],
            [7.8, 10.],
            [5.2, 10.],
            [2., 5.9],
            [2., 10.],
            [0., 10.],
        ],
    ),
    ("L", &[[0., 0.], [6., 0.], [6., 2.], [2., 2.], [2., 10.], [0., 10.]]),
    (
        "R",
        &[
            [0., 0.],
            [2., 0.],
            [2., 4.],
            [3., 4.],
            [5., 0.],
            [7.3, 0.],
            [5., 4.4],
            [6.4, 5.4],
            [7., 7.],
            [6.5, 8.8],
            [5.2, 9.8],
            [3.5, 10.],
            [0., 10.],
        ],
    ),
];

pub(super) const ENTRY: CurveEntry = CurveEntry {
    name: "letter",
    summary: "outline of a letter, evenly along its length",
    parameters: &[ParameterSpec { name: "of", default: "F", meaning: "F, G, J, K, L or R" }],
    source: "project, drawn by hand",
    build: |parameters| {
        let wanted = parameters.text("of");
        let found = LETTERS.iter().find(|(name, _)| *name == wanted);
        let (_, corners) = found.ok_or_else(|| parameters.bad("of", "expected F, G, J, K, L or R"))?;
        Ok::<Curve, EntryError>(along(corners))
    },
};
