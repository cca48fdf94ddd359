//! The command line's contract, held with the real binary over every scene in `config/`: what is printed, where, in
//! which order, with which bits, and the exit code.
//!
//! A scene that is added to the folder is tested with the others. `BENCH_DRAGON_LONG=1` adds what takes minutes,
//! `trade` on long teams.

mod answers;
mod conventions;
mod events;
mod live;
mod outline;
mod scenes;
mod solve;
