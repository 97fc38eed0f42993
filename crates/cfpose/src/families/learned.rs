//! Trained families: a matrix over any other family, trained frequencies, a small perceptron.

use cfpose_kernel::family::{BasisRows, DynFamily, General, GradientTerm, Segment};
use cfpose_kernel::isa::Isa;
use cfpose_kernel::map::MapBlock;
use cfpose_kernel::points::Points;
use num_dual::HyperDual64;

use super::shared::waves::Waves;
use crate::entry::{BuildContext, BuildError, FamilyEntry, ParameterSpec, build_family};
use crate::geometry::linalg::symmetric_eigen;

mod adapt;
mod linear;
mod perceptron;
mod weights;

pub use adapt::{feature_covariance, whitening_root};
pub use weights::{Architecture, FORMAT, Matrix, Weights, WeightsError};

use linear::Linear;
use perceptron::Perceptron;

/// Which targets weights are for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum For {
    /// All.
    Any,
    /// Nearly flat ones, such as the rays of a plane, and targets that are not known.
    Flat,
    /// Bodies in space.
    Solid,
}

/// Least share of the largest principal standard deviation that the smallest one of a body has.
const SOLID: f64 = 0.25;

/// Weights that ship: kind, targets, bytes. Each was trained by `cfpose learn` from the file of its name in `experiments/learn`.
const SHIPPED: &[(&str, For, &[u8])] = &[
    ("linear", For::Any, include_bytes!("../../weights/linear-2.safetensors")),
    ("linear", For::Flat, include_bytes!("../../weights/linear-3.safetensors")),
    ("linear", For::Solid, include_bytes!("../../weights/linear-3-solid.safetensors")),
    ("frequencies", For::Any, include_bytes!("../../weights/frequencies-2.safetensors")),
    ("frequencies", For::Any, include_bytes!("../../weights/frequencies-3.safetensors")),
];

/// Say whether normalised target points fill three dimensions.
fn is_solid(target: Option<&Points>) -> bool {
    let Some(target) = target.filter(|target| target.dim() == 3) else { return false };
    let (variances, _) = symmetric_eigen(&target.covariance(), 3);
    let (least, most) = variances.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), v| (a.min(*v), b.max(*v)));
    least.max(0.0).sqrt() >= SOLID * most.sqrt()
}

/// Trained functions, one set for each feature space that there are weights for.
struct Learned {
    /// Of 1, 2 and 3 dimensions.
    parts: [Option<Box<dyn DynFamily>>; 3],
}

impl Learned {
    fn part(&self, dim: usize) -> Option<&dyn DynFamily> {
        self.parts.get(dim.wrapping_sub(1))?.as_deref()
    }
}

impl DynFamily for Learned {
    fn supports(&self, dim: usize) -> bool {
        self.part(dim).is_some_and(|part| part.supports(dim))
    }

    fn num_basis(&self, dim: usize) -> usize {
        self.part(dim).map_or(0, |part| part.num_basis(dim))
    }

    /// Said by [`DynFamily::segments`], which knows the dimension.
    fn per_coordinate(&self) -> Option<usize> {
        None
    }

    fn segments(&self, dim: usize) -> Vec<Segment> {
        self.part(dim).map_or_else(Vec::new, |part| part.segments(dim))
    }

    fn coefficients(&self, dim: usize) -> Option<Vec<f64>> {
        self.part(dim)?.coefficients(dim)
    }

    fn monomials(&self, dim: usize) -> Option<&[[usize; 3]]> {
        self.part(dim)?.monomials(dim)
    }

    fn gradient_terms(&self, dim: usize) -> Option<Vec<GradientTerm>> {
        self.part(dim)?.gradient_terms(dim)
    }

    fn block(&self, isa: Isa, points: &MapBlock, out: BasisRows<'_>) {
        if let Some(part) = self.part(points.x.len()) {
            part.block(isa, points, out);
        }
    }

    fn values(&self, x: &[f64], out: &mut [f64]) {
        if let Some(part) = self.part(x.len()) {
            part.values(x, out);
        }
    }

    fn hyper(&self, x: &[HyperDual64], out: &mut [HyperDual64]) {
        if let Some(part) = self.part(x.len()) {
            part.hyper(x, out);
        }
    }

    fn blur_hyper(&self, dim: usize, covariance: &[HyperDual64], means: &mut [HyperDual64]) -> bool {
        self.part(dim).is_some_and(|part| part.blur_hyper(dim, covariance, means))
    }
}

