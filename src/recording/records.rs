//! The records of a file, of MCAP or of a bag of ROS 1.

use super::bag::{self, Bag, Connection, Found};
use super::cursor::Cursor;
use super::walk::{Damage, Walk, read_up_to};
use mcap::records::op;
use std::io::{self, Read, Seek, SeekFrom};

/// Bytes of the footer with its head and the mark behind it.
const FOOTER: u64 = 9 + 20 + 8;
/// A summary beyond this is not read; the file can be without.
const MAX_SUMMARY: u64 = 1 << 28;

/// The records of a file.
pub(super) enum Records<R> {
    Mcap(Box<Walk<R>>),
    Bag(Box<Bag<R>>),
}

/// A record as both formats have it.
pub(super) enum Record {
    Message(MessageHead),
    Connection(Connection),
    /// A record of this kind of MCAP that is no message.
    Note(u8),
}

impl<R: Read + Seek> Records<R> {
    pub fn next(&mut self) -> io::Result<Option<Record>> {
        match self {
            Self::Mcap(walk) => {
                let Some(kind) = walk.next()? else {
                    return Ok(None);
                };
                if kind != op::MESSAGE {
                    return Ok(Some(Record::Note(kind)));
                }
                let head = MessageHead::read(&mut Cursor(walk.body()));
                Ok(Some(head.map_or(Record::Note(kind), Record::Message)))
            }
            Self::Bag(bag) => Ok(bag.next()?.map(|found| match found {
                Found::Connection(connection) => Record::Connection(connection),
                Found::Message {
                    connection,
                    time_ns,
                } => Record::Message(MessageHead::of_bag(connection, time_ns)),
            })),
        }
    }

    /// All of a record that is no message.
    pub fn body(&self) -> &[u8] {
        match self {
            Self::Mcap(walk) => walk.body(),
            Self::Bag(bag) => bag.content(),
        }
    }

    /// The content of a message.
    pub fn content(&self) -> &[u8] {
        match self {
            Self::Mcap(walk) => {
                let mut body = Cursor(walk.body());
                MessageHead::read(&mut body).map_or(&[], |_| body.0)
            }
            Self::Bag(bag) => bag.content(),
        }
    }

    pub fn damage(&self) -> Damage {
        match self {
            Self::Mcap(walk) => walk.damage,
            Self::Bag(bag) => bag.damage,
        }
    }
}

/// The head of a message.
pub(super) struct MessageHead {
    pub channel: u16,
    pub number: u32,
    pub log_ns: u64,
    pub publish_ns: u64,
}

impl MessageHead {
    /// Of a message of ROS 1, which has no number.
    fn of_bag(connection: u32, time_ns: u64) -> Self {
        Self {
            // None has the last one.
            channel: u16::try_from(connection).unwrap_or(u16::MAX),
            number: 0,
            log_ns: time_ns,
            publish_ns: time_ns,
        }
    }

    fn read(body: &mut Cursor) -> Option<Self> {
        Some(Self {
            channel: body.u16()?,
            number: body.u32()?,
            log_ns: body.u64()?,
            publish_ns: body.u64()?,
        })
    }
}

/// As many bytes from the beginning of a file as a bag of ROS says what it is with.
pub(super) fn first_bytes(file: &mut (impl Read + Seek)) -> io::Result<Vec<u8>> {
    file.seek(SeekFrom::Start(0))?;
    let mut bytes = vec![0; bag::MAGIC.len()];
    let read = read_up_to(file, &mut bytes)?;
    bytes.truncate(read);
    file.seek(SeekFrom::Start(0))?;
    Ok(bytes)
}

/// The records at the end of a file that was ended properly.
pub(super) fn summary(file: &mut (impl Read + Seek)) -> io::Result<Option<Vec<u8>>> {
    let length = file.seek(SeekFrom::End(0))?;
    let Some(footer_at) = length.checked_sub(FOOTER) else {
        return Ok(None);
    };
    file.seek(SeekFrom::Start(footer_at))?;
    let mut footer = [0; FOOTER as usize];
    let read = read_up_to(file, &mut footer)?;
    let mut cursor = Cursor(&footer[..read]);
    let Some((op::FOOTER, mut body)) = cursor.record().map(|(kind, body)| (kind, Cursor(body)))
    else {
        return Ok(None);
    };
    let start = body.u64().filter(|start| *start > 0 && *start < footer_at);
    let Some(start) =
        start.filter(|start| cursor.0 == mcap::MAGIC && footer_at - start <= MAX_SUMMARY)
    else {
        return Ok(None);
    };
    file.seek(SeekFrom::Start(start))?;
    let mut bytes = vec![0; (footer_at - start) as usize];
    let read = read_up_to(file, &mut bytes)?;
    bytes.truncate(read);
    Ok(Some(bytes))
}
