//! The table line of the blur by quadrature.

use std::sync::Arc;

pub use cfpose_kernel::family::QuadratureBlur;

use crate::entry::FamilyEntry;
use crate::entry::{ParameterSpec, build_family};

pub(super) const ENTRY: FamilyEntry = FamilyEntry {
    name: "quadrature-blur",
    summary: "any family with a noise blur by Gauss-Hermite quadrature, for families without a closed form",
    parameters: &[
        ParameterSpec { name: "family", default: "rbf[count=8]", meaning: "any family, with its own parameters" },
        ParameterSpec { name: "nodes", default: "5", meaning: "nodes per coordinate, odd, 3 to 9" },
        ParameterSpec {
            name: "spread",
            default: "0.1",
            meaning: "standard deviation of the noise at which it is most accurate, units of the feature space",
        },
    ],
    source: "Gauss-Hermite quadrature with weights that follow the covariance; not in the paper",
    details: "The functions of `family`, unchanged; noise is modelled by evaluating them at nodes^dim shifts of every point, which costs that many times as much. Problems that model noise take it by themselves, with the defaults, where a family has no closed-form blur.",
    build: |parameters, context| {
        let nodes = parameters.count("nodes", 3, 9)?;
        if nodes % 2 == 0 {
            return Err(parameters.bad("nodes", "expected an odd number from 3 to 9").into());
        }
        let spread = parameters.number("spread", "a positive number", |s| s > 0.0 && s.is_finite())?;
        if parameters.text("family").contains("quadrature-blur") {
            let problem = "a blur of a blur costs nodes^dim times nodes^dim evaluations; blur once, with more nodes";
            return Err(parameters.bad("family", problem).into());
        }
        let inner = build_family(parameters.text("family"), context)?;
        Ok(Box::new(QuadratureBlur::new(Arc::from(inner), nodes, spread)))
    },
};
