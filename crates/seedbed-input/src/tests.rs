//! Tests of reading files, and of the errors of wrong ones.

use super::numbers::{Count, Fraction};
use serde::Deserialize;

use super::*;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Team {
    name: Located<String>,
    members: Vec<Member>,
    #[serde(default)]
    captain: Located<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(dead_code, reason = "read from a file only to fail there")]
struct Member {
    name: Located<String>,
    #[serde(default)]
    role: Role,
}

#[derive(Debug, Default, Deserialize)]
#[allow(dead_code, reason = "read from a file only to fail there")]
enum Role {
    #[default]
    Player,
    Coach {
        share: Fraction,
    },
    Reserve(Count<10>),
}

const TEXT: &str = r#"// A team.
Team(
    name: "reds",
    members: [
        (name: "ann"),
        (name: "bob", role: Coach(share: 0.5)), (name: "cat", role: Reserve(3)),
    ],
    captain: "bop",
)"#;

fn team() -> Document<Team> {
    parse("team.ron", TEXT.to_owned()).unwrap()
}

/// Line, column, field and message of the error of a text that is not a team.
fn error(text: &str) -> (usize, usize, String, String) {
    let error = parse::<Team>("team.ron", text.to_owned()).unwrap_err();
    let position = error.position.expect("it has a place");
    (position.line, position.column, error.field, error.message)
}

#[test]
fn a_validation_error_has_the_place_and_the_field_of_its_value() {
    let team = team();
    let member = &team.value.members[2].name;
    let error = team.locate(member.error("is a cat"));
    let position = error.position.as_ref().unwrap();
    assert_eq!((position.line, position.column), (6, 57));
    assert_eq!(error.field, "members[2].name");
    let line =
        "        (name: \"bob\", role: Coach(share: 0.5)), (name: \"cat\", role: Reserve(3)),";
    assert_eq!(position.text, line);
    assert_eq!(
        error.to_string().lines().next(),
        Some("team.ron:6:57: in `members[2].name`: is a cat")
    );
}

/// Errors with the same message about different values point at different lines.
#[test]
fn each_located_value_has_an_ordinal_of_its_own() {
    let team = team();
    let lines = [
        &team.value.name,
        &team.value.members[0].name,
        &team.value.members[1].name,
        &team.value.captain,
    ]
    .map(|value| team.locate(value.error("")).position.unwrap().line);
    assert_eq!(lines, [3, 5, 6, 8]);
}

#[test]
fn a_default_value_has_no_place() {
    let text = "(name: \"reds\", members: [])".to_owned();
    let team = parse::<Team>("team.ron", text).unwrap();
    let error = team.locate(team.value.captain.error("is missing"));
    assert_eq!(error.position, None);
    assert_eq!(error.to_string(), "team.ron: is missing");
}

#[test]
fn an_unknown_name_lists_the_known_ones_and_suggests_the_nearest() {
    let team = team();
    let names = team.value.members.iter();
    let names: Vec<_> = names.map(|member| member.name.as_str()).collect();
    let error = team.locate(team.value.captain.unknown_name("member", names));
    assert_eq!(error.field, "captain");
    assert_eq!(
        error.message,
        "no member is named `bop`, expected one of `ann`, `bob`, `cat`"
    );
    assert_eq!(error.help.as_deref(), Some("did you mean `bob`?"));
    let none = team.value.captain.unknown_name("trainer", []);
    assert_eq!(none.message, "no trainer is named `bop`, there are none");
    assert_eq!(none.help, None);
}

#[test]
fn a_name_that_is_too_different_is_not_suggested() {
    assert_eq!(nearest_name("tehta", ["x", "theta"]), Some("theta"));
    assert_eq!(nearest_name("Slide", ["slide"]), Some("slide"));
    assert_eq!(nearest_name("push", ["torque", "x"]), None);
}

