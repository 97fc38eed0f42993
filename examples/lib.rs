//! Home of the examples; each file beside this one is a target of its own.
