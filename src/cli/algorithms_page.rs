//! All algorithms and parameters as a Markdown page: `docs/algorithms.md`.

use seedbed::scenario::Scenario;
use seedbed::tabular::Algorithm as TabularAlgorithm;
use seedbed_learn::algorithms::Algorithm;
use seedbed_learn::algorithms::catalog::{ACTION_KINDS, AlgorithmInfo, Choice, Parameter};

const INTRODUCTION: &str = "# Algorithms

All algorithms and parameters of a scenario, from the documentation of the code: `seedbed list algorithms --markdown`
prints this page. [Writing scenarios](scenarios.md) says how known algorithms are written with these parameters.

## Which algorithm

`SeedPg` fits all actions, and learns from whole episodes of the newest round: begin with it. `SeedSac`, for continuous actions, and the value-based learners (`QLearning`, `SeedTd`, `BootstrappedDqn`, `HyperAgent`), for one discrete action,
keep all transitions in a replay buffer and learn from each many times. `SeedPsrl` plans in a learned model, with a search at every step. `CrossEntropy` has no gradients,
`Random` is the floor. [Results](results.md) has how they learn, [Coordination](coordination.md) what differing pays.

What each fits with the defaults of its parameters; other values can exclude more:
";

/// The page.
pub(super) fn page() -> String {
    let algorithms = Algorithm::catalog();
    let common = common_parameters(&algorithms);
    let mut page = INTRODUCTION.to_owned() + &table_of_uses();
    for info in &algorithms {
        page += &format!("\n## {}\n\n{}\n", info.name, info.purpose);
        page += &table(&info.parameters, &common);
    }
    page += "\n## Parameters of several algorithms\n\nTheir defaults are in the tables above.\n";
    page += "\n| Parameter | Algorithms | Meaning |\n|---|---|---|\n";
    for parameter in &common {
        let names = names_with(&algorithms, parameter).join(", ");
        page += &format!(
            "| {} | {names} | {} |\n",
            code(&parameter.name),
            meaning(parameter)
        );
    }
    page += "\n## Tabular algorithms\n\n`algorithm:` in a tabular scenario.\n";
    page += "\n| Form | Meaning |\n|---|---|\n";
    for choice in TabularAlgorithm::catalog() {
        page += &format!("| {} | {} |\n", code(&choice.form), cell(&choice.meaning));
    }
    page += "\n## Other fields of a scenario\n";
    page += &table(&Scenario::catalog(), &[]);
    page
}

/// Where each algorithm can be used.
fn table_of_uses() -> String {
    let yes = |is_possible: bool| if is_possible { "yes" } else { "–" };
    let mut table = format!(
        "\n| Algorithm | {} | `schedule` | `bonus` |\n|---|---|---|---|---|---|---|\n",
        ACTION_KINDS.join(" | ")
    );
    for AlgorithmInfo { name, uses, .. } in Algorithm::catalog() {
        let actions = ACTION_KINDS.map(|kind| yes(uses.actions.contains(&kind)));
        let schedules: Vec<String> = uses.schedules.iter().map(|name| code(name)).collect();
        table += &format!(
            "| [`{name}`](#{}) | {} | {} | {} |\n",
            name.to_lowercase(),
            actions.join(" | "),
            schedules.join(", "),
            yes(uses.bonus)
        );
    }
    table
}

/// The parameters that are the same in several algorithms but for their defaults, each once.
fn common_parameters(algorithms: &[AlgorithmInfo]) -> Vec<&Parameter> {
    let all: Vec<&Parameter> = algorithms
        .iter()
        .flat_map(|info| &info.parameters)
        .collect();
    let mut common: Vec<&Parameter> = Vec::new();
    for (index, parameter) in all.iter().enumerate() {
        let is_repeated = all[index + 1..]
            .iter()
            .any(|other| are_same(parameter, other));
        if is_repeated && !common.iter().any(|known| are_same(known, parameter)) {
            common.push(parameter);
        }
    }
    common
}

/// The names of the algorithms that have a parameter, as code.
fn names_with(algorithms: &[AlgorithmInfo], parameter: &Parameter) -> Vec<String> {
    let has_it = |info: &&AlgorithmInfo| {
        let mut parameters = info.parameters.iter();
        parameters.any(|other| are_same(parameter, other))
    };
    let with_it = algorithms.iter().filter(has_it);
    with_it.map(|info| code(info.name)).collect()
}

/// Whether two parameters differ in nothing but their defaults.
fn are_same(one: &Parameter, other: &Parameter) -> bool {
    let with_same_default = Parameter {
        default: one.default.clone(),
        ..other.clone()
    };
    *one == with_same_default
}

/// Parameters that are among the `common` ones have a link to their meaning.
fn table(parameters: &[Parameter], common: &[&Parameter]) -> String {
    let mut table = "\n| Parameter | Default | Meaning |\n|---|---|---|\n".to_owned();
    for parameter in parameters {
        let meaning = if common.iter().any(|known| are_same(known, parameter)) {
            "[below](#parameters-of-several-algorithms)".to_owned()
        } else {
            meaning(parameter)
        };
        let (name, default) = (code(&parameter.name), code(&parameter.default));
        table += &format!("| {name} | {default} | {meaning} |\n");
    }
    table
}

/// What a parameter means, what is expected, and its choices.
fn meaning(parameter: &Parameter) -> String {
    let choices: Vec<String> = parameter.choices.iter().map(choice).collect();
    let expected = match parameter.expected.as_str() {
        "" => String::new(),
        expected => format!(" ({expected})"),
    };
    cell(&format!("{}{expected}", parameter.meaning)) + &choices.concat()
}

fn choice(choice: &Choice) -> String {
    format!("<br>{}: {}", code(&choice.form), cell(&choice.meaning))
}

/// A text as code in a cell.
fn code(text: &str) -> String {
    format!("`{}`", cell(text))
}

/// A text in a cell: a bar would end the cell.
fn cell(text: &str) -> String {
    text.replace('|', "\\|")
}
