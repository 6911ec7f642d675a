//! A message with another value in every field, by the rule of `make_fixtures.py`.
//!
//! The n-th primitive value, counted from 1, is a function of n and its type: integers are the low
//! bits of n times an odd constant, floats are n / 8, booleans tell whether n is odd, strings are
//! "é" n % 4 times and then n. Sequences have two elements. The values come from a deserializer, so
//! that no message is written out by hand.

use std::fmt;

use serde::de::{self, DeserializeOwned, DeserializeSeed, SeqAccess, Visitor};
use serde::forward_to_deserialize_any;

/// Elements of a sequence of unspecified length.
const ELEMENTS: usize = 2;

/// The sample of type `T`.
pub(crate) fn sample<T: DeserializeOwned>() -> T {
    T::deserialize(&mut Sampler { n: 0 }).unwrap()
}

struct Sampler {
    n: u64,
}

impl Sampler {
    fn count(&mut self) -> u64 {
        self.n += 1;
        self.n
    }

    fn integer(&mut self) -> u64 {
        self.count().wrapping_mul(0x9E37_79B9_7F4A_7C15)
    }
}

#[derive(Debug)]
pub(crate) struct NotInMessages(pub(crate) String);

impl fmt::Display for NotInMessages {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for NotInMessages {}

impl de::Error for NotInMessages {
    fn custom<T: fmt::Display>(message: T) -> Self {
        NotInMessages(message.to_string())
    }
}

impl serde::ser::Error for NotInMessages {
    fn custom<T: fmt::Display>(message: T) -> Self {
        NotInMessages(message.to_string())
    }
}

macro_rules! integers {
    ($($method:ident $visit:ident $type:ty,)*) => {
        $(fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, NotInMessages> {
            visitor.$visit(self.integer() as $type)
        })*
    };
}

impl<'de> de::Deserializer<'de> for &mut Sampler {
    type Error = NotInMessages;

    integers! {
        deserialize_i8 visit_i8 i8,
        deserialize_i32 visit_i32 i32,
        deserialize_u8 visit_u8 u8,
        deserialize_u16 visit_u16 u16,
        deserialize_u32 visit_u32 u32,
        deserialize_u64 visit_u64 u64,
    }

    fn deserialize_bool<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, NotInMessages> {
        visitor.visit_bool(self.count() % 2 == 1)
    }

    fn deserialize_f32<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, NotInMessages> {
        visitor.visit_f32(self.count() as f32 / 8.0)
    }

    fn deserialize_f64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, NotInMessages> {
        visitor.visit_f64(self.count() as f64 / 8.0)
    }

    fn deserialize_string<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, NotInMessages> {
        let n = self.count();
        visitor.visit_string("é".repeat((n % 4) as usize) + &n.to_string())
    }

    fn deserialize_byte_buf<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, NotInMessages> {
        let bytes = (0..ELEMENTS).map(|_| self.integer() as u8).collect();
        visitor.visit_byte_buf(bytes)
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, NotInMessages> {
        visitor.visit_seq(Elements { sampler: self, left: ELEMENTS })
    }

    fn deserialize_tuple<V: Visitor<'de>>(self, length: usize, visitor: V) -> Result<V::Value, NotInMessages> {
        visitor.visit_seq(Elements { sampler: self, left: length })
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, NotInMessages> {
        visitor.visit_seq(Elements { sampler: self, left: fields.len() })
    }

    fn deserialize_any<V: Visitor<'de>>(self, _visitor: V) -> Result<V::Value, NotInMessages> {
        Err(NotInMessages("a type that no message has".to_owned()))
    }

    forward_to_deserialize_any! {
        i16 i64 i128 u128 char str bytes option unit unit_struct newtype_struct tuple_struct map enum identifier
        ignored_any
    }
}

struct Elements<'a> {
    sampler: &'a mut Sampler,
    left: usize,
}

impl<'de> SeqAccess<'de> for Elements<'_> {
    type Error = NotInMessages;

    fn next_element_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<Option<T::Value>, NotInMessages> {
        if self.left == 0 {
            return Ok(None);
        }
        self.left -= 1;
        seed.deserialize(&mut *self.sampler).map(Some)
    }
}
