//! The weights of all agents' networks as safetensors, named `agent_3.policy.layer_0.weight` and the like.

use std::path::Path;

use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensorError};

use super::files;
use crate::agent::Agent;

/// Writes the weights of a team. Weights are `[in × out]`, biases `[out]`, little-endian f32.
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, agents: &[Box<dyn Agent>]) -> std::io::Result<()> {
    let named: Vec<(String, Vec<usize>, Vec<u8>)> = agents
        .iter()
        .enumerate()
        .flat_map(|(agent, learner)| {
            let named = move |tensor: crate::agent::Tensor<'_>| {
                let bytes = tensor.values.iter().flat_map(|value| value.to_le_bytes()).collect();
                (format!("agent_{agent}.{}", tensor.name), tensor.shape, bytes)
            };
            learner.tensors().into_iter().map(named)
        })
        .collect();
    let views: Result<Vec<(&str, TensorView<'_>)>, SafeTensorError> = named
        .iter()
        .map(|(name, shape, bytes)| Ok((name.as_str(), TensorView::new(Dtype::F32, shape.clone(), bytes)?)))
        .collect();
    let bytes = views.and_then(|views| safetensors::serialize(views, None)).map_err(std::io::Error::other)?;
    files::replace(path, &bytes)
}
