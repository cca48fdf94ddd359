#![no_main]

bench_dragon_fuzz::fuzz!(timecode);
