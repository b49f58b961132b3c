use super::*;

fn about() -> Description {
    Description {
        kind: "table".into(),
        name: "cloth.toml".into(),
        details: "test".into(),
        program: "organza".into(),
    }
}

/// The cache of a folder that exists.
fn cache(folder: &Path, limit_bytes: u64) -> Cache {
    let cache = Cache::new(folder, limit_bytes);
    cache.make().unwrap();
    cache
}

fn key(name: &str) -> Key {
    Key::of("table", &[name.as_bytes()])
}

fn write(cache: &Cache, name: &str, bytes: &[u8]) -> bool {
    let kept = cache.write(&key(name), &about(), |out| out.write_all(bytes));
    kept.unwrap()
}

fn read(cache: &Cache, name: &str) -> Option<Vec<u8>> {
    cache.read(&key(name), u64::MAX).unwrap()
}

/// The time of last use of an entry, moved into the past.
fn age(cache: &Cache, name: &str, seconds: u64) {
    let file = File::options().append(true).open(cache.path(&key(name)));
    let then = SystemTime::now() - Duration::from_secs(seconds);
    file.unwrap().set_modified(then).unwrap();
}

#[test]
fn entries_are_read_back_described_and_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let inner = folder.path().join("a/b");
    let cache = cache(&inner, 1 << 20);
    assert_eq!(read(&cache, "x"), None);
    assert!(write(&cache, "x", b"one"));
    assert!(write(&cache, "x", b"two"));
    assert_eq!(read(&cache, "x").unwrap(), b"two");
    let [entry] = &cache.entries().unwrap()[..] else {
        panic!("one entry");
    };
    assert_eq!(entry.description(), Some(about()));
    assert_eq!(cache.read(&key("x"), 10).unwrap(), None, "too large");
    let tag = std::fs::read_to_string(inner.join("CACHEDIR.TAG")).unwrap();
    assert!(tag.starts_with("Signature: 8a477f597d28d172789f06886806bc55"));
}

#[test]
fn a_damaged_entry_is_an_error_once_and_is_then_gone() {
    let folder = tempfile::tempdir().unwrap();
    let cache = cache(folder.path(), 1 << 20);
    write(&cache, "x", b"result");
    let path = cache.path(&key("x"));
    let mut bytes = std::fs::read(&path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 4;
    std::fs::write(&path, bytes).unwrap();
    let damaged = cache.read(&key("x"), u64::MAX).unwrap_err();
    assert_eq!(damaged.kind(), ErrorKind::InvalidData);
    assert_eq!(read(&cache, "x"), None);
}

#[test]
fn a_write_that_fails_leaves_nothing_and_keeps_the_old_entry() {
    let folder = tempfile::tempdir().unwrap();
    let cache = cache(folder.path(), 1 << 20);
    write(&cache, "x", b"old");
    let failed = cache.write(&key("x"), &about(), |out| {
        out.write_all(b"half")?;
        Err(ErrorKind::StorageFull.into())
    });
    assert_eq!(failed.unwrap_err().kind(), ErrorKind::StorageFull);
    assert_eq!(read(&cache, "x").unwrap(), b"old");
    let names = std::fs::read_dir(folder.path()).unwrap();
    let left = names.filter(|n| n.as_ref().unwrap().path().extension() == Some("tmp".as_ref()));
    assert_eq!(left.count(), 0);
}

#[test]
fn the_entry_that_was_not_used_for_the_longest_time_makes_room() {
    let folder = tempfile::tempdir().unwrap();
    let one = {
        let cache = cache(folder.path(), 1 << 20);
        write(&cache, "a", &[0; 1000]);
        cache.entries().unwrap()[0].bytes
    };
    let cache = cache(folder.path(), 3 * one);
    for name in ["b", "c"] {
        write(&cache, name, &[0; 1000]);
    }
    for (name, seconds) in [("a", 300), ("b", 200), ("c", 100)] {
        age(&cache, name, seconds);
    }
    read(&cache, "a").unwrap(); // used now
    write(&cache, "d", &[0; 1000]);
    let held = ["a", "b", "c", "d"].map(|name| read(&cache, name).is_some());
    assert_eq!(held, [true, false, true, true]);
    assert!(!write(&cache, "large", &vec![0; 4 * one as usize]));
    assert_eq!(
        cache.entries().unwrap().len(),
        3,
        "nothing made room for it"
    );
    age(&cache, "c", 100);
    let minute_ago = SystemTime::now() - Duration::from_secs(60);
    let older = cache.remove_older(minute_ago).unwrap();
    assert_eq!((older.entries, older.bytes), (1, one));
    assert_eq!(cache.remove_above(one).unwrap().entries, 1);
    assert_eq!(cache.remove_above(0).unwrap().entries, 1);
    assert!(cache.entries().unwrap().is_empty());
}

#[test]
fn files_of_others_and_of_living_processes_stay() {
    let folder = tempfile::tempdir().unwrap();
    let cache = cache(folder.path(), 1 << 20);
    std::fs::write(folder.path().join("notes.txt"), "mine").unwrap();
    std::fs::write(folder.path().join("new.a1B2c3D4e5F6.tmp"), "half").unwrap();
    let living = temporary::file(folder.path(), TEMPORARY).unwrap();
    write(&cache, "x", b"result");
    cache.remove_above(0).unwrap();
    assert!(living.path().exists());
    assert!(folder.path().join("notes.txt").exists());
    assert!(!folder.path().join("new.a1B2c3D4e5F6.tmp").exists());
}

/// Writers and readers of few keys in a folder that holds fewer: whoever finds an entry finds
/// the right one, and the folder never holds more than its limit.
#[test]
fn many_at_once_find_what_belongs_to_their_keys() {
    let folder = tempfile::tempdir().unwrap();
    let content = |i: usize| vec![i as u8; 2000 + 100 * i];
    let limit = 12_000;
    std::thread::scope(|scope| {
        for thread in 0..4 {
            let cache = cache(folder.path(), limit);
            scope.spawn(move || {
                for round in 0..40 {
                    let i = (7 * thread + round) % 8;
                    let name = i.to_string();
                    match read(&cache, &name) {
                        Some(found) => assert_eq!(found, content(i)),
                        None => assert!(write(&cache, &name, &content(i))),
                    }
                    let held: u64 = cache.entries().unwrap().iter().map(|e| e.bytes).sum();
                    assert!(held <= limit, "{held}");
                }
            });
        }
    });
}
