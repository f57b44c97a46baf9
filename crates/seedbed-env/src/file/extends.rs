//! Task files that extend others.
//!
//! `extends: "cartpole_swingup"` names a base file. Each top-level field that the file does not
//! give itself is that of the base; a field that it gives replaces the whole field of the base.
//!
//! Files are merged as text, before anything is parsed, for two reasons. The merged text is a task
//! file that needs no other, which a run can store with its results. And one parser with one
//! schema serves both: each line of the merged text remembers its file and line, and columns are
//! kept, so that an error in the merged text is reported where the user wrote it.

mod fields;

use std::path::{Path, PathBuf};

use serde::de::IgnoredAny;

use self::fields::{Field, FileParts};
use seedbed_input::limits::MAX_EXTENDED_FILES;
use seedbed_input::{Disk, FileSource, InputError};

/// The text of a task file, merged with the fields of the files that it extends.
pub(super) struct MergedText {
    text: String,
    /// The file itself, then its base, then the base of its base, and so on.
    files: Vec<SourceFile>,
    /// Index of the file and line in it (both from 0) from which each line comes; empty if nothing
    /// was merged.
    line_sources: Vec<(usize, usize)>,
}

struct SourceFile {
    origin: String,
    text: String,
    /// Folder in which a base is looked for by name.
    folder: Option<PathBuf>,
}

/// A top-level field in the text of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FieldPlace<'a> {
    /// Line, from 1.
    pub line: usize,
    /// Column of the value, in characters from 1.
    pub column: usize,
    /// Text of the value.
    pub value: &'a str,
}

/// Where a top-level field of a file has its value or, with `entry`, a text in quotes within it. `None`
/// if the file does not have it.
#[must_use]
pub fn find_field<'a>(text: &'a str, field: &str, entry: Option<&str>) -> Option<FieldPlace<'a>> {
    let parts = FileParts::split(text)?;
    let field = parts.fields.iter().find(|found| found.name == field)?;
    let value = &text[field.value.clone()];
    let (at, value) = match entry {
        None => (0, value),
        Some(entry) => {
            let quoted = format!("{entry:?}");
            let at = value.find(&quoted)?;
            (at, &value[at..at + quoted.len()])
        }
    };
    let before = &text[..field.value.start + at];
    let line_start = before.rfind('\n').map_or(0, |at| at + 1);
    Some(FieldPlace {
        line: before.matches('\n').count() + 1,
        column: before[line_start..].chars().count() + 1,
        value: value.trim(),
    })
}

/// A field of one of the files.
struct FieldOfFile {
    /// Index of the file.
    file: usize,
    field: Field,
}

impl MergedText {
    /// Reads the file at `path` and those that it extends.
    pub(super) fn read(source: &dyn FileSource, path: &Path) -> Result<Self, InputError> {
        Self::merge(source, SourceFile::read(source, path)?)
    }

    /// A text without a folder, which thus cannot extend a file.
    pub(super) fn without_base(origin: &str, text: String) -> Result<Self, InputError> {
        let root = SourceFile {
            origin: origin.to_owned(),
            text,
            folder: None,
        };
        Self::merge(&Disk, root)
    }

    fn merge(source: &dyn FileSource, root: SourceFile) -> Result<Self, InputError> {
        // A text that cannot be split has an error, which parsing it reports better.
        let Some(parts) =
            FileParts::split(&root.text).filter(|parts| parts.extends_index().is_some())
        else {
            return Ok(Self {
                text: root.text.clone(),
                files: vec![root],
                line_sources: Vec::new(),
            });
        };
        let mut merged = Self {
            text: String::new(),
            files: vec![root],
            line_sources: Vec::new(),
        };
        let fields = merged.merged_fields(source, 0, parts)?;
        merged.write(&fields);
        Ok(merged)
    }

    /// The fields of a file, completed by those of the files that it extends.
    fn merged_fields(
        &mut self,
        source: &dyn FileSource,
        file: usize,
        mut parts: FileParts,
    ) -> Result<Vec<FieldOfFile>, InputError> {
        let Some(extends) = parts.take_extends() else {
            return Ok(fields_of_file(file, parts.fields));
        };
        let base = self.open_base(source, file, &extends)?;
        let Some(base_parts) = FileParts::split(&self.files[base].text) else {
            return Err(self.files[base].syntax_error());
        };
        let mut own = fields_of_file(file, parts.fields);
        let mut fields = Vec::new();
        for inherited in self.merged_fields(source, base, base_parts)? {
            // A field that is given twice in a file stays twice: the parser reports it.
            let own_index = own
                .iter()
                .position(|field| field.field.name == inherited.field.name);
            match own_index {
                Some(index) => fields.push(own.remove(index)),
                None => fields.push(inherited),
            }
        }
        fields.append(&mut own);
        Ok(fields)
    }

