//! Actions from Python: shapes, types and ranges are checked before anything moves.

use numpy::{Element, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use seedbed_env::{Choice, TaskSpec};

use crate::texts::{shape_text, type_name};

/// Reads actions into a matrix of numbers, one row per copy.
pub(super) struct ActionReader {
    components: Vec<Component>,
    layout: Layout,
    copies: usize,
    /// `[copies × components]`
    matrix: Vec<f32>,
}

/// One component of an action.
struct Component {
    name: String,
    /// Number of values of a discrete component; `None` for a continuous one.
    values: Option<usize>,
}

/// How the components of an action are arranged in Python.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Layout {
    /// One discrete component: `Discrete`.
    Index,
    /// Discrete or continuous components only: `MultiDiscrete` or `Box`.
    Array,
    /// Discrete and continuous components: a `Dict` with an entry per component.
    Named,
}

/// Where an array is within the actions, for messages.
#[derive(Clone, Copy)]
struct Place<'a> {
    /// Name of the component in a dictionary.
    key: Option<&'a str>,
    /// Number of components per row of the array: 0 if rows are numbers.
    width: usize,
    /// The copy whose action this is; `None` for the actions of all copies.
    only_copy: Option<usize>,
}

impl ActionReader {
    pub(super) fn new(spec: &TaskSpec, copies: usize) -> Self {
        let components: Vec<Component> = spec
            .actions
            .iter()
            .map(|action| Component {
                name: action.quantity.name.clone(),
                values: match &action.choice {
                    Choice::Discrete(values) => Some(values.len()),
                    Choice::Continuous => None,
                },
            })
            .collect();
        let discrete = components
            .iter()
            .filter(|component| component.values.is_some())
            .count();
        Self {
            layout: match (discrete, components.len()) {
                (1, 1) => Layout::Index,
                (discrete, count) if discrete == 0 || discrete == count => Layout::Array,
                _ => Layout::Named,
            },
            matrix: vec![0.0; copies * components.len()],
            components,
            copies,
        }
    }

    /// The actions that were read last: `[copies × components]`.
    pub(super) fn matrix(&self) -> &[f32] {
        &self.matrix
    }

    /// Reads the actions of all copies: arrays whose first dimension is the copy.
    pub(super) fn read_batch(&mut self, actions: &Bound<'_, PyAny>) -> PyResult<()> {
        self.read(actions, None)
    }

    /// Reads the action of one copy.
    pub(super) fn read_single(&mut self, copy: usize, action: &Bound<'_, PyAny>) -> PyResult<()> {
        if self.layout == Layout::Index
            && let Ok(index) = action.extract::<i64>()
        {
            let place = Place {
                key: None,
                width: 0,
                only_copy: Some(copy),
            };
            self.matrix[copy] = self.components[0].checked_index(index, place, copy, 0)?;
            return Ok(());
        }
        self.read(action, Some(copy))
    }

    fn read(&mut self, actions: &Bound<'_, PyAny>, only_copy: Option<usize>) -> PyResult<()> {
        let count = self.components.len();
        let place = |width| Place {
            key: None,
            width,
            only_copy,
        };
        match self.layout {
            // A task without actuators has nothing to read.
            _ if count == 0 => Ok(()),
            Layout::Index => self.read_columns(actions, 0..1, place(0)),
            Layout::Array => self.read_columns(actions, 0..count, place(count)),
            Layout::Named => self.read_named(actions, only_copy),
        }
    }

    fn read_named(&mut self, actions: &Bound<'_, PyAny>, only_copy: Option<usize>) -> PyResult<()> {
        let names: Vec<String> = self
            .components
            .iter()
            .map(|component| component.name.clone())
            .collect();
        let expected = || {
            let kind = type_name(actions);
            PyValueError::new_err(format!(
                "actions are a {kind}, expected a dictionary with the keys {names:?}"
            ))
        };
        let actions = actions.cast::<PyDict>().map_err(|_| expected())?;
        if let Some(unknown) = actions
            .keys()
            .iter()
            .find(|key| !names.iter().any(|name| key.eq(name).unwrap_or(false)))
        {
            return Err(PyValueError::new_err(format!(
                "actions have the key {unknown:?}, expected the keys {names:?}"
            )));
        }
        for (index, name) in names.iter().enumerate() {
            let values = actions.get_item(name)?.ok_or_else(|| {
                PyValueError::new_err(format!(
                    "actions have no key \"{name}\", expected the keys {names:?}"
                ))
            })?;
            let place = Place {
                key: Some(name),
                width: 0,
                only_copy,
            };
            self.read_columns(&values, index..index + 1, place)?;
        }
        Ok(())
    }

