//! LZF, with which PCD files are compressed (Marc Lehmann's LibLZF).

/// Literal runs begin with a byte below this one.
const LITERALS: usize = 32;

/// What was compressed, if it is `size` bytes long; `None` where it is damaged.
pub(super) fn decompress(bytes: &[u8], size: usize) -> Option<Vec<u8>> {
    let mut out: Vec<u8> = Vec::new();
    let mut rest = bytes;
    while let Some((control, after)) = rest.split_first() {
        let control = usize::from(*control);
        rest = after;
        if control < LITERALS {
            let (run, after) = rest.split_at_checked(control + 1)?;
            out.extend(run);
            rest = after;
        } else {
            let mut length = control >> 5;
            if length == 7 {
                let (more, after) = rest.split_first()?;
                length += usize::from(*more);
                rest = after;
            }
            let (low, after) = rest.split_first()?;
            rest = after;
            let back = ((control & 0x1f) << 8) + usize::from(*low) + 1;
            let start = out.len().checked_sub(back)?;
            for i in start..start + length + 2 {
                out.push(*out.get(i)?);
            }
        }
        if out.len() > size {
            return None;
        }
    }
    (out.len() == size).then_some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_and_repeats() {
        // "abc", then the three again and twice more, as a repeat may overlap what it makes.
        let bytes = [2, b'a', b'b', b'c', (4 << 5), 2];
        assert_eq!(decompress(&bytes, 9).as_deref(), Some(&b"abcabcabc"[..]));
        assert_eq!(decompress(&bytes, 8), None);
        assert_eq!(decompress(&bytes[..5], 9), None);
        assert_eq!(decompress(&[(1 << 5), 9], 3), None);
        assert_eq!(decompress(&[], 0), Some(Vec::new()));
    }
}
