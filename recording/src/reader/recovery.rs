//! Recovery of a cut recording: its whole records are written again as a finished MCAP file, with
//! indexes, statistics and a footer, so that every reader opens it.
//!
//! Invariants: the bytes of messages, attachments and metadata, the ids of schemas and channels and
//! the order of records do not change; nothing of or behind a damaged or cut chunk is kept; the
//! output appears under its name when it is complete, and replaces nothing.
//!
//! Any MCAP file is recovered, whatever has written it. Records that are private to a program are
//! left out.

use std::borrow::Cow;
use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{self, BufWriter, ErrorKind};
use std::path::Path;
use std::sync::Arc;

use mcap::records::{self, MessageHeader, Record, op};
use mcap::{Attachment, Compression, WriteOptions, Writer};
use msgs::ids::Tick;
use thiserror::Error;

use super::records::{Flaw, Frame, Frames};
use super::source::{Source, WINDOW_BYTES};
use super::{End, RecordingError, no_mcap};
use system::input_file;

/// Bytes of a chunk where the input has none or larger ones.
const CHUNK_BYTES: u64 = 4 << 20;

/// What was kept of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Recovered {
    /// Number of messages.
    pub messages: u64,
    /// Number of topics with messages.
    pub topics: usize,
    /// The tick of the latest message; `None` without messages.
    pub tick: Option<Tick>,
    /// Names of the attachments, in order.
    pub attachments: Vec<String>,
    /// Where the input ends.
    pub end: End,
    /// Bytes of the input, and how many of them were read whole.
    pub bytes: u64,
    pub bytes_kept: u64,
}

/// Why a file was not recovered.
#[derive(Debug, Error)]
pub enum RecoverError {
    /// The input cannot be read, or is no MCAP file.
    #[error(transparent)]
    Input(#[from] RecordingError),
    /// Nothing of the input is whole.
    #[error("{file}: {end}, before the end of its first message or attachment; nothing was written")]
    Nothing { file: String, end: End },
    /// There is a file of this name.
    #[error("-o {file}: it exists; nothing was written; choose another name")]
    Exists { file: String },
    /// The output cannot be written.
    #[error("-o {file}: {source}")]
    Write { file: String, source: io::Error },
}

/// Why a pass over the input stops early.
enum Stop {
    /// The rest of the input cannot be used.
    Flaw(Flaw),
    /// The output cannot be written.
    Output(io::Error),
}

impl From<Flaw> for Stop {
    fn from(flaw: Flaw) -> Self {
        Self::Flaw(flaw)
    }
}

/// Writes what is whole of `input` as a finished file at `output`.
///
/// # Errors
/// If the input is no MCAP file or has nothing whole, or the output exists or cannot be written.
/// Then there is no output.
pub fn recover(input: &Path, output: &Path) -> Result<Recovered, RecoverError> {
    let name = input.display().to_string();
    let exists = || RecoverError::Exists { file: output.display().to_string() };
    let write_error = |source: io::Error| match source.kind() {
        ErrorKind::AlreadyExists => exists(),
        _ => RecoverError::Write { file: output.display().to_string(), source },
    };
    let source = input_file::open(input).and_then(|file| Source::of_file(Arc::new(file)));
    let source = source.map_err(|source| RecordingError::Read { file: name.clone(), source })?;
    let mut magic = [0; mcap::MAGIC.len()];
    let read = source.read_at(0, &mut magic);
    let read = read.map_err(|source| RecordingError::Read { file: name.clone(), source })?;
    if magic[..read] != *mcap::MAGIC {
        return Err(no_mcap(&name, "it does not begin as MCAP does").into());
    }
    if output.symlink_metadata().is_ok() {
        return Err(exists());
    }
    let folder = output.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut temporary = tempfile::Builder::new();
    temporary.prefix(".recover.").suffix(".tmp");
    #[cfg(unix)]
    temporary.permissions(new_file_mode());
    let temporary = temporary.tempfile_in(folder).map_err(write_error)?;
    let mut recovery = Recovery::new(&source, temporary.as_file().try_clone().map_err(write_error)?);
    let end = match recovery.run() {
        Ok(end) => end,
        Err(Stop::Flaw(flaw)) => End::of(flaw, source.length()),
        Err(Stop::Output(error)) => return Err(write_error(error)),
    };
    let recovered = recovery.finish(end).map_err(write_error)?;
    if recovered.messages == 0 && recovered.attachments.is_empty() {
        return Err(RecoverError::Nothing { file: name, end: recovered.end });
    }
    temporary.as_file().sync_all().map_err(write_error)?;
    temporary.persist_noclobber(output).map_err(|error| write_error(error.error))?;
    Ok(recovered)
}

/// What a new file has, less the mask of the user.
#[cfg(unix)]
fn new_file_mode() -> std::fs::Permissions {
    use std::os::unix::fs::PermissionsExt as _;
    std::fs::Permissions::from_mode(0o666)
}

/// A pass over a file.
struct Recovery<'a> {
    frames: Frames<'a>,
    output: Output,
    bytes_kept: u64,
}

