#![no_main]

bench_dragon_fuzz::fuzz!(command_line);
