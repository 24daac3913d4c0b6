//! From record to record through a bag of ROS 1 (format 2.0), as RealSense cameras record it, too. It
//! may be cut short, damaged or hostile: what is whole is given out. Memory holds one chunk.

use super::cursor::Cursor;
use super::walk::{Damage, read_up_to};
use std::io::{self, BufReader, Read, Seek, SeekFrom};

/// First line of a file of this format.
pub(super) const MAGIC: &[u8] = b"#ROSBAG V2.0\n";
/// First letters of a file of any version.
pub(super) const ANY_MAGIC: &[u8] = b"#ROSBAG V";
/// No chunk and no record of a recording of pictures is longer.
const MAX_RECORD: u64 = 1 << 29;
/// No head of a record is longer; they hold names and numbers.
const MAX_HEAD: u32 = 1 << 20;
/// So many records of the index are looked at: hours of film in small chunks.
const MAX_INDEX: usize = 1 << 20;

/// Kinds of records.
mod op {
    pub const MESSAGE: u8 = 0x02;
    pub const BAG: u8 = 0x03;
    pub const CHUNK: u8 = 0x05;
    pub const CHUNK_INFO: u8 = 0x06;
    pub const CONNECTION: u8 = 0x07;
}

/// A series of messages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Connection {
    pub id: u32,
    pub topic: String,
    /// What its messages are, e.g. `sensor_msgs/Image`.
    pub kind: String,
}

/// A record that says something.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Found {
    Connection(Connection),
    /// Its content is in [`Bag::content`].
    Message {
        connection: u32,
        time_ns: u64,
    },
}

/// What the index at the end of a file says.
#[derive(Clone, Debug, Default)]
pub(super) struct Index {
    pub connections: Vec<Connection>,
    /// Messages by connection.
    pub counts: Vec<Count>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Count {
    pub connection: u32,
    pub messages: u64,
}

/// A way through a file.
pub(super) struct Bag<R> {
    file: BufReader<R>,
    /// Place of the next record outside chunks, and length of the file.
    at: u64,
    length: u64,
    /// What a chunk holds, and how far it has been given out.
    chunk: Vec<u8>,
    given: usize,
    content: Vec<u8>,
    ended: bool,
    pub damage: Damage,
}

impl<R: Read + Seek> Bag<R> {
    /// A way through a file that begins with [`MAGIC`].
    pub fn new(mut file: R) -> io::Result<Self> {
        let length = file.seek(SeekFrom::End(0))?;
        let at = MAGIC.len() as u64;
        file.seek(SeekFrom::Start(at))?;
        Ok(Self {
            file: BufReader::with_capacity(1 << 16, file),
            at,
            length,
            chunk: Vec::new(),
            given: 0,
            content: Vec::new(),
            ended: false,
            damage: Damage::default(),
        })
    }

    /// What the index says, where the file was ended properly; the next record is the first again.
    pub fn index(&mut self) -> io::Result<Index> {
        let mut index = Index::default();
        let start = match self.record()? {
            Some(record) if record.kind() == Some(op::BAG) => record.number("index_pos"),
            _ => None,
        };
        if let Some(start) = start.filter(|start| (1..self.length).contains(start)) {
            self.at = start;
            self.file.seek(SeekFrom::Start(start))?;
            for _ in 0..MAX_INDEX {
                let Some(record) = self.record()? else { break };
                index.add(&record);
            }
        }
        self.at = MAGIC.len() as u64;
        self.file.seek(SeekFrom::Start(self.at))?;
        (self.ended, self.damage) = (false, Damage::default());
        Ok(index)
    }

    /// The next record that says something; `None` at the end.
    ///
    /// # Errors
    /// The file itself cannot be read.
    pub fn next(&mut self) -> io::Result<Option<Found>> {
        loop {
            if self.given < self.chunk.len() {
                if let Some(found) = self.in_chunk() {
                    return Ok(Some(found));
                }
                continue;
            }
            let Some(record) = self.record()? else {
                return Ok(None);
            };
            if record.kind() == Some(op::CHUNK) {
                self.open_chunk(&record);
            } else if let Some(found) = record.found() {
                self.content = record.data;
                return Ok(Some(found));
            }
        }
    }

    /// Content of the message that [`Bag::next`] found.
    pub fn content(&self) -> &[u8] {
        &self.content
    }

    fn in_chunk(&mut self) -> Option<Found> {
        let mut rest = Cursor(&self.chunk[self.given..]);
        let (Some(head), Some(data)) = (rest.counted(), rest.counted()) else {
            self.damage.parts += 1;
            self.damage.bytes += (self.chunk.len() - self.given) as u64;
            self.given = self.chunk.len();
            return None;
        };
        self.given = self.chunk.len() - rest.0.len();
        let found = found(head, data)?;
        self.content.clear();
        self.content.extend_from_slice(data);
        Some(found)
    }

