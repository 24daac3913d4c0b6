//! One file: chunks that are closed and handed to the system one by one, and a proper end even on a
//! full disk.

use super::disk::{self, Disk, Room};
use super::error::RecordingError;
use super::schema::{ABOUT, SEQUENCE, Topic};
use mcap::records::MessageHeader;
use std::collections::BTreeMap;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// A chunk is closed when it has grown to this, whatever the time: a reader holds one in memory.
const CHUNK_BYTES: u64 = 4 << 20;
/// Bytes of small writes that are gathered; a frame goes past it.
const BUFFER: usize = 1 << 16;
/// Room kept for the end of the file: schemas and channels once more, and what each chunk adds to
/// the summary.
const END_BYTES: u64 = 64 << 10;
const END_BYTES_PER_CHUNK: u64 = 256;
/// What the format adds to a message at most, in the chunk and in its index.
const MESSAGE_BYTES: u64 = 64;

/// When a message is from, ns.
#[derive(Clone, Copy, Debug)]
pub(super) struct Times {
    /// Since 1970.
    pub log: u64,
    /// By the sensor's clock, shifted where that is negative.
    pub publish: u64,
}

/// A file that is being written.
pub(super) struct Writer {
    path: PathBuf,
    /// `None` when it is closed.
    mcap: Option<mcap::Writer<BufWriter<Disk>>>,
    room: Room,
    channels: BTreeMap<Topic, u16>,
    chunks: u64,
    /// Bytes and messages in the chunk that is open.
    open_bytes: u64,
    open_messages: u64,
    /// End of the last whole chunk.
    whole: u64,
}

impl Writer {
    /// Makes the file; there must be none of that name.
    pub fn create(path: &Path) -> Result<Self, RecordingError> {
        let (disk, room) = disk::create(path).map_err(|e| RecordingError::of_place(path, e))?;
        // An empty file is no recording, and would be in the way of the next try.
        Self::begin(path, disk, room).inspect_err(|_| drop(std::fs::remove_file(path)))
    }

    fn begin(path: &Path, disk: Disk, mut room: Room) -> Result<Self, RecordingError> {
        room.reserve(END_BYTES)
            .map_err(|e| RecordingError::of_place(path, e))?;
        let options = mcap::WriteOptions::new()
            .compression(None)
            // Each chunk has a checksum of its own; one over the whole file would be computed over
            // every byte again.
            .calculate_data_section_crc(false)
            // Chunks are closed by time and size here.
            .chunk_size(None)
            .library(concat!("arborcam ", env!("CARGO_PKG_VERSION")));
        let buffered = BufWriter::with_capacity(BUFFER, disk);
        let mcap = options
            .create(buffered)
            .map_err(|e| RecordingError::of_write(path, &e))?;
        let (channels, path) = (BTreeMap::new(), path.to_owned());
        let (chunks, open_bytes, open_messages, whole) = (0, 0, 0, 0);
        let mut writer = Self {
            path,
            mcap: Some(mcap),
            room,
            channels,
            chunks,
            open_bytes,
            open_messages,
            whole,
        };
        // From the first moment on it is a recording, if an empty one.
        writer.flush()?;
        Ok(writer)
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Bytes of the file so far, what waits in the open chunk included.
    pub fn bytes(&self) -> u64 {
        self.room.end().max(self.whole + self.open_bytes)
    }

    /// Bytes that would be lost now if the program were killed.
    pub fn unflushed(&self) -> u64 {
        self.open_bytes
    }

    /// Writes the record that says what this recording is.
    pub fn about(&mut self, entries: BTreeMap<String, String>) -> Result<(), RecordingError> {
        let record = mcap::records::Metadata {
            name: ABOUT.into(),
            metadata: entries,
        };
        self.with(|mcap| mcap.write_metadata(&record))?;
        self.flush()
    }

    /// Appends a message.
    ///
    /// # Errors
    /// The disk is full or broken. The file is closed then, and readable up to here.
    pub fn message(
        &mut self,
        topic: Topic,
        sequence: u32,
        times: Times,
        data: &[u8],
    ) -> Result<(), RecordingError> {
        let channel_id = self.channel(topic)?;
        let bytes = data.len() as u64 + MESSAGE_BYTES;
        let end = END_BYTES
            + END_BYTES_PER_CHUNK * (self.chunks + 1)
            + MESSAGE_BYTES * (self.open_messages + 1);
        let upto = self.bytes() + bytes + BUFFER as u64 + end;
        if let Err(e) = self.room.reserve(upto) {
            // There is room kept for this.
            self.close()?;
            return Err(RecordingError::of_place(&self.path, e));
        }
        let header = MessageHeader {
            channel_id,
            sequence,
            log_time: times.log,
            publish_time: times.publish,
        };
        self.with(|mcap| mcap.write_to_known_channel(&header, data))?;
        self.open_bytes += bytes;
        self.open_messages += 1;
        if self.open_bytes >= CHUNK_BYTES {
            self.flush()
        } else {
            Ok(())
        }
    }

    fn channel(&mut self, topic: Topic) -> Result<u16, RecordingError> {
        if let Some(id) = self.channels.get(&topic) {
            return Ok(*id);
        }
        let channel = topic.channel();
        let metadata: BTreeMap<String, String> = topic
            .sequence()
            .map(|counted| (SEQUENCE.to_owned(), counted.to_owned()))
            .into_iter()
            .collect();
        let id = self.with(|mcap| {
            let schema =
                mcap.add_schema(channel.schema, channel.schema_encoding, channel.definition)?;
            mcap.add_channel(schema, channel.topic, channel.message_encoding, &metadata)
        })?;
        self.channels.insert(topic, id);
        self.open_bytes += channel.definition.len() as u64 + 2 * MESSAGE_BYTES;
        Ok(id)
    }

    /// Closes the chunk and hands it to the system: from here on it survives the program.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        self.with(|mcap| mcap.flush())?;
        self.chunks += 1;
        (self.open_bytes, self.open_messages) = (0, 0);
        self.whole = self.room.end();
        Ok(())
    }

    /// Writes the summary and ends the file. Doing it twice does nothing.
    pub fn close(&mut self) -> Result<(), RecordingError> {
        if self.mcap.is_none() {
            return Ok(());
        }
        self.with(|mcap| {
            mcap.finish()?;
            Ok(())
        })?;
        let Some(mcap) = self.mcap.take() else {
            return Ok(());
        };
        let flushed = mcap.into_inner().into_inner().map(drop);
        if let Err(e) = flushed {
            let _ = self.room.cut(self.whole);
            return Err(RecordingError::of_write(
                &self.path,
                &mcap::McapError::Io(e.into_error()),
            ));
        }
        // A file whose spare room cannot be given back is whole all the same.
        let _ = self.room.cut(self.room.end());
        self.whole = self.room.end();
        self.open_bytes = 0;
        Ok(())
    }

    /// Does it; where that fails the file is cut back to its last whole chunk and given up.
    fn with<T>(
        &mut self,
        act: impl FnOnce(&mut mcap::Writer<BufWriter<Disk>>) -> mcap::McapResult<T>,
    ) -> Result<T, RecordingError> {
        let Some(mcap) = &mut self.mcap else {
            return Err(RecordingError::Disk {
                path: self.path.clone(),
                what: "it is closed".into(),
            });
        };
        act(mcap).map_err(|e| {
            if let Some(broken) = self.mcap.take() {
                // Without what it still holds: that would be written behind the cut.
                let _ = broken.into_inner().into_parts();
            }
            let _ = self.room.cut(self.whole);
            RecordingError::of_write(&self.path, &e)
        })
    }
}
