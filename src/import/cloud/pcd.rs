//! PCD, the format of the Point Cloud Library.

use super::{Points, lzf, refuse_many};
use crate::import::error::ImportError;
use std::io::{BufRead, Read};

/// Longest line of the header, and most lines, bytes.
const LONGEST_LINE: u64 = 4096;
const MOST_LINES: usize = 64;
/// Most bytes of one point.
const LARGEST_ROW: usize = 4096;

/// A field of a point.
#[derive(Clone, Debug, Default)]
struct Field {
    name: String,
    /// Bytes of a number.
    size: usize,
    /// `F`, `I` or `U`.
    kind: u8,
    /// Numbers of it.
    count: usize,
}

/// What the header says.
#[derive(Clone, Debug, Default)]
struct Header {
    fields: Vec<Field>,
    points: u64,
    width: Option<u64>,
    height: Option<u64>,
    data: String,
}

/// Reads x, y and z of all points.
///
/// # Errors
/// It is no PCD, has no x, y and z, or is cut off.
pub(super) fn read(mut input: impl BufRead, points: &mut Points) -> Result<(), ImportError> {
    let header = Header::read(&mut input)?;
    refuse_many(header.points)?;
    let row: usize = header.fields.iter().map(Field::bytes).sum();
    if row == 0 || row > LARGEST_ROW {
        return Err(ImportError::bad_format("its fields have no sound size"));
    }
    let columns = header.columns()?;
    match header.data.as_str() {
        "ascii" => read_text(input, &header, columns, points),
        "binary" => {
            let mut bytes = vec![0; row];
            for _ in 0..header.points {
                input
                    .read_exact(&mut bytes)
                    .map_err(|e| ImportError::unreadable(&e))?;
                let [x, y, z] = columns.map(|c| c.field(&header).number(&bytes[c.offset..]));
                points.push(x, y, z)?;
            }
            let behind = bytes_behind(&mut input)? / row as u64;
            points.said_too_few(header.points, header.points + behind);
            Ok(())
        }
        "binary_compressed" => read_compressed(input, &header, columns, points),
        other => Err(ImportError::bad_format(format!("its data are {other:?}"))),
    }
}

/// How many bytes follow.
fn bytes_behind(input: &mut impl BufRead) -> Result<u64, ImportError> {
    std::io::copy(input, &mut std::io::sink()).map_err(|e| ImportError::unreadable(&e))
}

/// Where x, y or z is in a row.
#[derive(Clone, Copy, Debug)]
struct Column {
    place: usize,
    /// Bytes before it in a row.
    offset: usize,
    /// Numbers before it in a row.
    word: usize,
}

impl Column {
    fn field(self, header: &Header) -> &Field {
        &header.fields[self.place]
    }
}

impl Field {
    fn bytes(&self) -> usize {
        self.size.saturating_mul(self.count)
    }

    /// The number at the begin of these bytes; none is no number.
    fn number(&self, bytes: &[u8]) -> f64 {
        let Some(own) = bytes.get(..self.size) else {
            return f64::NAN;
        };
        match (self.kind, own) {
            (b'F', &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]).into(),
            (b'F', &[a, b, c, d, e, f, g, h]) => f64::from_le_bytes([a, b, c, d, e, f, g, h]),
            (b'I', &[a]) => i8::from_le_bytes([a]).into(),
            (b'I', &[a, b]) => i16::from_le_bytes([a, b]).into(),
            (b'I', &[a, b, c, d]) => i32::from_le_bytes([a, b, c, d]).into(),
            (b'U', own) if own.len() <= 4 => own
                .iter()
                .rev()
                .fold(0.0, |sum, byte| sum * 256.0 + f64::from(*byte)),
            _ => f64::NAN,
        }
    }
}

impl Header {
    fn read(input: &mut impl BufRead) -> Result<Self, ImportError> {
        let mut header = Self::default();
        for _ in 0..MOST_LINES {
            let mut line = Vec::new();
            let read = input.take(LONGEST_LINE).read_until(b'\n', &mut line);
            if read.map_err(|e| ImportError::unreadable(&e))? == 0 {
                break;
            }
            let text = String::from_utf8_lossy(&line);
            let mut words = text.split_whitespace();
            let key = words.next().unwrap_or_default();
            let values: Vec<&str> = words.collect();
            header.take(key, &values).ok_or_else(|| {
                ImportError::bad_format(format!("its header cannot be read at {key}"))
            })?;
            if !header.data.is_empty() {
                return header.checked();
            }
        }
        Err(ImportError::bad_format(
            "its header has no end, and it is no PCD",
        ))
    }

    /// Checks that it says one number of points.
    fn checked(self) -> Result<Self, ImportError> {
        match (self.width, self.height) {
            (Some(width), Some(height)) if width.checked_mul(height) != Some(self.points) => {
                Err(ImportError::bad_format(format!(
                    "its header says POINTS {}, and WIDTH {width} times HEIGHT {height}: set them right",
                    self.points
                )))
            }
            _ => Ok(self),
        }
    }

