//! The description of a run in its recording: name, properties, and a page of text.

use std::sync::Arc;

use rerun::external::arrow::array::StringArray;
use rerun::log::Chunk;
use rerun::{AnyValues, ComponentIdentifier, EntityPath, RecordingInfo, TextDocument};

use super::error::RecordingError;
use super::rows::static_chunk;
use crate::run::recorder::RunInfo;
use crate::scenario::recording::RecordingSettings;
use crate::text::markdown_cell;
use seedbed_env::{Choice, Quantity, TaskSpec};

/// The recording's name, its properties, `/how_to_read` and `/scenario`.
pub(super) fn chunks(
    info: &RunInfo<'_>,
    settings: &RecordingSettings,
) -> Result<[Chunk; 4], RecordingError> {
    let name = RecordingInfo::new().with_name(info.name);
    let properties = run_properties(info, settings);
    let how_to_read = TextDocument::from_markdown(how_to_read(info));
    let text = TextDocument::from_markdown(page(info, &properties));
    Ok([
        static_chunk(EntityPath::properties(), &name)?,
        static_chunk(
            EntityPath::properties().join(&"run".into()),
            &property_values(properties),
        )?,
        static_chunk("how_to_read", &how_to_read)?,
        static_chunk("scenario", &text)?,
    ])
}

/// Properties of the run, which queries over many recordings can use as filters.
fn property_values(properties: Vec<(String, String)>) -> AnyValues {
    properties
        .into_iter()
        .fold(
            AnyValues::default(),
            |values, (name, value)| match ComponentIdentifier::try_new(name) {
                Ok(name) => {
                    values.with_component_from_data(name, Arc::new(StringArray::from(vec![value])))
                }
                Err(_) => values,
            },
        )
}

fn run_properties(info: &RunInfo<'_>, settings: &RecordingSettings) -> Vec<(String, String)> {
    let common_properties = [
        ("environment", info.spec.name.clone()),
        ("agents", info.agents.to_string()),
        ("seed", info.run_seed.to_string()),
        ("raw_every", settings.raw_every.get().to_string()),
        ("seedbed", env!("CARGO_PKG_VERSION").to_owned()),
    ];
    let further_properties = info
        .properties
        .iter()
        .map(|(name, value)| ((*name).to_owned(), value.clone()));
    common_properties
        .map(|(name, value)| (name.to_owned(), value))
        .into_iter()
        .chain(further_properties)
        .collect()
}

fn page(info: &RunInfo<'_>, properties: &[(String, String)]) -> String {
    let RunInfo {
        name,
        spec,
        scenario,
        ..
    } = info;
    let description = &spec.description;
    let rows: Vec<String> = properties
        .iter()
        .map(|(name, value)| format!("| {} | {} |\n", markdown_cell(name), markdown_cell(value)))
        .collect();
    let (name, properties) = (markdown_cell(name), rows.concat());
    let (observation_rows, action_rows) = (observation_rows(spec), action_rows(spec));
    format!(
        "# {name}\n\n{description}\n\n\
         ## Run\n\n| property | value |\n|---|---|\n{properties}\n\
         ## Observations and actions\n\n| quantity | range | unit |\n|---|---|---|\n{observation_rows}{action_rows}\n\
         ## Scenario\n\n```ron\n{scenario}\n```\n"
    )
}

/// What the views show.
fn how_to_read(info: &RunInfo<'_>) -> String {
    let name = info.name;
    let team = match info.agents {
        1 => "One agent learns this task.".to_owned(),
        agents => format!(
            "{agents} concurrent agents learn in {agents} copies of this task and share their experience. Each of the first eight \
             agents has the same color in all views, all others are gray, and thick gray curves are of the team."
        ),
    };
    format!(
        "# {name}\n\n\
         {team}\n\n\
         - **Parallel coordinates**: each vertical axis is an observation, each line across them a state. Lines are a sample of the \
         states; colored by agent, they are dark at an episode's start and bright at its end. Densities count the lines of all states: \
         the scale beside them gives the number of states per pixel.\n\
         - **Difference**: orange where a larger share of the first agent's states passes than of the second agent's, blue where a \
         smaller share does. Colors follow the square root of the difference (√ scale), so that small differences are visible.\n\
         - **Time**: drag the time cursor at the bottom to see an earlier episode. Choose `env_step` beside it to watch the bodies \
         move: green arrows are forces of actions, red arrows are contact forces.\n\
         - **Pairs of observations**: one observation against another, with one point per state.\n\
         - **Mean bonus**: the mean intrinsic reward of the steps taken from each cell, for agents with a bonus.\n\
         - **Returns**: the sum of rewards of each episode.\n\
         - **Motion**: one episode in one view, from dark (its start) to bright (its end).\n\
         - **Scenario**: properties of the run, and the scenario with all settings.\n\
         - **Columns** of `/raw` have the observations and actions of every `raw_every`-th episode of each agent. To select states by \
         brushes on all axes, run `seedbed explore` on this file.\n"
    )
}

fn observation_rows(spec: &TaskSpec) -> String {
    spec.observations
        .iter()
        .map(|quantity| quantity_row(quantity, &range_text(quantity)))
        .collect::<Vec<_>>()
        .concat()
}

fn action_rows(spec: &TaskSpec) -> String {
    let range = |choice: &Choice, quantity| match choice {
        Choice::Discrete(values) => format!("one of {values:?}"),
        Choice::Continuous => range_text(quantity),
    };
    let rows = spec
        .actions
        .iter()
        .map(|action| quantity_row(&action.quantity, &range(&action.choice, &action.quantity)));
    rows.collect::<Vec<_>>().concat()
}

fn range_text(quantity: &Quantity) -> String {
    let [low, high] = quantity.range;
    format!("{low} to {high}")
}

fn quantity_row(quantity: &Quantity, range: &str) -> String {
    let [name, unit] = [&quantity.name, &quantity.unit].map(|text| markdown_cell(text));
    format!("| {name} | {range} | {unit} |\n")
}
