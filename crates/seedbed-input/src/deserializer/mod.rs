//! Reads types from the tree of a RON text.
//!
//! RON's semantics are those of the `ron` crate with its extensions `implicit_some` and `unwrap_variant_newtypes`. An
//! error gets its place from the innermost value that was being read, and the path of its field on the way out.

mod access;
mod failure;
mod numbers;

use std::cell::{Cell, RefCell};

use seedbed_settings::{Expected, Node, Tree, Value};
use serde::de::{DeserializeOwned, DeserializeSeed, Deserializer, Error as _, Visitor};

use self::access::{Entries, Fields, Items, LocatedParts, Variant};
pub(crate) use self::failure::{Failure, Problem, Type};

/// The name with which [`Located`](super::Located) asks for its ordinal.
pub(crate) const LOCATED: &str = "$seedbed_input::Located";

/// An error about a located value.
#[derive(Clone, Copy)]
pub(crate) struct LocatedError<'t> {
    /// Number of located values that are read before it.
    pub(crate) ordinal: u32,
    pub(crate) message: &'t str,
}

/// Reads a `T`, and fails at the located value that `error` is about.
pub(crate) fn read<T: DeserializeOwned>(
    tree: &Tree<'_>,
    error: Option<LocatedError<'_>>,
) -> Result<T, Failure> {
    let value = read_node(tree.text, &tree.root, error)?;
    match tree.error {
        Some(malformed) => Err(Failure::malformed(malformed)),
        None => Ok(value),
    }
}

/// Reads a `T` from a node of a tree of `text`.
pub(crate) fn read_node<T: DeserializeOwned>(
    text: &str,
    node: &Node<'_>,
    error: Option<LocatedError<'_>>,
) -> Result<T, Failure> {
    let context = Context {
        text,
        error,
        located: Cell::new(0),
        refused_number: RefCell::new(None),
    };
    let reader = Reader {
        context: &context,
        node,
        is_inside: false,
    };
    reader.read(std::marker::PhantomData)
}

/// What all readers of a text share.
struct Context<'t> {
    text: &'t str,
    error: Option<LocatedError<'t>>,
    /// Number of located values that have been read.
    located: Cell<u32>,
    /// The error about a whole number that its type cannot hold. The type gets its largest number instead, to say which
    /// range it has.
    refused_number: RefCell<Option<Failure>>,
}

/// Reads one value.
#[derive(Clone, Copy)]
struct Reader<'t> {
    context: &'t Context<'t>,
    node: &'t Node<'t>,
    /// Whether the value is not the node, but what it has in parentheses after its name: `Some(…)`, `Variant(…)`.
    is_inside: bool,
}

impl<'t> Reader<'t> {
    fn of(self, node: &'t Node<'t>) -> Self {
        Self {
            node,
            is_inside: false,
            ..self
        }
    }

    /// Reads the value. Its errors are at its place, unless they are about a value within it.
    fn read<'de, S: DeserializeSeed<'de>>(self, seed: S) -> Result<S::Value, Failure> {
        let result = seed.deserialize(self);
        let refused = self.context.refused_number.take();
        match (result, refused) {
            (Ok(value), None) => Ok(value),
            (Err(failure), None) => Err(self.placed(failure)),
            (Ok(_), Some(refused)) => Err(refused),
            (Err(failure), Some(refused)) => Err(refused.with_range_of(&failure)),
        }
    }

    fn placed(self, mut failure: Failure) -> Failure {
        if failure.place().is_none() {
            let place = match failure.problem() {
                Problem::DuplicateField(name) => self.second_field(name),
                // A closing bracket alone in its line does not show what the message is about.
                Problem::Message(_) if self.has_several_lines() => Some(self.node.place.start),
                _ => None,
            };
            failure.set_place(place.unwrap_or_else(|| self.place()));
        }
        failure
    }

    fn has_several_lines(self) -> bool {
        let text = &self.context.text[self.node.place.clone()];
        text.ends_with([')', ']', '}']) && text.contains('\n')
    }

    fn second_field(self, name: &str) -> Option<usize> {
        let fields = self.node.fields().iter();
        let mut same = fields.filter(|field| field.name == name);
        same.nth(1).map(|field| field.place.start)
    }

