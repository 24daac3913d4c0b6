//! Files of others, which may be of any size.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// No file that a user writes by hand has more bytes: markers, the profile of a lens, the places of pairs.
pub const LARGEST_NOTE: u64 = 16_000_000;

/// The bytes of a file that may have `most` of them.
///
/// # Errors
/// It cannot be read, or is larger ([`io::ErrorKind::FileTooLarge`]).
pub fn read_bounded(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    // A device or a pipe says that it holds nothing, and never ends.
    File::open(path)?.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        let why = format!("it has more than {} MB", most / 1_000_000);
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, why));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_larger_is_refused_also_if_it_has_no_end() {
        let file = tempfile::NamedTempFile::new().expect("file");
        std::fs::write(file.path(), [7; 10]).expect("write");
        assert_eq!(read_bounded(file.path(), 10).expect("fits"), [7; 10]);
        for path in [file.path(), Path::new("/dev/zero")] {
            let refused = read_bounded(path, 9).expect_err("too large");
            assert_eq!(refused.kind(), io::ErrorKind::FileTooLarge);
        }
    }
}