/// The file that is written, with what is known of it.
struct Output {
    /// `None` until the header was read.
    writer: Option<Writer<BufWriter<File>>>,
    file: Option<File>,
    topics: BTreeMap<u16, String>,
    with_messages: BTreeSet<u16>,
    messages: u64,
    latest_ns: Option<u64>,
    attachments: Vec<String>,
}

impl<'a> Recovery<'a> {
    fn new(source: &'a Source, file: File) -> Self {
        let at = mcap::MAGIC.len() as u64;
        let output = Output {
            writer: None,
            file: Some(file),
            topics: BTreeMap::new(),
            with_messages: BTreeSet::new(),
            messages: 0,
            latest_ns: None,
            attachments: Vec::new(),
        };
        Self { frames: Frames::new(source, at, WINDOW_BYTES), output, bytes_kept: at }
    }

    /// Copies records up to the end of the data.
    fn run(&mut self) -> Result<End, Stop> {
        while let Some(frame) = self.frames.next().transpose()? {
            match frame.kind {
                op::DATA_END => {
                    self.bytes_kept = frame.end();
                    return self.read_summary();
                }
                op::CHUNK => self.copy_chunk(&frame)?,
                op::HEADER | op::SCHEMA | op::CHANNEL | op::MESSAGE | op::ATTACHMENT | op::METADATA => {
                    let content = self.frames.content(&frame)?;
                    self.output.take(frame.kind, content).map_err(|error| stop(&frame, error))?;
                }
                _ => {}
            }
            self.bytes_kept = frame.end();
        }
        Ok(End::Missing)
    }

    fn copy_chunk(&mut self, frame: &Frame) -> Result<(), Stop> {
        let mut records = self.frames.chunk(frame, &mut None)?;
        let mut refused = None;
        let output = &mut self.output;
        let source = self.frames.window.source;
        let read = records.next(source, &mut None, |kind, content| match output.take(kind, content) {
            Ok(()) => Ok(None::<()>),
            Err(error) => {
                refused = Some(error);
                Ok(Some(()))
            }
        });
        if let Some(error) = refused {
            return Err(stop(frame, error));
        }
        if let Some(Err(flaw)) = read {
            return Err(flaw.into());
        }
        output.end_chunk().map_err(|error| stop(frame, error))
    }

    /// Whether the part behind the data is whole as well.
    fn read_summary(&mut self) -> Result<End, Stop> {
        loop {
            let Some(frame) = self.frames.next().transpose()? else { return Ok(End::Missing) };
            if frame.kind == op::FOOTER {
                let (end, length) = (frame.end() + mcap::MAGIC.len() as u64, self.frames.window.source.length());
                self.bytes_kept = end.min(length);
                return Ok(match end.cmp(&length) {
                    Ordering::Equal => End::Whole,
                    Ordering::Greater => End::CutOff { bytes: length },
                    Ordering::Less => {
                        let reason = format!("{} bytes after the end of the recording", length - end);
                        End::Damage { before_byte: length, reason }
                    }
                });
            }
        }
    }

