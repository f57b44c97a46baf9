//! Any text that RON's own parser reads is read, however it is printed.

use proptest::prelude::*;
use ron::Value;
use ron::ser::PrettyConfig;
use seedbed_settings::{Settings, Tree};

fn value() -> impl Strategy<Value = Value> {
    let leaf = prop_oneof![
        any::<bool>().prop_map(Value::Bool),
        any::<char>().prop_map(Value::Char),
        any::<i64>().prop_map(|number| Value::Number(number.into())),
        any::<f64>().prop_map(|number| Value::Number(number.into())),
        any::<f32>().prop_map(|number| Value::Number(number.into())),
        ".*".prop_map(Value::String),
        Just(Value::Unit),
        Just(Value::Option(None)),
    ];
    leaf.prop_recursive(4, 40, 5, |inner| {
        let entry = (".*".prop_map(Value::String), inner.clone());
        prop_oneof![
            prop::collection::vec(inner.clone(), 0..5).prop_map(Value::Seq),
            prop::collection::vec(entry, 0..5)
                .prop_map(|entries| Value::Map(entries.into_iter().collect())),
            inner.prop_map(|value| Value::Option(Some(Box::new(value)))),
        ]
    })
}

proptest! {
    #[test]
    fn settings_do_not_depend_on_how_a_value_is_printed(value in value()) {
        let short = ron::to_string(&value).unwrap();
        let pretty = ron::ser::to_string_pretty(&value, PrettyConfig::new()).unwrap();
        let raw = PrettyConfig::new().escape_strings(false).separate_tuple_members(true);
        let raw = ron::ser::to_string_pretty(&value, raw).unwrap();
        let settings = Settings::of(&short).unwrap();
        prop_assert_eq!(&Settings::of(&pretty).unwrap(), &settings);
        prop_assert_eq!(&Settings::of(&raw).unwrap(), &settings);
    }

    #[test]
    fn no_text_makes_it_panic(text in "[()\\[\\]{}:,\"'#!r0-9a-e.+\\-/* \\\\\n]*") {
        let _ = Tree::parse(&text);
    }

    /// Texts that are no RON may be read, but not the other way round.
    #[test]
    fn what_ron_reads_is_read(text in "[()\\[\\]{}:,\"ac01 ]{0,12}") {
        if ron::from_str::<Value>(&text).is_ok() {
            prop_assert!(Tree::parse(&text).is_ok(), "{text}");
        }
    }
}

#[test]
fn comments_extensions_and_raw_names_are_read() {
    let text = "#![enable(implicit_some)] /* a /* b */ */ A( // c\n r#type: 1, b: r##\"x\"#y\"##,)";
    assert_eq!(
        Settings::of(text).unwrap().text(&[]),
        " = A\nb = \"x\\\"#y\"\ntype = 1"
    );
}
