//! A folder of results that are expensive to compute, found by the content that they were
//! computed from.
//!
//! A [`Key`] is a digest of everything that decides a result, the program included. An entry
//! is one file that holds a [`Description`], the result and a checksum. Several processes may
//! use one folder: entries appear under their names only when complete, and a process that is
//! killed leaves at most a temporary file, which a later one removes.
//!
//! ```
//! use organza_cache::{Cache, Description, Key};
//!
//! # fn main() -> std::io::Result<()> {
//! # let folder = tempfile::tempdir()?;
//! let cache = Cache::new(folder.path(), 1 << 20);
//! cache.make()?;
//! let key = Key::of("table", &[b"organza 0.1.0", b"what the table is made from"]);
//! let about = Description {
//!     kind: "table".into(),
//!     name: "organza.toml".into(),
//!     details: "12 directions".into(),
//!     program: "organza 0.1.0".into(),
//! };
//! assert!(cache.read(&key, 1 << 20)?.is_none());
//! cache.write(&key, &about, |out| out.write_all(b"0.25"))?;
//! assert_eq!(cache.read(&key, 1 << 20)?.as_deref(), Some(&b"0.25"[..]));
//! # Ok(())
//! # }
//! ```
#![allow(clippy::disallowed_methods)] // opens the files of its own folder

mod cache;
mod entry;
mod key;
pub mod temporary;

pub use cache::{Cache, Removed};
pub use entry::{Description, Entry, decode, encode};
pub use key::Key;
