//! Files that can be written with all defaults, and replacing a value in this text.

use serde::de::DeserializeOwned;

use seedbed_input::limits::MAX_OVERRIDE_BYTES;
use seedbed_input::{
    Document, InputError, ValidationError, WITH_REPLACED_VALUES, nearest_name, path_with_new_names,
    quoted_list,
};
use seedbed_learn::algorithms::catalog::Parameter;
use seedbed_settings::{UnknownField, opening, replace};

/// Number of characters of an override that is too long which its error shows.
const SHOWN_CHARACTERS: usize = 40;

/// A file that can be written with all defaults.
pub trait Resolve: DeserializeOwned + Clone {
    /// Text of the file with all defaults.
    fn resolved(&self) -> String;

    /// Documented fields, whose forms errors name.
    #[must_use]
    fn parameters() -> Vec<Parameter> {
        Vec::new()
    }

    /// Checks whether the values of different fields contradict each other.
    ///
    /// # Errors
    /// The first contradiction.
    fn check(&self) -> Result<(), ValidationError> {
        Ok(())
    }

    /// Short files that are like `text`, which is invalid, the most similar one first. Not all are
    /// valid.
    #[must_use]
    fn examples(text: &str) -> Vec<String>;

    /// A file that is like `text`, which is invalid.
    #[must_use]
    fn like(text: &str) -> Option<Document<Self>> {
        let examples = Self::examples(text);
        let parsed = |text| seedbed_input::parse("", text).ok();
        examples.into_iter().find_map(parsed)
    }
}

/// The name or value with which the value of a field begins in the file with all defaults, such as `SeedPg`; none if
/// there is no such field.
pub(super) fn opening_of<T: Resolve>(document: &Document<T>, path: &str) -> Option<String> {
    opening(&document.value.resolved(), path).map(str::to_owned)
}

/// The file with one value replaced, without explanations of names of other libraries.
pub(super) fn apply_value<T: Resolve>(
    document: &Document<T>,
    assignment: &str,
) -> Result<Document<T>, InputError> {
    let invalid = |field: &str, message: String, help: Option<String>| InputError {
        origin: format!("--set {assignment}"),
        position: None,
        field: field.to_owned(),
        message,
        help,
    };
    if assignment.len() > MAX_OVERRIDE_BYTES {
        let shown: String = assignment.chars().take(SHOWN_CHARACTERS).collect();
        let message = format!(
            "expected at most {MAX_OVERRIDE_BYTES} characters, found {}",
            assignment.len()
        );
        return Err(InputError {
            origin: format!("--set {shown}…"),
            ..invalid("", message, None)
        });
    }
    let Some((path, value)) = assignment.split_once('=') else {
        let message = "expected PATH=VALUE, such as agents.count=16";
        return Err(invalid("", message.to_owned(), None));
    };
    let (path, value) = (&*path_with_new_names(path.trim()), value.trim());
    let parse = |value: &str| -> Result<T, InputError> {
        seedbed_input::check_ron_value(value).map_err(|reason| {
            let expected = "expected one value, such as 16 or Normal(sigma: 0.1)";
            invalid(path, format!("{expected}: {reason}"), None)
        })?;
        let text = replace(&document.value.resolved(), path, value).map_err(|unknown| {
            let (message, help) = explain(&unknown, path);
            invalid(path, message, help)
        })?;
        let parsed = seedbed_input::parse::<T>(&document.origin, text);
        let parsed = parsed.map_err(|error| {
            let field = field_of(&error.field, path);
            let forms = || forms::<T>(path).filter(|_| field == path);
            invalid(field, error.message, error.help.or_else(forms))
        })?;
        Ok(parsed.value)
    };
    // Shells remove quotes, so that a text such as the name of an environment may come without them.
    let value = match parse(value) {
        Err(error) if !is_call(value) => parse(&format!("{value:?}")).map_err(|_| error)?,
        parsed => parsed?,
    };
    // The text is parsed again, so that later errors show lines of the resolved scenario.
    let file = document.origin.trim_end_matches(WITH_REPLACED_VALUES);
    let origin = format!("{file}{WITH_REPLACED_VALUES}");
    Ok(Document {
        former_names: document.former_names.clone(),
        ..seedbed_input::parse(&origin, value.resolved())?
    })
}

/// Whether a value is written as `Name(…)`, such as `Gymnasium(id: "CartPole-v1")`.
fn is_call(value: &str) -> bool {
    let name = value.split_once('(').map(|(name, _)| name.trim_end());
    name.is_some_and(|name| {
        name.starts_with(char::is_uppercase) && name.chars().all(char::is_alphanumeric)
    })
}

/// The field of an error in the file with the value of `path` replaced: `path`, or a field within its value.
fn field_of<'a>(field: &'a str, path: &'a str) -> &'a str {
    let without_variants = |path: &str| {
        let is_field = |name: &&str| !name.starts_with(char::is_uppercase);
        let names: Vec<&str> = path.split('.').filter(is_field).collect();
        names.join(".")
    };
    let (found, replaced) = (without_variants(field), without_variants(path));
    let within = found.strip_prefix(&replaced);
    let is_within = within.is_some_and(|rest| rest.starts_with(['.', '[']));
    if is_within { field } else { path }
}

/// The forms that the value of a field can have, if it has several.
fn forms<T: Resolve>(path: &str) -> Option<String> {
    let parameters = T::parameters();
    let parameter = parameters.iter().find(|parameter| parameter.name == path)?;
    let forms: Vec<&str> = parameter
        .choices
        .iter()
        .map(|choice| choice.form.as_str())
        .collect();
    (!forms.is_empty()).then(|| format!("expected one of {}", quoted_list(forms)))
}

/// Message and help for a name in `path` that is not a field.
fn explain(unknown: &UnknownField, path: &str) -> (String, Option<String>) {
    let known = || unknown.known_fields.iter().map(String::as_str);
    if unknown.known_fields.is_empty() {
        let message = format!(
            "there is no field `{}` here: the value has no fields",
            unknown.name
        );
        let help = path.starts_with("environment.").then(|| {
            "`environment` is the name of a task file, which has these settings; write the environment in its place to change \
             them, such as --set 'environment=Gymnasium(id: \"file.py:Class\", kwargs: {\"size\": 8})'"
                .to_owned()
        });
        return (message, help);
    }
    let message = format!(
        "there is no field `{}` here, expected one of {}",
        unknown.name,
        quoted_list(known())
    );
    let nearest = nearest_name(&unknown.name, known());
    (
        message,
        nearest.map(|name| format!("did you mean `{name}`?")),
    )
}