    /// Where errors about the whole value are: at a number or name, at the first character of a text, and at the closing
    /// bracket of others.
    fn place(self) -> usize {
        let place = self.node.place.clone();
        match &self.node.value {
            Value::Tuple { name, items } if self.is_inside || *name == Some("Some") => {
                match items.first() {
                    Some(item) if items.len() == 1 => return self.of(item).place(),
                    _ => {}
                }
            }
            Value::Text(_) => {
                let text = &self.context.text[place.clone()];
                return place.start + text.find('"').map_or(0, |quote| quote + 1);
            }
            _ => {}
        }
        let is_closed = self.context.text[place.clone()].ends_with([')', ']', '}']);
        if is_closed {
            place.end - 1
        } else {
            place.start
        }
    }

    fn failure(self, problem: Problem) -> Failure {
        Failure::at(self.node.place.start, problem)
    }

    /// The error that the value is not what was expected.
    fn expected(self, expected: Type) -> Failure {
        match self.node.malformed() {
            Some(malformed) if malformed.expected != Expected::Value => {
                Failure::malformed(malformed)
            }
            _ => self.failure(Problem::WrongType(expected, self.found())),
        }
    }

    /// The error that a field was expected.
    fn expected_field(self) -> Failure {
        match self.node.name() {
            Some(_) => Failure::at(self.after_name(), Problem::Syntax(Expected::Colon)),
            None => self.expected(Type::Name),
        }
    }

    /// Byte behind the name, at the parenthesis if there is one.
    fn after_name(self) -> usize {
        let place = self.node.place.clone();
        match self.node.value {
            Value::Name(_) => place.end,
            _ => place.start + self.context.text[place].find('(').unwrap_or_default(),
        }
    }

    /// Where the first field is.
    fn place_of_fields(self) -> usize {
        let first = self.node.fields().first();
        first.map_or(self.place(), |field| field.place.start)
    }

    /// What is there instead, if it could be a number or a name.
    fn found(self) -> Option<String> {
        let place = self.node.place.clone();
        match &self.node.value {
            Value::Number(found) => Some((*found).to_owned()),
            Value::Malformed(_) => Some(word(&self.context.text[place.start..])),
            _ => None,
        }
        .filter(|found| !found.is_empty())
    }

    /// The reader of a value that is no struct, tuple or unit: inside of parentheses, of the only one.
    fn single(self, expected: Type) -> Result<Self, Failure> {
        match &self.node.value {
            _ if !self.is_inside => Ok(self),
            Value::Tuple { items, .. } => match &items[..] {
                [] => Err(Failure::at(
                    self.place(),
                    Problem::WrongType(expected, None),
                )),
                [item] => Ok(self.of(item)),
                [item, next, ..] if next.malformed().is_some() => Ok(self.of(item)),
                // Brackets are missing.
                [item, ..] if expected == Type::List && !matches!(item.value, Value::List(_)) => {
                    Ok(self.of(item))
                }
                [_, next, ..] => Err(self.of(next).failure(Problem::TooMany)),
            },
            Value::Record { .. } => Err(Failure::at(
                self.place_of_fields(),
                Problem::WrongType(expected, None),
            )),
            _ => Err(self.expected(expected)),
        }
    }

