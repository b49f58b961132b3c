//! `organza library`: a page for several fabrics, of which only what has changed is made again.

use crate::program::{complaint, folder, succeed};
use std::path::Path;
use std::time::SystemTime;

const CLOTH: &str = "name = \"</script> & \\\"net\\\"\"\n[draft]\nweave = \"plain\"\n[warp]\n\
                     per_cm = 20.0\n[weft]\nper_cm = 20.0\n";

fn made(path: &Path) -> SystemTime {
    std::fs::metadata(path).unwrap().modified().unwrap()
}

#[test]
fn a_library_makes_what_is_missing_and_keeps_the_rest() {
    let folder = folder("library");
    std::fs::create_dir_all(folder.join("cloths/open")).unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
    write("cloths/open/net.toml", CLOTH);
    write("cloths/twill.toml", &CLOTH.replace("plain", "twill-2-2"));
    let library = "library cloths -o out --only sheet";
    succeed(&folder, library);
    let page = std::fs::read_to_string(folder.join("out/index.html")).unwrap();
    assert!(page.contains("open_net") && page.contains("twill-2-2"));
    // Names of fabrics end no script.
    assert_eq!(page.matches("</script>").count(), 1, "{page}");
    let sheets = ["out/open_net/sheet.json", "out/twill/sheet.json"].map(|s| folder.join(s));
    let before = sheets.each_ref().map(|s| made(s));
    let changed = CLOTH.replace("20.0", "18.0");
    write("cloths/open/net.toml", &changed);
    succeed(&folder, library);
    let after = sheets.each_ref().map(|s| made(s));
    assert!(after[0] > before[0] && after[1] == before[1]);
    let copy = std::fs::read_to_string(folder.join("out/open_net/net.toml")).unwrap();
    assert_eq!(copy, changed);

    // Nothing is written unless all fabrics can be read.
    write("cloths/wrong.toml", &CLOTH.replace("plain", "plian"));
    let words = complaint(&folder, "library cloths -o new");
    assert!(
        words.contains("wrong.toml") && words.contains("plain"),
        "{words}"
    );
    assert!(!folder.join("new").exists());
    let twice = "library cloths/twill.toml cloths/twill.toml -o new";
    assert!(complaint(&folder, twice).contains("both would be called twill"));
    let inside = "library out/twill/twill.toml -o out";
    assert!(complaint(&folder, inside).contains("lies in the folder of the library"));
}
