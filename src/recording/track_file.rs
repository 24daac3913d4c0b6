//! The track log on disk: all track sets of a capture, so that memory stays flat however long it
//! runs, and so that a capture that was cut can be finished.
//!
//! The file begins with a mark of its kind and version. Each set is a record of its length, its
//! checksum and its bytes; a file that was cut anywhere is read up to its last whole record. All
//! numbers are little-endian.

use crate::model::{
    Agreement, Background, CameraMotion, DepthSeen, Observation, TrackId, TrackSet,
};
use nalgebra::{Similarity2, Vector2};
use std::fs::{File, OpenOptions};
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::sync::Arc;

/// What the file begins with: its kind and version.
const MARK: [u8; 12] = *b"arborlog\x03\0\0\0";
/// Bytes of the length and the checksum before each set.
const RECORD_HEAD: usize = 4 + 4;
/// Bytes of the head of a set (frame, time, lost, born, two counts), of the camera's motion (shift,
/// turn, scale and how well it is known), and of one observation.
const HEAD: usize = 8 + 8 + 4 + 4 + 4 + 4;
const CAMERA: usize = 7 * 8;
const OBSERVATION: usize = 29;
/// A longer record is damage, bytes: some millions of points in one frame.
const LONGEST_RECORD: u32 = 1 << 28;
const BUFFER: usize = 1 << 16;

/// Writing end.
pub struct TrackFile {
    file: Arc<File>,
    writer: BufWriter<Appender>,
    /// The record that is being written.
    record: Vec<u8>,
    sets: u64,
    /// A record could not be written whole; what came after it could not be read.
    is_broken: bool,
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

impl TrackFile {
    /// Creates a nameless file in `folder`, which vanishes with the program.
    ///
    /// # Errors
    /// Whatever the file system says.
    pub fn nameless(folder: &Path) -> io::Result<Self> {
        Self::begin(tempfile::tempfile_in(folder)?)
    }

    /// Creates the file at `path`, in place of one that is there. It is locked for as long as it is
    /// written, see [`TrackFileReader::open`].
    ///
    /// # Errors
    /// Whatever the file system says.
    pub fn create(path: &Path) -> io::Result<Self> {
        // Readers of a file that was there keep it; nobody else can have locked the new one.
        match std::fs::remove_file(path) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(e),
            _ => {}
        }
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .create_new(true)
            .open(path)?;
        file.lock()?;
        Self::begin(file)
    }

    fn begin(file: File) -> io::Result<Self> {
        let file = Arc::new(file);
        let appender = Appender {
            file: file.clone(),
            at: 0,
        };
        let mut writer = BufWriter::with_capacity(BUFFER, appender);
        writer.write_all(&MARK)?;
        Ok(Self {
            file,
            writer,
            record: Vec::new(),
            sets: 0,
            is_broken: false,
        })
    }

    /// Appends a set. After a failure the file ends with the set before it, and takes no more.
    ///
    /// # Errors
    /// Whatever the file system says, a full disk among it; `BrokenPipe` after an earlier failure.
    pub fn push(&mut self, set: &TrackSet) -> io::Result<()> {
        if self.is_broken {
            let what = "an earlier write has failed";
            return Err(io::Error::new(io::ErrorKind::BrokenPipe, what));
        }
        self.record.clear();
        encode_record(set, &mut self.record);
        if let Err(e) = self.writer.write_all(&self.record) {
            self.is_broken = true;
            return Err(e);
        }
        self.sets += 1;
        Ok(())
    }

    /// A reader of what has been pushed so far. All that is handed to the system: from now on it
    /// outlives the program.
    ///
    /// # Errors
    /// Whatever the file system says, a full disk among it.
    pub fn reader(&mut self) -> io::Result<TrackFileReader> {
        self.writer.flush()?;
        Ok(TrackFileReader {
            file: self.file.clone(),
            sets: self.sets,
        })
    }
}

/// Reads a track file from the start, as often as wanted, up to where it was when the reader was
/// made.
#[derive(Clone, Debug)]
pub struct TrackFileReader {
    file: Arc<File>,
    sets: u64,
}

