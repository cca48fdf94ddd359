//! Tests of the checker: its intervals against exact integers, its lemmas and its rules on cases made by hand.

mod intervals;
mod lemmas;
mod rules;