    /// The items in parentheses.
    fn tuple(self, name: &'static str) -> Result<Items<'t>, Failure> {
        if !self.is_inside {
            self.check_name(name)?;
        }
        match &self.node.value {
            Value::Tuple { items, .. } => Ok(Items::new(self, items)),
            Value::Record { .. } => Err(Failure::at(
                self.place_of_fields(),
                Problem::WrongType(Type::Unnamed, None),
            )),
            _ => Err(self.expected(Type::Struct(name))),
        }
    }

    /// The fields in parentheses.
    fn fields(self, name: &'static str) -> Result<Fields<'t>, Failure> {
        if !self.is_inside {
            self.check_name(name)?;
        }
        match &self.node.value {
            Value::Record { fields, .. } => Ok(Fields::new(self, fields)),
            Value::Tuple { items, .. } => match items.first() {
                None => Ok(Fields::new(self, &[])),
                Some(item) => Err(self.of(item).expected_field()),
            },
            Value::Name(_) => Err(Failure::at(
                self.node.place.end,
                Problem::WrongType(Type::Struct(name), None),
            )),
            _ => Err(self.expected(Type::Struct(name))),
        }
    }

    /// The name before the parenthesis may be left out, but must not be another one.
    fn check_name(self, expected: &'static str) -> Result<(), Failure> {
        match self.node.name() {
            Some(found) if found != expected => {
                let found = found.to_owned();
                Err(self.failure(Problem::OtherName { expected, found }))
            }
            _ => Ok(()),
        }
    }

    /// Whether the value is written as this name alone.
    fn is_name(self, name: &str) -> bool {
        match &self.node.value {
            Value::Tuple { items, .. } if self.is_inside && items.len() == 1 => {
                self.of(&items[0]).is_name(name)
            }
            Value::Name(found) => *found == name,
            _ => false,
        }
    }

    /// The reader of what is in `Some(…)`.
    fn inside_some(self) -> Option<Self> {
        let node = match &self.node.value {
            Value::Tuple { items, .. } if self.is_inside && items.len() == 1 => &items[0],
            _ if self.is_inside => return None,
            _ => self.node,
        };
        let is_some = node.name() == Some("Some") && !matches!(node.value, Value::Name(_));
        is_some.then_some(Self {
            node,
            is_inside: true,
            ..self
        })
    }

    /// Checks that nothing is wrong with the text up to the closing bracket.
    fn check_end(self) -> Result<(), Failure> {
        let last = match &self.node.value {
            Value::List(items) | Value::Tuple { items, .. } => items.last(),
            Value::Record { fields, .. } => fields.last().map(|field| &field.value),
            _ => None,
        };
        match last.and_then(Node::malformed) {
            Some(malformed) => Err(Failure::malformed(malformed)),
            None => Ok(()),
        }
    }

    fn visit_unit<'de, V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Failure> {
        match &self.node.value {
            Value::Tuple { items, .. } if !items.is_empty() => {
                Err(self.of(&items[0]).failure(Problem::TooMany))
            }
            Value::Record { fields, .. } if !fields.is_empty() => {
                Err(Failure::at(self.place_of_fields(), Problem::TooMany))
            }
            _ => visitor.visit_unit(),
        }
    }
}

/// The characters at the beginning of a text that could be a name or a number.
pub(crate) fn word(text: &str) -> String {
    let is_part = |c: &char| c.is_alphanumeric() || "_.+-".contains(*c);
    text.chars().take_while(is_part).collect()
}

/// Methods for values that are written as one token.
macro_rules! scalars {
    ($($method:ident: $read:ident, $visit:ident;)*) => {
        $(fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Failure> {
            visitor.$visit(self.$read()?)
        })*
    };
}

impl<'de> Deserializer<'de> for Reader<'_> {
    type Error = Failure;

    scalars! {
        deserialize_bool: boolean, visit_bool;
        deserialize_i8: whole_number, visit_i8;
        deserialize_i16: whole_number, visit_i16;
        deserialize_i32: whole_number, visit_i32;
        deserialize_i64: whole_number, visit_i64;
        deserialize_u8: whole_number, visit_u8;
        deserialize_u16: whole_number, visit_u16;
        deserialize_u32: whole_number, visit_u32;
        deserialize_u64: whole_number, visit_u64;
        deserialize_f32: number, visit_f32;
        deserialize_f64: number, visit_f64;
        deserialize_char: character, visit_char;
        deserialize_str: text, visit_str;
        deserialize_string: text, visit_str;
        deserialize_identifier: name, visit_str;
    }

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Failure> {
        if let Some(inside) = self.inside_some() {
            return inside.visit_some(visitor);
        }
        match &self.node.value {
            Value::Tuple { items, .. } if self.is_inside && items.len() == 1 => {
                self.of(&items[0]).deserialize_any(visitor)
            }
            Value::Name("true" | "false") => visitor.visit_bool(self.boolean()?),
            Value::Name("inf" | "NaN") => visitor.visit_f64(self.number()?),
            Value::Name("None") => visitor.visit_none(),
            Value::Number(token) => match numbers::whole(token) {
                Some(Ok(whole)) if whole >= 0 => visitor.visit_u64(self.whole_number()?),
                Some(Ok(_)) => visitor.visit_i64(self.whole_number()?),
                _ => visitor.visit_f64(self.number()?),
            },
            Value::Character(character) => visitor.visit_char(*character),
            Value::Text(text) => visitor.visit_str(text),
            Value::List(_) => self.deserialize_seq(visitor),
            Value::Map(_) => self.deserialize_map(visitor),
            Value::Record { fields, .. } if !fields.is_empty() => {
                visitor.visit_map(Fields::new(self, fields))
            }
            Value::Tuple { items, .. } if !items.is_empty() => {
                Items::new(self, items).visit(visitor)
            }
            Value::Name(_) | Value::Record { .. } | Value::Tuple { .. } => visitor.visit_unit(),
            Value::Malformed(malformed) => Err(Failure::malformed(*malformed)),
        }
    }

