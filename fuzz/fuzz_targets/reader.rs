//! Fuzzes the reader of the target's name, see `entries.rs`.
#![no_main]
#[path = "../entries.rs"]
mod entries;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let name = env!("CARGO_BIN_NAME");
    let reader = entries::ALL.iter().find(|reader| reader.0 == name);
    reader.expect("every target has the name of a reader").1(data);
});
