//! LAS and LAZ.

use super::las_units::{Said, units_of};
use super::laz_chunks::{ChunkedFile, end_of_chunks};
use super::{Points, refuse_many};
use crate::caught::caught;
use crate::import::error::ImportError;
use las::Reader;
use std::io::{BufRead, Read, Seek, SeekFrom};

/// Every file begins with this.
const BEGIN: &[u8] = b"LASF";
/// A byte holds no more compressed points than that: equal points take an eighth of a bit each.
const MOST_POINTS_OF_BYTE: u64 = 64;
/// Points that are read at a time, and their bytes: a header may say that each point has 65,535.
const PIECE: u64 = 65_536;
const PIECE_BYTES: u64 = 1 << 22;
/// Where the header of LAS 1.4 has the place of its first extended record, how long the head of such
/// a record is, and where in it its length is.
const EVLR_AT: usize = 235;
const HEADER_1_4: usize = 375;
const EVLR_HEAD: u64 = 60;
const EVLR_LENGTH_AT: u64 = 20;

/// Where a header has the place of the points, their format, and the bytes of each, and the bits of the format
/// which say that they are compressed.
const POINTS_AT: usize = 96;
const FORMAT_AT: usize = 104;
const RECORD_AT: usize = 105;
/// Where the header of LAS 1.3 has the place of wave forms, which may stand behind the points.
const WAVES_AT: usize = 227;
const COMPRESSED: u8 = 0b1100_0000;
/// Bytes of a chunk of compressed points at least: the first of them is not compressed.
const LEAST_CHUNK: u64 = 20;

/// Reads all points. What the header says of their extent is not looked at: it is often wrong.
///
/// # Errors
/// It is damaged or cut off, or has too many points.
pub(super) fn read<R>(mut input: R, points: &mut Points) -> Result<(), ImportError>
where
    R: BufRead + Seek + Send + Sync + 'static,
{
    check_begin(&mut input)?;
    let lengths = check_lengths(&mut input).map_err(|e| ImportError::unreadable(&e))?;
    // The decompressor panics on some damaged files.
    let read = caught(move || {
        let mut own = Points {
            units: points.units,
            unit_is_given: points.unit_is_given,
            read: Default::default(),
        };
        let done = read_points(input, lengths, &mut own);
        points.read = own.read;
        done
    });
    read.unwrap_or_else(|| Err(ImportError::bad_format("its compressed points are damaged")))
}

/// Refuses what is something else. What is shorter is cut off, which is found later.
fn check_begin(input: &mut (impl Read + Seek)) -> Result<(), ImportError> {
    let mut begin = Vec::new();
    let read = input.take(BEGIN.len() as u64).read_to_end(&mut begin);
    read.map_err(|e| ImportError::unreadable(&e))?;
    if begin.len() == BEGIN.len() && begin != BEGIN {
        return Err(ImportError::bad_format("it does not begin as LAS does"));
    }
    Ok(())
}

/// How long a file is.
#[derive(Clone, Copy, Debug)]
struct Lengths {
    /// All of it, bytes.
    size: u64,
    /// Points that are not compressed for which there is room.
    records: u64,
    /// Chunks of points that are compressed.
    chunks: u64,
}

impl Lengths {
    /// Points for which a file has room at least, be it that `said` are in it.
    fn room(self, header: &las::Header, said: u64) -> u64 {
        if !header.point_format().is_compressed {
            return self.records;
        }
        match (header.laz_vlr(), self.chunks.checked_sub(1)) {
            // The last chunk holds one at least.
            (Ok(laz), Some(full)) if !laz.uses_variable_size_chunks() => {
                u64::from(laz.chunk_size()).saturating_mul(full) + 1
            }
            _ => said,
        }
    }
}

/// What is read at once, be it as long as it says, is not longer than the file.
fn check_lengths(input: &mut (impl Read + Seek)) -> std::io::Result<Lengths> {
    let end = input.seek(SeekFrom::End(0))?;
    input.seek(SeekFrom::Start(0))?;
    let mut header = Vec::new();
    input.take(HEADER_1_4 as u64).read_to_end(&mut header)?;
    check_extended_records(input, &header, end)?;
    let chunks = check_chunks(input, &header, end)?;
    input.seek(SeekFrom::Start(0))?;
    Ok(Lengths {
        size: end,
        records: room_for_records(&header, end),
        chunks,
    })
}

