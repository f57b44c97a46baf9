//! What RON's own reader accepts is read as the same value, with the extensions that are always on.

use std::collections::BTreeMap;

use proptest::prelude::*;
use ron::extensions::Extensions;
use ron::ser::PrettyConfig;
use serde::{Deserialize, Serialize};

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Task {
    name: String,
    #[serde(default)]
    body: Option<Body>,
    #[serde(default)]
    shapes: Vec<Shape>,
    #[serde(default)]
    units: BTreeMap<String, i64>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Body {
    mass: f64,
    #[serde(default)]
    damping: f32,
    #[serde(default)]
    mark: char,
    #[serde(default)]
    is_fixed: bool,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
enum Shape {
    Nothing,
    Ball(f64),
    Line((f64, f64), (f64, f64)),
    Points(Vec<(f64, f64)>),
    Solid(Body),
    Maybe(Option<u8>),
    Box {
        width: f64,
        shape: Option<Box<Shape>>,
    },
}

fn extensions() -> Extensions {
    Extensions::IMPLICIT_SOME | Extensions::UNWRAP_VARIANT_NEWTYPES
}

fn read_by_ron(text: &str) -> Option<Task> {
    let options = ron::Options::default().with_default_extension(extensions());
    options.from_str(text).ok()
}

fn read(text: &str) -> Option<Task> {
    let document = seedbed_input::parse("text", text.to_owned());
    document.ok().map(|document| document.value)
}

fn body() -> impl Strategy<Value = Body> {
    (-1e9..1e9, any::<f32>(), any::<char>(), any::<bool>()).prop_map(
        |(mass, damping, mark, is_fixed)| Body {
            mass,
            damping: if damping.is_nan() { 0.0 } else { damping },
            mark,
            is_fixed,
        },
    )
}

fn shape() -> impl Strategy<Value = Shape> {
    let number = || prop_oneof![Just(f64::INFINITY), -1e300..1e300, -9.0..9.0];
    let point = move || (number(), number());
    let leaf = prop_oneof![
        Just(Shape::Nothing),
        number().prop_map(Shape::Ball),
        (point(), point()).prop_map(|(from, to)| Shape::Line(from, to)),
        prop::collection::vec(point(), 0..4).prop_map(Shape::Points),
        body().prop_map(Shape::Solid),
        any::<Option<u8>>().prop_map(Shape::Maybe),
    ];
    leaf.prop_recursive(3, 8, 2, move |inner| {
        (number(), prop::option::of(inner)).prop_map(|(width, shape)| Shape::Box {
            width,
            shape: shape.map(Box::new),
        })
    })
}

fn task() -> impl Strategy<Value = Task> {
    (
        ".*",
        prop::option::of(body()),
        prop::collection::vec(shape(), 0..5),
        prop::collection::btree_map(".*", any::<i64>(), 0..4),
    )
        .prop_map(|(name, body, shapes, units)| Task {
            name,
            body,
            shapes,
            units,
        })
}

/// Texts that are written between, before or in place of others.
const PIECES: [&str; 24] = [
    "(",
    ")",
    "[",
    "]",
    "{",
    "}",
    ",",
    ":",
    "Some(",
    "None",
    "1",
    "-2.5e3",
    "0x1f",
    "1_000",
    "\"a\\n\"",
    "r#\"b\"#",
    "'c'",
    "true",
    "// d\n",
    "/* e /* f */ */",
    "Ball",
    "mass",
    "x",
    "@",
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn what_is_written_is_read(task in task()) {
        let pretty = PrettyConfig::new().extensions(Extensions::UNWRAP_VARIANT_NEWTYPES);
        let raw = PrettyConfig::new()
            .escape_strings(false)
            .struct_names(true)
            .separate_tuple_members(true)
            .extensions(extensions());
        for config in [pretty, raw] {
            let text = ron::ser::to_string_pretty(&task, config).unwrap();
            prop_assert_eq!(read(&text), Some(task.clone()), "{}", text);
        }
    }

    /// A change of one place is accepted or refused as RON's own reader does.
    #[test]
    fn what_is_accepted_is_accepted_by_ron_with_the_same_value(
        task in task(),
        place in any::<prop::sample::Index>(),
        piece in prop::sample::select(&PIECES[..]),
        length in 0..3_usize,
    ) {
        let config = PrettyConfig::new().extensions(extensions());
        let text = ron::ser::to_string_pretty(&task, config).unwrap();
        let mut text = text[text.find("\n(").unwrap()..].to_owned();
        let places: Vec<usize> = text.char_indices().map(|(at, _)| at).collect();
        let start = place.index(places.len());
        let end = places.get(start + length).copied().unwrap_or(text.len());
        text.replace_range(places[start]..end, piece);
        prop_assert_eq!(read(&text), read_by_ron(&text), "{}", text);
    }
}
