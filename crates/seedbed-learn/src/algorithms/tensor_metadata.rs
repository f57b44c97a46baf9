//! What readers of the tensors of a team need to know: texts by key. `docs/network_tensors.md` lists them.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::Value;

use super::Algorithm;
use crate::agent::network_info::NetworkInfo;
use seedbed_env::{Quantity, TaskSpec};

/// Version of the names of tensors and of the keys of metadata. It changes if readers must change.
const FORMAT_VERSION: u32 = 1;

impl Algorithm {
    /// The metadata of the [tensors](crate::team::Team::tensors) of a team of `agents`. They do not
    /// depend on what was learned. Lists and records are JSON.
    #[must_use]
    pub fn tensor_metadata(
        &self,
        spec: &TaskSpec,
        agents: u32,
        run_seed: u64,
    ) -> BTreeMap<&'static str, String> {
        let texts = [
            ("format_version", FORMAT_VERSION.to_string()),
            ("seedbed_version", env!("CARGO_PKG_VERSION").to_owned()),
            ("task", spec.name.clone()),
            ("run_seed", run_seed.to_string()),
            ("algorithm", self.name().to_owned()),
            ("agents", agents.to_string()),
            ("observations", observations_text(&spec.observations)),
        ];
        let mut metadata = BTreeMap::from(texts);
        if let Some(info) = self.config().network_info(spec, agents as usize) {
            metadata.extend(network_texts(&info));
        }
        if let Some(info) = self.config().planner_info(spec) {
            metadata.insert("planner", json(&info));
        }
        metadata
    }
}

/// The metadata of networks. Keys are missing if the algorithm does not have the part.
fn network_texts(info: &NetworkInfo) -> impl Iterator<Item = (&'static str, String)> {
    let models = info.models.as_ref();
    let optional = [
        ("models", models.map(|models| models.count.to_string())),
        (
            "model_of_agent",
            models.map(|models| models.model_of_agent.to_owned()),
        ),
        ("value", info.value.map(str::to_owned)),
        ("bonus", info.bonus.as_ref().map(json)),
    ];
    let present = optional
        .into_iter()
        .filter_map(|(key, text)| Some((key, text?)));
    [
        ("activation", info.activation.name().to_owned()),
        ("output_activation", "none".to_owned()),
        ("weight_layout", "[inputs, outputs], y = x W + b".to_owned()),
        ("outputs", json(&info.outputs)),
        ("heads", json(&info.heads)),
        ("action_selection", info.action_selection.clone()),
        ("observation_scaling", json(&info.observation_scaling)),
    ]
    .into_iter()
    .chain(present)
}

/// Names and units of observations, in the order of the networks' inputs.
fn observations_text(observations: &[Quantity]) -> String {
    let observations = observations.iter();
    let columns: Vec<Value> = observations
        .map(|Quantity { name, unit, .. }| serde_json::json!({ "name": name, "unit": unit }))
        .collect();
    json(&columns)
}

fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).expect("plain data always serializes")
}
