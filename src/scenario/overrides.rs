//! Overrides such as `agents.count=16`: values of a resolved scenario that are replaced.

use std::path::Path;

use super::resolve::{Resolve, apply_value};
use super::synonyms;
use seedbed_input::limits::MAX_OVERRIDE_BYTES;
use seedbed_input::{Document, InputError, NAME_IN_QUOTES};

/// Reads the text of the file at `path`.
///
/// # Errors
/// The text is not a `T`; names of other libraries are explained.
pub fn parse<T: Resolve>(path: &Path, text: &str) -> Result<Document<T>, InputError> {
    let parsed = seedbed_input::parse(&path.display().to_string(), text.to_owned());
    parsed.map_err(|error| synonyms::explain::<T>(text, error))
}

/// The file with values replaced, each by `path.to.field=value`.
///
/// # Errors
/// If an assignment is invalid.
pub fn apply_all<T: Resolve>(
    mut document: Document<T>,
    assignments: &[String],
) -> Result<Document<T>, InputError> {
    for assignment in assignments {
        document = apply(&document, assignment)?;
    }
    Ok(document)
}

/// The file with one value replaced.
///
/// # Errors
/// If the assignment is invalid; names of other libraries are explained.
pub fn apply<T: Resolve>(
    document: &Document<T>,
    assignment: &str,
) -> Result<Document<T>, InputError> {
    apply_value(document, assignment).map_err(|error| {
        let is_short = assignment.len() <= MAX_OVERRIDE_BYTES;
        let parts = assignment.split_once('=').filter(|_| is_short);
        let suggestion = parts
            .filter(|(path, _)| !says_enough(&error, path.trim()))
            .and_then(|(path, value)| synonyms::suggest(document, path.trim(), value.trim()));
        let help = suggestion.map(|suggestion| suggestion.help());
        InputError {
            help: help.or(error.help),
            ..error
        }
    })
}

/// Whether an error is about a field within the value of `path`, or says how to write this value.
fn says_enough(error: &InputError, path: &str) -> bool {
    error.field != path || error.message.starts_with(NAME_IN_QUOTES)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Scenario;

    fn document() -> Document<Scenario> {
        seedbed_input::parse(
            "short.ron",
            r#"Scenario(environment: "cartpole")"#.to_owned(),
        )
        .unwrap()
    }

    fn error_message(assignment: &str) -> String {
        apply(&document(), assignment).unwrap_err().to_string()
    }

    #[test]
    fn values_of_any_shape_are_replaced() {
        let mut changed = document();
        for assignment in [
            "agents.count=16",
            "agents.seeds=Normal(sigma: 0)",
            "algorithm.SeedPg.discount=0.5",
            "algorithm.policy_loss=SimplePg",
            "algorithm.value_target.ratio_product_cap=None",
            "stop=Solved(return: 195, at_most: 500)",
            "stop.window=10",
            "recording.scene=None",
            "environment=mistakes/parking_naive",
        ] {
            changed = apply(&changed, assignment).unwrap_or_else(|error| panic!("{error}"));
        }
        let text = changed.value.resolved();
        for expected in [
            "count: 16,",
            "sigma: 0.0,",
            "discount: 0.5,",
            "policy_loss: SimplePg,",
            "ratio_product_cap: None,",
            "environment: \"mistakes/parking_naive\",",
        ] {
            assert!(text.contains(expected), "{expected} in {text}");
        }
        assert!(
            text.contains("window: 10,") && text.contains("scene: None,"),
            "{text}"
        );
    }

    /// A value with parentheses is not taken for a name that lacks its quotes, and errors in other fields have no line of the
    /// file.
    #[test]
    fn errors_say_what_a_user_wrote() {
        let message = error_message("environment=Gymnasium(id: 3)");
        assert!(
            message
                .starts_with("--set environment=Gymnasium(id: 3): in `environment.id`: expected"),
            "{message}"
        );
        let changed = apply(&document(), "agents.count=2").unwrap();
        let error = changed.locate(changed.value.environment.error("wrong"));
        assert_eq!(
            error.to_string().lines().next(),
            Some("short.ron with --set: in `environment`: wrong")
        );
    }

    /// A value of a wrong form is answered with the forms.
    #[test]
    fn errors_list_the_forms_of_a_field() {
        let message = error_message("schedule=100");
        assert!(
            message.contains("\n  = help: expected one of `Synchronous(episodes: …)`"),
            "{message}"
        );
        let message = error_message("agents.seeds=Normal(0.1)");
        assert!(message.contains("`Normal(sigma: "), "{message}");
        assert!(!error_message("agents.count=-3").contains("expected one of"));
    }

    #[test]
    fn errors_within_a_value_name_its_field() {
        for (assignment, expected) in [
            (
                "agents=(count: 2.0)",
                "in `agents.count`: expected a whole number from 1 to 100000, found `2.0`\n  = help: write `2`",
            ),
            (
                "agents=(count: -1)",
                "in `agents.count`: expected a whole number from 1 to 100000, found -1",
            ),
            (
                "agents.count=99999999999999999999",
                "in `agents.count`: expected a whole number from 1 to 100000, found 99999999999999999999",
            ),
            (
                "agents.seeds=Normal(sigma: -1)",
                "in `agents.seeds.Normal.sigma`: expected a number of at least 0, found -1.0",
            ),
            (
                "seed=-1",
                "in `seed`: expected a whole number from 0 to 18446744073709551615, found -1",
            ),
            (
                "physics=\"Rapier\"",
                "in `physics`: expected a name without quotes, found `\"Rapier\"`\n  = help: write `Rapier`",
            ),
            (
                "algorithm=\"SeedPg\"",
                "in `algorithm`: expected a name without quotes, found `\"SeedPg\"`\n  = help: write `SeedPg()`",
            ),
        ] {
            assert_eq!(
                error_message(assignment),
                format!("--set {assignment}: {expected}")
            );
        }
    }

    #[test]
    fn errors_name_the_override() {
        assert_eq!(
            error_message("agents.cout=3"),
            "--set agents.cout=3: in `agents.cout`: there is no field `cout` here, expected one of `count`, `seeds`, `initial`, `same_initial`\n  \
             = help: did you mean `count`?"
        );
        assert_eq!(
            error_message("agents.count=0"),
            "--set agents.count=0: in `agents.count`: expected a whole number from 1 to 100000, found 0"
        );
        assert_eq!(
            error_message("environment.kwargs.size=8"),
            "--set environment.kwargs.size=8: in `environment.kwargs.size`: there is no field `kwargs` here: the value has no fields\n  \
             = help: `environment` is the name of a task file, which has these settings; write the environment in its place to change \
             them, such as --set 'environment=Gymnasium(id: \"file.py:Class\", kwargs: {\"size\": 8})'"
        );
        for (broken, reason) in [
            (
                "Normal(sigma: 0",
                "expected a comma or the end of the list of fields",
            ),
            (
                "Normal(sigma: 0))",
                "unexpected text after the end of the value",
            ),
            ("", "expected a value"),
        ] {
            let expected =
                format!("expected one value, such as 16 or Normal(sigma: 0.1): {reason}");
            assert_eq!(
                error_message(&format!("agents.seeds={broken}")),
                format!("--set agents.seeds={broken}: in `agents.seeds`: {expected}")
            );
        }
        assert_eq!(
            error_message("agents"),
            "--set agents: expected PATH=VALUE, such as agents.count=16"
        );
    }
}
