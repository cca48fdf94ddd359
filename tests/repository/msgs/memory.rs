//! The offsets of a Rust value's fields in memory, without a list of fields: serde passes every field's name and a
//! reference to it.

use serde::de::value::Error;
use serde::ser::{Error as _, Impossible, Serialize, SerializeStruct, Serializer};

/// A field: its name, its offset, its size.
pub type Member = (&'static str, usize, usize);

/// Returns the fields of a struct in order.
pub fn members<T: Serialize>(value: &T) -> Vec<Member> {
    value.serialize(Members { base: address(value), found: Vec::new() }).unwrap()
}

fn address<T: ?Sized>(value: &T) -> usize {
    std::ptr::from_ref(value).addr()
}

struct Members {
    base: usize,
    found: Vec<Member>,
}

impl SerializeStruct for Members {
    type Ok = Vec<Member>;
    type Error = Error;

    fn serialize_field<T: Serialize + ?Sized>(&mut self, name: &'static str, value: &T) -> Result<(), Error> {
        self.found.push((name, address(value) - self.base, size_of_val(value)));
        Ok(())
    }

    fn end(self) -> Result<Vec<Member>, Error> {
        Ok(self.found)
    }
}

/// Methods for all types except structs with named fields.
macro_rules! refused {
    ($($method:ident($($argument:ty),*) -> $of:ty;)*) => {
        $(fn $method(self $(, _: $argument)*) -> Result<$of, Error> {
            Err(Error::custom("a layout is a struct with named fields"))
        })*
    };
}

type Nothing = Impossible<Vec<Member>, Error>;

impl Serializer for Members {
    type Ok = Vec<Member>;
    type Error = Error;
    type SerializeStruct = Self;
    type SerializeSeq = Nothing;
    type SerializeTuple = Nothing;
    type SerializeTupleStruct = Nothing;
    type SerializeTupleVariant = Nothing;
    type SerializeMap = Nothing;
    type SerializeStructVariant = Nothing;

    fn serialize_struct(self, _: &'static str, _: usize) -> Result<Self, Error> {
        Ok(self)
    }

    fn serialize_some<T: Serialize + ?Sized>(self, value: &T) -> Result<Self::Ok, Error> {
        value.serialize(self)
    }

    fn serialize_newtype_struct<T: Serialize + ?Sized>(self, _: &'static str, value: &T) -> Result<Self::Ok, Error> {
        value.serialize(self)
    }

    fn serialize_newtype_variant<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
        value: &T,
    ) -> Result<Self::Ok, Error> {
        value.serialize(self)
    }

    refused! {
        serialize_bool(bool) -> Self::Ok;
        serialize_i8(i8) -> Self::Ok;
        serialize_i16(i16) -> Self::Ok;
        serialize_i32(i32) -> Self::Ok;
        serialize_i64(i64) -> Self::Ok;
        serialize_u8(u8) -> Self::Ok;
        serialize_u16(u16) -> Self::Ok;
        serialize_u32(u32) -> Self::Ok;
        serialize_u64(u64) -> Self::Ok;
        serialize_f32(f32) -> Self::Ok;
        serialize_f64(f64) -> Self::Ok;
        serialize_char(char) -> Self::Ok;
        serialize_str(&str) -> Self::Ok;
        serialize_bytes(&[u8]) -> Self::Ok;
        serialize_none() -> Self::Ok;
        serialize_unit() -> Self::Ok;
        serialize_unit_struct(&'static str) -> Self::Ok;
        serialize_unit_variant(&'static str, u32, &'static str) -> Self::Ok;
        serialize_seq(Option<usize>) -> Nothing;
        serialize_tuple(usize) -> Nothing;
        serialize_tuple_struct(&'static str, usize) -> Nothing;
        serialize_tuple_variant(&'static str, u32, &'static str, usize) -> Nothing;
        serialize_map(Option<usize>) -> Nothing;
        serialize_struct_variant(&'static str, u32, &'static str, usize) -> Nothing;
    }
}
