//! Simple players for benches, demos and tests.