    /// Reads the file that the file with index `from` extends; returns the index of the file read.
    fn open_base(
        &mut self,
        source: &dyn FileSource,
        from: usize,
        extends: &Field,
    ) -> Result<usize, InputError> {
        let file = &self.files[from];
        let name = file.base_name(extends)?;
        let Some(folder) = &file.folder else {
            let message = "only a file can extend another one, not a text without a folder";
            return Err(file.extends_error(extends, message.to_owned(), None));
        };
        let path = base_path(folder, &name);
        if !source.is_file(&path) {
            let message = format!(
                "cannot extend `{name}`: there is no file {}",
                path.display()
            );
            return Err(file.extends_error(extends, message, similar_task(source, folder, &name)));
        }
        let base = SourceFile::read(source, &path)?;
        self.check_base(file, extends, &name, &base)?;
        self.files.push(base);
        Ok(self.files.len() - 1)
    }

    /// Checks that `file` can extend `base`, which its field `extends` calls `name`.
    fn check_base(
        &self,
        file: &SourceFile,
        extends: &Field,
        name: &str,
        base: &SourceFile,
    ) -> Result<(), InputError> {
        let error = |message| Err(file.extends_error(extends, message, None));
        if self.files.iter().any(|other| same_file(other, base)) {
            return error(format!(
                "`{name}` extends this file in turn: remove one of the two `extends`"
            ));
        }
        if self.files.len() == MAX_EXTENDED_FILES {
            return error(format!(
                "at most {MAX_EXTENDED_FILES} files can extend each other in a chain"
            ));
        }
        let (own_kind, base_kind) = (file.kind()?, base.kind()?);
        if own_kind != base_kind {
            return error(format!(
                "`{name}` is a file of another kind: expected `{}(…)`, found `{}(…)`",
                own_kind.name(),
                base_kind.name()
            ));
        }
        Ok(())
    }

    /// Writes the merged text: the file itself, with all fields in the order of the base.
    fn write(&mut self, fields: &[FieldOfFile]) {
        let Some(parts) = FileParts::split(&self.files[0].text) else {
            return;
        };
        self.write_piece(0, 0..parts.open, None);
        for FieldOfFile { file, field } in fields {
            self.write_piece(*file, field.text.clone(), field.missing_comma);
        }
        self.write_piece(0, parts.close..self.files[0].text.len(), None);
    }

    /// Appends a piece of a file on a line of its own, in the columns that it has in the file.
    fn write_piece(
        &mut self,
        file: usize,
        piece: std::ops::Range<usize>,
        missing_comma: Option<usize>,
    ) {
        let text = &self.files[file].text;
        let line_start = text[..piece.start].rfind('\n').map_or(0, |at| at + 1);
        let first_line = text[..line_start].matches('\n').count();
        let indent = text[line_start..piece.start].chars().count();
        let mut written = " ".repeat(indent);
        match missing_comma {
            Some(at) => {
                written.push_str(&text[piece.start..at]);
                written.push(',');
                written.push_str(&text[at..piece.end]);
            }
            None => written.push_str(&text[piece]),
        }
        if !written.ends_with('\n') {
            written.push('\n');
        }
        let lines = written.matches('\n').count();
        self.line_sources
            .extend((0..lines).map(|line| (file, first_line + line)));
        self.text.push_str(&written);
    }

    pub(super) fn origin(&self) -> &str {
        &self.files[0].origin
    }

    pub(super) fn text(&self) -> &str {
        &self.text
    }

    pub(super) fn into_text(self) -> String {
        self.text
    }

    /// Turns an error in the merged text into one in the file from which its line comes.
    pub(super) fn locate(&self, mut error: InputError) -> InputError {
        let Some(position) = &mut error.position else {
            return error;
        };
        if let Some(&(file, line)) = self.line_sources.get(position.line - 1) {
            let source = &self.files[file];
            error.origin.clone_from(&source.origin);
            position.line = line + 1;
            let text = source.text.lines().nth(line).unwrap_or_default();
            text.clone_into(&mut position.text);
        }
        error
    }
}

impl SourceFile {
    fn read(source: &dyn FileSource, path: &Path) -> Result<Self, InputError> {
        Ok(Self {
            origin: path.display().to_string(),
            text: source.read(path)?,
            folder: Some(source.folder_of(path)),
        })
    }

    fn kind(&self) -> Result<seedbed_input::FileKind, InputError> {
        seedbed_input::file_kind(&self.origin, &self.text)
    }

