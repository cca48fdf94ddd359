//! The reason why a line is refused.

use std::fmt;

/// The condition of a line that does not hold, as a sentence without the number of the line.
#[derive(Debug)]
pub(super) struct Problem(String);

/// The result of a check.
pub(super) type Checked<T = ()> = Result<T, Problem>;

impl From<String> for Problem {
    fn from(sentence: String) -> Self {
        Self(sentence)
    }
}

impl From<Problem> for String {
    fn from(problem: Problem) -> Self {
        problem.0
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.0)
    }
}

/// Makes a [`Problem`] of the arguments of `format!`.
macro_rules! problem {
    ($($sentence:tt)*) => {
        $crate::problem::Problem::from(format!($($sentence)*))
    };
}

/// Returns the problem from the function unless the condition holds.
macro_rules! ensure {
    ($condition:expr, $($sentence:tt)*) => {
        if !$condition {
            return Err($crate::problem::problem!($($sentence)*));
        }
    };
}

pub(super) use {ensure, problem};
