//! The native part of the Python module `organza`: [`call::call`] runs a request on files in
//! memory, the rest reads drafts, volumes and TOML.
//!
//! The package around it, in `crates/python/python/organza`, has the functions and classes that
//! users see; `_native.pyi` there describes the functions of this module. Everything here takes
//! and returns plain Python objects: texts, bytes, dictionaries.

mod array;
mod call;
mod draft;
mod errors;
mod read_toml;
mod volume;

use organza_cli::Program;
use pyo3::IntoPyObjectExt;
use pyo3::ffi::{PyModule_Create, PyModuleDef, PyModuleDef_HEAD_INIT, PyObject};
use pyo3::prelude::*;
use pyo3::types::{PyCFunction, PyDict, PyTuple};
use std::ffi::{CStr, OsString};
use std::path::PathBuf;

/// What the interpreter calls, by this name, when it imports the module.
#[allow(unsafe_code)] // The symbol is the interface; no other library has one of this name.
#[unsafe(no_mangle)]
pub extern "C" fn PyInit__native() -> *mut PyObject {
    Python::attach(|py| match module(py) {
        Ok(module) => module.into_ptr(),
        Err(e) => {
            e.restore(py);
            std::ptr::null_mut()
        }
    })
}

/// An empty module for the interpreter to import.
///
/// # Errors
/// Those of the interpreter.
#[allow(unsafe_code)]
fn empty_module(py: Python<'_>) -> PyResult<Bound<'_, PyModule>> {
    // The interpreter keeps the definition, so it must live as long as the process.
    let definition = Box::leak(Box::new(PyModuleDef {
        m_base: PyModuleDef_HEAD_INIT,
        m_name: c"_native".as_ptr(),
        m_doc: c"The native part of organza.".as_ptr(),
        m_size: -1,
        m_methods: std::ptr::null_mut(),
        m_slots: std::ptr::null_mut(),
        m_traverse: None,
        m_clear: None,
        m_free: None,
    }));
    // SAFETY: the definition is complete and is never moved or freed. `PyModule_Create` returns a
    // new reference, or null with an exception set, as `from_owned_ptr_or_err` expects.
    let module = unsafe { Bound::from_owned_ptr_or_err(py, PyModule_Create(definition)) }?;
    Ok(module.cast_into::<PyModule>()?)
}

/// The module with its functions.
fn module(py: Python<'_>) -> PyResult<Bound<'_, PyModule>> {
    let module = empty_module(py)?;
    module.add("VERSION", env!("CARGO_PKG_VERSION"))?;
    add(&module, c"call", |py, words| {
        let (request, files, about, warn, progress) = words.extract()?;
        Ok(call::call(py, request, files, about, warn, progress)?.into_any())
    })?;
    add(&module, c"read_draft", |py, words| {
        let (word, bytes, rows): (String, Option<Vec<u8>>, _) = words.extract()?;
        draft::read_draft(py, &word, bytes.as_deref(), rows)?.into_bound_py_any(py)
    })?;
    add(&module, c"read_toml", |py, words| {
        let (path, text) = words.extract()?;
        read_toml::read_toml(py, path, text)?.into_bound_py_any(py)
    })?;
    add(&module, c"read_volume", |py, words| {
        let (name, files, level): (String, _, _) = words.extract()?;
        volume::read_volume(py, &name, files, level)?.into_bound_py_any(py)
    })?;
    add(&module, c"run_command", |py, words| {
        let (arguments, code): (Vec<OsString>, PathBuf) = words.extract()?;
        let path = arguments.first().map(PathBuf::from);
        // A word without a folder is no file that could be started again.
        let path = path.filter(|path| path.is_file());
        let program = path.map(|path| Program { path, code });
        let status = py.detach(|| organza_cli::status(arguments, program));
        status.into_bound_py_any(py)
    })?;
    Ok(module)
}

/// Adds a function of positional arguments.
fn add(
    module: &Bound<'_, PyModule>,
    name: &'static CStr,
    function: impl for<'py> Fn(Python<'py>, &Bound<'py, PyTuple>) -> PyResult<Bound<'py, PyAny>>
    + Send
    + Sync
    + 'static,
) -> PyResult<()> {
    let closure = move |words: &Bound<'_, PyTuple>, _: Option<&Bound<'_, PyDict>>| {
        function(words.py(), words).map(Bound::unbind)
    };
    let function = PyCFunction::new_closure(module.py(), Some(name), None, closure)?;
    module.add(&*name.to_string_lossy(), function)
}
