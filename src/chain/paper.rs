//! The paper's solver, with its rules and its errors.
