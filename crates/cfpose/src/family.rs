//! Feature families: what their authors write, and the line that each has in the table.

pub use cfpose_kernel::family::*;

use crate::entry::{BuildContext, BuildError, ParameterSpec, Parameters};

/// Build a family from its parameters and the context.
pub type BuildFamily = fn(&Parameters, &BuildContext<'_>) -> Result<Box<dyn DynFamily>, BuildError>;

/// One line of the family table.
pub struct FamilyEntry {
    /// Name, kebab-case, equal to its file name.
    pub name: &'static str,
    /// One line for lists.
    pub summary: &'static str,
    /// Parameters with defaults.
    pub parameters: &'static [ParameterSpec],
    /// Paper equation or reference.
    pub source: &'static str,
    /// Markdown for the generated reference page: formula, order of the functions, when to use it.
    pub details: &'static str,
    /// Build the family.
    pub build: BuildFamily,
}

impl std::fmt::Debug for FamilyEntry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "FamilyEntry({})", self.name)
    }
}