    fn finish(self, end: End) -> io::Result<Recovered> {
        let Self { frames, output, bytes_kept } = self;
        let Output { writer, topics, with_messages, messages, latest_ns, attachments, .. } = output;
        if let Some(mut writer) = writer {
            writer.finish().map_err(output_error)?;
            io::Write::flush(&mut writer.into_inner())?;
        }
        let names: BTreeSet<&String> = with_messages.iter().filter_map(|channel| topics.get(channel)).collect();
        Ok(Recovered {
            messages,
            topics: names.len(),
            tick: latest_ns.map(|time_ns| Tick(time_ns / Tick::TICK_NS)),
            attachments,
            end,
            bytes: frames.window.source.length(),
            bytes_kept,
        })
    }
}

/// An error of the writer: of the output if the system has refused, of the input otherwise.
fn stop(frame: &Frame, error: mcap::McapError) -> Stop {
    match error {
        mcap::McapError::Io(error) => Stop::Output(error),
        error => Stop::Flaw(frame.damage(error.to_string())),
    }
}

fn output_error(error: mcap::McapError) -> io::Error {
    match error {
        mcap::McapError::Io(error) => error,
        error => io::Error::other(error),
    }
}

impl Output {
    /// Writes a record of the input.
    fn take(&mut self, kind: u8, content: &[u8]) -> mcap::McapResult<()> {
        let record = mcap::parse_record(kind, content)?;
        if let Record::Header(header) = &record
            && let Some(file) = self.file.take()
        {
            self.writer = Some(open_writer(header, file)?);
        }
        let Some(writer) = &mut self.writer else { return Ok(()) };
        match record {
            Record::Schema { header, data } => {
                writer.add_schema_with_id(header.id, &header.name, &header.encoding, &data)?;
            }
            Record::Channel(channel) => {
                let records::Channel { id, schema_id, topic, message_encoding, metadata } = channel;
                writer.add_channel_with_id(id, schema_id, &topic, &message_encoding, &metadata)?;
                self.topics.insert(id, topic);
            }
            Record::Message { header, data } => self.message(&header, &data)?,
            Record::Attachment { header, data, .. } => {
                let records::AttachmentHeader { log_time, create_time, name, media_type } = header;
                self.attachments.push(name.clone());
                let data = Cow::Borrowed(&*data);
                writer.attach(&Attachment { log_time, create_time, name, media_type, data })?;
            }
            Record::Metadata(metadata) => writer.write_metadata(&metadata)?,
            _ => {}
        }
        Ok(())
    }

    fn message(&mut self, header: &MessageHeader, data: &[u8]) -> mcap::McapResult<()> {
        let Some(writer) = &mut self.writer else { return Ok(()) };
        writer.write_to_known_channel(header, data)?;
        self.with_messages.insert(header.channel_id);
        self.messages += 1;
        self.latest_ns = self.latest_ns.max(Some(header.log_time));
        Ok(())
    }

    fn end_chunk(&mut self) -> mcap::McapResult<()> {
        self.writer.as_mut().map_or(Ok(()), Writer::flush)
    }
}

/// A writer with the profile and the library of the input.
fn open_writer(header: &records::Header, file: File) -> mcap::McapResult<Writer<BufWriter<File>>> {
    let options = WriteOptions::new().profile(&header.profile).library(&header.library);
    let options = options.compression(Some(Compression::Zstd)).chunk_size(Some(CHUNK_BYTES)).compression_threads(0);
    options.create(BufWriter::new(file))
}

/// The report for the user.
#[must_use]
pub fn text(recovered: &Recovered) -> String {
    let Recovered { messages, topics, tick, attachments, end, bytes, bytes_kept } = recovered;
    let kept = match tick {
        Some(tick) => {
            let sim_s = tick.time_ns() as f64 * 1e-9;
            format!("kept {messages} messages on {topics} topics, up to tick {tick} ({sim_s:.2} s)")
        }
        None => "kept no message".to_owned(),
    };
    let attached = match attachments.as_slice() {
        [] => "there is no attachment".to_owned(),
        names => format!("attachments: {}", names.join(", ")),
    };
    let input = match bytes - bytes_kept {
        0 => format!("the input is {end}"),
        left => format!("the input is {end}; its last {left} of {bytes} bytes were left out"),
    };
    format!("{kept}\n{attached}\n{input}")
}

#[cfg(test)]
mod tests;
