//! Named parameters of networks.

use std::borrow::Cow;
use std::fmt::Display;

use serde::{Deserialize, Serialize};

use super::Mlp;

/// A named array of parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tensor<'a> {
    /// The name, such as `policy.layer_0.weight`.
    pub name: String,
    /// Size of each dimension.
    pub shape: Vec<usize>,
    /// The numbers in row-major order.
    pub values: Cow<'a, [f32]>,
}

impl<'a> Tensor<'a> {
    /// A list of numbers.
    pub(crate) fn list(name: &str, values: impl Into<Cow<'a, [f32]>>) -> Self {
        let values = values.into();
        Self {
            name: name.to_owned(),
            shape: vec![values.len()],
            values,
        }
    }

    /// The same tensor with numbers of its own.
    #[must_use]
    pub fn into_owned(self) -> Tensor<'static> {
        Tensor {
            name: self.name,
            shape: self.shape,
            values: Cow::Owned(self.values.into_owned()),
        }
    }

    /// The same tensor with `prefix` before its name.
    pub(crate) fn prefixed(self, prefix: &str) -> Self {
        Self {
            name: format!("{prefix}{}", self.name),
            ..self
        }
    }
}

/// The weights and biases of a network, layer by layer, named after its `role`.
pub(crate) fn network_tensors<'a>(
    mlp: &'a Mlp,
    parameters: &'a [f32],
    role: impl Display + 'a,
) -> impl Iterator<Item = Tensor<'a>> {
    let tensors = mlp.tensors(parameters);
    tensors.map(move |(name, shape, values)| Tensor {
        name: format!("{role}.{name}"),
        shape,
        values: Cow::Borrowed(values),
    })
}
