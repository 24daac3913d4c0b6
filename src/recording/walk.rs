//! From record to record through a file that may be cut short, damaged or hostile: what is whole is
//! given out, what is not is left out and counted. Memory holds one chunk.

use super::cursor::Cursor;
use super::wire::little;
use mcap::records::op;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::io::{self, BufReader, Read, Seek, SeekFrom};

/// No chunk and no record of a recording of pictures is longer.
const MAX_RECORD: u64 = 1 << 29;
/// Kind and length in front of each record.
const HEAD: u64 = 9;
/// Least head of a chunk: times, sizes, checksum, empty name of the compression.
const CHUNK_HEAD: u64 = 40;
/// Bytes looked through at once for the next chunk.
const SCAN: usize = 1 << 18;

/// What was left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Damage {
    /// Damaged stretches with something readable behind them, and their bytes.
    pub parts: u64,
    pub bytes: u64,
    /// Bytes at the end that are no whole chunk; `None` if the file was ended properly.
    pub tail: Option<u64>,
}

/// A way through a file.
pub(super) struct Walk<R> {
    file: BufReader<R>,
    /// Place of the next record outside chunks, and length of the file.
    at: u64,
    length: u64,
    chunk: Option<Chunk>,
    ended: bool,
    /// The record that was found last.
    body: Vec<u8>,
    pub damage: Damage,
}

struct Chunk {
    start: u64,
    content: Content,
}

enum Content {
    /// Not compressed: its records, and how far they have been given out. The crate's reader would
    /// trust their lengths.
    Plain(Vec<u8>, usize),
    /// The crate unpacks it; bytes of it that have not been read from the file.
    Packed(Box<LinearReader>, u64),
}

/// What to do with a record outside chunks.
enum Next {
    Chunk,
    /// The file was ended properly.
    End,
    /// It is given out.
    Record,
    Skipped,
    Damaged,
}

impl Next {
    /// By the record's kind and length; `fits` unless the length cannot be true.
    fn of(kind: u8, length: u64, fits: bool) -> Self {
        match kind {
            op::CHUNK if fits && length >= CHUNK_HEAD => Self::Chunk,
            op::DATA_END if length == 4 => Self::End,
            op::FOOTER if length == 20 => Self::End,
            op::HEADER | op::SCHEMA | op::CHANNEL | op::MESSAGE | op::METADATA
                if fits && length <= MAX_RECORD =>
            {
                Self::Record
            }
            op::MESSAGE_INDEX..=op::SUMMARY_OFFSET | 0x80.. if fits => Self::Skipped,
            _ => Self::Damaged,
        }
    }
}

impl<R: Read + Seek> Walk<R> {
    /// `None` if the file does not begin as a recording does.
    pub fn new(mut file: R) -> io::Result<Option<Self>> {
        let length = file.seek(SeekFrom::End(0))?;
        file.seek(SeekFrom::Start(0))?;
        let mut file = BufReader::with_capacity(1 << 16, file);
        let mut magic = [0; mcap::MAGIC.len()];
        if length < magic.len() as u64 {
            return Ok(None);
        }
        file.read_exact(&mut magic)?;
        let at = magic.len() as u64;
        let walk = Self {
            file,
            at,
            length,
            chunk: None,
            ended: false,
            body: Vec::new(),
            damage: Damage::default(),
        };
        Ok((magic == mcap::MAGIC).then_some(walk))
    }

    /// Kind of the next record that is whole, within a chunk or outside; `None` at the end. See
    /// [`Walk::body`].
    ///
    /// # Errors
    /// The file itself cannot be read.
    pub fn next(&mut self) -> io::Result<Option<u8>> {
        while !self.ended {
            let found = if self.chunk.is_some() {
                self.in_chunk()?
            } else {
                self.outside()?
            };
            if found.is_some() {
                return Ok(found);
            }
        }
        Ok(None)
    }