/// Build the functions of weights.
///
/// # Errors
/// [`BuildError::Data`] where the basis of a linear kind is unknown or of another size; what the basis needs from the data.
pub fn functions(weights: &Weights, context: &BuildContext<'_>) -> Result<Box<dyn DynFamily>, BuildError> {
    let refuse = |problem: String| BuildError::Data { name: "learned".to_string(), problem };
    match &weights.architecture {
        Architecture::Linear { basis, matrix, ridge } => {
            if basis.contains("learned") {
                return Err(refuse(format!(
                    "the basis `{basis}` is itself learned; name the family that it was trained over"
                )));
            }
            let context = BuildContext { dim: weights.dim, ..*context };
            let inner = build_family(basis, &context)
                .map_err(|error| refuse(format!("the basis `{basis}` of the weights: {error}")))?;
            let linear = Linear::new(inner, weights.dim, matrix).map_err(refuse)?;
            match (ridge, context.target) {
                (None, _) => Ok(Box::new(linear)),
                (Some(ridge), Some(target)) if target.dim() == weights.dim => {
                    Ok(Box::new(linear.adapted(target, *ridge).map_err(refuse)?))
                }
                (Some(_), _) => Err(refuse("these weights follow the target points, which are not known here".into())),
            }
        }
        Architecture::Frequencies { frequencies, amplitudes } => {
            let dim = weights.dim;
            let place = |row: &[f64]| std::array::from_fn(|q| row.get(q).copied().unwrap_or(0.0));
            let rows = frequencies.values.chunks_exact(dim).map(place).collect();
            Ok(Box::new(General(Waves::new(rows).with_amplitudes(amplitudes.clone()).only_in(dim))))
        }
        Architecture::Perceptron { hidden, bias, output } => {
            Ok(Box::new(General(Perceptron::new(hidden, bias, output))))
        }
    }
}

/// Read weights and build their functions, at their dimension.
fn with(bytes: &[u8], context: &BuildContext<'_>, parts: &mut Learned) -> Result<(), BuildError> {
    let refuse = |problem: WeightsError| BuildError::Data { name: "learned".into(), problem: problem.to_string() };
    let weights = Weights::from_bytes(bytes).map_err(refuse)?;
    parts.parts[weights.dim - 1] = Some(functions(&weights, context)?);
    Ok(())
}

pub(super) const ENTRY: FamilyEntry = FamilyEntry {
    name: "learned",
    summary: "functions trained for a wide basin: a matrix over Hermite products, trained frequencies, or weights of a file",
    parameters: &[
        ParameterSpec {
            name: "kind",
            default: "linear",
            meaning: "which of the weights that ship: linear or frequencies",
        },
        ParameterSpec {
            name: "file",
            default: "none",
            meaning: "file of weights that `cfpose learn` wrote (docs/learned.md), instead of those that ship; the library takes its bytes from the build context",
        },
    ],
    source: "the open problem of section V: which feature functions; training in cfpose-learn, not in the paper",
    details: "Kinds of weights: `linear`, f = M g(x) with a trained matrix M over the features g of any family, whose cost per point, moments and blur it keeps; `frequencies`, a cos(w.x) and a sin(w.x) with trained w and a, closed-form blur; `perceptron` (from files), M tanh(W x + b), blur by quadrature. Weights are of one dimension of the feature space; those that ship are for 2 and 3. In three dimensions `linear` takes one matrix (18 functions of degree 6) for targets that are nearly flat, such as the rays of a plane, and another (34 of degree 4, whitened by the target points) for bodies: those whose smallest principal standard deviation is at least a quarter of the largest. What was learned, what it costs and where a hand-made family wins: docs/learned.md.",
    build: |parameters, context| {
        let kind = parameters.choice("kind", &[("linear", "linear"), ("frequencies", "frequencies")])?;
        let mut learned = Learned { parts: [None, None, None] };
        match parameters.text("file") {
            "none" => {
                let other = if is_solid(context.target) { For::Flat } else { For::Solid };
                for (_, _, bytes) in SHIPPED.iter().filter(|(shipped, of, _)| *shipped == kind && *of != other) {
                    with(bytes, context, &mut learned)?;
                }
            }
            file => {
                let Some(bytes) = context.files.and_then(|files| files.get(file)) else {
                    let problem =
                        format!("file: `{file}` was not read; hand its bytes to the registry (`Registry::files`)");
                    return Err(BuildError::Data { name: "learned".to_string(), problem });
                };
                with(bytes, context, &mut learned)?;
            }
        }
        Ok(Box::new(learned))
    },
};
