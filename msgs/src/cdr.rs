//! Messages as bytes: CDR with the 4-byte header that says so, as ROS 2 sends and records it.
//!
//! Invariants: the bytes are those that ROS 2 itself makes of the same values (little-endian,
//! alignment counted after the header), and equal values give equal bytes. Decoding takes any
//! bytes: what is not a message is an error that says where. This module does not know topics or
//! transports; the ROS client encodes what it sends by itself, with the same rules.
//!
//! Other writers do not give equal bytes for equal values: Fast DDS leaves the padding between
//! fields as it finds it in memory. So what came in is decoded and encoded again before it is
//! recorded, compared or hashed.

use std::sync::Arc;

use byteorder::{BigEndian, ByteOrder, LittleEndian};
use cdr_encoding::CdrDeserializer;
use serde::de::DeserializeOwned;
use serde::ser::{Serialize, SerializeTuple, Serializer};
use thiserror::Error;

/// Plain CDR, little-endian, no options.
const HEADER_LE: [u8; 4] = [0, 1, 0, 0];

/// Most bytes that may follow a message: a sample is sent in whole words of four.
const PADDING_MAX: usize = 3;

/// Why bytes are not a message of the type asked for.
#[derive(Debug, Error)]
pub enum CdrError {
    /// There is no room for the header.
    #[error("a CDR message begins with a header of 4 bytes, but there are only {0}")]
    NoHeader(usize),
    /// The header names another encoding.
    #[error("the CDR header is {0:02x?}, but only plain CDR is known: [00, 00, ..] and [00, 01, ..]")]
    Encoding([u8; 4]),
    /// The bytes break off, or hold something that the type does not allow.
    #[error("byte {offset} of {length}: {source}")]
    Body {
        /// How far the bytes were understood, counted from the first byte of the header.
        offset: usize,
        /// How many bytes there are.
        length: usize,
        /// What is wrong there.
        source: cdr_encoding::Error,
    },
    /// The header names the byte order in which nothing is sent.
    #[error("the message is big-endian, and can be passed on as it stands only if it is little-endian")]
    BigEndian,
    /// Something follows the message.
    #[error("the message ends at byte {end}, but there are {length} bytes")]
    Trailing {
        /// Where the message ends, counted from the first byte of the header.
        end: usize,
        /// How many bytes there are.
        length: usize,
    },
}

/// The bytes of `message`, with the header.
///
/// ```
/// use msgs::{cdr, rosgraph_msgs::Clock};
///
/// let bytes = cdr::encode(&Clock::default());
/// assert_eq!(bytes, [0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
/// ```
///
/// # Panics
/// As [`encode_into`].
pub fn encode<T: Serialize>(message: &T) -> Vec<u8> {
    let mut bytes = Vec::new();
    encode_into(&mut bytes, message);
    bytes
}

/// Replaces what is in `bytes` by the bytes of `message`, with the header. A buffer that is used
/// again does not grow again.
///
/// # Panics
/// If the type holds what CDR cannot: a sequence that does not know its length. No type that
/// derives `Serialize` from plain fields does.
pub fn encode_into<T: Serialize>(bytes: &mut Vec<u8>, message: &T) {
    bytes.clear();
    append(bytes, message);
}

/// Adds the bytes of `message` to `bytes`, with the header. What comes before has no influence on
/// the padding.
///
/// # Panics
/// As [`encode_into`].
pub fn append<T: Serialize>(bytes: &mut Vec<u8>, message: &T) {
    bytes.extend_from_slice(&HEADER_LE);
    cdr_encoding::to_writer::<T, LittleEndian, _>(bytes, message)
        .expect("writing to memory succeeds, and every sequence of a message knows its length");
}

/// The message in `bytes`, which begin with the header; either byte order is understood.
///
/// # Errors
/// If the bytes are not one whole message of type `T`; up to three bytes of padding may follow it.
///
/// ```
/// use msgs::{cdr, rosgraph_msgs::Clock};
///
/// let broken = cdr::decode::<Clock>(&[0, 1, 0, 0, 7, 0, 0, 0, 9, 9]);
/// assert_eq!(broken.unwrap_err().to_string(), "byte 8 of 10: unexpected end of input");
/// ```
pub fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, CdrError> {
    let (header, body) = bytes.split_first_chunk::<4>().ok_or(CdrError::NoHeader(bytes.len()))?;
    match header[..2] {
        [0, 0] => decode_body::<T, BigEndian>(body),
        [0, 1] => decode_body::<T, LittleEndian>(body),
        _ => Err(CdrError::Encoding(*header)),
    }
}

fn decode_body<T: DeserializeOwned, Order: ByteOrder>(body: &[u8]) -> Result<T, CdrError> {
    let length = HEADER_LE.len() + body.len();
    let mut deserializer = CdrDeserializer::<Order>::new(body);
    let decoded = T::deserialize(&mut deserializer);
    let offset = HEADER_LE.len() + deserializer.bytes_consumed();
    let message = decoded.map_err(|source| CdrError::Body { offset, length, source })?;
    if length - offset > PADDING_MAX {
        return Err(CdrError::Trailing { end: offset, length });
    }
    Ok(message)
}

/// A message that is passed on as it stands, whatever its type. Encoding it gives the bytes that it
/// was made of.
///
/// ```
/// use msgs::cdr::{self, Encoded};
/// use msgs::rosgraph_msgs::Clock;
///
/// let bytes = cdr::encode(&Clock::default());
/// assert_eq!(cdr::encode(&Encoded::new(&bytes).unwrap()), bytes);
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Encoded(Arc<[u8]>);

