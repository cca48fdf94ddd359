//! The first touch of two boards that share no handle.