    /// Content of the record that [`Walk::next`] found.
    pub fn body(&self) -> &[u8] {
        &self.body
    }

    fn in_chunk(&mut self) -> io::Result<Option<u8>> {
        let Some(chunk) = &mut self.chunk else {
            return Ok(None);
        };
        let (reader, left) = match &mut chunk.content {
            Content::Packed(reader, left) => (reader, left),
            Content::Plain(bytes, given) => {
                let mut rest = Cursor(bytes.get(*given..).unwrap_or_default());
                if rest.0.is_empty() {
                    self.chunk = None;
                    return Ok(None);
                }
                let record = rest.record();
                let Some((kind, body)) = record else {
                    let start = chunk.start;
                    self.chunk = None;
                    self.find_chunk(start)?;
                    return Ok(None);
                };
                self.body.clear();
                self.body.extend_from_slice(body);
                *given += HEAD as usize + body.len();
                return Ok(Some(kind));
            }
        };
        match reader.next_event() {
            Some(Ok(LinearReadEvent::Record { opcode, data })) => {
                self.body.clear();
                self.body.extend_from_slice(data);
                return Ok(Some(opcode));
            }
            Some(Ok(LinearReadEvent::ReadRequest(wanted))) => {
                let count = (*left).min(wanted as u64);
                let read = read_up_to(&mut self.file, reader.insert(count as usize))?;
                // Nothing left means the end to the reader, which then says whether the chunk was
                // whole.
                reader.notify_read(read);
                *left = if read as u64 == count {
                    *left - count
                } else {
                    0
                };
            }
            Some(Err(_)) => {
                let start = chunk.start;
                self.chunk = None;
                self.find_chunk(start)?;
            }
            None => {
                self.chunk = None;
                self.file.seek(SeekFrom::Start(self.at))?;
            }
        }
        Ok(None)
    }

    /// Takes the next record outside chunks; its kind, if it is one that is given out.
    fn outside(&mut self) -> io::Result<Option<u8>> {
        let mut head = [0; HEAD as usize];
        let start = self.at;
        if read_up_to(&mut self.file, &mut head)? < head.len() {
            self.damage.tail = Some(self.length.saturating_sub(start));
            self.ended = true;
            return Ok(None);
        }
        let (kind, length) = (head[0], little(&head[1..]));
        let fits = length <= self.length.saturating_sub(start + HEAD);
        // A chunk has a checksum; of all else, a length that lies could lead past whole chunks.
        let fits = fits && (kind == op::CHUNK || self.leads_to_a_record(length)?);
        match Next::of(kind, length, fits) {
            Next::Chunk => self.open_chunk(start, &head, length)?,
            Next::End => self.ended = true,
            Next::Record => {
                self.body.resize(length as usize, 0);
                self.file.read_exact(&mut self.body)?;
                self.at = start + HEAD + length;
                return Ok(Some(kind));
            }
            Next::Skipped => {
                self.at = start + HEAD + length;
                self.file.seek_relative(length as i64)?;
            }
            Next::Damaged => self.find_chunk(start)?,
        }
        Ok(None)
    }

    /// Begins the chunk of this length whose head has just been read.
    fn open_chunk(&mut self, start: u64, head: &[u8], length: u64) -> io::Result<()> {
        self.at = start + HEAD + length;
        let mut fields = [0; CHUNK_HEAD as usize];
        self.file.read_exact(&mut fields)?;
        let mut cursor = Cursor(&fields[2 * 8..]);
        let (size, checksum, name) = (cursor.u64(), cursor.u32(), cursor.u32());
        if name == Some(0) {
            let (packed, records) = (cursor.u64(), length - CHUNK_HEAD);
            if packed != Some(records) || size != packed || records > MAX_RECORD {
                return self.find_chunk(start);
            }
            let mut bytes = vec![0; records as usize];
            self.file.read_exact(&mut bytes)?;
            if checksum.is_some_and(|saved| saved != 0 && saved != crc32fast::hash(&bytes)) {
                return self.find_chunk(start);
            }
            self.chunk = Some(Chunk {
                start,
                content: Content::Plain(bytes, 0),
            });
            return Ok(());
        }
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(MAX_RECORD as usize);
        let mut reader = LinearReader::new_with_options(options);
        for part in [head, &fields] {
            reader.insert(part.len()).copy_from_slice(part);
            reader.notify_read(part.len());
        }
        self.chunk = Some(Chunk {
            start,
            content: Content::Packed(Box::new(reader), length - CHUNK_HEAD),
        });
        Ok(())
    }

