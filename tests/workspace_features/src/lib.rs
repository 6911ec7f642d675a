//! No code: the features that Cargo.toml asks for are all there is.
