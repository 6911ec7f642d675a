//! Does nothing; without a build script, the build dependencies of this package would be left out.

fn main() {}
