//! All track sets of a capture in a nameless temporary file, so that memory stays flat however long
//! it runs. The file vanishes with the program, whatever its end.

use crate::model::{Observation, TrackId, TrackSet};
use std::fs::File;
use std::io::{self, BufWriter, Read, Write};
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::sync::Arc;

/// Bytes of the head of a set (frame, time, lost, born, two counts) and of one observation.
const HEAD: usize = 8 + 8 + 4 + 4 + 4 + 4;
const OBSERVATION: usize = 21;

/// Writing end.
pub struct Spool {
    file: Arc<File>,
    writer: BufWriter<Appender>,
    buffer: Vec<u8>,
    sets: u64,
}

/// Writes at its own offset, so that readers of the same file do not disturb it.
struct Appender {
    file: Arc<File>,
    at: u64,
}

impl Write for Appender {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let n = self.file.write_at(bytes, self.at)?;
        self.at += n as u64;
        Ok(n)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Spool {
    /// Creates the file in `folder`.
    ///
    /// # Errors
    /// Whatever the file system says.
    pub fn create(folder: &Path) -> io::Result<Self> {
        let file = Arc::new(tempfile::tempfile_in(folder)?);
        let writer = BufWriter::with_capacity(
            1 << 16,
            Appender {
                file: file.clone(),
                at: 0,
            },
        );
        Ok(Self {
            file,
            writer,
            buffer: Vec::new(),
            sets: 0,
        })
    }

    /// Appends a set.
    ///
    /// # Errors
    /// Whatever the file system says, a full disk among it.
    pub fn push(&mut self, set: &TrackSet) -> io::Result<()> {
        let b = &mut self.buffer;
        b.clear();
        b.extend(set.frame.to_le_bytes());
        b.extend(set.time_s.to_le_bytes());
        b.extend(set.lost.to_le_bytes());
        b.extend(set.born.to_le_bytes());
        b.extend((set.observations.len() as u32).to_le_bytes());
        b.extend((set.rejected.len() as u32).to_le_bytes());
        for o in &set.observations {
            b.extend(o.id.0.to_le_bytes());
            for x in [
                o.u_px,
                o.v_px,
                o.fb_error_px,
                o.error_px.unwrap_or(f32::NAN),
            ] {
                b.extend(x.to_le_bytes());
            }
            b.push(u8::from(o.confirmed));
        }
        set.rejected
            .iter()
            .for_each(|id| b.extend(id.0.to_le_bytes()));
        self.writer.write_all(b)?;
        self.sets += 1;
        Ok(())
    }

    /// A reader of what has been pushed so far.
    ///
    /// # Errors
    /// Whatever the file system says.
    pub fn reader(&mut self) -> io::Result<SpoolReader> {
        self.writer.flush()?;
        Ok(SpoolReader {
            file: self.file.clone(),
            sets: self.sets,
        })
    }
}

/// Reads a spool from the start, as often as wanted, up to where it was when the reader was made.
#[derive(Clone)]
pub struct SpoolReader {
    file: Arc<File>,
    sets: u64,
}

impl SpoolReader {
    /// Number of sets.
    pub fn len(&self) -> u64 {
        self.sets
    }

    pub fn is_empty(&self) -> bool {
        self.sets == 0
    }

    /// The sets in their order.
    pub fn sets(&self) -> Sets {
        let reader = io::BufReader::with_capacity(
            1 << 16,
            At {
                file: self.file.clone(),
                at: 0,
            },
        );
        Sets {
            reader,
            next: 0,
            end: self.sets,
        }
    }
}

/// The sets of a spool, from the first on.
pub struct Sets {
    reader: io::BufReader<At>,
    next: u64,
    end: u64,
}

impl Sets {
    /// Goes on to the end of a later reader of the same spool.
    pub fn until(&mut self, later: &SpoolReader) {
        self.end = later.sets;
    }
}

impl Iterator for Sets {
    type Item = io::Result<TrackSet>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.next >= self.end {
            return None;
        }
        self.next += 1;
        Some(read_set(&mut self.reader))
    }
}

