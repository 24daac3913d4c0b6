//! The header and the rows of a PLY file.

use super::error::ImportError;
use std::io::{BufRead, Read};

/// Longest header, and longest word of a file of text, bytes.
const LONGEST_HEADER: u64 = 1 << 16;
const LONGEST_WORD: usize = 64;

/// How its numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// A kind of number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

/// A column of an element.
#[derive(Clone, Debug)]
pub(super) struct Property {
    pub name: String,
    pub scalar: Scalar,
    /// Of a list: how its length is written.
    pub count: Option<Scalar>,
}

/// A kind of rows.
#[derive(Clone, Debug)]
pub(super) struct Element {
    pub name: String,
    pub count: usize,
    pub properties: Vec<Property>,
}

/// What the header says.
pub(super) struct Header {
    pub encoding: Encoding,
    pub elements: Vec<Element>,
}

/// What is wrong with it, as an error.
pub(super) fn bad(what: &str) -> ImportError {
    ImportError::bad_format(what)
}

/// Reads the header up to the line that ends it.
///
/// # Errors
/// It is no PLY, or its header has no end or cannot be understood.
pub(super) fn read_header(input: &mut impl BufRead) -> Result<Header, ImportError> {
    let mut text = Vec::new();
    let mut limited = input.take(LONGEST_HEADER);
    loop {
        let begin = text.len();
        let read = limited.read_until(b'\n', &mut text);
        match read.map_err(|e| ImportError::unreadable(&e))? {
            0 => return Err(bad("its header has no end")),
            _ if text[begin..].trim_ascii() == b"end_header" => break,
            _ => {}
        }
    }
    let text = std::str::from_utf8(&text).map_err(|_| bad("its header is no text"))?;
    header(text)
}

fn header(text: &str) -> Result<Header, ImportError> {
    let mut lines = text.lines().map(str::trim);
    if lines.next() != Some("ply") {
        return Err(bad("it is no PLY"));
    }
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    for line in lines {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            ["format", word, _] => encoding = encoding_of(word),
            ["element", name, count] => elements.push(Element {
                name: name.into(),
                count: count.parse().map_err(|_| bad("an element has no number"))?,
                properties: Vec::new(),
            }),
            ["property", ref own @ ..] => {
                let property = property(own).ok_or_else(|| bad("a property cannot be read"))?;
                let element = elements.last_mut();
                element
                    .ok_or_else(|| bad("a property is of no element"))?
                    .properties
                    .push(property);
            }
            _ => {}
        }
    }
    let encoding = encoding.ok_or_else(|| bad("its format is none that is known"))?;
    Ok(Header { encoding, elements })
}

fn encoding_of(word: &str) -> Option<Encoding> {
    match word {
        "ascii" => Some(Encoding::Ascii),
        "binary_little_endian" => Some(Encoding::LittleEndian),
        "binary_big_endian" => Some(Encoding::BigEndian),
        _ => None,
    }
}

fn property(words: &[&str]) -> Option<Property> {
    match words {
        ["list", count, scalar, name] => Some(Property {
            name: (*name).into(),
            scalar: scalar_of(scalar)?,
            count: Some(scalar_of(count)?),
        }),
        [scalar, name] => Some(Property {
            name: (*name).into(),
            scalar: scalar_of(scalar)?,
            count: None,
        }),
        _ => None,
    }
}

fn scalar_of(word: &str) -> Option<Scalar> {
    Some(match word {
        "char" | "int8" => Scalar::I8,
        "uchar" | "uint8" => Scalar::U8,
        "short" | "int16" => Scalar::I16,
        "ushort" | "uint16" => Scalar::U16,
        "int" | "int32" => Scalar::I32,
        "uint" | "uint32" => Scalar::U32,
        "float" | "float32" => Scalar::F32,
        "double" | "float64" => Scalar::F64,
        _ => return None,
    })
}

/// What follows the header.
pub(super) struct Body<R> {
    pub encoding: Encoding,
    pub input: R,
}

impl<R: BufRead> Body<R> {
    /// The next number; `None` where the file is cut off, or holds none.
    pub fn number(&mut self, scalar: Scalar) -> Option<f64> {
        if self.encoding == Encoding::Ascii {
            return std::str::from_utf8(&self.word()?).ok()?.parse().ok();
        }
        let mut bytes = [0; 8];
        let own = &mut bytes[..size(scalar)];
        self.input.read_exact(own).ok()?;
        if self.encoding == Encoding::BigEndian {
            own.reverse();
        }
        Some(value(scalar, bytes))
    }

    /// The next word of a file of text.
    fn word(&mut self) -> Option<Vec<u8>> {
        let mut word = Vec::new();
        loop {
            let buffer = self.input.fill_buf().ok()?;
            let Some(byte) = buffer.first().copied() else {
                return (!word.is_empty()).then_some(word);
            };
            if !byte.is_ascii_whitespace() {
                word.push(byte);
            } else if !word.is_empty() {
                return Some(word);
            }
            if word.len() > LONGEST_WORD {
                return None;
            }
            self.input.consume(1);
        }
    }

    /// The number of a property; of a list its last one.
    pub fn property(&mut self, property: &Property) -> Option<f64> {
        let Some(count) = property.count else {
            return self.number(property.scalar);
        };
        let mut last = 0.0;
        let mut left = self.number(count)?;
        while left >= 1.0 {
            last = self.number(property.scalar)?;
            left -= 1.0;
        }
        Some(last)
    }

    /// Whether anything but white space is left.
    pub fn has_more(&mut self) -> bool {
        match self.encoding {
            Encoding::Ascii => self.word().is_some(),
            _ => self.input.fill_buf().is_ok_and(|rest| !rest.is_empty()),
        }
    }
}

/// Bytes of a number.
fn size(scalar: Scalar) -> usize {
    match scalar {
        Scalar::I8 | Scalar::U8 => 1,
        Scalar::I16 | Scalar::U16 => 2,
        Scalar::I32 | Scalar::U32 | Scalar::F32 => 4,
        Scalar::F64 => 8,
    }
}

/// The number in the first of these bytes, the lowest first.
fn value(scalar: Scalar, bytes: [u8; 8]) -> f64 {
    let [a, b, c, d, ..] = bytes;
    match scalar {
        Scalar::I8 => f64::from(i8::from_le_bytes([a])),
        Scalar::U8 => f64::from(a),
        Scalar::I16 => f64::from(i16::from_le_bytes([a, b])),
        Scalar::U16 => f64::from(u16::from_le_bytes([a, b])),
        Scalar::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
        Scalar::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
        Scalar::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
        Scalar::F64 => f64::from_le_bytes(bytes),
    }
}