    /// The name in the field `extends`.
    fn base_name(&self, extends: &Field) -> Result<String, InputError> {
        let value = &self.text[extends.value.clone()];
        let name = seedbed_input::parse::<Option<String>>("", value.to_owned());
        if let Ok(Some(name)) = name.map(|document| document.value) {
            return Ok(name);
        }
        let message = "expected the name of a task file in quotes";
        Err(self.extends_error(extends, message.to_owned(), None))
    }

    /// An error about the value of the field `extends`.
    fn extends_error(&self, extends: &Field, message: String, help: Option<String>) -> InputError {
        let (origin, text) = (&self.origin, &self.text);
        seedbed_input::error_at(origin, text, extends.value.start, "extends", message, help)
    }

    /// The error that keeps the text from being split into fields.
    fn syntax_error(&self) -> InputError {
        match seedbed_input::parse::<IgnoredAny>(&self.origin, self.text.clone()) {
            Err(error) => error,
            Ok(_) => InputError {
                origin: self.origin.clone(),
                position: None,
                field: String::new(),
                message: "expected a task file with named fields".to_owned(),
                help: None,
            },
        }
    }
}

fn fields_of_file(file: usize, fields: Vec<Field>) -> Vec<FieldOfFile> {
    let fields = fields.into_iter();
    fields.map(|field| FieldOfFile { file, field }).collect()
}

/// The path of the base `name`: a path relative to `folder` if it ends in `.ron`, else the stem of
/// a file in `folder`.
fn base_path(folder: &Path, name: &str) -> PathBuf {
    if seedbed_input::is_ron(Path::new(name)) {
        folder.join(name)
    } else {
        folder.join(format!("{name}.ron"))
    }
}

fn same_file(one: &SourceFile, other: &SourceFile) -> bool {
    let canonical = |file: &SourceFile| Path::new(&file.origin).canonicalize().ok();
    one.origin == other.origin || (canonical(one).is_some() && canonical(one) == canonical(other))
}

