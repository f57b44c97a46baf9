//! Prints values as RON files: one field per line, four spaces of indentation per level.

use ron::extensions::Extensions;
use ron::ser::PrettyConfig;
use serde::Serialize;

/// A value as a RON file that begins with the word `kind`: all fields, one per line.
///
/// # Panics
/// If the value cannot be serialized.
#[must_use]
pub fn to_ron_string(kind: &str, value: &impl Serialize) -> String {
    let config = PrettyConfig::new()
        .compact_arrays(true)
        .extensions(Extensions::UNWRAP_VARIANT_NEWTYPES);
    let text = ron::ser::to_string_pretty(value, config).expect("the value can be serialized");
    let body = text
        .split_once("\n(")
        .map_or(text.as_str(), |(_, body)| body);
    format!("{kind}({body}\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Serialize)]
    struct Outer {
        inner: Inner,
        count: u32,
        shape: Shape,
    }

    #[derive(Serialize)]
    struct Inner {
        count: u32,
        list: Vec<u32>,
    }

    #[derive(Serialize)]
    enum Shape {
        Circle { radius: u32 },
    }

    fn text() -> String {
        let inner = Inner {
            count: 1,
            list: vec![2, 3],
        };
        let shape = Shape::Circle { radius: 4 };
        to_ron_string(
            "Outer",
            &Outer {
                inner,
                count: 5,
                shape,
            },
        )
    }

    #[test]
    fn values_are_printed_one_field_per_line() {
        assert_eq!(
            text(),
            "Outer(\n    inner: (\n        count: 1,\n        list: [2, 3],\n    ),\n    count: 5,\n    \
             shape: Circle(\n        radius: 4,\n    ),\n)\n"
        );
    }
}
