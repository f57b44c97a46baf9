//! Arguments of the command line that do not exist: what is meant.

use std::ffi::OsString;
use std::io::IsTerminal;
use std::path::Path;

use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{CommandFactory, FromArgMatches};

use super::study::translated;
use super::{Cli, groups};
use seedbed::input_files::{self, Directory};
use seedbed::scenario::Scenario;
use seedbed::scenario::overrides;
use seedbed::scenario::resolve::Resolve;
use seedbed::scenario::synonyms::{self, Suggestion};
use seedbed::tabular::TabularScenario;
use seedbed::text::shell_word;
use seedbed_input::{Document, FileKind, file_kind};

/// The arguments of this process. Ends it if they are invalid.
pub(super) fn parse() -> Cli {
    let mut given: Vec<OsString> = std::env::args_os().collect();
    if let Some(new) = given.get(1..).and_then(translated) {
        let words: Vec<_> = new.iter().map(|word| word.to_string_lossy()).collect();
        let words: Vec<_> = words.iter().map(|word| shell_word(word)).collect();
        note!("note: the new spelling is `seedbed {}`", words.join(" "));
        given.splice(1.., new);
    }
    let arguments: Vec<String> = given
        .iter()
        .skip(1)
        .map(|argument| argument.to_string_lossy().into_owned())
        .collect();
    let parsed = parse_given(&given).and_then(|cli| match value_without_equals(&arguments) {
        // A command that takes several files has taken the value for one of them.
        Some((_, value)) => Err(unexpected_argument(value)),
        None => Ok(cli),
    });
    parsed.unwrap_or_else(|mut error| {
        if let Some(tip) = tip(&error, &arguments) {
            error.remove(ContextKind::SuggestedArg);
            let tip = ContextValue::StyledStrs(vec![StyledStr::from(tip)]);
            error.insert(ContextKind::Suggested, tip);
        }
        exit_with(&error)
    })
}

/// Prints an error and ends the process. What the standard library says of numbers is said in other words.
fn exit_with(error: &clap::Error) -> ! {
    let words = [
        ("invalid digit found in string", "expected a whole number"),
        (
            "cannot parse integer from empty string",
            "expected a whole number",
        ),
        (
            "number too large to fit in target type",
            "expected a smaller number",
        ),
        (
            "number too small to fit in target type",
            "expected a number that is not negative",
        ),
        ("invalid float literal", "expected a number"),
    ];
    let text = error.render();
    let found = words
        .iter()
        .find(|(text_of_rust, _)| text.to_string().contains(text_of_rust));
    let Some((text_of_rust, plain)) = found.filter(|_| error.kind() == ErrorKind::ValueValidation)
    else {
        error.exit()
    };
    let text = if std::io::stderr().is_terminal() {
        text.ansi().to_string()
    } else {
        text.to_string()
    };
    note!("{}", text.replace(text_of_rust, plain).trim_end());
    std::process::exit(2)
}

fn parse_given(given: &[OsString]) -> Result<Cli, clap::Error> {
    let mut command = groups::command();
    let matches = command.try_get_matches_from_mut(given)?;
    Cli::from_arg_matches(&matches).map_err(|error| error.format(&mut command))
}

fn unexpected_argument(argument: &str) -> clap::Error {
    let mut error = clap::Error::new(ErrorKind::UnknownArgument).with_cmd(&Cli::command());
    let argument = ContextValue::String(argument.to_owned());
    error.insert(ContextKind::InvalidArg, argument);
    error
}

/// What to write in place of an invalid argument, if it is the name of a field.
fn tip(error: &clap::Error, arguments: &[String]) -> Option<String> {
    let invalid = match error.get(ContextKind::InvalidArg)? {
        ContextValue::String(invalid) => invalid.as_str(),
        _ => return None,
    };
    let command = arguments
        .iter()
        .find(|argument| !argument.starts_with('-'))?;
    if error.kind() == ErrorKind::UnknownArgument
        && let Some((name, value)) = value_without_equals(arguments)
    {
        return Some(format!("write `{name}={value}`"));
    }
    match error.kind() {
        ErrorKind::ArgumentConflict if invalid.starts_with("--seed ") => {
            Some("`seedbed bench SCENARIO --seeds 10` and studies run several run seeds".to_owned())
        }
        ErrorKind::UnknownArgument if command == "run" || command == "bench" => {
            tip_of_a_run(invalid, arguments)
        }
        ErrorKind::UnknownArgument if command == "study" || command == "tune" => {
            tip_of_a_study(invalid, arguments)
        }
        _ => None,
    }
}

