//! Where frames go: each transport implements [`Publisher`](crate::live::Publisher); none knows another, nor a solver.

pub mod iceoryx2;