impl TrackFileReader {
    /// Opens a file that nobody writes any more; it ends before the first record that is not whole.
    ///
    /// # Errors
    /// It cannot be read, it is no track file (`InvalidData`), or it is still being written
    /// (`WouldBlock`).
    pub fn open(path: &Path) -> io::Result<Self> {
        let file = File::open(path)?;
        file.try_lock().map_err(io::Error::from)?;
        let mut all = Self {
            file: Arc::new(file),
            sets: u64::MAX,
        };
        let mut mark = [0; MARK.len()];
        let is_whole = all.file.read_exact_at(&mut mark, 0).is_ok();
        if !is_whole || mark != MARK {
            let what = "it is no track log of this version of arborcam";
            return Err(io::Error::new(io::ErrorKind::InvalidData, what));
        }
        all.sets = all.sets().take_while(Result::is_ok).count() as u64;
        Ok(all)
    }

    /// Number of sets.
    pub fn len(&self) -> u64 {
        self.sets
    }

    pub fn is_empty(&self) -> bool {
        self.sets == 0
    }

    /// Size of the file, bytes.
    ///
    /// # Errors
    /// Whatever the file system says.
    pub fn bytes(&self) -> io::Result<u64> {
        Ok(self.file.metadata()?.len())
    }

    /// The sets in their order.
    pub fn sets(&self) -> Sets {
        let place = Place {
            file: self.file.clone(),
            at: MARK.len() as u64,
        };
        Sets {
            reader: BufReader::with_capacity(BUFFER, place),
            next: 0,
            end: self.sets,
        }
    }
}

/// The sets of a track file, from the first on.
pub struct Sets {
    reader: BufReader<Place>,
    next: u64,
    end: u64,
}

impl Sets {
    /// Goes on to the end of a later reader of the same file.
    pub fn until(&mut self, later: &TrackFileReader) {
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
        Some(read_record(&mut self.reader))
    }
}

/// Reads at its own offset.
struct Place {
    file: Arc<File>,
    at: u64,
}

impl Read for Place {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let n = self.file.read_at(into, self.at)?;
        self.at += n as u64;
        Ok(n)
    }
}

fn read_record(reader: &mut impl Read) -> io::Result<TrackSet> {
    let mut head = [0; RECORD_HEAD];
    reader.read_exact(&mut head)?;
    let [length, checksum] = [0, 4].map(|at| u32_at(&head, at));
    if length > LONGEST_RECORD {
        return Err(damaged());
    }
    let mut bytes = vec![0; length as usize];
    reader.read_exact(&mut bytes)?;
    if crc32fast::hash(&bytes) != checksum {
        return Err(damaged());
    }
    decode(&bytes).ok_or_else(damaged)
}

fn damaged() -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, "the track log is damaged")
}

/// Length, checksum, set.
fn encode_record(set: &TrackSet, out: &mut Vec<u8>) {
    out.extend([0; RECORD_HEAD]);
    encode(set, out);
    let (head, bytes) = out.split_at_mut(RECORD_HEAD);
    let (length, checksum) = head.split_at_mut(4);
    length.copy_from_slice(&(bytes.len() as u32).to_le_bytes());
    checksum.copy_from_slice(&crc32fast::hash(bytes).to_le_bytes());
}

fn encode(set: &TrackSet, out: &mut Vec<u8>) {
    out.extend(set.frame.to_le_bytes());
    out.extend(set.time_s.to_le_bytes());
    out.extend(set.lost.to_le_bytes());
    out.extend(set.born.to_le_bytes());
    out.extend((set.observations.len() as u32).to_le_bytes());
    out.extend((set.rejected.len() as u32).to_le_bytes());
    encode_camera(&set.camera, out);
    for o in &set.observations {
        out.extend(o.id.0.to_le_bytes());
        let error_px = o.error_px.unwrap_or(f32::NAN);
        for x in [o.u_px, o.v_px, o.fb_error_px, error_px] {
            out.extend(x.to_le_bytes());
        }
        out.push(u8::from(o.confirmed));
        let (depth_m, sd_m) = o
            .depth
            .map_or((f32::NAN, f32::NAN), |d| (d.depth_m, d.sd_m));
        out.extend(depth_m.to_le_bytes());
        out.extend(sd_m.to_le_bytes());
    }
    for id in &set.rejected {
        out.extend(id.0.to_le_bytes());
    }
}

