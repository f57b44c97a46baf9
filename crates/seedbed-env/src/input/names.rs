//! Suggestions for names that refer to nothing.

/// The name among `valid` that is most similar to `found`, if one is similar enough to be meant.
#[must_use]
pub fn nearest_name<'a>(found: &str, valid: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    valid
        .into_iter()
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
pub(super) fn suggestion<'a>(
    found: &str,
    valid: impl IntoIterator<Item = &'a str>,
) -> Option<String> {
    nearest_name(found, valid).map(|name| format!("did you mean `{name}`?"))
}
