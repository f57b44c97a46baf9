//! Neural networks with flat parameter vectors: layers and their gradients, the optimizer, and
//! normalization of inputs and targets.
//!
//! All functions work on slices; they assert shapes and do not return a `Result`. This module must
//! not depend on reinforcement learning.

pub mod adam;
pub mod bayesian;
mod coded;
mod kernels;
pub mod median_scale;
pub mod mlp;
pub mod pop_art;
pub mod standardizer;
mod tensor;

pub use adam::{Adam, AdamSettings};
pub use bayesian::{
    BayesianNetwork, BayesianSettings, BayesianState, DiagonalGaussian, Likelihood,
};
pub(crate) use coded::CodedNetwork;
pub(crate) use kernels::move_towards;
pub use median_scale::MedianScale;
pub use mlp::{Activation, Activations, Initial, Mlp};
pub use pop_art::PopArt;
pub use standardizer::{STANDARDIZED_LIMIT, Standardizer};
pub use tensor::Tensor;
pub(crate) use tensor::network_tensors;
