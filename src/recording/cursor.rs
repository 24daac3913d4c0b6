//! Little-endian numbers and length-prefixed texts out of a record that may be damaged. The crate's
//! own parser takes some lengths on trust.

/// Reads from the front; `None` where there is too little.
pub(super) struct Cursor<'a>(pub &'a [u8]);

impl<'a> Cursor<'a> {
    pub fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    pub fn u16(&mut self) -> Option<u16> {
        Some(u16::from_le_bytes(self.take(2)?.try_into().ok()?))
    }

    pub fn u32(&mut self) -> Option<u32> {
        Some(u32::from_le_bytes(self.take(4)?.try_into().ok()?))
    }

    pub fn u64(&mut self) -> Option<u64> {
        Some(u64::from_le_bytes(self.take(8)?.try_into().ok()?))
    }

    /// Kind and content of a record.
    pub fn record(&mut self) -> Option<(u8, &'a [u8])> {
        let kind = *self.take(1)?.first()?;
        let length = usize::try_from(self.u64()?).ok()?;
        Some((kind, self.take(length)?))
    }

    /// Bytes with their count in front.
    pub fn counted(&mut self) -> Option<&'a [u8]> {
        let count = self.u32()?;
        self.take(count as usize)
    }

    pub fn text(&mut self) -> Option<&'a str> {
        std::str::from_utf8(self.counted()?).ok()
    }

    /// A map of texts.
    pub fn map(&mut self) -> Option<Vec<(&'a str, &'a str)>> {
        let mut inner = Cursor(self.counted()?);
        let mut pairs = Vec::new();
        while !inner.0.is_empty() {
            pairs.push((inner.text()?, inner.text()?));
        }
        Some(pairs)
    }
}
