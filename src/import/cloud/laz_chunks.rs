//! Chunks of points that are compressed in layers (LAZ, point formats 6 to 10).
//!
//! A chunk is its first point as it is, the number of its points, the size of each layer, and the layers. The
//! decompressor takes memory for a layer as large as the file says, so chunks are looked at beforehand, and the
//! file ends for it where the first of them does not fit.

use super::las_file::number;
use std::io::{Error, ErrorKind, Read, Result, Seek, SeekFrom};

/// Versions of the items of a point that are compressed in layers.
const LAYERED: std::ops::RangeInclusive<u16> = 3..=4;
/// Kinds of items (LAZ specification 1.4 r1), ...
const POINT14: u16 = 10;
const RGB14: u16 = 11;
const RGB_NIR14: u16 = 12;
const WAVE_PACKET14: u16 = 13;
const BYTE14: u16 = 14;
/// Bytes of the number of points of a chunk, and of the size of a layer.
const NUMBER: u64 = 4;
/// Before the chunks there is the place of the table of them.
const TABLE_PLACE: u64 = 8;

/// The place at which the chunks end, of a file of `size` bytes; `u64::MAX` where points are not compressed in
/// layers.
///
/// # Errors
/// Its header is damaged, or the file cannot be read.
pub(super) fn end_of_chunks(input: &mut (impl Read + Seek), size: u64) -> las::Result<u64> {
    let header = las::Header::new(&mut *input)?;
    let first = input.stream_position()?;
    input.seek(SeekFrom::Start(0))?;
    if !header.point_format().is_compressed {
        return Ok(u64::MAX);
    }
    let mut head = ChunkHead::default();
    for item in header.laz_vlr()?.items() {
        if !LAYERED.contains(&item.version()) {
            return Ok(u64::MAX);
        }
        head.add(u16::from(item.item_type()), u64::from(item.size()));
    }
    if first + TABLE_PLACE + head.length() > size {
        return Err(Error::from(ErrorKind::UnexpectedEof).into());
    }
    let end = head.last_end(input, first + TABLE_PLACE, size)?;
    input.seek(SeekFrom::Start(0))?;
    Ok(end)
}

/// What a chunk begins with.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct ChunkHead {
    /// Bytes of its first point.
    point: u64,
    layers: u64,
}

impl ChunkHead {
    /// Adds an item of a point; `size` is that of extra bytes, which have a layer each.
    fn add(&mut self, kind: u16, size: u64) {
        let (bytes, layers) = match kind {
            POINT14 => (30, 9),
            RGB14 => (6, 1),
            RGB_NIR14 => (8, 2),
            WAVE_PACKET14 => (29, 1),
            BYTE14 => (size, size),
            // The decompressor refuses others.
            _ => (0, 0),
        };
        self.point += bytes;
        self.layers += layers;
    }

    /// Bytes before the layers.
    fn length(self) -> u64 {
        self.point + NUMBER + NUMBER * self.layers
    }

    /// The end of the last of the chunks that begin at `first` and fit into a file of `size` bytes.
    fn last_end(self, input: &mut (impl Read + Seek), first: u64, size: u64) -> Result<u64> {
        let mut end = first;
        let mut sizes = vec![0; (NUMBER * self.layers) as usize];
        while self.layers > 0 && end + self.length() <= size {
            input.seek(SeekFrom::Start(end + self.point + NUMBER))?;
            input.read_exact(&mut sizes)?;
            let sizes = sizes.chunks_exact(NUMBER as usize);
            let next = end + self.length() + sizes.map(number).sum::<u64>();
            if next > size {
                break;
            }
            end = next;
        }
        Ok(end)
    }
}

/// A file whose points are read up to a place. What lies behind is read only after it was sought.
pub(super) struct ChunkedFile<R> {
    input: R,
    at: u64,
    points_end: u64,
    /// Up to where it is read from here.
    until: u64,
}

impl<R> ChunkedFile<R> {
    /// A file that is at its beginning.
    pub(super) fn new(input: R, points_end: u64) -> Self {
        Self {
            input,
            at: 0,
            points_end,
            until: points_end,
        }
    }
}

impl<R: Read> Read for ChunkedFile<R> {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize> {
        let room = usize::try_from(self.until - self.at).unwrap_or(usize::MAX);
        let count = bytes.len().min(room);
        let read = self.input.read(&mut bytes[..count])?;
        self.at += read as u64;
        Ok(read)
    }
}

impl<R: Seek> Seek for ChunkedFile<R> {
    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        self.at = self.input.seek(to)?;
        self.until = match self.at < self.points_end {
            true => self.points_end,
            false => u64::MAX,
        };
        Ok(self.at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    /// A chunk of two layers with these sizes, of points of three bytes.
    fn chunk(sizes: [u32; 2], held: usize) -> Vec<u8> {
        let mut bytes = vec![7; 3];
        bytes.extend(1_u32.to_le_bytes());
        bytes.extend(sizes.iter().flat_map(|s| s.to_le_bytes()));
        bytes.extend(vec![1; held]);
        bytes
    }

    #[test]
    fn chunks_end_where_one_does_not_fit() {
        let head = ChunkHead {
            point: 3,
            layers: 2,
        };
        let first = [chunk([4, 0], 4), chunk([1, 2], 3)].concat();
        for behind in [
            Vec::new(),
            vec![0; 14],
            chunk([u32::MAX, 1], 40),
            chunk([20, 30], 49),
        ] {
            let file = [first.clone(), behind].concat();
            let size = file.len() as u64;
            let end = head
                .last_end(&mut Cursor::new(file), 0, size)
                .expect("read");
            assert_eq!(end, first.len() as u64);
        }
        let size = first.len() as u64 - 1;
        let end = head
            .last_end(&mut Cursor::new(first), 0, size)
            .expect("read");
        assert_eq!(end, 19);
    }

    #[test]
    fn what_lies_behind_the_points_is_read_after_it_was_sought() {
        let mut file = ChunkedFile::new(Cursor::new([1, 2, 3, 4, 5, 6]), 4);
        let mut bytes = [0; 5];
        assert_eq!(file.read(&mut bytes).expect("read"), 4);
        assert_eq!(file.read(&mut bytes).expect("read"), 0);
        file.seek(SeekFrom::Start(4)).expect("sought");
        assert_eq!(file.read(&mut bytes).expect("read"), 2);
        file.seek(SeekFrom::Start(3)).expect("sought");
        assert_eq!(file.read(&mut bytes).expect("read"), 1);
    }
}
