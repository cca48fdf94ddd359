//! The command line's contract, tested with the real binary over every scene in `config/`: the output, its streams,
//! order and bits, and the exit code.
//!
//! A scene that is added to the folder is tested with the others. `BENCH_DRAGON_LONG=1` adds tests of minutes: `trade`
//! on long teams.

mod answers;
mod conventions;
mod events;
mod live;
mod outline;
mod scenes;
mod solve;
