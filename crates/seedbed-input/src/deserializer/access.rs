//! Values within values.

use seedbed_settings::{Expected, Field, Node, Value};
use serde::de::value::{StrDeserializer, U32Deserializer};
use serde::de::{
    DeserializeSeed, EnumAccess, IntoDeserializer, MapAccess, SeqAccess, VariantAccess, Visitor,
};

use super::Reader;
use super::failure::{Failure, Problem, Type};

/// The items of a list or in parentheses.
pub(super) struct Items<'t> {
    reader: Reader<'t>,
    items: std::iter::Enumerate<std::slice::Iter<'t, Node<'t>>>,
}

impl<'t> Items<'t> {
    pub(super) fn new(reader: Reader<'t>, items: &'t [Node<'t>]) -> Self {
        let items = items.iter().enumerate();
        Self { reader, items }
    }

    /// What a type makes of all items.
    pub(super) fn visit<'de, V: Visitor<'de>>(mut self, visitor: V) -> Result<V::Value, Failure> {
        let value = visitor.visit_seq(&mut self)?;
        match self.items.next() {
            None => Ok(value),
            Some((_, item)) => Err(match item.malformed() {
                Some(malformed) => Failure::malformed(malformed),
                None => self.reader.of(item).failure(Problem::TooMany),
            }),
        }
    }
}

impl<'de> SeqAccess<'de> for &mut Items<'_> {
    type Error = Failure;

    fn next_element_seed<S: DeserializeSeed<'de>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, Failure> {
        let Some((index, item)) = self.items.next() else {
            return Ok(None);
        };
        match item.malformed() {
            Some(malformed) if malformed.expected == Expected::Comma => {
                Err(Failure::malformed(malformed))
            }
            _ => {
                let value = self.reader.of(item).read(seed);
                value.map(Some).map_err(|failure| failure.in_item(index))
            }
        }
    }
}

/// The fields in parentheses.
pub(super) struct Fields<'t> {
    reader: Reader<'t>,
    rest: std::slice::Iter<'t, Field<'t>>,
    /// The field whose name was read last.
    field: Option<&'t Field<'t>>,
}

impl<'t> Fields<'t> {
    pub(super) fn new(reader: Reader<'t>, fields: &'t [Field<'t>]) -> Self {
        Self {
            reader,
            rest: fields.iter(),
            field: None,
        }
    }
}

impl<'de> MapAccess<'de> for Fields<'_> {
    type Error = Failure;

    fn next_key_seed<S: DeserializeSeed<'de>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, Failure> {
        self.field = self.rest.next();
        let Some(field) = self.field else {
            return Ok(None);
        };
        if field.name.is_empty() {
            return Err(self.reader.of(&field.value).expected(Type::Name));
        }
        let name = seed.deserialize(StrDeserializer::new(field.name));
        name.map(Some).map_err(|mut failure: Failure| {
            failure.set_place(field.place.start);
            failure.in_field(field.name)
        })
    }

    fn next_value_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<S::Value, Failure> {
        let field = self.field.expect("a name before its value");
        let value = self.reader.of(&field.value).read(seed);
        value.map_err(|failure| failure.in_field(field.name))
    }
}

/// The entries of a map.
pub(super) struct Entries<'t> {
    reader: Reader<'t>,
    rest: std::slice::Iter<'t, (Node<'t>, Node<'t>)>,
    /// The entry whose key was read last.
    entry: Option<&'t (Node<'t>, Node<'t>)>,
}

impl<'t> Entries<'t> {
    pub(super) fn new(reader: Reader<'t>, entries: &'t [(Node<'t>, Node<'t>)]) -> Self {
        Self {
            reader,
            rest: entries.iter(),
            entry: None,
        }
    }
}

impl<'de> MapAccess<'de> for Entries<'_> {
    type Error = Failure;

    fn next_key_seed<S: DeserializeSeed<'de>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, Failure> {
        self.entry = self.rest.next();
        match self.entry {
            Some((key, _)) => self.reader.of(key).read(seed).map(Some),
            None => Ok(None),
        }
    }

    fn next_value_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<S::Value, Failure> {
        let (key, value) = self.entry.expect("a key before its value");
        let read = self.reader.of(value).read(seed);
        read.map_err(|failure| match &key.value {
            Value::Text(name) => failure.in_field(name),
            _ => failure,
        })
    }
}

/// A variant of an enum.
pub(super) struct Variant<'t> {
    reader: Reader<'t>,
    name: &'t str,
    /// Whether it has values in parentheses.
    has_content: bool,
}

