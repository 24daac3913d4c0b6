//! A capture that is not written yet: the folder `DIR.unfinished`.
//!
//! The track log is the capture; everything else is derived from it. So the log is on disk while
//! the film goes on, with a note of the source and the settings, and a run that was cut by a crash
//! or by a full disk is completed from there.

use super::announce::Announced;
use super::depth_scale::{doubt_of_depth, take_scale_of_depth};
use super::finish::{self, CaptureJob, Quality, Written};
use super::shared::{Failure, Shared};
use super::status::{median_error_px, median_fb_error_px};
use crate::cancel::CancelToken;
use crate::document::note::json;
use crate::document::{
    ASKED_FILE, BARK_FILE, Begun, CaptureNote, LEAVES_MASK_FILE, PICTURE_FILE, REST_FILE,
    WOOD_FILE, WOOD_MASK_FILE, asked_csv, at_rest_files, jpeg, png, wood_csv,
};
use crate::model::{AtRest, FormatNote, Size, WoodSeen};
use crate::pipeline::{BackEnd, Followed};
use crate::recording::{SpaceReserve, TrackFile, TrackFileReader};
use crate::source::SourceInfo;
use std::ffi::OsString;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// What is appended to the name of a capture's folder until it is written.
const SUFFIX: &str = ".unfinished";
const LOG_FILE: &str = "tracks.log";
const NOTE_FILE: &str = "capture.json";
const RESERVE_FILE: &str = "reserve";
/// The log and its note are brought to disk at this interval: a crash costs no more.
const KEPT_EVERY: Duration = Duration::from_millis(500);
/// Space that is held back for the results of the shortest film, bytes: the model, the picture.
const LEAST_RESERVE: u64 = 8 << 20;
/// The pictures of the tree at rest: none is of use without the others.
const AT_REST_FILES: [&str; 3] = [REST_FILE, WOOD_MASK_FILE, LEAVES_MASK_FILE];
/// Size of those pictures, not compressed: one in colour and two in grey.
const AT_REST_BYTES_PER_PIXEL: u64 = 5;
/// Size of the results beside that of the log: both tables are text.
const RESULTS_PER_LOG: u64 = 4;

/// The folder of a running capture.
pub struct Unfinished {
    dir: PathBuf,
    reserve: SpaceReserve,
    kept: Option<Instant>,
    picture_is_kept: bool,
    /// How much of the wood that was found is on disk.
    kept_wood: usize,
    /// How many times are on disk at which it was to be looked for again.
    kept_asked: usize,
}

/// Where the capture `out` lies until it is written.
pub fn unfinished_dir(out: &Path) -> PathBuf {
    let mut name = OsString::from(out);
    name.push(SUFFIX);
    PathBuf::from(name)
}

impl Unfinished {
    /// Makes the folder for the capture `out`, with the log in it, and holds back space for the
    /// results.
    ///
    /// # Errors
    /// There is one already, the disk is full, or whatever else the file system says.
    pub fn create(out: &Path) -> Result<(Self, TrackFile), Failure> {
        let dir = unfinished_dir(out);
        if let Some(above) = dir.parent() {
            std::fs::create_dir_all(above).map_err(Failure::Log)?;
        }
        std::fs::create_dir(&dir).map_err(|e| match e.kind() {
            io::ErrorKind::AlreadyExists => Failure::UnfinishedIsThere { dir: dir.clone() },
            _ => Failure::Log(e),
        })?;
        let opened = SpaceReserve::create(&dir.join(RESERVE_FILE), LEAST_RESERVE)
            .and_then(|reserve| Ok((reserve, TrackFile::create(&dir.join(LOG_FILE))?)));
        match opened {
            Ok((reserve, log)) => {
                let unfinished = Self {
                    dir,
                    reserve,
                    kept: None,
                    picture_is_kept: false,
                    kept_wood: 0,
                    kept_asked: 0,
                };
                Ok((unfinished, log))
            }
            Err(e) => {
                let _ = std::fs::remove_dir_all(&dir);
                Err(Failure::Log(e))
            }
        }
    }

