//! Imports between the files of a crate: no circle joins files of different rooms.
//!
//! A room is a folder directly below `src`, with all that it holds; the files that lie in
//! `src` itself are one more room. Files of one room may need each other, as a list and
//! its entries do. What a module re-exports counts as an import of the file that declares
//! it.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use syn::visit::{self, Visit};
use syn::{Attribute, ItemMod, ItemUse, UseTree, Visibility};

/// What a module names of its own crate: paths without `crate::`, as `room::file::Name`.
#[derive(Default)]
struct Named {
    /// Imports, and paths in code.
    used: Vec<String>,
    /// Names that others find here, and where they come from.
    exported: BTreeMap<String, String>,
}

/// Every module of a crate that is no test, by its path; the root's path is empty.
type Modules = BTreeMap<String, Named>;

/// Collects what one file names.
struct Reader<'a> {
    module: &'a str,
    named: Named,
}

impl Reader<'_> {
    /// A path as one without `crate::`; `None` for paths of other crates.
    fn absolute(&self, path: &[String]) -> Option<String> {
        let mut base: Vec<&str> = self.module.split("::").filter(|p| !p.is_empty()).collect();
        let mut rest = path;
        match rest.first()?.as_str() {
            "crate" => base.clear(),
            "self" => {}
            "super" => {
                while rest.first().is_some_and(|p| p == "super") {
                    base.pop();
                    rest = &rest[1..];
                }
                let names = rest.iter().map(String::as_str);
                return Some(base.into_iter().chain(names).collect::<Vec<_>>().join("::"));
            }
            // A child of this module, if there is one; else another crate.
            _ => return Some([base.join("::"), path.join("::")].join("::")),
        }
        let names = rest[1..].iter().map(String::as_str);
        Some(base.into_iter().chain(names).collect::<Vec<_>>().join("::"))
    }

    fn leaves(&mut self, tree: &UseTree, path: &mut Vec<String>, is_public: bool) {
        match tree {
            UseTree::Path(p) => {
                path.push(p.ident.to_string());
                self.leaves(&p.tree, path, is_public);
                path.pop();
            }
            UseTree::Group(g) => {
                for item in &g.items {
                    self.leaves(item, path, is_public);
                }
            }
            UseTree::Glob(_) => self.leaf(path, "*", is_public),
            UseTree::Name(n) => {
                path.push(n.ident.to_string());
                self.leaf(path, &n.ident.to_string(), is_public);
                path.pop();
            }
            UseTree::Rename(r) => {
                path.push(r.ident.to_string());
                self.leaf(path, &r.rename.to_string(), is_public);
                path.pop();
            }
        }
    }

    fn leaf(&mut self, path: &[String], name: &str, is_public: bool) {
        let Some(path) = self.absolute(path) else {
            return;
        };
        let path = path.trim_start_matches("::").trim_end_matches("::self");
        if is_public {
            self.named.exported.insert(name.to_owned(), path.to_owned());
        } else {
            self.named.used.push(path.to_owned());
        }
    }
}

fn is_for_tests(attributes: &[Attribute]) -> bool {
    let is_cfg_test = |a: &Attribute| {
        a.path().is_ident("cfg") && matches!(a.parse_args::<syn::Ident>(), Ok(i) if i == "test")
    };
    attributes.iter().any(is_cfg_test)
}

impl<'ast> Visit<'ast> for Reader<'_> {
    fn visit_item_mod(&mut self, item: &'ast ItemMod) {
        if !is_for_tests(&item.attrs) {
            visit::visit_item_mod(self, item);
        }
    }

    fn visit_item_use(&mut self, item: &'ast ItemUse) {
        if !is_for_tests(&item.attrs) {
            let is_public = !matches!(item.vis, Visibility::Inherited);
            self.leaves(&item.tree, &mut Vec::new(), is_public);
        }
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let parts: Vec<String> = path.segments.iter().map(|s| s.ident.to_string()).collect();
        if parts.len() > 1 {
            self.leaf(&parts, "", false);
        }
        visit::visit_path(self, path);
    }
}

fn read_module(module: &str, text: &str) -> Named {
    let file = syn::parse_file(text).unwrap_or_else(|e| panic!("{module}: {e}"));
    let mut reader = Reader {
        module,
        named: Named::default(),
    };
    reader.visit_file(&file);
    reader.named
}

fn read_crate(src: &Path) -> Modules {
    fn walk(folder: &Path, prefix: &str, out: &mut Modules) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let stem = path.file_stem().unwrap().to_string_lossy().into_owned();
            if stem.contains("test") {
                continue;
            }
            if path.is_dir() {
                walk(&path, &format!("{prefix}{stem}::"), out);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let module = match stem.as_str() {
                    "lib" | "main" => String::new(),
                    "mod" => prefix.trim_end_matches("::").to_owned(),
                    _ => format!("{prefix}{stem}"),
                };
                let text = std::fs::read_to_string(&path).unwrap();
                let named = read_module(&module, &text);
                out.insert(module, named);
            }
        }
    }
    let mut out = Modules::new();
    walk(src, "", &mut out);
    out
}