/// What is written where the background says nothing. A negative deviation is that of the foot of
/// the trunk, which served in its place.
const NOT_SEEN: Agreement = Agreement {
    sd_px: f64::NAN,
    inliers: 0,
    rms_px: f64::NAN,
};

fn encode_camera(camera: &CameraMotion, out: &mut Vec<u8>) {
    let motion = &camera.filmed_from_steady;
    let shift_px = motion.isometry.translation.vector;
    let turn = motion.isometry.rotation.angle();
    for x in [shift_px.x, shift_px.y, turn, motion.scaling()] {
        out.extend(x.to_le_bytes());
    }
    let Agreement {
        sd_px,
        inliers,
        rms_px,
    } = match camera.background {
        Background::Seen(agreement) => agreement,
        Background::Foot(agreement) => Agreement {
            sd_px: -agreement.sd_px,
            ..agreement
        },
        Background::Unclear => NOT_SEEN,
        Background::Lost => Agreement {
            sd_px: f64::INFINITY,
            ..NOT_SEEN
        },
    };
    out.extend(sd_px.to_le_bytes());
    out.extend(u64::from(inliers).to_le_bytes());
    out.extend(rms_px.to_le_bytes());
}

/// `None` where there is no such motion.
fn decode_camera(bytes: &[u8]) -> Option<CameraMotion> {
    let [u_px, v_px, turn, scale, sd_px, rms_px] =
        [0, 8, 16, 24, 32, 48].map(|at| f64::from_bits(u64_at(bytes, at)));
    let inliers = u32::try_from(u64_at(bytes, 40)).ok()?;
    let is_motion = scale > 0.0 && [u_px, v_px, turn, scale].iter().all(|x| x.is_finite());
    is_motion.then(|| CameraMotion {
        filmed_from_steady: Similarity2::new(Vector2::new(u_px, v_px), turn, scale),
        background: match sd_px {
            sd_px if sd_px.is_nan() => Background::Unclear,
            f64::INFINITY => Background::Lost,
            sd_px if sd_px.is_sign_negative() => Background::Foot(Agreement {
                sd_px: -sd_px,
                inliers,
                rms_px,
            }),
            sd_px => Background::Seen(Agreement {
                sd_px,
                inliers,
                rms_px,
            }),
        },
    })
}

/// `None` where the counts do not fit the length.
fn decode(bytes: &[u8]) -> Option<TrackSet> {
    let (head, rest) = bytes.split_at_checked(HEAD)?;
    let (camera, rest) = rest.split_at_checked(CAMERA)?;
    let n_observations = u32_at(head, 24) as usize;
    let n_rejected = u32_at(head, 28) as usize;
    let (observations, rejected) =
        rest.split_at_checked(n_observations.checked_mul(OBSERVATION)?)?;
    if rejected.len() != n_rejected.checked_mul(4)? {
        return None;
    }
    Some(TrackSet {
        frame: u64_at(head, 0),
        time_s: f64::from_bits(u64_at(head, 8)),
        camera: decode_camera(camera)?,
        lost: u32_at(head, 16),
        born: u32_at(head, 20),
        observations: observations
            .chunks_exact(OBSERVATION)
            .map(observation)
            .collect(),
        rejected: rejected
            .chunks_exact(4)
            .map(|id| TrackId(u32_at(id, 0)))
            .collect(),
    })
}

fn observation(bytes: &[u8]) -> Observation {
    let [u_px, v_px, fb_error_px, error_px, depth_m, sd_m] =
        [4, 8, 12, 16, 21, 25].map(|at| f32::from_bits(u32_at(bytes, at)));
    Observation {
        id: TrackId(u32_at(bytes, 0)),
        u_px,
        v_px,
        fb_error_px,
        error_px: (!error_px.is_nan()).then_some(error_px),
        confirmed: bytes[20] != 0,
        depth: (!depth_m.is_nan()).then_some(DepthSeen { depth_m, sd_m }),
    }
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(std::array::from_fn(|k| bytes[at + k]))
}

fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(std::array::from_fn(|k| bytes[at + k]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point2;

    const CORNER: Point2<f64> = Point2::new(1280.0, 720.0);

    fn set(frame: u64, n: u32) -> TrackSet {
        let at = |k: u32| Observation {
            id: TrackId(k * 3 + 1),
            u_px: k as f32 * 1.25,
            v_px: -(frame as f32) / 3.0,
            fb_error_px: 0.125,
            error_px: (k > 20).then_some(k as f32),
            confirmed: k.is_multiple_of(2),
            depth: k.is_multiple_of(3).then_some(DepthSeen {
                depth_m: 2.0 + k as f32,
                sd_m: 0.01,
            }),
        };
        let observations = (0..n).map(at).collect();
        let rejected = (0..n / 20).map(TrackId).collect();
        TrackSet {
            frame,
            time_s: frame as f64 / 30.0,
            camera: CameraMotion {
                filmed_from_steady: Similarity2::new(Vector2::new(1.5, frame as f64), 0.01, 1.1),
                background: match frame % 4 {
                    0 => Background::Seen(Agreement {
                        sd_px: 0.01,
                        inliers: 120,
                        rms_px: 0.1,
                    }),
                    1 => Background::Unclear,
                    2 => Background::Foot(Agreement {
                        sd_px: 0.0,
                        inliers: 14,
                        rms_px: 0.2,
                    }),
                    _ => Background::Lost,
                },
            },
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
        let mut log = TrackFile::nameless(&std::env::temp_dir()).unwrap();
        let sets: Vec<TrackSet> = (0..2000).map(|f| set(f, (f % 7) as u32 * 10)).collect();
        let same = |a: &TrackSet, b: &TrackSet| {
            (a.frame, a.time_s, a.lost, a.born) == (b.frame, b.time_s, b.lost, b.born)
                && a.camera.background == b.camera.background
                && (a.camera.filmed_px(CORNER) - b.camera.filmed_px(CORNER)).norm() < 1e-9
                && (&a.observations, &a.rejected) == (&b.observations, &b.rejected)
        };
        let check = |reader: TrackFileReader, n: usize| {
            let read: Vec<TrackSet> = reader.sets().map(Result::unwrap).collect();
            assert_eq!(read.len(), n);
            assert!(read.iter().zip(&sets).all(|(a, b)| same(a, b)));
        };
        sets[..1000].iter().for_each(|s| log.push(s).unwrap());
        let half = log.reader().unwrap();
        sets[1000..1500].iter().for_each(|s| log.push(s).unwrap());
        check(half.clone(), 1000);
        // One who reads along goes on where they were.
        let mut along = half.sets();
        assert_eq!(along.by_ref().count(), 1000);
        sets[1500..].iter().for_each(|s| log.push(s).unwrap());
        let all = log.reader().unwrap();
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

    /// A power cut or `kill -9` ends the file anywhere.
    #[test]
    fn a_file_cut_or_damaged_anywhere_is_read_up_to_its_last_whole_set() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("tracks.log");
        let mut log = TrackFile::create(&path).unwrap();
        (0..20).for_each(|f| log.push(&set(f, 30)).unwrap());
        log.reader().unwrap();
        let busy = TrackFileReader::open(&path).unwrap_err();
        assert_eq!(busy.kind(), io::ErrorKind::WouldBlock, "{busy}");
        drop(log);
        let whole = std::fs::read(&path).unwrap();
        let record = (whole.len() - MARK.len()) / 20;
        for cut in 0..whole.len() {
            std::fs::write(&path, &whole[..cut]).unwrap();
            let Some(body) = cut.checked_sub(MARK.len()) else {
                let error = TrackFileReader::open(&path).unwrap_err();
                assert_eq!(error.kind(), io::ErrorKind::InvalidData);
                continue;
            };
            let read = TrackFileReader::open(&path).unwrap();
            assert_eq!(read.len(), (body / record) as u64, "cut at {cut}");
        }
        for at in (MARK.len()..whole.len()).step_by(37) {
            let mut damaged = whole.clone();
            damaged[at] ^= 0x5a;
            std::fs::write(&path, &damaged).unwrap();
            let read = TrackFileReader::open(&path).unwrap();
            assert_eq!(read.len(), ((at - MARK.len()) / record) as u64, "at {at}");
        }
    }
}