#[test]
fn errors_within_a_string_point_at_the_character() {
    let text = "(name: \"one\n  two\", members: [])".to_owned();
    let team = parse::<Team>("team.ron", text).unwrap();
    let place = |line, column| {
        let error = team.value.name.error("here").at(line, column);
        let position = team.locate(error).position.unwrap();
        (position.line, position.column)
    };
    assert_eq!(place(0, 2), (1, 11));
    assert_eq!(place(1, 2), (2, 3));
}

#[test]
fn nested_fields_and_ranges_are_in_the_path_of_an_error() {
    let wrong_share = TEXT.replace("0.5", "1.5");
    assert_eq!(
        error(&wrong_share),
        (
            6,
            42,
            "members[1].role.Coach.share".to_owned(),
            "expected a number from 0 to 1, found 1.5".to_owned()
        )
    );
    let wrong_count = TEXT.replace("Reserve(3)", "Reserve(11)");
    let (line, _, field, message) = error(&wrong_count);
    assert_eq!((line, field.as_str()), (6, "members[2].role.Reserve"));
    assert_eq!(message, "expected a whole number from 1 to 10, found 11");
    let unknown_field = TEXT.replace("captain", "capitan");
    let (line, _, field, message) = error(&unknown_field);
    assert_eq!((line, field.as_str()), (8, "capitan"));
    assert_eq!(
        message,
        "unexpected field `capitan`, expected one of `name`, `members`, `captain`"
    );
}

/// A type may read a text of its own while it is read.
#[test]
fn reading_a_text_within_another_keeps_the_ordinals() {
    #[derive(Deserialize)]
    #[serde(try_from = "String")]
    struct Inner;
    impl TryFrom<String> for Inner {
        type Error = String;
        fn try_from(text: String) -> Result<Self, String> {
            let team = parse::<Team>("inner", text).map_err(|error| error.message)?;
            assert_eq!(team.value.members.len(), 0);
            Ok(Self)
        }
    }
    #[derive(Deserialize)]
    struct Outer {
        _inner: Inner,
        last: Located<u32>,
    }
    let text = "(_inner: \"(name: \\\"a\\\", members: [])\",\nlast: 3)".to_owned();
    let outer = parse::<Outer>("outer", text).unwrap();
    let error = outer.locate(outer.value.last.error("here"));
    assert_eq!(
        (error.field.as_str(), error.position.unwrap().line),
        ("last", 2)
    );
}

#[test]
fn the_kind_of_a_file_is_its_first_word() {
    let kind = |text: &str| file_kind("file", text);
    assert_eq!(kind("Study()"), Ok(FileKind::Study));
    let commented = "// one\n/* two */ #![enable(implicit_some)]\nScenario (";
    assert_eq!(kind(commented), Ok(FileKind::Scenario));
    // RON's block comments nest.
    let nested = "/* a /* b */ c /**/ d */ Environment(";
    assert_eq!(kind(nested), Ok(FileKind::Environment));
    for text in ["", "  \n", "// a comment", "/* never ends"] {
        let error = kind(text).unwrap_err();
        assert_eq!(error.position, None, "{text}");
        assert!(error.message.ends_with("but it is empty"), "{error}");
    }
    let error = kind("\n  Scenaria(a: 1)").unwrap_err();
    assert!(
        error.message.ends_with("but it begins with `Scenaria(a:`"),
        "{error}"
    );
    assert_eq!(error.help.as_deref(), Some("did you mean `Scenario`?"));
    let position = error.position.unwrap();
    assert_eq!((position.line, position.column), (2, 3));
}