/// The module that declares what a path names, through re-exports.
fn declared_in(path: &str, modules: &Modules) -> Option<String> {
    let mut path = path.to_owned();
    for _ in 0..8 {
        let parts: Vec<&str> = path.split("::").collect();
        let module = (0..=parts.len())
            .rev()
            .map(|n| (n, parts[..n].join("::")))
            .find(|(_, m)| modules.contains_key(m))?;
        let (taken, module) = module;
        let next = parts.get(taken).and_then(|name| {
            let exported = &modules[&module].exported;
            Some((taken, exported.get(*name)?))
        });
        match next {
            // The path leads on, unless it names another crate.
            Some((taken, from)) if is_of_crate(from, modules) => {
                let rest = parts[taken + 1..].iter().map(|p| (*p).to_owned());
                path = std::iter::once(from.clone())
                    .chain(rest)
                    .collect::<Vec<_>>()
                    .join("::");
            }
            _ => return Some(module),
        }
    }
    None
}

/// True when a path begins with a module of the crate, or with a name that its root exports.
fn is_of_crate(path: &str, modules: &Modules) -> bool {
    let first = path.split("::").next().unwrap_or_default();
    let is_exported = |root: &Named| root.exported.contains_key(first);
    modules.contains_key(first) || modules.get("").is_some_and(is_exported)
}

/// The room of a module.
fn room<'a>(module: &'a str, modules: &Modules) -> &'a str {
    let first = module.split("::").next().unwrap_or_default();
    let inside = format!("{first}::");
    let is_folder = modules.keys().any(|m| m.starts_with(&inside));
    if is_folder { first } else { "" }
}

/// Pairs of modules of different rooms, each of which needs the other.
fn circles(modules: &Modules) -> Vec<(String, String)> {
    let needs: BTreeMap<&str, BTreeSet<String>> = modules
        .iter()
        .map(|(module, named)| {
            let used = named.used.iter().filter(|p| is_of_crate(p, modules));
            let targets = used.filter_map(|p| declared_in(p, modules));
            let targets = targets.filter(|t| t != module && !t.is_empty());
            (module.as_str(), targets.collect())
        })
        .collect();
    let reached = |start: &str| {
        let mut seen = BTreeSet::new();
        let mut open = vec![start.to_owned()];
        while let Some(module) = open.pop() {
            for next in needs.get(module.as_str()).into_iter().flatten() {
                if seen.insert(next.clone()) {
                    open.push(next.clone());
                }
            }
        }
        seen
    };
    let all: BTreeMap<&str, BTreeSet<String>> =
        modules.keys().map(|m| (m.as_str(), reached(m))).collect();
    let mut out = Vec::new();
    for (a, of_a) in &all {
        for b in of_a {
            if *a < b.as_str()
                && all[b.as_str()].contains(*a)
                && room(a, modules) != room(b, modules)
            {
                out.push(((*a).to_owned(), b.clone()));
            }
        }
    }
    out
}

#[test]
fn no_circle_of_imports_joins_two_rooms() {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).join("crates");
    let mut wrong = Vec::new();
    for entry in std::fs::read_dir(&crates).unwrap() {
        let folder = entry.unwrap().path();
        let modules = read_crate(&folder.join("src"));
        assert!(!modules.is_empty(), "{} has no modules", folder.display());
        let name = folder.file_name().unwrap().to_string_lossy().into_owned();
        let found = circles(&modules).into_iter();
        wrong.extend(found.map(|(a, b)| format!("{name}: {a} and {b} need each other")));
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

/// The known-bad twins: a circle by imports, one through a re-export, and one by a path
/// in code; and what is no circle.
#[test]
fn circles_are_found() {
    let check = |files: &[(&str, &str)]| {
        let read = files
            .iter()
            .map(|(m, text)| ((*m).to_owned(), read_module(m, text)));
        circles(&read.collect())
    };
    let pair = |a: &str, b: &str| vec![(a.to_owned(), b.to_owned())];
    let lib = ("", "pub use one::first::A;");
    let first = ("one::first", "use crate::two::B; pub struct A;");
    let direct = ("two", "use crate::one::first::A; pub struct B;");
    assert_eq!(
        check(&[lib, ("one", "pub mod first;"), first, direct]),
        pair("one::first", "two")
    );
    let exported = ("two", "use crate::{A, C}; pub struct B;");
    assert_eq!(
        check(&[lib, ("one", ""), first, exported]),
        pair("one::first", "two")
    );
    let inline = (
        "two",
        "pub struct B; fn f() { let _ = crate::one::first::A; }",
    );
    assert_eq!(
        check(&[lib, ("one", ""), first, inline]),
        pair("one::first", "two")
    );
    let only_tests = (
        "two",
        "pub struct B; #[cfg(test)] mod tests { use crate::one::first::A; }",
    );
    assert_eq!(check(&[lib, ("one", ""), first, only_tests]), []);
    let same_room = ("one::second", "use super::first::A; pub struct B;");
    let back = ("one::first", "use super::second::B; pub struct A;");
    assert_eq!(check(&[lib, ("one", ""), back, same_room]), []);
}