    /// Unpacks a chunk; one that is damaged is left out.
    fn open_chunk(&mut self, record: &Record) {
        self.given = 0;
        self.chunk.clear();
        let unpacked = record.unpacked();
        match unpacked {
            Some(chunk) => self.chunk = chunk,
            None => {
                self.damage.parts += 1;
                self.damage.bytes += record.data.len() as u64;
            }
        }
    }

    /// The next record outside chunks; `None` where there is no whole one.
    fn record(&mut self) -> io::Result<Option<Record>> {
        if self.ended || self.at >= self.length {
            self.ended = true;
            return Ok(None);
        }
        let start = self.at;
        let head = self.counted(u64::from(MAX_HEAD))?;
        let data = match head {
            Some(_) => self.counted(MAX_RECORD)?,
            None => None,
        };
        if let Some((head, data)) = head.zip(data) {
            return Ok(Some(Record { head, data }));
        }
        self.ended = true;
        self.damage.tail = Some(self.length - start);
        Ok(None)
    }

    /// Bytes with their count in front, no more than `most`; `None` where the file has fewer.
    fn counted(&mut self, most: u64) -> io::Result<Option<Vec<u8>>> {
        let mut count = [0; 4];
        if read_up_to(&mut self.file, &mut count)? < count.len() {
            return Ok(None);
        }
        let count = u64::from(u32::from_le_bytes(count));
        self.at += 4;
        if count > most || count > self.length.saturating_sub(self.at) {
            return Ok(None);
        }
        let mut bytes = vec![0; count as usize];
        if read_up_to(&mut self.file, &mut bytes)? < bytes.len() {
            return Ok(None);
        }
        self.at += count;
        Ok(Some(bytes))
    }
}

impl Index {
    fn add(&mut self, record: &Record) {
        if let Some(Found::Connection(connection)) = record.found() {
            self.connections.push(connection);
        }
        if record.kind() == Some(op::CHUNK_INFO) {
            let mut data = Cursor(&record.data);
            while let (Some(connection), Some(count)) = (data.u32(), data.u32()) {
                let messages = u64::from(count);
                self.counts.push(Count {
                    connection,
                    messages,
                });
            }
        }
    }
}

/// A record outside chunks.
struct Record {
    head: Vec<u8>,
    data: Vec<u8>,
}

impl Record {
    fn kind(&self) -> Option<u8> {
        field(&self.head, "op")?.first().copied()
    }

    fn number(&self, name: &str) -> Option<u64> {
        number(&self.head, name)
    }

    fn found(&self) -> Option<Found> {
        found(&self.head, &self.data)
    }

    /// What a chunk holds; `None` where it is damaged or packed in a way that is not known.
    fn unpacked(&self) -> Option<Vec<u8>> {
        let size = self.number("size").filter(|size| *size <= MAX_RECORD)?;
        let packed = self.data.as_slice();
        let mut bytes = Vec::new();
        // No more than is said: a small file could unpack to a very long one.
        match field(&self.head, "compression")? {
            b"none" => bytes.extend_from_slice(packed),
            b"lz4" => {
                let unpacking = lz4::Decoder::new(packed).ok()?;
                unpacking.take(size).read_to_end(&mut bytes).ok()?;
            }
            b"bz2" => {
                let unpacking = bzip2::read::BzDecoder::new(packed);
                unpacking.take(size).read_to_end(&mut bytes).ok()?;
            }
            _ => return None,
        }
        (bytes.len() as u64 == size).then_some(bytes)
    }
}

/// The value of a field in the head of a record.
fn field<'a>(head: &'a [u8], name: &str) -> Option<&'a [u8]> {
    let mut fields = Cursor(head);
    while let Some(field) = fields.counted() {
        let value = field
            .strip_prefix(name.as_bytes())
            .and_then(|field| field.strip_prefix(b"="));
        if value.is_some() {
            return value;
        }
    }
    None
}

fn text(head: &[u8], name: &str) -> Option<String> {
    let value = field(head, name)?;
    Some(std::str::from_utf8(value).ok()?.to_owned())
}

/// A number of four or eight bytes.
fn number(head: &[u8], name: &str) -> Option<u64> {
    let value = field(head, name)?;
    matches!(value.len(), 4 | 8).then(|| super::wire::little(value))
}

/// The connection that a record belongs to.
fn connection_id(head: &[u8]) -> Option<u32> {
    u32::try_from(number(head, "conn")?).ok()
}

/// What a record says; `None` where that is nothing for us.
fn found(head: &[u8], data: &[u8]) -> Option<Found> {
    match field(head, "op")? {
        [op::MESSAGE] => {
            let mut time = Cursor(field(head, "time")?);
            let (seconds, nanos) = (time.u32()?, time.u32()?);
            Some(Found::Message {
                connection: connection_id(head)?,
                time_ns: u64::from(seconds) * 1_000_000_000 + u64::from(nanos),
            })
        }
        // The data is a second head.
        [op::CONNECTION] => Some(Found::Connection(Connection {
            id: connection_id(head)?,
            topic: text(head, "topic")?,
            kind: text(data, "type")?,
        })),
        _ => None,
    }
}
