//! Suggestions for names that refer to nothing.

/// The name among `valid` that is meant by `found`, or most similar to it, if one is similar enough.
#[must_use]
pub fn nearest_name<'a>(found: &str, valid: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let valid: Vec<&str> = valid.into_iter().collect();
    let meant = simplified(found);
    let is_meant = |name: &&str| simplified(name) == meant;
    let is_meant_without_first_word = |name: &&str| {
        let rest = name.split_once(['/', '_']).map(|(_, rest)| rest);
        rest.is_some_and(|rest| simplified(rest) == meant)
    };
    let mut names = valid.iter().copied();
    names
        .find(is_meant)
        .or_else(|| valid.iter().copied().find(is_meant_without_first_word))
        .or_else(|| most_similar(found, &valid))
}

/// The name without its version, as in `CartPole-v1`; `None` if it has none.
#[must_use]
pub fn without_version(name: &str) -> Option<&str> {
    let (base, version) = name.rsplit_once("-v")?;
    let is_number = !version.is_empty() && version.chars().all(|c| c.is_ascii_digit());
    is_number.then_some(base)
}

/// The name in lower case, without separators and without a version such as `-v1`.
fn simplified(name: &str) -> String {
    let kept = without_version(name)
        .unwrap_or(name)
        .chars()
        .filter(|c| c.is_alphanumeric());
    kept.flat_map(char::to_lowercase).collect()
}

fn most_similar<'a>(found: &str, valid: &[&'a str]) -> Option<&'a str> {
    valid
        .iter()
        .copied()
        .map(|name| {
            (
                strsim::damerau_levenshtein(&found.to_lowercase(), &name.to_lowercase()),
                name,
            )
        })
        .filter(|&(distance, name)| {
            distance <= 1 + name.chars().count().min(found.chars().count()) / 4
        })
        .min_by_key(|&(distance, _)| distance)
        .map(|(_, name)| name)
}

/// The names in backquotes, separated by commas.
#[must_use]
pub fn quoted_list<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    names
        .into_iter()
        .map(|name| format!("`{name}`"))
        .collect::<Vec<_>>()
        .join(", ")
}

/// The hint that the most similar name may have been meant.
pub(crate) fn suggestion<'a>(
    found: &str,
    valid: impl IntoIterator<Item = &'a str>,
) -> Option<String> {
    nearest_name(found, valid).map(|name| format!("did you mean `{name}`?"))
}

/// The beginning of a text that may be long, for messages.
#[must_use]
pub fn shown(text: &str) -> String {
    const CHARACTERS: usize = 30;
    let end = text.char_indices().nth(CHARACTERS).map(|(end, _)| end);
    end.map_or_else(|| text.to_owned(), |end| format!("{}…", &text[..end]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Names as Gymnasium and `dm_control` write them.
    #[test]
    fn names_of_other_libraries_are_recognized() {
        let valid = [
            "acrobot",
            "cartpole",
            "cartpole_swingup",
            "gym_half_cheetah",
            "dm_cheetah_run",
            "mistakes/parking_naive",
        ];
        for (found, expected) in [
            ("CartPole-v1", Some("cartpole")),
            ("Acrobot-v1", Some("acrobot")),
            ("HalfCheetah-v5", Some("gym_half_cheetah")),
            ("cheetah-run", Some("dm_cheetah_run")),
            ("parking_naive", Some("mistakes/parking_naive")),
            ("cartpole-swingup", Some("cartpole_swingup")),
            ("cartpol", Some("cartpole")),
            ("Humanoid-v5", None),
            ("", None),
        ] {
            assert_eq!(nearest_name(found, valid), expected, "{found}");
        }
    }
}