#[test]
fn ranged_numbers_say_what_they_expect() {
    use super::numbers::{FiniteNumber, FractionBelowOne, NonNegative, Positive};
    let message = |result: Result<f64, String>| result.unwrap_err();
    assert_eq!(Positive::try_from(0.5).map(Positive::get), Ok(0.5));
    assert_eq!(
        message(Positive::try_from(0.0).map(Positive::get)),
        "expected a number above 0, found 0.0"
    );
    assert_eq!(NonNegative::try_from(0.0).map(NonNegative::get), Ok(0.0));
    assert!(FractionBelowOne::try_from(1.0).is_err() && FractionBelowOne::try_from(0.0).is_ok());
    assert_eq!(
        message(FiniteNumber::try_from(f64::NAN).map(FiniteNumber::get)),
        "expected a finite number, found NaN"
    );
    assert_eq!(
        message(FiniteNumber::try_from(1e300).map(FiniteNumber::get)),
        "1e300 does not fit into a number of single precision"
    );
    assert!(Count::<5, 2>::try_from(2).is_ok() && Count::<5, 2>::try_from(1).is_err());
}

#[test]
fn a_long_line_is_shortened_around_the_caret() {
    let text = format!(
        "(name: \"reds\", members: [{}], captian: \"\")",
        " ".repeat(200)
    );
    let shown = parse::<Team>("team.ron", text).unwrap_err().to_string();
    let lines: Vec<_> = shown.lines().collect();
    let caret = lines[2].find('^').unwrap();
    assert!(lines[1].len() <= 104, "{shown}");
    assert!(lines[1][..=caret].ends_with('c'), "{shown}");
}

/// Field, message and help of the error of a text that is not a team.
fn explained(text: &str) -> (String, String, Option<String>) {
    let error = parse::<Team>("team.ron", text.to_owned()).unwrap_err();
    (error.field, error.message, error.help)
}

#[test]
fn whole_numbers_that_do_not_fit_are_answered_with_their_field_and_range() {
    for (number, shown, help) in [
        ("-3", "-3", None),
        ("99999999999999999999", "99999999999999999999", None),
        ("3.0", "`3.0`", Some("write `3`")),
        ("3.5", "`3.5`", None),
        ("1e300", "`1e300`", None),
    ] {
        let text = TEXT.replace("Reserve(3)", &format!("Reserve({number})"));
        let (field, message, found_help) = explained(&text);
        assert_eq!(field, "members[2].role.Reserve", "{number}");
        let expected = format!("expected a whole number from 1 to 10, found {shown}");
        assert_eq!(message, expected);
        assert_eq!(found_help.as_deref(), help, "{number}");
    }
}

/// A type without a range of its own has that of its bits.
#[test]
fn the_range_of_a_plain_whole_number_is_that_of_its_type() {
    #[derive(Debug, Deserialize)]
    #[allow(dead_code, reason = "read from a file only to fail there")]
    struct Plain {
        mask: Option<u32>,
        moves: Vec<i32>,
        seed: u64,
    }
    let error = |text: &str| {
        let error = parse::<Plain>("plain.ron", text.to_owned()).unwrap_err();
        (error.field, error.message)
    };
    for (text, field, message) in [
        (
            "(mask: -1, moves: [], seed: 1)",
            "mask",
            "expected a whole number from 0 to 4294967295, found -1",
        ),
        (
            "(mask: None, moves: [1, 2.0], seed: 1)",
            "moves[1]",
            "expected a whole number, found `2.0`",
        ),
        (
            "(mask: 7, moves: [1], seed: 18446744073709551616)",
            "seed",
            "expected a whole number from 0 to 18446744073709551615, found 18446744073709551616",
        ),
    ] {
        assert_eq!(error(text), (field.to_owned(), message.to_owned()));
    }
}

#[test]
fn variants_in_quotes_are_answered_with_the_variant() {
    for (variant, message, help) in [
        (
            "\"Player\"",
            "expected a name without quotes, found `\"Player\"`",
            "write `Player`",
        ),
        (
            "\"Coach\"",
            "expected a name without quotes, found `\"Coach\"`",
            "write `Coach(…)`",
        ),
        (
            "\"Playr\"",
            "unexpected variant `Playr`, expected one of `Player`, `Coach`, `Reserve`",
            "did you mean `Player`?",
        ),
    ] {
        let (field, found, found_help) = explained(&TEXT.replace("Reserve(3)", variant));
        assert_eq!(field, "members[2].role");
        assert_eq!(
            (found.as_str(), found_help.as_deref()),
            (message, Some(help))
        );
    }
}

