//! All algorithms and parameters as a Markdown page: `docs/algorithms.md`.

use seedbed::scenario::Scenario;
use seedbed::tabular::Algorithm as TabularAlgorithm;
use seedbed_learn::algorithms::Algorithm;
use seedbed_learn::algorithms::catalog::{Choice, Parameter};

const INTRODUCTION: &str = "# Algorithms

All algorithms and parameters of a scenario, from the documentation of the code: `seedbed list algorithms --markdown`
prints this page. [Writing scenarios](scenarios.md) says how known algorithms are written with these parameters.
";

/// The page.
pub(super) fn page() -> String {
    let mut page = INTRODUCTION.to_owned();
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