    /// Reads an array into some columns of the matrix, which are all discrete or all continuous.
    fn read_columns(
        &mut self,
        actions: &Bound<'_, PyAny>,
        columns: std::ops::Range<usize>,
        place: Place<'_>,
    ) -> PyResult<()> {
        // The types that samples of spaces and common libraries have, without a detour.
        if self.components[columns.start].values.is_some() {
            if let Ok(array) = actions.cast::<PyArrayDyn<i64>>() {
                return self.fill(array, &columns, place, Component::checked_index);
            }
            let array = converted(actions, "iub", "int64", "integers", place)?;
            return self.fill(
                array.cast::<PyArrayDyn<i64>>()?,
                &columns,
                place,
                Component::checked_index,
            );
        }
        if let Ok(array) = actions.cast::<PyArrayDyn<f32>>() {
            return self.fill(array, &columns, place, Component::checked_number);
        }
        let array = converted(actions, "iubf", "float64", "numbers", place)?;
        let check = |component: &Component, number: f64, place: Place<'_>, copy, column| {
            component.checked_number(number as f32, place, copy, column)
        };
        self.fill(array.cast::<PyArrayDyn<f64>>()?, &columns, place, check)
    }

    fn fill<T: Element + Copy>(
        &mut self,
        array: &Bound<'_, PyArrayDyn<T>>,
        columns: &std::ops::Range<usize>,
        place: Place<'_>,
        check: impl Fn(&Component, T, Place<'_>, usize, usize) -> PyResult<f32>,
    ) -> PyResult<()> {
        let expected = place.shape(self.copies);
        if array.shape() != expected {
            let (subject, verb) = (place.subject(), place.verb("has", "have"));
            let (found, expected) = (shape_text(array.shape()), shape_text(&expected));
            return Err(PyValueError::new_err(format!(
                "{subject} {verb} the shape {found}, expected {expected}"
            )));
        }
        let array = array.try_readonly();
        let array = array.map_err(|error| PyValueError::new_err(error.to_string()))?;
        let in_order;
        let values = if array.is_c_contiguous() {
            array
                .as_slice()
                .map_err(|error| PyValueError::new_err(error.to_string()))?
        } else {
            in_order = array.as_array().iter().copied().collect::<Vec<T>>();
            &in_order
        };
        let components = &self.components[columns.clone()];
        let first_copy = place.only_copy.unwrap_or(0);
        let rows = self.matrix.chunks_exact_mut(self.components.len());
        let rows = rows
            .skip(first_copy)
            .zip(values.chunks_exact(columns.len()));
        for (row, (written, values)) in rows.enumerate() {
            let written = written[columns.clone()].iter_mut().zip(components);
            for (column, ((written, component), value)) in written.zip(values).enumerate() {
                *written = check(component, *value, place, first_copy + row, column)?;
            }
        }
        Ok(())
    }
}

impl Component {
    fn checked_index(
        &self,
        index: i64,
        place: Place<'_>,
        copy: usize,
        column: usize,
    ) -> PyResult<f32> {
        let count = self.values.unwrap_or_default();
        if (0..count as i64).contains(&index) {
            return Ok(index as f32);
        }
        let place = place.element(copy, column);
        let (name, last) = (&self.name, count - 1);
        Err(PyValueError::new_err(format!(
            "{place} is {index}, expected the index of a value of `{name}`: 0 to {last}"
        )))
    }

    fn checked_number(
        &self,
        number: f32,
        place: Place<'_>,
        copy: usize,
        column: usize,
    ) -> PyResult<f32> {
        if number.is_finite() {
            return Ok(number);
        }
        let place = place.element(copy, column);
        let name = &self.name;
        let number = number.to_string().to_lowercase();
        Err(PyValueError::new_err(format!(
            "{place} is {number}, expected a finite number for `{name}`"
        )))
    }
}

impl Place<'_> {
    fn shape(self, copies: usize) -> Vec<usize> {
        let rows = self.only_copy.is_none().then_some(copies);
        let components = (self.width > 0).then_some(self.width);
        rows.into_iter().chain(components).collect()
    }

    fn subject(self) -> String {
        match self.key {
            Some(key) => format!("actions[\"{key}\"]"),
            None if self.only_copy.is_none() => "actions".to_owned(),
            None => "the action".to_owned(),
        }
    }

    /// The form of a verb that agrees with the subject.
    fn verb(self, singular: &'static str, plural: &'static str) -> &'static str {
        if self.key.is_none() && self.only_copy.is_none() {
            plural
        } else {
            singular
        }
    }

    /// Name of one element, such as `actions[3, 0]`.
    fn element(self, copy: usize, column: usize) -> String {
        let rows = self.only_copy.is_none().then_some(copy);
        let components = (self.width > 0).then_some(column);
        let indices: Vec<String> = rows
            .into_iter()
            .chain(components)
            .map(|index| index.to_string())
            .collect();
        match (indices.is_empty(), self.key) {
            (true, _) => self.subject(),
            (false, None) => format!("actions[{}]", indices.join(", ")),
            (false, Some(_)) => format!("{}[{}]", self.subject(), indices.join(", ")),
        }
    }
}

/// The actions as an array of the type `dtype`. `kinds`: the kinds of NumPy's types that are accepted,
/// which `noun` describes.
fn converted<'py>(
    actions: &Bound<'py, PyAny>,
    kinds: &str,
    dtype: &str,
    noun: &str,
    place: Place<'_>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = actions.py();
    let mismatch = |found: String| {
        let (subject, verb) = (place.subject(), place.verb("is", "are"));
        PyValueError::new_err(format!("{subject} {verb} of type {found}, expected {noun}"))
    };
    let array = py.import("numpy")?.call_method1("asarray", (actions,));
    let array = array.map_err(|_| mismatch(type_name(actions)))?;
    let found = array.getattr("dtype")?;
    let kind: String = found.getattr("kind")?.extract()?;
    if !kinds.contains(&kind) {
        return Err(mismatch(found.str()?.to_string()));
    }
    array.call_method1("astype", (dtype,))
}
