//! What a recording says about its run, in words.

use std::sync::Arc;

use rerun::external::arrow::array::StringArray;
use rerun::log::Chunk;
use rerun::{AnyValues, ComponentIdentifier, EntityPath, RecordingInfo, TextDocument};

use super::RecordingAbout;
use super::rows::timeless;
use super::sink::Fault;
use crate::env::{Choice, Quantity, Spec};
use crate::record::RecordingSettings;

/// The recording's name, its properties and `/scenario`.
pub(super) fn chunks(
    about: &RecordingAbout<'_>,
    settings: &RecordingSettings,
) -> Result<[Chunk; 3], Fault> {
    let name = RecordingInfo::new().with_name(about.name);
    let facts = facts(about, settings);
    let text = TextDocument::from_markdown(page(about, &facts));
    Ok([
        timeless(EntityPath::properties(), &name)?,
        timeless(
            EntityPath::properties().join(&"run".into()),
            &properties(facts),
        )?,
        timeless("scenario", &text)?,
    ])
}

/// Properties can be filtered by when many recordings are queried together.
fn properties(facts: Vec<(String, String)>) -> AnyValues {
    facts
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

fn facts(about: &RecordingAbout<'_>, settings: &RecordingSettings) -> Vec<(String, String)> {
    let own = [
        ("environment", about.spec.name.clone()),
        ("agents", about.agents.to_string()),
        ("seed", about.run_seed.to_string()),
        ("raw_every", settings.raw_every.get().to_string()),
        ("seedbed", env!("CARGO_PKG_VERSION").to_owned()),
    ];
    let further = about
        .properties
        .iter()
        .map(|(name, value)| ((*name).to_owned(), value.clone()));
    own.map(|(name, value)| (name.to_owned(), value))
        .into_iter()
        .chain(further)
        .collect()
}

fn page(about: &RecordingAbout<'_>, facts: &[(String, String)]) -> String {
    let RecordingAbout {
        name,
        spec,
        agents,
        scenario,
        ..
    } = about;
    let description = &spec.description;
    let rows: Vec<String> = facts
        .iter()
        .map(|(name, value)| format!("| {name} | {value} |\n"))
        .collect();
    let facts = rows.concat();
    let (observed, done) = (observations(spec), actions(spec));
    format!(
        "# {name}\n\n\
         {agents} concurrent agents learn in as many copies of one task and share what they experience. {description}\n\n\
         ## How to read this recording\n\n\
         - **Latest episodes, all states so far**: parallel coordinates, with one upright axis for each observed quantity and one line \
         across them for each state. Lines are a sample; by agent, they go from dark (an episode's start) to bright (its end). Densities \
         count the lines of all states; what their colours mean stands beside them and follows the time cursor.\n\
         - **Difference**: orange where a larger share of the one agent's states passes than of the other's, blue where a smaller one.\n\
         - **Pairs of observations**: one against the other, one point a state.\n\
         - **Where bonuses come from**: the mean intrinsic reward of the steps taken from each place, for curious agents.\n\
         - **Returns**: the sum of rewards of each episode. Each agent has one colour throughout.\n\
         - **In motion**: one episode in one picture, from dark (its start) to bright (its end).\n\
         - **Time** is counted in episodes. Choose `env_step` in the time panel to watch the bodies move: green arrows are \
         forces of actions, red ones of contacts.\n\
         - **Columns** of `/raw` have what an agent saw and did in every `raw_every`-th of its episodes.\n\n\
         ## The run\n\n| fact | value |\n|---|---|\n{facts}\n\
         ## What an agent sees and does\n\n| quantity | range | unit |\n|---|---|---|\n{observed}{done}\n\
         ## Scenario\n\n```ron\n{scenario}\n```\n"
    )
}

fn observations(spec: &Spec) -> String {
    spec.observations
        .iter()
        .map(|quantity| row(quantity, &ends(quantity)))
        .collect::<Vec<_>>()
        .concat()
}

fn actions(spec: &Spec) -> String {
    let range = |choice: &Choice, quantity| match choice {
        Choice::Discrete(values) => format!("one of {values:?}"),
        Choice::Continuous => ends(quantity),
    };
    let rows = spec
        .actions
        .iter()
        .map(|action| row(&action.quantity, &range(&action.choice, &action.quantity)));
    rows.collect::<Vec<_>>().concat()
}

fn ends(quantity: &Quantity) -> String {
    let [low, high] = quantity.range;
    format!("{low} to {high}")
}

fn row(quantity: &Quantity, range: &str) -> String {
    format!("| {} | {range} | {} |\n", quantity.name, quantity.unit)
}