    /// A new log in place of the old one: the capture starts again.
    ///
    /// # Errors
    /// Whatever the file system says.
    pub fn restart(&mut self) -> Result<TrackFile, Failure> {
        self.picture_is_kept = false;
        self.kept = None;
        if std::mem::take(&mut self.kept_wood) > 0 {
            std::fs::remove_file(self.dir.join(WOOD_FILE)).map_err(Failure::Log)?;
            self.remove_file(BARK_FILE)?;
            self.remove_at_rest()?;
        }
        self.kept_asked = 0;
        self.remove_file(ASKED_FILE)?;
        TrackFile::create(&self.dir.join(LOG_FILE)).map_err(Failure::Log)
    }

    /// Whether it is time for [`keep`](Self::keep).
    pub fn is_due(&self) -> bool {
        self.kept.is_none_or(|at| at.elapsed() >= KEPT_EVERY)
    }

    /// Brings to disk what a crash would lose beside the log, and holds back space for those
    /// results of the film up to now that are not among the `written_bytes` of its tables.
    ///
    /// # Errors
    /// The disk is full, or whatever else the file system says.
    pub fn keep(&mut self, job: &CaptureJob, written_bytes: u64) -> Result<(), Failure> {
        self.kept = Some(Instant::now());
        let results = RESULTS_PER_LOG * job.tracks.bytes().map_err(Failure::Log)?;
        let at_rest = newest_at_rest(&job.wood).map_or(0, |at_rest| {
            AT_REST_BYTES_PER_PIXEL * at_rest.picture.size.area() as u64
        });
        let missing = LEAST_RESERVE + at_rest + results.saturating_sub(written_bytes);
        self.reserve.grow_to(missing).map_err(Failure::Log)?;
        let note = json(&finish::describe(job, None, None))?;
        self.replace(NOTE_FILE, &note)?;
        if let Some(picture) = job.picture.as_ref().filter(|_| !self.picture_is_kept) {
            self.replace(PICTURE_FILE, &jpeg(&picture.rgb)?)?;
            self.picture_is_kept = true;
        }
        self.keep_wood(job)
    }

    /// Brings to disk the wood that was found, and when the user had it looked for again. The
    /// frames are not kept, and with them it would be lost.
    ///
    /// # Errors
    /// The disk is full, or whatever else the file system says.
    pub fn keep_wood(&mut self, job: &CaptureJob) -> Result<(), Failure> {
        let (wood, asked) = (&job.wood, &job.asked);
        if asked.len() > self.kept_asked {
            self.replace(ASKED_FILE, &asked_csv(asked)?)?;
            self.kept_asked = asked.len();
        }
        if wood.len() > self.kept_wood {
            // After a crash there may be none, but none of other wood.
            self.remove_at_rest()?;
            self.replace(WOOD_FILE, &wood_csv(wood)?)?;
            self.keep_pictures(wood)?;
            self.kept_wood = wood.len();
        }
        Ok(())
    }

    /// Bark and pictures at rest of the newest wood, or none where that has none.
    fn keep_pictures(&self, wood: &WoodSeen) -> Result<(), Failure> {
        let Some(newest) = wood.values().next_back() else {
            return Ok(());
        };
        match &newest.bark {
            Some(bark) => self.replace(BARK_FILE, &png(bark)?)?,
            None => self.remove_file(BARK_FILE)?,
        }
        let Some(at_rest) = &newest.at_rest else {
            return Ok(());
        };
        for file in at_rest_files(at_rest)? {
            self.replace(file.name, &file.bytes)?;
        }
        Ok(())
    }

    fn remove_at_rest(&self) -> Result<(), Failure> {
        AT_REST_FILES
            .into_iter()
            .try_for_each(|name| self.remove_file(name))
    }

    /// Removes a file, if it is there.
    fn remove_file(&self, name: &str) -> Result<(), Failure> {
        match std::fs::remove_file(self.dir.join(name)) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => Err(Failure::Log(e)),
            _ => Ok(()),
        }
    }

    fn replace(&self, name: &str, bytes: &[u8]) -> Result<(), Failure> {
        let partial = self.dir.join(format!("{name}.partial"));
        std::fs::write(&partial, bytes)
            .and_then(|()| std::fs::rename(&partial, self.dir.join(name)))
            .map_err(Failure::Log)
    }

    /// Gives the space back that was held for the results.
    pub fn release_space(&mut self) {
        self.reserve.release();
        let _ = std::fs::remove_file(self.dir.join(RESERVE_FILE));
    }

    /// The capture is written, or there is nothing to keep.
    pub fn remove(self) {
        let _ = std::fs::remove_dir_all(&self.dir);
    }

    pub fn dir(&self) -> &Path {
        &self.dir
    }
}