struct At {
    file: Arc<File>,
    at: u64,
}

impl Read for At {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let n = self.file.read_at(into, self.at)?;
        self.at += n as u64;
        Ok(n)
    }
}

fn read_set(reader: &mut impl Read) -> io::Result<TrackSet> {
    let mut head = [0u8; HEAD];
    reader.read_exact(&mut head)?;
    let u64_at = |i: usize| u64::from_le_bytes(std::array::from_fn(|k| head[i + k]));
    let u32_at = |i: usize| u32::from_le_bytes(std::array::from_fn(|k| head[i + k]));
    let n = u32_at(24) as usize;
    let mut bytes = vec![0u8; n * OBSERVATION];
    reader.read_exact(&mut bytes)?;
    let mut rejected = vec![0u8; u32_at(28) as usize * 4];
    reader.read_exact(&mut rejected)?;
    let observation = |o: &[u8]| {
        let word = |i: usize| u32::from_le_bytes(std::array::from_fn(|k| o[4 * i + k]));
        let [u_px, v_px, fb_error_px, error_px] = [1, 2, 3, 4].map(|i| f32::from_bits(word(i)));
        let error_px = (!error_px.is_nan()).then_some(error_px);
        Observation {
            id: TrackId(word(0)),
            u_px,
            v_px,
            fb_error_px,
            error_px,
            confirmed: o[20] != 0,
        }
    };
    Ok(TrackSet {
        frame: u64_at(0),
        time_s: f64::from_bits(u64_at(8)),
        lost: u32_at(16),
        born: u32_at(20),
        observations: bytes.chunks_exact(OBSERVATION).map(observation).collect(),
        rejected: rejected
            .as_chunks()
            .0
            .iter()
            .map(|id| TrackId(u32::from_le_bytes(*id)))
            .collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(frame: u64, n: u32) -> TrackSet {
        let at = |k: u32| Observation {
            id: TrackId(k * 3 + 1),
            u_px: k as f32 * 1.25,
            v_px: -(frame as f32) / 3.0,
            fb_error_px: 0.125,
            error_px: (k > 20).then_some(k as f32),
            confirmed: k.is_multiple_of(2),
        };
        let observations = (0..n).map(at).collect();
        let rejected = (0..n / 20).map(TrackId).collect();
        TrackSet {
            frame,
            time_s: frame as f64 / 30.0,
            observations,
            lost: 2,
            born: n,
            rejected,
        }
    }

    /// An export in the middle of a capture reads what was there and does not disturb what comes
    /// after.
    #[test]
    fn what_is_pushed_is_read_back_also_while_writing_goes_on() {
        let mut spool = Spool::create(&std::env::temp_dir()).unwrap();
        let sets: Vec<TrackSet> = (0..2000).map(|f| set(f, (f % 7) as u32 * 10)).collect();
        let same = |a: &TrackSet, b: &TrackSet| {
            (a.frame, a.time_s, a.lost, a.born) == (b.frame, b.time_s, b.lost, b.born)
                && (&a.observations, &a.rejected) == (&b.observations, &b.rejected)
        };
        let check = |reader: SpoolReader, n: usize| {
            let read: Vec<TrackSet> = reader.sets().map(Result::unwrap).collect();
            assert_eq!(read.len(), n);
            assert!(read.iter().zip(&sets).all(|(a, b)| same(a, b)));
        };
        sets[..1000].iter().for_each(|s| spool.push(s).unwrap());
        let half = spool.reader().unwrap();
        sets[1000..1500].iter().for_each(|s| spool.push(s).unwrap());
        check(half.clone(), 1000);
        // One who reads along goes on where they were.
        let mut along = half.sets();
        assert_eq!(along.by_ref().count(), 1000);
        sets[1500..].iter().for_each(|s| spool.push(s).unwrap());
        let all = spool.reader().unwrap();
        along.until(&all);
        assert!(
            along
                .map(Result::unwrap)
                .zip(&sets[1000..])
                .all(|(a, b)| same(&a, b))
        );
        check(all, 2000);
        check(half, 1000);
    }
}