    /// Takes a line of the header; `None` where it cannot be read.
    fn take(&mut self, key: &str, values: &[&str]) -> Option<()> {
        match key {
            "FIELDS" | "COLUMNS" => {
                let field = |name: &&str| Field {
                    name: (*name).into(),
                    size: 4,
                    kind: b'F',
                    count: 1,
                };
                self.fields = values.iter().map(field).collect();
            }
            "SIZE" => {
                for (field, value) in self.fields.iter_mut().zip(values) {
                    field.size = value.parse().ok()?;
                }
            }
            "TYPE" => {
                for (field, value) in self.fields.iter_mut().zip(values) {
                    field.kind = *value.as_bytes().first()?;
                }
            }
            "COUNT" => {
                for (field, value) in self.fields.iter_mut().zip(values) {
                    field.count = value.parse().ok()?;
                }
            }
            "WIDTH" => self.width = Some(values.first()?.parse().ok()?),
            "HEIGHT" => self.height = Some(values.first()?.parse().ok()?),
            "POINTS" => self.points = values.first()?.parse().ok()?,
            "DATA" => self.data = values.first()?.to_ascii_lowercase(),
            _ => {}
        }
        Some(())
    }

    fn columns(&self) -> Result<[Column; 3], ImportError> {
        let mut columns = [Column {
            place: 0,
            offset: 0,
            word: 0,
        }; 3];
        for (column, name) in columns.iter_mut().zip(["x", "y", "z"]) {
            let place = self.fields.iter().position(|f| f.name == name);
            column.place = place
                .ok_or_else(|| ImportError::bad_format(format!("its points have no {name}")))?;
            let before = &self.fields[..column.place];
            column.offset = before.iter().map(Field::bytes).sum();
            column.word = before.iter().map(|f| f.count).sum();
        }
        Ok(columns)
    }
}

fn read_text(
    mut input: impl BufRead,
    header: &Header,
    columns: [Column; 3],
    points: &mut Points,
) -> Result<(), ImportError> {
    for number in 0..header.points {
        let text = next_row(&mut input)?;
        let words: Vec<&str> = text.split_whitespace().collect();
        let value = |c: Column| words.get(c.word).and_then(|w| w.parse::<f64>().ok());
        let [Some(x), Some(y), Some(z)] = columns.map(value) else {
            let said = header.points;
            let what = format!(
                "its header says {said} points, and point {} cannot be read",
                number + 1
            );
            return Err(ImportError::bad_format(what));
        };
        points.push(x, y, z)?;
    }
    let mut rows = header.points;
    loop {
        let text = next_row(&mut input)?;
        if text.is_empty() {
            break;
        }
        rows += u64::from(!text.trim().is_empty());
    }
    points.said_too_few(header.points, rows);
    Ok(())
}

/// The next line of data, or as much of it as is read at once; empty at the end.
fn next_row(input: &mut impl BufRead) -> Result<String, ImportError> {
    let mut line = Vec::new();
    let read = input.take(16 * LONGEST_LINE).read_until(b'\n', &mut line);
    read.map_err(|e| ImportError::unreadable(&e))?;
    Ok(String::from_utf8_lossy(&line).into_owned())
}

/// The fields one after the other, each of all points.
fn read_compressed(
    mut input: impl BufRead,
    header: &Header,
    columns: [Column; 3],
    points: &mut Points,
) -> Result<(), ImportError> {
    let unreadable = |e: std::io::Error| ImportError::unreadable(&e);
    let mut sizes = [0; 8];
    input.read_exact(&mut sizes).map_err(unreadable)?;
    let [a, b, c, d, e, f, g, h] = sizes;
    let [compressed, size] = [
        u32::from_le_bytes([a, b, c, d]),
        u32::from_le_bytes([e, f, g, h]),
    ];
    let row: u64 = header.fields.iter().map(|f| f.bytes() as u64).sum();
    if u64::from(size) != row * header.points {
        return Err(ImportError::bad_format(
            "its compressed data are of another size than its header says",
        ));
    }
    let mut bytes = Vec::new();
    input
        .take(compressed.into())
        .read_to_end(&mut bytes)
        .map_err(unreadable)?;
    let data = lzf::decompress(&bytes, size as usize);
    let data = data.ok_or_else(|| ImportError::bad_format("its compressed data are damaged"))?;
    let count = header.points as usize;
    for i in 0..count {
        let [x, y, z] = columns.map(|c| {
            let field = c.field(header);
            let at = c.offset * count + i * field.bytes();
            field.number(data.get(at..).unwrap_or_default())
        });
        points.push(x, y, z)?;
    }
    Ok(())
}