/// What the newest wood was found in.
fn newest_at_rest(wood: &WoodSeen) -> Option<&AtRest> {
    wood.values().next_back()?.at_rest.as_deref()
}

/// Completes the capture `out` from what its run has left.
///
/// The tree is built from the log as a replay would build it.
///
/// # Errors
/// There is nothing to finish, it is still being filmed, it is damaged, or the capture cannot be
/// written; what was left stays as it is then.
pub fn finish_unfinished(out: &Path, cancel: &CancelToken) -> Result<Written, Failure> {
    let out = named(out);
    let dir = unfinished_dir(&out);
    let tracks = TrackFileReader::open(&dir.join(LOG_FILE)).map_err(|e| cannot_open(&dir, e))?;
    let Begun {
        note,
        picture,
        outline,
        wood,
        asked,
    } = Begun::read(&dir).map_err(|e| Failure::DamagedUnfinished {
        dir: dir.clone(),
        what: e.to_string(),
    })?;
    let info = info_of(&note);
    let outline = Arc::new(outline.unwrap_or_else(|| crate::outline::whole(info.size)));
    let shared = Shared::restored(&note.timing, &note.warnings, note.origin());
    let shared = Arc::new(shared);
    let mut back = BackEnd::new(&note.config);
    back.put_wood(wood);
    back.put_asked(asked);
    let mut quality = None;
    for set in tracks.sets() {
        if cancel.is_cancelled() {
            return Err(Failure::Stopped);
        }
        let tracks = set.map_err(Failure::Log)?;
        quality
            .get_or_insert_with(|| Quality::since(tracks.time_s, &note.timing))
            .note(
                &tracks,
                median_fb_error_px(&tracks),
                median_error_px(&tracks),
            );
        back.step(Followed {
            tracks,
            outline: outline.clone(),
            preview: None,
            raw: None,
            received: Instant::now(),
        });
    }
    back.finish(cancel);
    Announced::default().tell_of_wood(back.wood_sight(), true, &shared);
    let _ = std::fs::remove_file(dir.join(RESERVE_FILE));
    let mut config = note.config;
    let model = back.model().map(|model| &**model);
    take_scale_of_depth(&mut config, model);
    if let Some(doubt) = doubt_of_depth(&config, model) {
        shared.warn(doubt);
    }
    let job = CaptureJob {
        tree: back.model().cloned(),
        outline: back.outline().cloned(),
        tracks,
        log: back.log().clone(),
        wood: back.wood().clone(),
        asked: back.asked().clone(),
        info,
        config,
        quality: quality.unwrap_or_default(),
        picture,
        tag: note.tag,
        shared,
    };
    let written = finish::write(&job, &out)?;
    let _ = std::fs::remove_dir_all(&dir);
    Ok(written)
}

/// The name of the capture, where that of its unfinished folder was given.
fn named(out: &Path) -> PathBuf {
    let text = out.to_string_lossy();
    let text = text.trim_end_matches('/');
    PathBuf::from(text.strip_suffix(SUFFIX).unwrap_or(text))
}

fn cannot_open(dir: &Path, e: io::Error) -> Failure {
    let dir = dir.to_owned();
    match e.kind() {
        io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => {
            Failure::NothingUnfinished { dir }
        }
        io::ErrorKind::WouldBlock => Failure::StillFilming { dir },
        _ => Failure::DamagedUnfinished {
            dir,
            what: e.to_string(),
        },
    }
}

fn info_of(note: &CaptureNote) -> SourceInfo {
    SourceInfo {
        name: note.source.name.clone(),
        format: FormatNote {
            asked: note.source.format_asked.clone(),
            given: note.source.format_given.clone(),
        },
        size: Size::new(note.source.width, note.source.height),
        nominal_rate_hz: note.timing.nominal_rate_hz,
        frames_total: None,
        live: false,
        depth: None,
    }
}