    /// Values of no type: no type has to hold a number.
    fn deserialize_ignored_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Failure> {
        match &self.node.value {
            Value::Number(token) if numbers::whole(token).is_some() => visitor.visit_unit(),
            _ => self.deserialize_any(visitor),
        }
    }

    fn deserialize_bytes<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Failure> {
        self.deserialize_any(visitor)
    }

    fn deserialize_byte_buf<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Failure> {
        self.deserialize_any(visitor)
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Failure> {
        if self.is_name("None") {
            return visitor.visit_none();
        }
        match self.inside_some() {
            Some(inside) => inside.visit_some(visitor),
            None => visitor.visit_some(self),
        }
    }

    fn deserialize_unit<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Failure> {
        match &self.node.value {
            Value::Tuple { name: None, .. } => self.visit_unit(visitor),
            _ if self.is_inside => self.visit_unit(visitor),
            _ => Err(self.expected(Type::Unit)),
        }
    }

    fn deserialize_unit_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        visitor: V,
    ) -> Result<V::Value, Failure> {
        if self.is_name(name) && !self.is_inside {
            return visitor.visit_unit();
        }
        self.deserialize_unit(visitor)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        visitor: V,
    ) -> Result<V::Value, Failure> {
        if name == LOCATED {
            return self.visit_located(visitor);
        }
        if self.is_inside {
            let inner = self.single(Type::Struct(name))?;
            return visitor.visit_newtype_struct(inner);
        }
        self.check_name(name)?;
        match &self.node.value {
            Value::Tuple { items, .. } if !items.is_empty() => {
                let inside = Self {
                    is_inside: true,
                    ..self
                };
                let value = visitor.visit_newtype_struct(inside.single(Type::Struct(name))?)?;
                self.check_end().map(|()| value)
            }
            _ => Err(self.expected(Type::Struct(name))),
        }
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Failure> {
        let reader = self.single(Type::List)?;
        match &reader.node.value {
            Value::List(items) => Items::new(reader, items).visit(visitor),
            _ => Err(reader.expected(Type::List)),
        }
    }

    fn deserialize_tuple<V: Visitor<'de>>(self, _: usize, visitor: V) -> Result<V::Value, Failure> {
        match self.node.name() {
            Some(_) if !self.is_inside => Err(self.expected(Type::Struct(""))),
            _ => self.tuple("")?.visit(visitor),
        }
    }

    fn deserialize_tuple_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        _: usize,
        visitor: V,
    ) -> Result<V::Value, Failure> {
        self.tuple(name)?.visit(visitor)
    }

    fn deserialize_map<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Failure> {
        let reader = self.single(Type::Map)?;
        match &reader.node.value {
            Value::Map(entries) => visitor.visit_map(Entries::new(reader, entries)),
            _ => Err(reader.expected(Type::Map)),
        }
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Failure> {
        visitor.visit_map(self.fields(name)?)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Failure> {
        let reader = self.single(Type::Name)?;
        visitor.visit_enum(Variant::new(reader)?)
    }
}

impl Reader<'_> {
    fn visit_some<'de, V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Failure> {
        let value = visitor.visit_some(self)?;
        self.check_end().map(|()| value)
    }

    fn visit_located<'de, V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Failure> {
        let mut parts = LocatedParts::new(self);
        let value = visitor.visit_seq(&mut parts)?;
        match self.context.error {
            Some(error) if Some(error.ordinal) == parts.ordinal => {
                Err(Failure::custom(error.message))
            }
            _ => Ok(value),
        }
    }
}
