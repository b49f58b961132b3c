//! The live page from outside: requests over sockets, and the pictures behind them.
#![allow(clippy::unwrap_used, clippy::disallowed_methods)] // helpers outside test functions

mod client; // a server of a folder, and clients that behave as they like
mod editing; // changes, undo, saving
mod pictures; // what is rendered, and when it stops
mod requests; // who is answered, and what malformed requests get
mod slowness; // clients that are slow, many, or gone
