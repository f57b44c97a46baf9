//! Assignments as fields of a file.

/// A field, whose value has fields of its own or is a text.
struct Field {
    name: String,
    path: String,
    value: String,
    fields: Vec<Field>,
}

/// The fields that a file has with assignments such as `agents.count=16`: `agents: (count: 16)`.
/// `opening` returns what a field's value begins with, such as `SeedPg(`.
pub(super) fn nested(
    assignments: &[String],
    opening: impl Fn(&str) -> Option<String> + Copy,
) -> String {
    let mut fields = Vec::new();
    for assignment in assignments {
        if let Some((path, value)) = assignment.split_once('=') {
            insert(&mut fields, "", path, value);
        }
    }
    written(&fields, opening)
}

fn insert(fields: &mut Vec<Field>, parent: &str, path: &str, value: &str) {
    let (name, rest) = path.split_once('.').unwrap_or((path, ""));
    let path = format!("{parent}{name}");
    let index = fields.iter().position(|field| field.name == name);
    let index = index.unwrap_or_else(|| {
        fields.push(Field {
            name: name.to_owned(),
            path: path.clone(),
            value: value.to_owned(),
            fields: Vec::new(),
        });
        fields.len() - 1
    });
    if !rest.is_empty() {
        insert(&mut fields[index].fields, &format!("{path}."), rest, value);
    }
}

fn written(fields: &[Field], opening: impl Fn(&str) -> Option<String> + Copy) -> String {
    let field = |field: &Field| {
        let Field { name, .. } = field;
        if !field.fields.is_empty() {
            let variant = opening(&field.path).unwrap_or_default();
            return format!("{name}: {variant}({})", written(&field.fields, opening));
        }
        // Texts may come without quotes after `--set`.
        if name == "environment" && !field.value.contains('(') {
            return format!("{name}: {:?}", field.value.trim_matches('"'));
        }
        format!("{name}: {}", field.value)
    };
    let fields: Vec<String> = fields.iter().map(field).collect();
    fields.join(", ")
}

/// The value at the beginning of a line, to the comma or bracket after it.
pub(super) fn first_value(line: &str) -> &str {
    let (mut depth, mut is_text) = (0, false);
    for (index, character) in line.char_indices() {
        match character {
            '"' => is_text = !is_text,
            _ if is_text => {}
            '(' | '[' | '{' => depth += 1,
            ',' | ')' | ']' | '}' if depth == 0 => return line[..index].trim(),
            ')' | ']' | '}' => depth -= 1,
            _ => {}
        }
    }
    // The value ends on another line.
    if depth > 0 { "" } else { line.trim() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_end_at_the_comma_or_bracket_after_them() {
        for (line, value) in [
            (" 0.001, seed: 3)", "0.001"),
            (" [32, 32]),", "[32, 32]"),
            (" \"a, b\")", "\"a, b\""),
            (" PPO(", ""),
            (" 16", "16"),
        ] {
            assert_eq!(first_value(line), value, "{line}");
        }
    }

    #[test]
    fn assignments_with_a_common_path_share_parentheses() {
        let assignments = ["agents.count=3", "algorithm.a.b=1", "algorithm.c=2"];
        let opening = |path: &str| (path == "algorithm").then(|| "SeedPg".to_owned());
        assert_eq!(
            nested(&assignments.map(str::to_owned), opening),
            "agents: (count: 3), algorithm: SeedPg(a: (b: 1), c: 2)"
        );
    }
}