/// How many points that are not compressed stand between the place of the first and what follows in the file.
fn room_for_records(header: &[u8], end: u64) -> u64 {
    if header.len() < RECORD_AT + 2 {
        return 0;
    }
    let start = number(&header[POINTS_AT..POINTS_AT + 4]);
    let behind = [WAVES_AT, EVLR_AT]
        .into_iter()
        .zip([3, 4])
        .filter(|(at, minor)| header.len() >= at + 8 && header[25] >= *minor)
        .map(|(at, _)| number(&header[at..at + 8]));
    let end = behind.filter(|place| *place > start).fold(end, u64::min);
    let record = number(&header[RECORD_AT..RECORD_AT + 2]);
    end.saturating_sub(start) / record.max(1)
}

/// Memory for the table of chunks is taken for as many as it says to have, which are returned.
fn check_chunks(input: &mut (impl Read + Seek), header: &[u8], end: u64) -> std::io::Result<u64> {
    let is_compressed = header.get(FORMAT_AT).is_some_and(|f| f & COMPRESSED != 0);
    if !is_compressed {
        return Ok(0);
    }
    let start = number(&header[POINTS_AT..POINTS_AT + 4]);
    let mut table = number_at(input, start)?;
    if table as i64 <= start as i64 {
        // Who wrote it could not go back, and put the place at the end.
        table = number_at(input, end.saturating_sub(8))?;
    }
    let chunks = number_at(input, table)? >> 32;
    if chunks > end / LEAST_CHUNK {
        return Err(std::io::ErrorKind::UnexpectedEof.into());
    }
    Ok(chunks)
}

/// The eight bytes at a place.
fn number_at(input: &mut (impl Read + Seek), place: u64) -> std::io::Result<u64> {
    let mut bytes = [0; 8];
    input.seek(SeekFrom::Start(place))?;
    input.read_exact(&mut bytes)?;
    Ok(number(&bytes))
}

fn check_extended_records(
    input: &mut (impl Read + Seek),
    header: &[u8],
    end: u64,
) -> std::io::Result<()> {
    let is_1_4 = header.len() == HEADER_1_4 && (header[24], header[25]) >= (1, 4);
    if is_1_4 && number(&header[EVLR_AT + 8..EVLR_AT + 12]) > 0 {
        let start = number(&header[EVLR_AT..EVLR_AT + 8]);
        let length = number_at(input, start.min(end).saturating_add(EVLR_LENGTH_AT))?;
        if start.saturating_add(EVLR_HEAD).saturating_add(length) > end {
            return Err(std::io::ErrorKind::UnexpectedEof.into());
        }
    }
    Ok(())
}

/// The number in bytes, the lowest first.
pub(super) fn number(bytes: &[u8]) -> u64 {
    bytes
        .iter()
        .rev()
        .fold(0, |sum, byte| (sum << 8) | u64::from(*byte))
}

fn read_points<R>(mut input: R, lengths: Lengths, points: &mut Points) -> Result<(), ImportError>
where
    R: BufRead + Seek + Send + Sync + 'static,
{
    let size = lengths.size;
    let points_end = end_of_chunks(&mut input, size).map_err(damaged)?;
    let mut reader = Reader::new(ChunkedFile::new(input, points_end)).map_err(damaged)?;
    let said = reader.header().number_of_points();
    refuse_many(said)?;
    let steps = reader.header().transforms();
    if [steps.x, steps.y, steps.z]
        .iter()
        .any(|step| step.scale == 0.0)
    {
        return Err(ImportError::bad_format("the scale of its coordinates is 0"));
    }
    // The decompressor goes on behind the end of the file.
    if said > MOST_POINTS_OF_BYTE * size {
        return Err(ImportError::bad_format(format!(
            "its header says {said} points, and the file has {size} bytes"
        )));
    }
    points.said_too_few(said, lengths.room(reader.header(), said));
    let records = reader.header().all_vlrs();
    if !points.unit_is_given {
        for record in records {
            match units_of(record.record_id, &record.data)? {
                Said::Units(units) => {
                    points.take_units(units);
                    break;
                }
                Said::UnknownSystem(code) => points.read.unknown_system = Some(code),
                Said::Nothing => {}
            }
        }
    }
    let of_point = u64::from(reader.header().point_format().len()).max(1);
    let most = PIECE.min(PIECE_BYTES / of_point);
    let mut read = 0;
    while read < said {
        let piece = reader.read_points(most.min(said - read)).map_err(damaged)?;
        if piece.is_empty() {
            break;
        }
        for ((x, y), z) in piece.x().zip(piece.y()).zip(piece.z()) {
            points.push(x, y, z)?;
        }
        read += piece.len() as u64;
    }
    if read < said {
        return Err(ImportError::bad_format(format!(
            "its header says {said} points, and it holds {read}"
        )));
    }
    Ok(())
}

fn damaged(e: las::Error) -> ImportError {
    match &e {
        las::Error::Io(io) => ImportError::unreadable(io),
        _ => ImportError::bad_format(e),
    }
}