/// The first option of the command whose value needs a `=` and that has a value without one, as in
/// `--serve 9876`.
fn value_without_equals(arguments: &[String]) -> Option<(&str, &str)> {
    let is_name = |argument: &&String| !argument.starts_with('-');
    let cli = Cli::command();
    let options = cli
        .find_subcommand(arguments.iter().find(is_name)?)?
        .get_arguments();
    let names: Vec<String> = options
        .filter(|option| option.is_require_equals_set())
        .filter_map(|option| Some(format!("--{}", option.get_long()?)))
        .collect();
    let mut pairs = arguments.iter().zip(arguments.iter().skip(1));
    let pair = pairs.find(|(name, value)| names.contains(name) && is_value(value))?;
    Some((pair.0, pair.1))
}

/// Whether an argument is a number or an address, and not a name of a file.
fn is_value(argument: &str) -> bool {
    let is_number = argument.starts_with(|c: char| c.is_ascii_digit());
    (is_number || argument.contains("://")) && !Path::new(argument).exists()
}

/// `--set …` for an option, or for an assignment without `--set`.
fn tip_of_a_run(invalid: &str, arguments: &[String]) -> Option<String> {
    let Some(name) = invalid.strip_prefix("--") else {
        let (path, value) = invalid.split_once('=')?;
        return match meant(path, value, arguments) {
            Some(suggestion) => Some(suggestion.help_with_options()),
            None => Some(format!("write `--set {invalid}`")),
        };
    };
    let value = value_of(invalid, arguments);
    meant(name, value, arguments).map(|suggestion| suggestion.help_with_options())
}

/// The value of an option: after `=`, or the next argument.
fn value_of<'a>(option: &str, arguments: &'a [String]) -> &'a str {
    let mut found = arguments.iter().enumerate();
    let value = found.find_map(|(index, argument)| {
        let rest = argument.strip_prefix(option)?;
        if rest.is_empty() {
            let next = arguments.get(index + 1).map_or("", String::as_str);
            return Some(if next.starts_with("--") { "" } else { next });
        }
        rest.strip_prefix('=')
    });
    value.unwrap_or("")
}

/// Scenarios of studies are changed in the study file.
fn tip_of_a_study(invalid: &str, arguments: &[String]) -> Option<String> {
    let name = invalid.strip_prefix("--")?;
    let value = value_of(invalid, arguments);
    let suggestion = meant(name, value, arguments)?;
    let is_field = !suggestion.assignments.is_empty();
    is_field.then(|| format!("in the study file, {}", suggestion.help_in_study()))
}

/// What an option or assignment means for the scenario among the arguments, or else for a scenario with
/// all defaults.
fn meant(name: &str, value: &str, arguments: &[String]) -> Option<Suggestion> {
    let name = name.trim_start_matches('-');
    for argument in arguments.iter().skip(1) {
        let Some((kind, path, text)) = scenario(argument) else {
            continue;
        };
        return match kind {
            FileKind::TabularScenario => {
                suggest::<TabularScenario>(overrides::parse(&path, &text).ok(), name, value)
            }
            _ => suggest::<Scenario>(overrides::parse(&path, &text).ok(), name, value),
        };
    }
    suggest::<Scenario>(None, name, value)
}

/// The kind, the path and the text of the scenario that an argument names.
fn scenario(argument: &str) -> Option<(FileKind, std::path::PathBuf, String)> {
    let path = Path::new(argument);
    if argument.starts_with('-') || input_files::is_stream(path) {
        return None;
    }
    let path = input_files::find_argument(path, &[Directory::Scenarios]).ok()?;
    let text = input_files::read_text(&path).ok()?;
    let kind = file_kind(argument, &text).ok()?;
    let is_scenario = matches!(kind, FileKind::Scenario | FileKind::TabularScenario);
    is_scenario.then_some((kind, path, text))
}

fn suggest<T: Resolve>(
    document: Option<Document<T>>,
    name: &str,
    value: &str,
) -> Option<Suggestion> {
    synonyms::suggest(&document.or_else(|| T::like(""))?, name, value)
}
