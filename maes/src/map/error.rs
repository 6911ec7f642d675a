//! Errors of the map commands.

use std::io::{self, ErrorKind};
use std::path::PathBuf;

use thiserror::Error;
use voxels::ExtentError;

use map_files::{FormatError, ImportError};
use mapgen::MapError;

/// Why a map command failed; always one line.
#[derive(Debug, Error)]
pub(crate) enum MapCliError {
    /// A file cannot be read.
    #[error("{}: cannot be read: {reason}", .file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// The system's reason.
        reason: io::Error,
    },
    /// A file cannot be written; it is as it was before.
    #[error("{}: cannot be written: {reason}", .file.display())]
    Write {
        /// The file.
        file: PathBuf,
        /// The system's reason.
        reason: io::Error,
    },
    /// A file that is there is not to be replaced.
    #[error("{}: {what}; nothing was written; choose another name", .file.display())]
    Exists {
        /// The file.
        file: PathBuf,
        /// What it is.
        what: &'static str,
    },
    /// A file's name or content does not fit a map format.
    #[error("{}: {reason}", .file.display())]
    Format {
        /// The file.
        file: PathBuf,
        /// What is wrong, and where.
        reason: FormatError,
    },
    /// The size or the cell length is not usable.
    #[error(transparent)]
    Extent(#[from] ExtentError),
    /// No map can be made from the options.
    #[error(transparent)]
    Map(#[from] MapError),
    /// No map can be made from the file.
    #[error(transparent)]
    Import(#[from] ImportError),
    /// An option that the chosen kind of map does not have.
    #[error("--{option} is not an option of --kind {kind}, which has {has}")]
    NotForKind {
        /// The option's name.
        option: &'static str,
        /// The kind's name.
        kind: &'static str,
        /// Its options.
        has: &'static str,
    },
    /// A parameter that the chosen kind of map does not have, or of another type.
    #[error("--set {assignment}: {reason}")]
    Set {
        /// What was asked for.
        assignment: String,
        /// What is wrong.
        reason: String,
    },
    /// A slice outside the map.
    #[error("{}: --slice {axis}={at} is outside the map, {axis} goes from 0 to {last}", .file.display())]
    Slice {
        /// The file.
        file: PathBuf,
        /// `x`, `y` or `z`.
        axis: char,
        /// The layer that was asked for.
        at: u32,
        /// The last layer of the map.
        last: u32,
    },
    /// A cut that leaves all or nothing of the map.
    #[error("{}: --cut {axis}={at}: allowed is {axis}=1 to {axis}={last}", .file.display())]
    Cut {
        /// The file.
        file: PathBuf,
        /// `x`, `y` or `z`.
        axis: char,
        /// The layer that was asked for.
        at: u32,
        /// The last layer of the map.
        last: u32,
    },
    /// A property that no body can have, or for which distances are not known.
    #[error("{flag} {value}: allowed is {allowed}")]
    OutOfRange {
        /// The flag.
        flag: &'static str,
        /// Its value.
        value: f64,
        /// The range with its unit.
        allowed: String,
    },
    /// A property of ground bodies, of another one.
    #[error("{flag}: only with --body ground")]
    NotForBody {
        /// The flag.
        flag: &'static str,
    },
    /// A map in which the team has no room, which has been described.
    #[error("{}: {agents} agents of radius {radius_m} m find no starts; see the advice above", .file.display())]
    NoStart {
        /// The file.
        file: PathBuf,
        /// Number of agents.
        agents: u32,
        /// Radius of their bodies, metres.
        radius_m: f64,
    },
    /// An option for another format of the output.
    #[error("{}: {option} is an option for {format} files", .file.display())]
    NotForOutput {
        /// The file to write.
        file: PathBuf,
        /// The option.
        option: &'static str,
        /// The extension that has it.
        format: &'static str,
    },
    /// One picture for several maps.
    #[error("--png {}: a picture is of one map, there are {count}", .file.display())]
    OnePicture {
        /// The picture.
        file: PathBuf,
        /// Number of maps.
        count: usize,
    },
    /// A picture cannot be packed.
    #[error("--png {}: {reason}", .file.display())]
    Picture {
        /// The picture.
        file: PathBuf,
        /// What is wrong.
        reason: png::EncodingError,
    },
    /// A picture by the page cannot be made.
    #[error("--picture {}: {reason}", .file.display())]
    Render {
        /// The picture.
        file: PathBuf,
        /// What is wrong.
        reason: String,
        /// Whether the request was at fault, and not the machine.
        is_bad_input: bool,
    },
    /// The operating system gives no random numbers.
    #[error("no seed can be drawn ({0}); give one with --seed")]
    Seed(getrandom::Error),
    /// The report cannot be printed.
    #[error("stdout: {0}")]
    Print(#[from] io::Error),
}

impl MapCliError {
    /// Whether the machine is at fault, or a check has failed, and the command was right.
    pub(crate) fn is_failure(&self) -> bool {
        match self {
            Self::Write { reason, .. } => !is_of_name(reason.kind()),
            Self::Render { is_bad_input, .. } => !is_bad_input,
            Self::NoStart { .. } | Self::Print(_) | Self::Seed(_) => true,
            _ => false,
        }
    }
}

/// Whether a file cannot be written under the name that was given, and could be under another one.
fn is_of_name(kind: ErrorKind) -> bool {
    matches!(
        kind,
        ErrorKind::NotFound
            | ErrorKind::NotADirectory
            | ErrorKind::IsADirectory
            | ErrorKind::AlreadyExists
            | ErrorKind::InvalidInput
            | ErrorKind::InvalidFilename
            | ErrorKind::PermissionDenied
            | ErrorKind::ReadOnlyFilesystem
    )
}
