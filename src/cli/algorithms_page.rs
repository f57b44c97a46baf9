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
    let mut page = INTRODUCTION.to_owned() + &table_of_uses();
    for info in Algorithm::catalog() {
        page += &format!("\n## {}\n\n{}\n", info.name, info.purpose);
        page += &table(&info.parameters);
    }
    page += "\n## Tabular algorithms\n\n`algorithm:` in a tabular scenario.\n";
    page += "\n| Form | Meaning |\n|---|---|\n";
    for choice in TabularAlgorithm::catalog() {
        page += &format!("| {} | {} |\n", code(&choice.form), cell(&choice.meaning));
    }
    page += "\n## Other fields of a scenario\n";
    page += &table(&Scenario::catalog());
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

fn table(parameters: &[Parameter]) -> String {
    let mut table = "\n| Parameter | Default | Meaning |\n|---|---|---|\n".to_owned();
    for parameter in parameters {
        let choices: Vec<String> = parameter.choices.iter().map(choice).collect();
        let expected = match parameter.expected.as_str() {
            "" => String::new(),
            expected => format!(" ({expected})"),
        };
        let meaning = format!("{}{expected}", parameter.meaning);
        table += &format!(
            "| {} | {} | {}{} |\n",
            code(&parameter.name),
            code(&parameter.default),
            cell(&meaning),
            choices.concat()
        );
    }
    table
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