    /// Whether there is the head of a record, or the end, `length` bytes from here.
    fn leads_to_a_record(&mut self, length: u64) -> io::Result<bool> {
        let mut head = [0; HEAD as usize];
        self.file.seek_relative(length as i64)?;
        let read = read_up_to(&mut self.file, &mut head)?;
        self.file.seek_relative(-((length + read as u64) as i64))?;
        let (kind, length) = (head[0], little(&head[1..]));
        // A chunk that was not closed has the greatest length of all.
        let known = (op::HEADER..=op::DATA_END).contains(&kind) || kind >= 0x80;
        Ok(read < head.len()
            || known && (length <= MAX_RECORD || (kind == op::CHUNK && length == !0)))
    }

    /// Goes to the next chunk behind `from` whose head makes sense; all before it is damaged.
    fn find_chunk(&mut self, from: u64) -> io::Result<()> {
        let mut window = vec![0; SCAN];
        let head_bytes = (HEAD + CHUNK_HEAD) as usize;
        let mut at = from + 1;
        while at + head_bytes as u64 <= self.length {
            self.file.seek(SeekFrom::Start(at))?;
            let read = read_up_to(&mut self.file, &mut window)?;
            if read < head_bytes {
                break;
            }
            let found = (0..=read - head_bytes).find(|&i| {
                let room = self.length - (at + i as u64);
                window[i] == op::CHUNK && is_chunk(&window[i + 1..], room)
            });
            if let Some(found) = found {
                self.at = at + found as u64;
                self.file.seek(SeekFrom::Start(self.at))?;
                self.damage.parts += 1;
                self.damage.bytes += self.at - from;
                return Ok(());
            }
            at += (read - head_bytes + 1) as u64;
        }
        self.damage.tail = Some(self.length - from);
        self.ended = true;
        Ok(())
    }
}

/// Whether these bytes, behind the kind, are the head of a chunk that ends within `room` bytes of
/// its beginning.
fn is_chunk(bytes: &[u8], room: u64) -> bool {
    let mut cursor = Cursor(bytes);
    let (Some(length), Some(start), Some(end), Some(uncompressed)) =
        (cursor.u64(), cursor.u64(), cursor.u64(), cursor.u64())
    else {
        return false;
    };
    if length < CHUNK_HEAD
        || length > room.saturating_sub(HEAD)
        || start > end
        || uncompressed > MAX_RECORD
    {
        return false;
    }
    let checksum = cursor.u32();
    let (Some(compression), Some(compressed)) = (cursor.text(), cursor.u64()) else {
        return false;
    };
    let known = matches!(compression, "" | "lz4" | "zstd");
    let whole = (CHUNK_HEAD + compression.len() as u64).checked_add(compressed) == Some(length);
    checksum.is_some_and(|c| c != 0)
        && known
        && whole
        && (!compression.is_empty() || compressed == uncompressed)
}

/// As many bytes as there are, which is fewer than asked for only at the end of the file.
pub(super) fn read_up_to(file: &mut impl Read, into: &mut [u8]) -> io::Result<usize> {
    let mut done = 0;
    while done < into.len() {
        match file.read(&mut into[done..]) {
            Ok(0) => break,
            Ok(n) => done += n,
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
    Ok(done)
}
