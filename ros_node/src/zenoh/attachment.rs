//! What `rmw_zenoh` attaches to each message, request and answer: its number, the time at which it
//! was sent, and the id of the endpoint that sent it.
//!
//! Each number has eight bytes, the lowest first; the id has its length before it.

use system::wall_clock;

/// Bytes of an id, and its length as it is written.
const ID_BYTES: u8 = 16;

/// Bytes of an attachment.
const BYTES: usize = 33;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Attachment {
    /// Counts the messages of a publisher, or the requests of a client, from 1.
    pub(super) sequence: i64,
    /// System time in nanoseconds since 1970.
    pub(super) sent_ns: i64,
    pub(super) gid: [u8; 16],
}

impl Attachment {
    /// Of a message that is sent now.
    pub(super) fn now(sequence: i64, gid: [u8; 16]) -> Self {
        let passed = wall_clock::since_epoch();
        Attachment { sequence, sent_ns: i64::try_from(passed.as_nanos()).unwrap_or(i64::MAX), gid }
    }

    pub(super) fn to_bytes(self) -> [u8; BYTES] {
        let mut bytes = [0; BYTES];
        bytes[..8].copy_from_slice(&self.sequence.to_le_bytes());
        bytes[8..16].copy_from_slice(&self.sent_ns.to_le_bytes());
        bytes[16] = ID_BYTES;
        bytes[17..].copy_from_slice(&self.gid);
        bytes
    }

    pub(super) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (sequence, rest) = bytes.split_first_chunk::<8>()?;
        let (sent_ns, rest) = rest.split_first_chunk::<8>()?;
        let gid = rest.strip_prefix(&[ID_BYTES])?.try_into().ok()?;
        Some(Attachment { sequence: i64::from_le_bytes(*sequence), sent_ns: i64::from_le_bytes(*sent_ns), gid })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_those_of_rmw_zenoh() {
        let attachment = Attachment { sequence: 7, sent_ns: 0x0102_0304_0506_0708, gid: [0xab; 16] };
        let mut expected = vec![7, 0, 0, 0, 0, 0, 0, 0, 8, 7, 6, 5, 4, 3, 2, 1, 16];
        expected.extend([0xab; 16]);
        assert_eq!(attachment.to_bytes()[..], expected);
        assert_eq!(Attachment::from_bytes(&expected), Some(attachment));
    }

    #[test]
    fn other_bytes_are_no_attachment() {
        let mut bytes = Attachment { sequence: 1, sent_ns: 2, gid: [3; 16] }.to_bytes().to_vec();
        assert_eq!(Attachment::from_bytes(&bytes[..32]), None);
        bytes[16] = 15;
        assert_eq!(Attachment::from_bytes(&bytes), None);
        bytes[16] = 16;
        bytes.push(0);
        assert_eq!(Attachment::from_bytes(&bytes), None);
    }
}
