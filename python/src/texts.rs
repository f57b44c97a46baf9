//! Words of messages about what Python gives.

use pyo3::prelude::*;

/// Name of the type of a value.
pub(crate) fn type_name(value: &Bound<'_, PyAny>) -> String {
    let name = value.get_type().name();
    name.map_or_else(|_| "object".to_owned(), |name| name.to_string())
}

/// A shape as Python writes it.
pub(crate) fn shape_text(shape: &[usize]) -> String {
    let sides: Vec<String> = shape.iter().map(usize::to_string).collect();
    match &sides[..] {
        [only] => format!("({only},)"),
        _ => format!("({})", sides.join(", ")),
    }
}
