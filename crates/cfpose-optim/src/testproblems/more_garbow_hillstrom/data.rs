//! Published numbers: starts, optima, observations, bounds.

/// A problem of fixed size.
pub(super) struct Fixed {
    pub(super) number: usize,
    pub(super) name: &'static str,
    pub(super) num_residuals: usize,
    pub(super) start: &'static [f64],
    pub(super) optima: &'static [f64],
}

const fn fixed(
    number: usize,
    name: &'static str,
    num_residuals: usize,
    start: &'static [f64],
    optima: &'static [f64],
) -> Fixed {
    Fixed { number, name, num_residuals, start, optima }
}

/// Problems 1 to 19.
pub(super) const FIXED: &[Fixed] = &[
    fixed(1, "Rosenbrock", 2, &[-1.2, 1.0], &[0.0]),
    fixed(2, "Freudenstein and Roth", 2, &[0.5, -2.0], &[0.0, 48.9842536792]),
    fixed(3, "Powell badly scaled", 2, &[0.0, 1.0], &[0.0]),
    fixed(4, "Brown badly scaled", 3, &[1.0, 1.0], &[0.0]),
    fixed(5, "Beale", 3, &[1.0, 1.0], &[0.0]),
    fixed(6, "Jennrich and Sampson", 10, &[0.3, 0.4], &[124.362]),
    fixed(7, "Helical valley", 3, &[-1.0, 0.0, 0.0], &[0.0]),
    fixed(8, "Bard", 15, &[1.0, 1.0, 1.0], &[8.21487e-3, 17.4286]),
    fixed(9, "Gaussian", 15, &[0.4, 1.0, 0.0], &[1.12793e-8]),
    fixed(10, "Meyer", 16, &[0.02, 4000.0, 250.0], &[87.9458]),
    fixed(11, "Gulf research and development", 99, &[5.0, 2.5, 0.15], &[0.0]),
    fixed(12, "Box three-dimensional", 10, &[0.0, 10.0, 20.0], &[0.0]),
    fixed(13, "Powell singular", 4, &[3.0, -1.0, 0.0, 1.0], &[0.0]),
    fixed(14, "Wood", 6, &[-3.0, -1.0, -3.0, -1.0], &[0.0]),
    fixed(15, "Kowalik and Osborne", 11, &[0.25, 0.39, 0.415, 0.39], &[3.07505e-4, 1.02734e-3]),
    fixed(16, "Brown and Dennis", 20, &[25.0, 5.0, -5.0, -1.0], &[85822.2]),
    fixed(17, "Osborne 1", 33, &[0.5, 1.5, -1.0, 0.01, 0.02], &[5.46489e-5]),
    fixed(18, "Biggs EXP6", 13, &[1.0, 2.0, 1.0, 1.0, 1.0, 1.0], &[0.0, 5.65565e-3]),
    fixed(19, "Osborne 2", 65, &[1.3, 0.65, 0.65, 0.7, 0.6, 3.0, 5.0, 7.0, 2.0, 4.5, 5.5], &[4.01377e-2]),
];

/// A bounded variant.
pub(super) struct Boxed {
    pub(super) number: usize,
    pub(super) num_residuals: usize,
    pub(super) lower: &'static [f64],
    pub(super) upper: &'static [f64],
    pub(super) optimum: f64,
}

const fn boxed(
    number: usize,
    num_residuals: usize,
    lower: &'static [f64],
    upper: &'static [f64],
    optimum: f64,
) -> Boxed {
    Boxed { number, num_residuals, lower, upper, optimum }
}

/// The bounded variants.
pub(super) const BOXED: &[Boxed] = &[
    boxed(3, 2, &[0.0, 1.0], &[1.0, 9.0], 0.15125900e-9),
    boxed(4, 3, &[0.0, 0.00003], &[1000000.0, 100.0], 0.78400000e3),
    boxed(5, 3, &[0.6, 0.5], &[10.0, 100.0], 0.0),
    boxed(7, 3, &[-100.0, -1.0, -1.0], &[0.8, 1.0, 1.0], 0.99042212),
    boxed(9, 15, &[0.398, 1.0, -0.5], &[4.2, 2.0, 0.1], 0.11279300e-7),
    boxed(12, 3, &[0.0, 5.0, 0.0], &[2.0, 9.5, 20.0], 0.30998153e-5),
    boxed(14, 6, &[-100.0, -100.0, -100.0, -100.0], &[0.0, 10.0, 100.0, 100.0], 0.15567008e1),
    boxed(16, 20, &[-10.0, 0.0, -100.0, -20.0], &[100.0, 15.0, 0.0, 0.2], 0.88860479e5),
    boxed(18, 13, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0], &[2.0, 8.0, 1.0, 7.0, 5.0, 5.0], 0.53209865e-3),
];

/// Observations of number 8.
pub(super) const BARD: [f64; 15] =
    [0.14, 0.18, 0.22, 0.25, 0.29, 0.32, 0.35, 0.39, 0.37, 0.58, 0.73, 0.96, 1.34, 2.10, 4.39];

/// Observations of number 9.
pub(super) const GAUSSIAN: [f64; 15] = [
    0.0009, 0.0044, 0.0175, 0.0540, 0.1295, 0.2420, 0.3521, 0.3989, 0.3521, 0.2420, 0.1295, 0.0540, 0.0175, 0.0044,
    0.0009,
];

/// Observations of number 10.
pub(super) const MEYER: [f64; 16] = [
    34780.0, 28610.0, 23650.0, 19630.0, 16370.0, 13720.0, 11540.0, 9744.0, 8261.0, 7030.0, 6005.0, 5147.0, 4427.0,
    3820.0, 3307.0, 2872.0,
];

/// Observations y, u of number 15.
pub(super) const KOWALIK: [(f64, f64); 11] = [
    (0.1957, 4.0),
    (0.1947, 2.0),
    (0.1735, 1.0),
    (0.1600, 0.5),
    (0.0844, 0.25),
    (0.0627, 0.167),
    (0.0456, 0.125),
    (0.0342, 0.1),
    (0.0323, 0.0833),
    (0.0235, 0.0714),
    (0.0246, 0.0625),
];

/// Observations of number 17.
pub(super) const OSBORNE1: [f64; 33] = [
    0.844, 0.908, 0.932, 0.936, 0.925, 0.908, 0.881, 0.850, 0.818, 0.784, 0.751, 0.718, 0.685, 0.658, 0.628, 0.603,
    0.580, 0.558, 0.538, 0.522, 0.506, 0.490, 0.478, 0.467, 0.457, 0.448, 0.438, 0.431, 0.424, 0.420, 0.414, 0.411,
    0.406,
];

/// Observations of number 19.
pub(super) const OSBORNE2: [f64; 65] = [
    1.366, 1.191, 1.112, 1.013, 0.991, 0.885, 0.831, 0.847, 0.786, 0.725, 0.746, 0.679, 0.608, 0.655, 0.616, 0.606,
    0.602, 0.626, 0.651, 0.724, 0.649, 0.649, 0.694, 0.644, 0.624, 0.661, 0.612, 0.558, 0.533, 0.495, 0.500, 0.423,
    0.395, 0.375, 0.372, 0.391, 0.396, 0.405, 0.428, 0.429, 0.523, 0.562, 0.607, 0.653, 0.672, 0.708, 0.633, 0.668,
    0.645, 0.632, 0.591, 0.559, 0.597, 0.625, 0.739, 0.710, 0.729, 0.720, 0.636, 0.581, 0.428, 0.292, 0.162, 0.098,
    0.054,
];
