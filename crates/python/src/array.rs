//! Arrays for numpy: name of the type, shape, bytes.

use organza_requests::{Array, Numbers};
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyTuple};

/// What `numpy.frombuffer` needs: type, shape, and writable bytes in the order of the machine.
pub type Buffer<'py> = (&'static str, Bound<'py, PyTuple>, Bound<'py, PyByteArray>);

/// An array as a buffer.
///
/// # Errors
/// Those of the interpreter: no memory.
pub fn buffer<'py>(py: Python<'py>, array: &Array) -> PyResult<Buffer<'py>> {
    let shape = PyTuple::new(py, &array.shape)?;
    let (name, bytes) = match &array.numbers {
        Numbers::F32(list) => ("f4", bytes_of(py, list, |x| x.to_ne_bytes())?),
        Numbers::F64(list) => ("f8", bytes_of(py, list, |x| x.to_ne_bytes())?),
        Numbers::I32(list) => ("i4", bytes_of(py, list, |x| x.to_ne_bytes())?),
        Numbers::U8(list) => ("u1", bytes_of(py, list, |x| [x])?),
    };
    Ok((name, shape, bytes))
}

fn bytes_of<'py, T: Copy, const N: usize>(
    py: Python<'py>,
    numbers: &[T],
    bytes: impl Fn(T) -> [u8; N],
) -> PyResult<Bound<'py, PyByteArray>> {
    PyByteArray::new_with(py, numbers.len() * N, |place| {
        for (to, number) in place.chunks_exact_mut(N).zip(numbers) {
            to.copy_from_slice(&bytes(*number));
        }
        Ok(())
    })
}