impl<'t> Variant<'t> {
    /// # Errors
    /// The value has no name.
    pub(super) fn new(reader: Reader<'t>) -> Result<Self, Failure> {
        let (name, has_content) = match &reader.node.value {
            Value::Name(name) => (*name, false),
            // To say what is meant by it.
            Value::Text(name) => (&**name, false),
            Value::Record { name, .. } | Value::Tuple { name, .. } if name.is_some() => {
                (name.unwrap_or_default(), true)
            }
            _ => return Err(reader.expected(Type::Name)),
        };
        Ok(Self {
            reader,
            name,
            has_content,
        })
    }

    fn is_in_quotes(&self) -> bool {
        matches!(self.reader.node.value, Value::Text(_))
    }

    /// Reads what is in parentheses.
    fn inside(&self) -> Result<Reader<'t>, Failure> {
        if self.is_in_quotes() {
            return Err(self.in_quotes("(…)"));
        }
        if !self.has_content {
            let problem = Problem::WrongType(Type::Struct(""), None);
            return Err(Failure::at(self.reader.node.place.end, problem).in_field(self.name));
        }
        Ok(Reader {
            is_inside: true,
            ..self.reader
        })
    }

    fn in_quotes(&self, parentheses: &str) -> Failure {
        let place = self.reader.node.place.clone();
        self.reader.failure(Problem::InQuotes {
            found: self.reader.context.text[place].to_owned(),
            written: format!("{}{parentheses}", self.name),
        })
    }
}

impl<'de> EnumAccess<'de> for Variant<'_> {
    type Error = Failure;
    type Variant = Self;

    fn variant_seed<S: DeserializeSeed<'de>>(self, seed: S) -> Result<(S::Value, Self), Failure> {
        match seed.deserialize(StrDeserializer::new(self.name)) {
            Ok(variant) => Ok((variant, self)),
            Err(failure) => {
                let mut failure: Failure = failure;
                failure.set_place(self.reader.node.place.start);
                Err(failure)
            }
        }
    }
}

impl<'de> VariantAccess<'de> for Variant<'_> {
    type Error = Failure;

    fn unit_variant(self) -> Result<(), Failure> {
        if self.is_in_quotes() {
            return Err(self.in_quotes(""));
        }
        if self.has_content {
            let place = self.reader.after_name();
            let problem = Problem::WithParentheses(self.name.to_owned());
            return Err(Failure::at(place, problem));
        }
        Ok(())
    }

    fn newtype_variant_seed<S: DeserializeSeed<'de>>(self, seed: S) -> Result<S::Value, Failure> {
        if self.is_in_quotes() {
            let without_fields = Node {
                place: self.reader.node.place.clone(),
                value: Value::Record {
                    name: None,
                    fields: Vec::new(),
                },
            };
            let is_value = self.reader.of(&without_fields).read(seed).is_ok();
            return Err(self.in_quotes(if is_value { "()" } else { "(…)" }));
        }
        let inside = self.inside()?;
        let value = inside.read(seed);
        let value = value.and_then(|value| inside.check_end().map(|()| value));
        value.map_err(|failure| failure.in_field(self.name))
    }

    fn tuple_variant<V: Visitor<'de>>(self, _: usize, visitor: V) -> Result<V::Value, Failure> {
        let value = self
            .inside()?
            .tuple("")
            .and_then(|items| items.visit(visitor));
        value.map_err(|failure| self.placed(failure))
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Failure> {
        if self.is_in_quotes() {
            let empty = Fields::new(self.reader, &[]);
            let is_value = visitor.visit_map(empty).is_ok();
            return Err(self.in_quotes(if is_value { "()" } else { "(…)" }));
        }
        let value = self
            .inside()?
            .fields("")
            .and_then(|fields| visitor.visit_map(fields));
        value.map_err(|failure| self.placed(failure))
    }
}

impl Variant<'_> {
    /// An error about what is in parentheses.
    fn placed(&self, failure: Failure) -> Failure {
        self.reader.placed(failure).in_field(self.name)
    }
}

/// A located value, then its ordinal.
pub(super) struct LocatedParts<'t> {
    /// The reader of the value until it is read.
    reader: Option<Reader<'t>>,
    context: &'t super::Context<'t>,
    pub(super) ordinal: Option<u32>,
}

impl<'t> LocatedParts<'t> {
    pub(super) fn new(reader: Reader<'t>) -> Self {
        Self {
            reader: Some(reader),
            context: reader.context,
            ordinal: None,
        }
    }
}

impl<'de> SeqAccess<'de> for &mut LocatedParts<'_> {
    type Error = Failure;

    fn next_element_seed<S: DeserializeSeed<'de>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, Failure> {
        if let Some(reader) = self.reader.take() {
            return seed.deserialize(reader).map(Some);
        }
        let ordinal = self.context.located.get();
        self.context.located.set(ordinal + 1);
        self.ordinal = Some(ordinal);
        let ordinal: U32Deserializer<Failure> = ordinal.into_deserializer();
        seed.deserialize(ordinal).map(Some)
    }
}
