//! The few forms of protobuf's wire format that the published schemas need. A crate would copy
//! every frame once more.

/// A message under construction, appended to a buffer that is used again and again.
pub(super) struct Message<'a>(pub &'a mut Vec<u8>);

/// Wire types.
const VARINT: u32 = 0;
const FIXED64: u32 = 1;
const BYTES: u32 = 2;
const FIXED32: u32 = 5;

impl Message<'_> {
    fn varint(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.0.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.0.push(value as u8);
    }

    fn tag(&mut self, field: u32, kind: u32) {
        self.varint(u64::from(field << 3 | kind));
    }

    pub fn int(&mut self, field: u32, value: i64) {
        self.tag(field, VARINT);
        self.varint(value as u64);
    }

    pub fn fixed32(&mut self, field: u32, value: u32) {
        self.tag(field, FIXED32);
        self.0.extend(value.to_le_bytes());
    }

    pub fn double(&mut self, field: u32, value: f64) {
        self.tag(field, FIXED64);
        self.0.extend(value.to_le_bytes());
    }

    pub fn bytes(&mut self, field: u32, value: &[u8]) {
        self.tag(field, BYTES);
        self.varint(value.len() as u64);
        self.0.extend_from_slice(value);
    }

    pub fn text(&mut self, field: u32, value: &str) {
        self.bytes(field, value.as_bytes());
    }

    /// A message within this one.
    pub fn sub(&mut self, field: u32, fill: impl FnOnce(&mut Message)) {
        let mut inner = Vec::new();
        fill(&mut Message(&mut inner));
        self.bytes(field, &inner);
    }

    /// `google.protobuf.Timestamp`.
    pub fn timestamp(&mut self, field: u32, time_ns: u64) {
        self.sub(field, |t| {
            t.int(1, (time_ns / 1_000_000_000) as i64);
            t.int(2, (time_ns % 1_000_000_000) as i64);
        });
    }

    /// A message of doubles in the fields 1, 2, …: points, vectors, quaternions, colours.
    pub fn doubles(&mut self, field: u32, values: &[f64]) {
        self.tag(field, BYTES);
        self.varint(9 * values.len() as u64);
        for (i, value) in values.iter().enumerate() {
            self.double(i as u32 + 1, *value);
        }
    }

    pub fn packed_fixed32(&mut self, field: u32, values: &[u32]) {
        self.tag(field, BYTES);
        self.varint(4 * values.len() as u64);
        values.iter().for_each(|v| self.0.extend(v.to_le_bytes()));
    }
}

/// The value of a field that was read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Value<'a> {
    Number(u64),
    Bytes(&'a [u8]),
}

/// The fields of a message that somebody else has written, up to the first that is none.
pub(super) struct Fields<'a>(pub &'a [u8]);

impl<'a> Fields<'a> {
    fn varint(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let (&byte, rest) = self.0.split_first()?;
            self.0 = rest;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }

    fn take(&mut self, count: u64) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(usize::try_from(count).ok()?)?;
        self.0 = rest;
        Some(taken)
    }
}

impl<'a> Iterator for Fields<'a> {
    type Item = (u64, Value<'a>);

    fn next(&mut self) -> Option<Self::Item> {
        let tag = self.varint()?;
        let value = match (tag & 7) as u32 {
            VARINT => Value::Number(self.varint()?),
            FIXED64 => Value::Number(little(self.take(8)?)),
            FIXED32 => Value::Number(little(self.take(4)?)),
            BYTES => {
                let count = self.varint()?;
                Value::Bytes(self.take(count)?)
            }
            _ => return None,
        };
        Some((tag >> 3, value))
    }
}

/// A number whose lowest byte comes first, of up to eight.
pub(super) fn little(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |n, b| n << 8 | u64::from(*b))
}
