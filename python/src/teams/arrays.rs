//! Arrays from Python, whose shapes and types are checked.

use numpy::{Element, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::texts::{shape_text, type_name};

/// Reads numbers of the shape `shape` in single precision. `name`: that of the argument
pub(super) fn read_numbers(
    given: &Bound<'_, PyAny>,
    name: &str,
    shape: &[usize],
    numbers: &mut Vec<f32>,
) -> PyResult<()> {
    if let Ok(array) = given.cast::<PyArrayDyn<f32>>() {
        return copy(array, name, shape, numbers, |number| number);
    }
    if let Ok(array) = given.cast::<PyArrayDyn<f64>>() {
        return copy(array, name, shape, numbers, |number| number as f32);
    }
    let array = converted(given, name, "iubf", "float64", "numbers")?;
    let array = array.cast::<PyArrayDyn<f64>>()?;
    copy(array, name, shape, numbers, |number| number as f32)
}

/// Reads one truth value per agent.
pub(super) fn read_flags(
    given: &Bound<'_, PyAny>,
    name: &str,
    count: usize,
    flags: &mut Vec<bool>,
) -> PyResult<()> {
    if let Ok(array) = given.cast::<PyArrayDyn<bool>>() {
        return copy(array, name, &[count], flags, |flag| flag);
    }
    let array = converted(given, name, "b", "bool", "an array of bool")?;
    let array = array.cast::<PyArrayDyn<bool>>()?;
    copy(array, name, &[count], flags, |flag| flag)
}

fn copy<T: Element + Copy, R>(
    array: &Bound<'_, PyArrayDyn<T>>,
    name: &str,
    shape: &[usize],
    to: &mut Vec<R>,
    convert: impl Fn(T) -> R,
) -> PyResult<()> {
    if array.shape() != shape {
        let (found, expected) = (shape_text(array.shape()), shape_text(shape));
        return Err(PyValueError::new_err(format!(
            "`{name}` has the shape {found}, expected {expected}"
        )));
    }
    let array = array.try_readonly();
    let array = array.map_err(|error| PyValueError::new_err(error.to_string()))?;
    to.clear();
    match array.as_slice() {
        // A slice may also be in the order of columns.
        Ok(elements) if array.is_c_contiguous() => to.extend(elements.iter().copied().map(convert)),
        _ => to.extend(array.as_array().iter().copied().map(convert)),
    }
    Ok(())
}

/// The argument as an array of the type `dtype`. `kinds`: the kinds of NumPy's types that are accepted,
/// which `noun` describes.
fn converted<'py>(
    given: &Bound<'py, PyAny>,
    name: &str,
    kinds: &str,
    dtype: &str,
    noun: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let mismatch = |found: String| {
        PyValueError::new_err(format!("`{name}` is of type {found}, expected {noun}"))
    };
    let numpy = given.py().import("numpy")?;
    let array = numpy.call_method1("asarray", (given,));
    let array = array.map_err(|_| mismatch(type_name(given)))?;
    let found = array.getattr("dtype")?;
    let kind: String = found.getattr("kind")?.extract()?;
    if !kinds.contains(&kind) {
        return Err(mismatch(found.str()?.to_string()));
    }
    array.call_method1("astype", (dtype,))
}
