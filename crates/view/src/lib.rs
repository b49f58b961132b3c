//! The live page of `organza view`: a scene in a browser, rendered while it is changed.
//!
//! A [`Session`] holds the [`Document`] that all pages show, its history and the newest
//! picture. [`render()`] runs on a thread of its own: it shows the newest document, coarse
//! first, and begins anew at a change. [`serve()`] answers the requests of browsers, on the
//! loopback interface only. Requests change the document and wait for news; they never wait
//! for the render.
//!
//! Nothing here prints or opens a file: scenes, and the drafts of the folder that is served,
//! are read by `organza_scene`; files are saved by the caller's function.
//!
//! ```
//! use organza_view::{Answering, Guard, Patience, Session, open, talk};
//! use std::path::Path;
//! use std::sync::Arc;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A named weave; the path of a scene, a fabric or a draft would do.
//! let session = Arc::new(Session::new(open(Path::new("twill-3-1-s"), &[])?));
//! let guard = Guard::with_token(80, "secret");
//! let answering = Arc::new(Answering::new(session, guard, Patience::default()));
//! let request = "GET /secret/ HTTP/1.1\r\nHost: 127.0.0.1:80\r\nConnection: close\r\n\r\n";
//! let answer = talk(&answering, request.as_bytes())?;
//! assert!(String::from_utf8_lossy(&answer).starts_with("HTTP/1.1 200 OK"));
//! # Ok(())
//! # }
//! ```

mod assets;
mod describe;
mod document;
mod edit;
mod guard;
mod keys;
mod made_fabric;
mod matter;
mod news;
mod opening;
mod patient;
mod pile_and_print;
mod render;
mod requests;
mod saving;
mod seats;
mod server;
mod session;
mod tables;
mod talk;
mod tracing;

pub use document::{Document, FabricDocument};
pub use edit::Edit;
pub use guard::{Guard, Refusal};
pub use news::{Cost, News, Phase, Shown};
pub use opening::open;
pub use render::{Limits, run as render};
pub use requests::{Answering, Patience};
pub use saving::{SavedFile, WriteFile, WriteFiles};
pub use server::{Waits, listen, serve};
pub use session::Session;
pub use talk::talk;