/// Suggests the task file in `folder` whose name is most similar to `name`.
fn similar_task(source: &dyn FileSource, folder: &Path, name: &str) -> Option<String> {
    let names = source.names_in(folder);
    seedbed_input::nearest_name(name, names.iter().map(String::as_str))
        .map(|near| format!("did you mean `{near}`?"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::{load, load_from, parse};

    /// A temporary folder, which is removed when it is dropped.
    struct Folder(PathBuf);

    impl Folder {
        fn new(name: &str, files: &[(&str, &str)]) -> Self {
            let path = std::env::temp_dir().join(format!("{name}-{}", std::process::id()));
            std::fs::create_dir_all(&path).unwrap();
            for (file, text) in files {
                std::fs::write(path.join(file), text).unwrap();
            }
            Self(path)
        }

        /// The error of loading `file`, without the path of the folder.
        fn error(&self, file: &str) -> String {
            let error = load(&self.0.join(file)).unwrap_err().to_string();
            error.replace(&format!("{}/", self.0.display()), "")
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            let _ = std::fs::remove_dir_all(&self.0);
        }
    }

    const BASE_FILE_TEXT: &str = r#"// A disc on a rail.
Environment(
    description: "A disc on a rail.", // said to people, not to agents
    gravity: (0.0, -9.8), control_step: 0.02,
    time_limit: 200,
    bodies: [(name: "disc", mass: 1.0, geoms: [Ball(radius: 0.1)])],
    joints: [(name: "rail", parent: "world", child: "disc", type: Slide(axis: (1.0, 0.0)))],
    actuators: [(name: "push", type: JointForce("rail"), control: Continuous(-1.0, 1.0))],
    sensors: [(name: "x", type: JointPosition("rail"))],
    observations: [(name: "x", range: (-1.0, 1.0))],
    reward: "if x > 0 { 1 } else { 0 }" // no comma: the last field
)
"#;

    #[test]
    fn fields_replace_those_of_the_base() {
        let folder = Folder::new(
            "replaces",
            &[
                ("base.ron", BASE_FILE_TEXT),
                (
                    "mine.ron",
                    r#"Environment(extends: "base", time_limit: 7, reward: "x", terminated: "x > 1")"#,
                ),
                (
                    "third.ron",
                    r#"Environment(extends: "mine.ron", time_limit: 9)"#,
                ),
            ],
        );
        let (mine, text) = load_from(&Disk, &folder.0.join("mine.ron")).unwrap();
        assert_eq!(mine.spec().name, "mine");
        assert_eq!(mine.spec().time_limit, 7);
        assert_eq!(mine.spec().description, "A disc on a rail.");
        assert!(text.contains("said to people"), "comments stay: {text}");
        let origin = folder.0.join("mine.ron").display().to_string();
        assert_eq!(parse("mine", &origin, text).unwrap(), mine);
        let (third, text) = load_from(&Disk, &folder.0.join("third.ron")).unwrap();
        assert_eq!(third.spec().time_limit, 9);
        assert!(text.contains("terminated: \"x > 1\""), "{text}");
        assert!(!text.contains("extends"), "{text}");
    }

    #[test]
    fn fields_have_places() {
        let place = |field, entry| find_field(BASE_FILE_TEXT, field, entry);
        let reward = place("reward", None).unwrap();
        assert_eq!((reward.line, reward.column), (11, 13));
        assert_eq!(reward.value, r#""if x > 0 { 1 } else { 0 }""#);
        let observation = place("observations", Some("x")).unwrap();
        assert_eq!((observation.line, observation.column), (10, 27));
        assert_eq!(place("observations", Some("y")), None);
        assert_eq!(place("terminated", None), None);
    }

    #[test]
    fn a_file_that_extends_nothing_keeps_its_text() {
        let folder = Folder::new("alone", &[("base.ron", BASE_FILE_TEXT)]);
        let (_, text) = load_from(&Disk, &folder.0.join("base.ron")).unwrap();
        assert_eq!(text, BASE_FILE_TEXT);
    }

    #[test]
    fn errors_are_located_in_the_file_that_has_them() {
        let folder = Folder::new(
            "errors",
            &[
                ("base.ron", &BASE_FILE_TEXT.replace("-9.8)", "\"down\")")),
                ("first.ron", "Environment(\n    extends: \"base\",\n)"),
                ("good.ron", BASE_FILE_TEXT),
                (
                    "second.ron",
                    "Environment(\n    extends: \"good\",\n    time_limit: 5, reward: \"y\",\n)",
                ),
                (
                    "third.ron",
                    "Environment(\n    extends: \"good\",\n    sensors: [],\n)",
                ),
                (
                    "twice.ron",
                    "Environment(extends: \"good\", reward: \"1\", reward: \"2\")",
                ),
            ],
        );
        for (file, expected_start) in [
            (
                "first.ron",
                "base.ron:4:20: in `gravity[1]`: expected a number",
            ),
            (
                "second.ron",
                "second.ron:3:29: in `reward`: no variable is named `y`",
            ),
            // An observation of the base refers to a sensor that was replaced.
            (
                "third.ron",
                "good.ron:10:28: in `observations[0].name`: no sensor is named `x`",
            ),
        ] {
            let error = folder.error(file);
            assert!(error.starts_with(expected_start), "{error}");
        }
        let error = folder.error("twice.ron");
        assert!(error.contains("field `reward` is given twice"), "{error}");
    }

    #[test]
    fn files_that_cannot_be_extended_are_errors() {
        let folder = Folder::new(
            "impossible",
            &[
                ("one.ron", "Environment(extends: \"two\")"),
                ("two.ron", "Environment(extends: \"one\")"),
                ("missing.ron", "Environment(\n    extends: \"twos\",\n)"),
                ("number.ron", "Environment(extends: 2)"),
                ("other.ron", "TabularEnvironment(extends: \"one\")"),
                ("broken.ron", "Environment(gravity: (0.0, 0.0)"),
                ("of_broken.ron", "Environment(extends: \"broken\")"),
            ],
        );
        for (file, expected) in [
            (
                "one.ron",
                "two.ron:1:22: in `extends`: `one` extends this file in turn",
            ),
            (
                "missing.ron",
                "missing.ron:2:14: in `extends`: cannot extend `twos`: there is no file twos.ron",
            ),
            ("missing.ron", "did you mean `two`?"),
            (
                "number.ron",
                "number.ron:1:22: in `extends`: expected the name of a task file in quotes",
            ),
            (
                "other.ron",
                "other.ron:1:29: in `extends`: `one` is a file of another kind",
            ),
            ("of_broken.ron", "broken.ron:1:32: "),
        ] {
            let error = folder.error(file);
            assert!(error.contains(expected), "{error}\ninstead of {expected}");
        }
        let error = parse("mine", "mine", "Environment(extends: \"one\")".to_owned());
        assert!(error.unwrap_err().message.starts_with("only a file can"));
    }

    #[test]
    fn chains_are_limited() {
        let files: Vec<_> = (0..10)
            .map(|index| {
                let text = format!("Environment(extends: \"file_{}\")", index + 1);
                (format!("file_{index}.ron"), text)
            })
            .collect();
        let files: Vec<_> = files
            .iter()
            .map(|(name, text)| (name.as_str(), text.as_str()))
            .collect();
        let folder = Folder::new("chain", &files);
        let error = folder.error("file_0.ron");
        assert!(error.contains("at most 8 files"), "{error}");
    }
}
