//! Every file of `tests/data/invalid` is refused with the message beside it.
//!
//! `NAME.expected` holds the command after `$ organza ` and then what it prints.
//! `ORGANZA_BLESS=1 cargo test invalid` writes the messages anew, to be read
//! before they are kept.

use crate::program::{folder, organza};
use std::path::Path;

#[test]
fn every_invalid_file_is_refused_with_its_message_and_nothing_is_written() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/invalid");
    let bless = std::env::var_os("ORGANZA_BLESS").is_some();
    let folder = folder("invalid");
    let mut cases = Vec::new();
    let mut files = 0;
    for entry in std::fs::read_dir(&data).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "expected") {
            cases.push(path);
        } else {
            std::fs::copy(&path, folder.join(path.file_name().unwrap())).unwrap();
            files += 1;
        }
    }
    cases.sort();
    let mut wrong = String::new();
    for case in &cases {
        let expected = std::fs::read_to_string(case).unwrap();
        let command = expected.lines().next().unwrap();
        let words: Vec<&str> = command.split_whitespace().skip(2).collect();
        let out = organza(&folder, &words);
        let said = String::from_utf8_lossy(&out.stderr);
        let found = format!("{command}\n{said}");
        if out.status.code() != Some(2) {
            wrong += &format!("{command}: ended with {:?}\n", out.status.code());
        } else if bless {
            std::fs::write(case, &found).unwrap();
        } else if found != expected {
            wrong += &format!("{command}\nsaid: {said}expected: {expected}\n");
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
    assert!(cases.len() > 40, "only {} cases", cases.len());
    let left = std::fs::read_dir(&folder).unwrap().count();
    assert_eq!(left, files, "something was written");
}
