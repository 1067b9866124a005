#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| mrfgs_fuzz::pose(bytes));
