#![no_main]

bench_dragon_fuzz::fuzz!(design_page);
