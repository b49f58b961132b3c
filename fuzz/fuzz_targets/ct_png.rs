//! Fuzzes `ct_png`, see `entries.rs`.
#![no_main]
#[path = "../entries.rs"]
mod entries;
libfuzzer_sys::fuzz_target!(|data: &[u8]| entries::ct_png(data));
