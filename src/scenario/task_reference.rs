//! The task of a scenario: the name of a file, or an environment of Gymnasium.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use seedbed_env::gymnasium::GymnasiumFile;

/// The task of a scenario.
#[derive(Clone, Debug, PartialEq)]
pub enum TaskReference {
    /// Name of a file in `envs/`, without `.ron`, or path of a file.
    Named(String),
    /// An environment of Gymnasium: `Gymnasium(id: "CartPole-v1")`.
    Gymnasium(Box<GymnasiumFile>),
}

impl TaskReference {
    /// Name of the task: that of its file, without `.ron`, or of the environment.
    #[must_use]
    pub fn task_name(&self) -> Cow<'_, str> {
        match self {
            Self::Named(name) => {
                let file = name.rsplit('/').next().unwrap_or(name);
                file.strip_suffix(".ron").unwrap_or(file).into()
            }
            Self::Gymnasium(file) => file.task_name().into(),
        }
    }

    /// The name or path of the task's file, if it has one.
    #[must_use]
    pub fn named(&self) -> Option<&str> {
        match self {
            Self::Named(name) => Some(name),
            Self::Gymnasium(_) => None,
        }
    }
}

impl Default for TaskReference {
    fn default() -> Self {
        Self::Named(String::new())
    }
}

impl From<String> for TaskReference {
    fn from(name: String) -> Self {
        Self::Named(name)
    }
}

/// What errors show of a task that is named.
impl AsRef<str> for TaskReference {
    fn as_ref(&self) -> &str {
        self.named().unwrap_or("Gymnasium")
    }
}

impl Serialize for TaskReference {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Named(name) => serializer.serialize_str(name),
            Self::Gymnasium(file) => {
                serializer.serialize_newtype_variant("TaskReference", 1, "Gymnasium", file)
            }
        }
    }
}

impl<'de> Deserialize<'de> for TaskReference {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ReferenceVisitor)
    }
}

struct ReferenceVisitor;

impl<'de> Visitor<'de> for ReferenceVisitor {
    type Value = TaskReference;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("the name of a task in quotes, or `Gymnasium(id: \"…\")`")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<TaskReference, E> {
        Ok(TaskReference::Named(name.to_owned()))
    }

    // RON passes on no name in front of the fields; `check_word` looks at it.
    fn visit_map<A: MapAccess<'de>>(self, fields: A) -> Result<TaskReference, A::Error> {
        let file = GymnasiumFile::deserialize(MapAccessDeserializer::new(fields))?;
        Ok(TaskReference::Gymnasium(Box::new(file)))
    }
}

impl JsonSchema for TaskReference {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        String::schema_name()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        String::json_schema(generator)
    }
}
