//! Home of the benches; each file beside this one is a target of its own.
