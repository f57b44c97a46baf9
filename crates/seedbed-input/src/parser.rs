//! The parser of RON, with its extensions and limits.

use ron::extensions::Extensions;
use serde::de::DeserializeOwned;

use super::limits::MAX_NESTING;

/// Reads a text. An error has the path of the field that is wrong.
pub(crate) fn read<T: DeserializeOwned>(
    text: &str,
) -> Result<T, (ron::error::SpannedError, String)> {
    let options = ron::Options::default()
        .with_default_extension(Extensions::IMPLICIT_SOME | Extensions::UNWRAP_VARIANT_NEWTYPES)
        .with_recursion_limit(MAX_NESTING);
    let mut deserializer = ron::Deserializer::from_str_with_options(text, &options)
        .map_err(|spanned| (spanned, String::new()))?;
    let value = serde_path_to_error::deserialize(&mut deserializer).map_err(|error| {
        let field = field_path(error.path());
        (deserializer.span_error(error.into_inner()), field)
    })?;
    deserializer
        .end()
        .map_err(|error| (deserializer.span_error(error), String::new()))?;
    Ok(value)
}

/// For example `bodies[0].mass`.
fn field_path(path: &serde_path_to_error::Path) -> String {
    use serde_path_to_error::Segment;
    let segments = path.iter().filter_map(|segment| match segment {
        Segment::Seq { index } => Some(format!("[{index}]")),
        Segment::Map { key } | Segment::Enum { variant: key } => Some(format!(".{key}")),
        Segment::Unknown => None,
    });
    segments
        .collect::<String>()
        .trim_start_matches('.')
        .to_owned()
}
