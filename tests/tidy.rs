//! Rules of the workspace that the compiler does not check.