#[test]
fn a_located_list_has_at_most_the_maximum_of_entries() {
    #[derive(Debug, Deserialize)]
    struct Layers {
        #[serde(deserialize_with = "short_located_list")]
        widths: Located<Vec<u32>>,
    }
    let read = |layers| {
        parse::<Layers>(
            "layers.ron",
            format!("(widths: [{}])", "1, ".repeat(layers)),
        )
    };
    let longest = read(1000).unwrap();
    assert_eq!(longest.value.widths.len(), 1000);
    assert_eq!(
        longest.locate(longest.value.widths.error("here")).field,
        "widths"
    );
    let error = read(1001).unwrap_err();
    assert_eq!(error.field, "widths");
    assert_eq!(
        error.message,
        "expected a list of at most 1000 entries, found more"
    );
}

/// Settings without those that have their defaults.
mod settings {
    use serde::Deserialize;

    use crate::{Settings, settings_of};

    #[derive(Deserialize, PartialEq)]
    struct Team {
        task: String,
        #[serde(default)]
        count: u32,
        #[serde(default)]
        learner: Learner,
        #[serde(default)]
        sizes: Vec<Size>,
    }

    #[derive(Deserialize, PartialEq)]
    enum Learner {
        Gradient {
            #[serde(default, alias = "standardize")]
            standardize: bool,
            #[serde(default)]
            rate: f32,
        },
    }

    impl Default for Learner {
        fn default() -> Self {
            Self::Gradient {
                standardize: false,
                rate: 0.0,
            }
        }
    }

    #[derive(Deserialize, PartialEq)]
    struct Size {
        width: u32,
        #[serde(default)]
        height: u32,
    }

    fn settings(text: &str) -> Settings {
        settings_of::<Team>(text)
    }

    #[test]
    fn defaults_comments_spaces_and_order_do_not_matter() {
        let short =
            settings(r#"(task: "pole", learner: Gradient(rate: 0.5), sizes: [(width: 1)])"#);
        assert_eq!(
            short.text(&[]),
            "learner = Gradient\nlearner.rate = 0.5\nsizes[0].width = 1\ntask = \"pole\""
        );
        let long = "(count: 0, // none\n sizes: [(height: 0, width: 0x1)], task: r\"pole\", \
                    learner: Gradient(standardize: false, rate: 5e-1,),)";
        assert_eq!(settings(long), short);
        assert_eq!(settings(long).digest(&[]), short.digest(&[]));
    }

    #[test]
    fn each_value_that_is_no_default_matters() {
        let digest = |text| settings(text).digest(&[]);
        let mut digests = vec![
            digest(r#"(task: "pole")"#),
            digest(r#"(task: "Pole")"#),
            digest(r#"(task: "pole", count: 1)"#),
            digest(r#"(task: "pole", learner: Gradient(rate: 1))"#),
            digest(r#"(task: "pole", sizes: [(width: 0)])"#),
            digest(r#"(task: "pole", sizes: [(width: 0), (width: 0)])"#),
        ];
        digests.sort();
        digests.dedup();
        assert_eq!(digests.len(), 6);
    }

    /// SHA-256 of `settings 1\ntask = "pole"`, computed with `sha256sum`.
    #[test]
    fn the_digest_is_that_of_the_lines() {
        assert_eq!(
            settings(r#"(task: "pole", count: 0)"#).digest(&[]),
            "074b320dc9b1ca0c55dfb2e8ec3d577deefe456015feab5a90862c770ae695d6"
        );
    }
}
