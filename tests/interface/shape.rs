//! The fields of structs, as serde sees them: a serializer that writes down names and ROS types
//! instead of values.

use std::any::type_name;
use std::collections::BTreeMap;

use msgs::message::Message;
use serde::ser::{self, Impossible, Serialize};

use crate::sample::{NotInMessages, sample};

/// The fields (type, name) of each struct, by the name of the struct as it stands in a `.msg` file.
pub(crate) type Shapes = BTreeMap<String, Vec<(String, String)>>;

/// Writes down the fields of `M` and of all structs in it.
pub(crate) fn record<M: Message>(shapes: &mut Shapes) {
    ros_type(&sample::<M>(), shapes).unwrap();
}

/// The ROS type of a value; the structs in it are written down.
fn ros_type<T: Serialize + ?Sized>(value: &T, shapes: &mut Shapes) -> Result<String, NotInMessages> {
    value.serialize(Recorder { rust_type: type_name::<T>(), shapes })
}

struct Recorder<'a> {
    rust_type: &'static str,
    shapes: &'a mut Shapes,
}

fn refused<T>() -> Result<T, NotInMessages> {
    Err(NotInMessages("a type that no message has".to_owned()))
}

macro_rules! primitives {
    ($($method:ident $type:ty => $name:literal,)*) => {
        $(fn $method(self, _value: $type) -> Result<String, NotInMessages> {
            Ok($name.to_owned())
        })*
    };
}

macro_rules! refuse {
    ($($method:ident($($argument:ty),*) -> $result:ty;)*) => {
        $(fn $method(self, $(_: $argument),*) -> Result<$result, NotInMessages> {
            refused()
        })*
    };
}

type No = Impossible<String, NotInMessages>;

impl<'a> ser::Serializer for Recorder<'a> {
    type Ok = String;
    type Error = NotInMessages;
    type SerializeSeq = List<'a>;
    type SerializeTuple = List<'a>;
    type SerializeTupleStruct = No;
    type SerializeTupleVariant = No;
    type SerializeMap = No;
    type SerializeStruct = Fields<'a>;
    type SerializeStructVariant = No;

    primitives! {
        serialize_bool bool => "bool",
        serialize_i8 i8 => "int8",
        serialize_i16 i16 => "int16",
        serialize_i32 i32 => "int32",
        serialize_i64 i64 => "int64",
        serialize_u8 u8 => "uint8",
        serialize_u16 u16 => "uint16",
        serialize_u32 u32 => "uint32",
        serialize_u64 u64 => "uint64",
        serialize_f32 f32 => "float32",
        serialize_f64 f64 => "float64",
        serialize_str &str => "string",
        serialize_bytes &[u8] => "uint8[]",
    }

    fn serialize_seq(self, _length: Option<usize>) -> Result<List<'a>, NotInMessages> {
        Ok(List { suffix: "[]".to_owned(), element: None, shapes: self.shapes })
    }

    fn serialize_tuple(self, length: usize) -> Result<List<'a>, NotInMessages> {
        Ok(List { suffix: format!("[{length}]"), element: None, shapes: self.shapes })
    }

    fn serialize_struct(self, name: &'static str, _length: usize) -> Result<Fields<'a>, NotInMessages> {
        let mut path = self.rust_type.rsplit("::");
        assert_eq!(path.next(), Some(name));
        let package = path.next().unwrap();
        Ok(Fields { name: format!("{package}/{name}"), fields: Vec::new(), shapes: self.shapes })
    }

    refuse! {
        serialize_char(char) -> String;
        serialize_none() -> String;
        serialize_unit() -> String;
        serialize_unit_struct(&'static str) -> String;
        serialize_unit_variant(&'static str, u32, &'static str) -> String;
        serialize_tuple_struct(&'static str, usize) -> No;
        serialize_tuple_variant(&'static str, u32, &'static str, usize) -> No;
        serialize_map(Option<usize>) -> No;
        serialize_struct_variant(&'static str, u32, &'static str, usize) -> No;
    }

    fn serialize_some<T: Serialize + ?Sized>(self, _: &T) -> Result<String, NotInMessages> {
        refused()
    }

    fn serialize_newtype_struct<T: Serialize + ?Sized>(self, _: &'static str, _: &T) -> Result<String, NotInMessages> {
        refused()
    }

    fn serialize_newtype_variant<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
        _: &T,
    ) -> Result<String, NotInMessages> {
        refused()
    }
}

/// The elements of an array or of a sequence, which must not be empty.
struct List<'a> {
    suffix: String,
    element: Option<String>,
    shapes: &'a mut Shapes,
}

impl List<'_> {
    fn add<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), NotInMessages> {
        self.element = Some(ros_type(value, self.shapes)?);
        Ok(())
    }

    fn finish(self) -> Result<String, NotInMessages> {
        Ok(self.element.unwrap() + &self.suffix)
    }
}

impl ser::SerializeSeq for List<'_> {
    type Ok = String;
    type Error = NotInMessages;

    fn serialize_element<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), NotInMessages> {
        self.add(value)
    }

    fn end(self) -> Result<String, NotInMessages> {
        self.finish()
    }
}

impl ser::SerializeTuple for List<'_> {
    type Ok = String;
    type Error = NotInMessages;

    fn serialize_element<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), NotInMessages> {
        self.add(value)
    }

    fn end(self) -> Result<String, NotInMessages> {
        self.finish()
    }
}

struct Fields<'a> {
    name: String,
    fields: Vec<(String, String)>,
    shapes: &'a mut Shapes,
}

impl ser::SerializeStruct for Fields<'_> {
    type Ok = String;
    type Error = NotInMessages;

    fn serialize_field<T: Serialize + ?Sized>(&mut self, name: &'static str, value: &T) -> Result<(), NotInMessages> {
        self.fields.push((ros_type(value, self.shapes)?, name.to_owned()));
        Ok(())
    }

    fn end(self) -> Result<String, NotInMessages> {
        self.shapes.insert(self.name.clone(), self.fields);
        Ok(self.name)
    }
}
