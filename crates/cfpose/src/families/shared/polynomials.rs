//! Parameters of the polynomial families.

use cfpose_kernel::family::polynomial::Products;

use crate::entry::ParameterSpec;

/// Parameters of all polynomial families.
pub const DEGREE_AND_KIND: [ParameterSpec; 2] = [
    ParameterSpec { name: "degree", default: "3", meaning: "largest degree, 1 to 8" },
    ParameterSpec {
        name: "kind",
        default: "total",
        meaning: "total: all products up to the degree; separable: powers of single coordinates",
    },
];

/// Names of [`Products`] in parameters.
pub const KINDS: [(&str, Products); 2] = [("total", Products::Total), ("separable", Products::Separable)];

/// Parameters of polynomials on an interval.
pub const INTERVAL: [ParameterSpec; 4] = [
    DEGREE_AND_KIND[0],
    DEGREE_AND_KIND[1],
    ParameterSpec {
        name: "scale",
        default: "value",
        meaning: "value: orthonormal functions; raw: the polynomials with value 1 at the end of the interval",
    },
    ParameterSpec {
        name: "half-width",
        default: "1",
        meaning: "half the length a of the interval -a..a, units of the feature space",
    },
];

/// Values of the parameter `scale`: whether functions are normalised.
pub const SCALES: [(&str, bool); 2] = [("value", true), ("raw", false)];