impl Encoded {
    /// The message in `bytes`, which begin with the header.
    ///
    /// # Errors
    /// If there is no header, or one of another encoding than the one in which everything is sent
    /// here.
    pub fn new(bytes: &[u8]) -> Result<Self, CdrError> {
        let (header, body) = bytes.split_first_chunk::<4>().ok_or(CdrError::NoHeader(bytes.len()))?;
        match header[..2] {
            [0, 1] => Ok(Self(body.into())),
            [0, 0] => Err(CdrError::BigEndian),
            _ => Err(CdrError::Encoding(*header)),
        }
    }

    /// A message of a known type.
    ///
    /// # Panics
    /// As [`encode_into`].
    #[must_use]
    pub fn of<T: Serialize>(message: &T) -> Self {
        Self(encode(message)[HEADER_LE.len()..].into())
    }

    /// The message, if it is one of this type.
    ///
    /// # Errors
    /// As [`decode`].
    pub fn decode<T: DeserializeOwned>(&self) -> Result<T, CdrError> {
        decode_body::<T, LittleEndian>(&self.0)
    }
}

/// The bytes one by one, as a tuple, which has neither a length nor padding.
impl Serialize for Encoded {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut tuple = serializer.serialize_tuple(self.0.len())?;
        self.0.iter().try_for_each(|byte| tuple.serialize_element(byte))?;
        tuple.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin_interfaces::Time;
    use crate::maes_msgs::{AgentMessage, CellRuns, JoinReply};
    use crate::std_msgs::Header;

    fn message_of(error: Result<impl std::fmt::Debug, CdrError>) -> String {
        error.unwrap_err().to_string()
    }

    #[test]
    fn alignment_is_counted_after_the_header() {
        let message = AgentMessage { agent: 1, kind: 2, data: vec![8, 9].into() };
        assert_eq!(encode(&message), [0, 1, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 2, 0, 0, 0, 8, 9]);
    }

    #[test]
    fn a_buffer_is_replaced_not_extended() {
        let mut bytes = vec![7; 100];
        encode_into(&mut bytes, &Time { sec: -1, nanosec: 2 });
        assert_eq!(bytes, [0, 1, 0, 0, 255, 255, 255, 255, 2, 0, 0, 0]);
    }

    #[test]
    fn what_comes_before_has_no_influence_on_the_padding() {
        let message = AgentMessage { agent: 1, kind: 2, data: vec![8, 9].into() };
        for before in 0..8 {
            let mut bytes = vec![7; before];
            append(&mut bytes, &message);
            assert_eq!(bytes, [vec![7; before], encode(&message)].concat());
        }
    }

    #[test]
    fn big_endian_and_padding_are_understood() {
        let time: Time = decode(&[0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 2, 0, 0, 0]).unwrap();
        assert_eq!(time, Time { sec: 256, nanosec: 2 });
    }

    #[test]
    fn what_is_passed_on_stands_as_it_was() {
        let bytes = encode(&AgentMessage { agent: 1, kind: 2, data: vec![8, 9, 10].into() });
        let passed_on = Encoded::new(&bytes).unwrap();
        assert_eq!(encode(&passed_on), bytes);
        assert_eq!(passed_on, Encoded::of(&AgentMessage { agent: 1, kind: 2, data: vec![8, 9, 10].into() }));
        assert_eq!(*passed_on.decode::<AgentMessage>().unwrap().data, [8, 9, 10]);
        assert!(matches!(Encoded::new(&[0, 0, 0, 0, 1]), Err(CdrError::BigEndian)));
        assert!(matches!(Encoded::new(&[0, 3, 0, 0, 1]), Err(CdrError::Encoding(_))));
        assert!(matches!(Encoded::new(&[0, 1]), Err(CdrError::NoHeader(2))));
    }

    #[test]
    fn errors_say_what_and_where() {
        assert_eq!(
            message_of(decode::<Time>(&[0, 1])),
            "a CDR message begins with a header of 4 bytes, but there are only 2"
        );
        assert_eq!(
            message_of(decode::<Time>(&[0, 3, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8])),
            "the CDR header is [00, 03, 00, 00], but only plain CDR is known: [00, 00, ..] and [00, 01, ..]"
        );
        let mut bytes = encode(&Time::default());
        bytes.extend([0; 4]);
        assert_eq!(message_of(decode::<Time>(&bytes)), "the message ends at byte 12, but there are 16 bytes");
        let header = [0, 1, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, 0xff, 0xff, 0];
        assert!(message_of(decode::<Header>(&header)).starts_with("byte 19 of 19: UTF-8 error"));
        let mut reply = encode(&JoinReply::default());
        reply[28] = 2;
        assert_eq!(message_of(decode::<JoinReply>(&reply)), "byte 29 of 133: Expected 0 or 1 as Boolean, got: 2");
    }

    #[test]
    fn a_length_that_lies_is_an_error_not_an_allocation() {
        let mut bytes = encode(&CellRuns { start: vec![1, 2], length: vec![3, 4] });
        bytes[4..8].copy_from_slice(&u32::MAX.to_le_bytes());
        assert_eq!(message_of(decode::<CellRuns>(&bytes)), "byte 24 of 24: unexpected end of input");
        let mut bytes = encode(&AgentMessage { agent: 0, kind: 0, data: vec![1; 10].into() });
        bytes[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
        assert_eq!(message_of(decode::<AgentMessage>(&bytes)), "byte 16 of 26: unexpected end of input");
    }
}
