//! The package `sensor_msgs`: what sensors find.

use serde::{Deserialize, Serialize};

use crate::std_msgs::Header;

/// Points, each with the same fields.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PointCloud2 {
    /// When they were found, sim time, and the frame that they are in.
    pub header: Header,
    /// Rows; 1 if the points are in no order.
    pub height: u32,
    /// Points of a row.
    pub width: u32,
    /// What the bytes of a point are.
    pub fields: Vec<PointField>,
    /// Byte order of the data.
    pub is_bigendian: bool,
    /// Bytes of a point.
    pub point_step: u32,
    /// Bytes of a row.
    pub row_step: u32,
    /// The points, row by row.
    #[serde(with = "serde_bytes")]
    pub data: Vec<u8>,
    /// Whether every point is one: none has a coordinate that is no number.
    pub is_dense: bool,
}

/// What some bytes of a point are.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PointField {
    /// What it is called: `x`, `y`, `z`, `intensity`.
    pub name: String,
    /// Where it begins, bytes from the begin of the point.
    pub offset: u32,
    /// The type of its elements; one of the constants.
    pub datatype: u8,
    /// How many elements it has.
    pub count: u32,
}

impl PointField {
    /// `datatype`: 8 bits with sign.
    pub const INT8: u8 = 1;
    /// `datatype`: 8 bits without sign.
    pub const UINT8: u8 = 2;
    /// `datatype`: 16 bits with sign.
    pub const INT16: u8 = 3;
    /// `datatype`: 16 bits without sign.
    pub const UINT16: u8 = 4;
    /// `datatype`: 32 bits with sign.
    pub const INT32: u8 = 5;
    /// `datatype`: 32 bits without sign.
    pub const UINT32: u8 = 6;
    /// `datatype`: floating point, 32 bits.
    pub const FLOAT32: u8 = 7;
    /// `datatype`: floating point, 64 bits.
    pub const FLOAT64: u8 = 8;
}

/// A picture in a file format. Markers have one; nothing here uses it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CompressedImage {
    /// When it was taken, and the frame of the camera.
    pub header: Header,
    /// The file format.
    pub format: String,
    /// The file.
    #[serde(with = "serde_bytes")]
    pub data: Vec<u8>,
}
