//! Bytes by reference: a clone shares them instead of copying them.
//!
//! A message between agents has as many owners as it has receivers, and more: the command that
//! sends it, inboxes, observations and logs. In one process they all hold the same bytes. On the
//! wire they are a plain sequence of bytes, so what comes from another process is not shared.
//!
//! What the bytes say is decoded by the first receiver and kept with them for the others.

use std::any::Any;
use std::fmt;
use std::ops::Deref;
use std::sync::{Arc, OnceLock};

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Immutable bytes with shared ownership.
///
/// ```
/// use msgs::shared_bytes::SharedBytes;
///
/// let bytes = SharedBytes::from(vec![1, 2]);
/// let shared = bytes.clone();
/// assert_eq!(*shared, [1, 2]);
/// assert!(std::ptr::eq(&*bytes, &*shared));
/// ```
#[derive(Clone, Default)]
pub struct SharedBytes(Arc<Content>);

#[derive(Default)]
struct Content {
    bytes: Box<[u8]>,
    decoded: OnceLock<Arc<dyn Any + Send + Sync>>,
}

impl SharedBytes {
    /// The result of `decode`, which depends on the bytes alone. It is called once for all that
    /// share them; if they have been decoded as another type, the result is not kept.
    ///
    /// ```
    /// use msgs::shared_bytes::SharedBytes;
    ///
    /// let bytes = SharedBytes::from(vec![1, 2]);
    /// assert_eq!(*bytes.clone().decoded(|bytes| bytes.len()), 2);
    /// assert_eq!(*bytes.decoded(|_| -> usize { unreachable!("it is decoded already") }), 2);
    /// assert_eq!(*bytes.decoded(|bytes| bytes[0]), 1);
    /// ```
    pub fn decoded<T: Any + Send + Sync>(&self, decode: impl Fn(&[u8]) -> T) -> Arc<T> {
        let kept = self.0.decoded.get_or_init(|| Arc::new(decode(self)));
        Arc::clone(kept).downcast().unwrap_or_else(|_| Arc::new(decode(self)))
    }
}

impl Deref for SharedBytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.0.bytes
    }
}

impl From<Vec<u8>> for SharedBytes {
    fn from(bytes: Vec<u8>) -> Self {
        Self(Arc::new(Content { bytes: bytes.into_boxed_slice(), decoded: OnceLock::new() }))
    }
}

impl From<&[u8]> for SharedBytes {
    fn from(bytes: &[u8]) -> Self {
        bytes.to_vec().into()
    }
}

impl PartialEq for SharedBytes {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0) || **self == **other
    }
}

impl Eq for SharedBytes {}

impl fmt::Debug for SharedBytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        (**self).fmt(f)
    }
}

impl Serialize for SharedBytes {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_bytes(self)
    }
}

impl<'de> Deserialize<'de> for SharedBytes {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        serde_bytes::ByteBuf::deserialize(deserializer).map(|bytes| bytes.into_vec().into())
    }
}
