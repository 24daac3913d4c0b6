//! Recordings: what goes in comes out, whatever happens to the file in between.

use crate::support;
use arborcam::config::Config;
use arborcam::model::{FormatNote, PixelFormat, RawFrame, Size, seconds};
use arborcam::recording::{Encoding, Head, Limits, Picture, Reader, Series};
use arborcam::runtime::{self, Job, Pace, QUEUE_BYTES, RecordJob, RecordTo};
use arborcam::source::{self, Source, SourceError, SourceInfo};
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::time::Duration;

const SMALL: Size = Size {
    width: 16,
    height: 8,
};

fn head() -> Head {
    Head {
        source: "test".into(),
        size: Some(SMALL),
        clock: "file".into(),
        ..Head::default()
    }
}

fn now() -> u64 {
    1_700_000_000_000_000_000
}

fn frame(n: u64, format: PixelFormat) -> RawFrame {
    let bytes = match format.picture_bytes(SMALL) {
        Some(count) => (0..count).map(|i| (i as u64 * 7 + n * 13) as u8).collect(),
        // What a recording keeps is what came, be it a picture or not.
        None => [
            vec![0xff, 0xd8],
            (0..200 + n as usize).map(|i| (i * 11) as u8).collect(),
        ]
        .concat(),
    };
    RawFrame {
        sequence: Some(n),
        sensor_time_s: seconds(5_000_000_000 + n as i64 * 33_366_667),
        size: SMALL,
        format,
        bytes,
        depth: None,
    }
}

fn record(path: &Path, frames: &[RawFrame], each: impl Fn(&mut Series, usize)) {
    let mut series = Series::create(path, head(), Limits::default(), now).expect("new file");
    for (i, raw) in frames.iter().enumerate() {
        series.frame(raw, i as u64).expect("frame");
        each(&mut series, i);
    }
    series.close().expect("close");
}

fn pictures(bytes: &[u8]) -> (Vec<Picture>, Vec<String>) {
    let Ok(mut reader) = Reader::new(Path::new("test.mcap"), Cursor::new(bytes)) else {
        return (Vec::new(), Vec::new());
    };
    let pictures = std::iter::from_fn(|| reader.next_picture()).collect();
    (pictures, reader.warnings())
}

fn same(picture: &Picture, raw: &RawFrame) -> bool {
    let size = match &picture.encoding {
        Encoding::File(name) => raw.format == PixelFormat::Mjpeg && name == "jpeg",
        Encoding::Pixels(format, size) => (*format, *size) == (raw.format, raw.size),
    };
    size && picture.bytes == raw.bytes
        && picture.sequence == raw.sequence
        && seconds(picture.sensor_time_ns) == raw.sensor_time_s
}

/// Every format, a number beyond 32 bits, losses, a camera that does not count, times before zero:
/// all as delivered.
#[test]
fn frames_come_back_byte_for_byte_with_number_and_time() {
    let dir = tempfile::tempdir().expect("tempdir");
    for format in PixelFormat::ALL {
        for (counts, start_s) in [(true, 0.0), (false, 0.0), (true, -7.5), (true, 1.7e9)] {
            let path = dir.path().join(format!("{format}-{counts}-{start_s}.mcap"));
            let frames: Vec<RawFrame> = (0..40)
                .map(|n| {
                    let mut raw = frame(n, format);
                    let number = u64::from(u32::MAX) - 10 + n + if n > 20 { 3 } else { 0 };
                    raw.sequence = counts.then_some(number);
                    raw.sensor_time_s =
                        seconds(arborcam::model::nanoseconds(raw.sensor_time_s + start_s));
                    raw
                })
                .collect();
            record(&path, &frames, |series, i| {
                if i % 9 == 8 {
                    series.flush().expect("flush")
                }
            });
            let (read, warnings) = pictures(&std::fs::read(&path).expect("file"));
            assert_eq!(warnings, Vec::<String>::new());
            assert_eq!(read.len(), frames.len());
            assert!(
                read.iter().zip(&frames).all(|(p, raw)| same(p, raw)),
                "{format} {counts} {start_s}"
            );
        }
    }
}

/// A driver that takes up counting in mid-stream is told apart frame by frame.
#[test]
fn frames_with_and_without_a_number_keep_to_what_they_are() {
    let dir = tempfile::tempdir().expect("tempdir");
    let path = dir.path().join("mixed.mcap");
    let frames: Vec<RawFrame> = (0..20)
        .map(|n| RawFrame {
            sequence: (n % 3 > 0).then_some(n),
            ..frame(n, PixelFormat::Mjpeg)
        })
        .collect();
    record(&path, &frames, |_, _| ());
    let (read, _) = pictures(&std::fs::read(&path).expect("file"));
    assert!(
        read.iter()
            .map(|p| p.sequence)
            .eq(frames.iter().map(|f| f.sequence))
    );
}

/// Number of frames in whole chunks, by the length to which the file is cut.
fn chunked(path: &Path, format: PixelFormat) -> (Vec<RawFrame>, Vec<u64>) {
    let frames: Vec<RawFrame> = (0..24).map(|n| frame(n, format)).collect();
    let ends = std::cell::RefCell::new(Vec::new());
    record(path, &frames, |series, i| {
        if i % 4 == 3 {
            series.flush().expect("flush");
            ends.borrow_mut()
                .push(std::fs::metadata(path).expect("file").len());
        }
    });
    (frames, ends.into_inner())
}

#[test]
fn a_file_cut_anywhere_is_readable_up_to_its_last_whole_chunk() {
    let dir = tempfile::tempdir().expect("tempdir");
    let path = dir.path().join("cut.mcap");
    let (frames, ends) = chunked(&path, PixelFormat::Mjpeg);
    let bytes = std::fs::read(&path).expect("file");
    assert!(bytes.len() > *ends.last().expect("chunks") as usize);
    for cut in 0..=bytes.len() {
        let (read, warnings) = pictures(&bytes[..cut]);
        // A chunk's own index stands behind it, and is not needed.
        let whole = 4 * ends.iter().filter(|end| **end <= cut as u64).count();
        assert!(
            (whole..=whole + 4).contains(&read.len()),
            "cut at {cut}: {} of {whole}",
            read.len()
        );
        assert!(
            read.iter().zip(&frames).all(|(p, raw)| same(p, raw)),
            "cut at {cut}"
        );
        let told = !warnings.is_empty() || read.is_empty();
        assert!(
            told || cut > *ends.last().expect("chunks") as usize,
            "cut at {cut} and not a word: {warnings:?}"
        );
    }
}

/// A flipped bit costs at most the chunk it is in; no picture comes out other than it went in.
#[test]
fn a_flipped_bit_costs_its_chunk_and_nothing_else() {
    let dir = tempfile::tempdir().expect("tempdir");
    let path = dir.path().join("flip.mcap");
    let (frames, ends) = chunked(&path, PixelFormat::Grey);
    let whole = std::fs::read(&path).expect("file");
    let head = whole
        .windows(5)
        .position(|w| w == b"clock")
        .expect("metadata")
        + 400;
    for at in (head..*ends.last().expect("chunks") as usize).step_by(5) {
        let mut bytes = whole.clone();
        bytes[at] ^= 1 << (at % 8);
        let (read, _) = pictures(&bytes);
        assert!(
            read.len() >= frames.len() - 4,
            "bit in byte {at}: {} left",
            read.len()
        );
        assert!(
            read.iter().all(|p| frames.iter().any(|raw| same(p, raw))),
            "bit in byte {at}: a false picture"
        );
    }
}

#[test]
fn a_recording_goes_on_in_next_files_and_overwrites_none() {
    let dir = tempfile::tempdir().expect("tempdir");
    let path = dir.path().join("long.mcap");
    let taken = dir.path().join("long-2.mcap");
    std::fs::write(&taken, b"somebody else's").expect("write");
    let limits = Limits {
        max_time_ns: Some(300_000_000),
        ..Limits::default()
    };
    let mut series = Series::create(&path, head(), limits, now).expect("new file");
    let frames: Vec<RawFrame> = (0..36).map(|n| frame(n, PixelFormat::Mjpeg)).collect();
    frames
        .iter()
        .enumerate()
        .for_each(|(i, raw)| series.frame(raw, i as u64).expect("frame"));
    series.close().expect("close");
    assert_eq!(series.files(), 4, "somebody else's is not ours");
    assert_eq!(std::fs::read(&taken).expect("file"), b"somebody else's");
    let parts =
        ["long.mcap", "long-1.mcap", "long-3.mcap", "long-4.mcap"].map(|n| dir.path().join(n));
    let mut all = Vec::new();
    for part in &parts {
        let (read, warnings) = pictures(&std::fs::read(part).expect("part"));
        assert!(
            warnings.is_empty() && (8..=10).contains(&read.len()),
            "{}: {}",
            part.display(),
            read.len()
        );
        all.extend(read);
    }
    assert!(all.len() == frames.len() && all.iter().zip(&frames).all(|(p, raw)| same(p, raw)));
    assert!(
        Series::create(&path, head(), limits, now).is_err(),
        "an existing file is refused"
    );
}

/// What `--max-size` bounds is the file on the disk.
#[test]
fn a_file_stays_within_its_size() {
    let dir = tempfile::tempdir().expect("tempdir");
    let path = dir.path().join("size.mcap");
    let limits = Limits {
        max_bytes: Some(2_000_000),
        ..Limits::default()
    };
    let mut series = Series::create(&path, head(), limits, now).expect("new file");
    for n in 0..60 {
        let raw = RawFrame {
            bytes: vec![n as u8; 100_000],
            ..frame(n, PixelFormat::Mjpeg)
        };
        series.frame(&raw, n).expect("frame");
    }
    series.close().expect("close");
    assert_eq!(series.files(), 4);
    let sizes: Vec<u64> = (0..4)
        .map(|k| {
            if k == 0 {
                path.clone()
            } else {
                dir.path().join(format!("size-{k}.mcap"))
            }
        })
        .map(|p| std::fs::metadata(p).expect("part").len())
        .collect();
    assert!(
        sizes.iter().all(|s| *s < 2_100_000) && sizes[..3].iter().all(|s| *s > 1_700_000),
        "{sizes:?}"
    );
}

fn files_with(name: &str, bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().expect("tempdir");
    let path = dir.path().join(name);
    std::fs::write(&path, bytes).expect("write");
    (dir, path)
}

fn refusal(path: &Path) -> String {
    source::open(path, &Config::default(), None)
        .err()
        .expect("it is refused")
        .to_string()
}

#[test]
fn what_is_no_recording_is_refused_in_words() {
    for bytes in [
        &b""[..],
        b"\x89MCAP0\r\n",
        b"no recording at all, but a text",
    ] {
        let (_dir, path) = files_with("bad.mcap", bytes);
        let said = refusal(&path);
        assert!(said.contains("bad.mcap") && !said.contains('\n'), "{said}");
    }
}

/// A recording by another program: ten pictures on each of the topics.
fn file_by_another_program(topics: &[&str], compression: Option<mcap::Compression>) -> Vec<u8> {
    let jpeg = &support::recording()[0].bytes;
    let mut bytes = Vec::new();
    let mut writer = mcap::WriteOptions::new()
        .compression(compression)
        .create(Cursor::new(&mut bytes))
        .expect("writer");
    let schema = writer
        .add_schema("foxglove.CompressedImage", "protobuf", b"")
        .expect("schema");
    for n in 0..10u32 {
        for topic in topics {
            let channel = writer
                .add_channel(schema, topic, "protobuf", &Default::default())
                .expect("channel");
            // data = 2, format = 3
            let mut data = vec![0x12];
            let mut count = jpeg.len();
            while count >= 0x80 {
                data.push(count as u8 | 0x80);
                count >>= 7;
            }
            data.push(count as u8);
            data.extend(jpeg);
            data.extend(b"\x1a\x04jpeg");
            let times = u64::from(n + 1) * 40_000_000;
            let header = mcap::records::MessageHeader {
                channel_id: channel,
                sequence: 0,
                log_time: times,
                publish_time: 0,
            };
            writer
                .write_to_known_channel(&header, &data)
                .expect("message");
        }
    }
    writer.finish().expect("finish");
    drop(writer);
    bytes
}

/// A file by another program: its picture topic is used; where it has two, they are named.
#[test]
fn other_programs_files_are_read_or_refused_with_their_topics() {
    let jpeg = &support::recording()[0].bytes;
    for compression in [
        None,
        Some(mcap::Compression::Lz4),
        Some(mcap::Compression::Zstd),
    ] {
        let (_dir, path) = files_with(
            "other.mcap",
            &file_by_another_program(&["/cam/image"], compression),
        );
        let mut source = source::open(&path, &Config::default(), None).expect("opened");
        assert_eq!(
            (source.describe().frames_total, source.describe().size),
            (Some(10), support::SIZE)
        );
        let frames: Vec<RawFrame> =
            std::iter::from_fn(|| source.next_frame().expect("frame")).collect();
        assert!(
            frames.len() == 10
                && frames
                    .iter()
                    .all(|f| f.bytes == *jpeg && f.sequence.is_none())
        );
        assert!((frames[9].sensor_time_s - frames[0].sensor_time_s - 0.36).abs() < 1e-9);
    }
    let (_dir, path) = files_with(
        "two.mcap",
        &file_by_another_program(&["/left", "/right"], None),
    );
    let said = refusal(&path);
    assert!(
        said.contains("/left") && said.contains("/right") && said.contains("mcap filter"),
        "{said}"
    );
}

/// A camera made of the shipped recording, its numbers with a hole in them.
struct Replayed {
    next: usize,
    live: bool,
    name: String,
    /// Frames come as fast as they are taken, each with so many bytes.
    flood: Option<usize>,
}

impl Source for Replayed {
    fn next_frame(&mut self) -> Result<Option<RawFrame>, SourceError> {
        let n = self.next;
        self.next += 1;
        if let Some(bytes) = self.flood {
            let raw = RawFrame {
                bytes: vec![n as u8; bytes],
                ..frame(n as u64, PixelFormat::Mjpeg)
            };
            return Ok((n < 400).then_some(raw));
        }
        let mut raw = support::recording().get(n).cloned();
        raw.iter_mut()
            .for_each(|r| r.sequence = Some(n as u64 + if n >= 100 { 3 } else { 0 }));
        Ok(raw)
    }

    fn describe(&self) -> SourceInfo {
        SourceInfo {
            name: self.name.clone(),
            format: FormatNote::default(),
            size: if self.flood.is_some() {
                SMALL
            } else {
                support::SIZE
            },
            nominal_rate_hz: Some(30.0),
            frames_total: None,
            live: self.live,
            depth: None,
        }
    }
}

fn record_to(path: &Path) -> RecordTo {
    let head = Head {
        size: Some(support::SIZE),
        ..head()
    };
    RecordTo {
        path: path.to_owned(),
        limits: Limits::default(),
        head,
        queue_bytes: QUEUE_BYTES,
    }
}

fn run(source: Box<dyn Source>, out: &Path, record: Option<RecordTo>) -> runtime::Summary {
    let job = Job {
        config: Config::default(),
        outline: Some(support::outline().into()),
        pace: Pace::Fast,
        length_s: None,
        stream: None,
        out: Some(out.to_owned()),
        record,
        notes: Default::default(),
        preview_every: Some(Duration::from_secs(2)),
    };
    let (summary, failure) = runtime::start(source, job).expect("start").join();
    assert!(failure.is_none(), "{failure:?}");
    summary.expect("a summary")
}

/// What `capture.json` says about time.
fn timing(dir: &Path) -> serde_json::Value {
    let text = std::fs::read(dir.join("capture.json")).expect("capture.json");
    serde_json::from_slice::<serde_json::Value>(&text).expect("json")["timing"].clone()
}

fn message_count(summary: &mcap::Summary, topic: &str) -> u64 {
    let channel = summary
        .channels
        .values()
        .find(|c| c.topic == topic)
        .unwrap_or_else(|| panic!("no {topic}"));
    let statistics = summary.stats.as_ref().expect("statistics");
    let counts = &statistics.channel_message_counts;
    counts.get(&channel.id).copied().unwrap_or(0)
}

/// The run that records and the replay of what it recorded: the same tracks, the same tree, the
/// same poses, and the camera's losses are losses again.
#[test]
fn a_replay_of_a_recording_is_the_run_that_made_it() {
    let dir = tempfile::tempdir().expect("tempdir");
    let (path, first, second) = (
        dir.path().join("run.mcap"),
        dir.path().join("first"),
        dir.path().join("second"),
    );
    let live = Box::new(Replayed {
        next: 0,
        live: false,
        name: path.display().to_string(),
        flood: None,
    });
    let recorded = run(live, &first, Some(record_to(&path)))
        .recorded
        .expect("recorded");
    assert_eq!((recorded.frames, recorded.files), (330, 1));
    run(
        source::open(&path, &Config::default(), None).expect("opened"),
        &second,
        None,
    );
    for name in [
        "tracks.csv",
        "left_out.csv",
        "nodes.csv",
        "motion.csv",
        "tree.glb",
    ] {
        let [live, again] = [&first, &second].map(|dir| std::fs::read(dir.join(name)));
        assert!(live.expect(name) == again.expect(name), "{name} differs");
    }
    assert_eq!(timing(&second)["frames_dropped_camera"], 3);
    assert_eq!(timing(&first)["gaps"], timing(&second)["gaps"]);
    // What was found is in it as well, under the names that viewers know.
    let bytes = std::fs::read(&path).expect("file");
    let summary = mcap::Summary::read(&bytes)
        .expect("summary")
        .expect("a summary");
    for topic in ["/camera/image", "/tree/points", "/tree/tracks"] {
        assert_eq!(message_count(&summary, topic), 330, "{topic}");
    }
    // The tree as it was built, and along its wood.
    assert_eq!(message_count(&summary, "/tree/outline"), 1);
    assert_eq!(message_count(&summary, "/tree/skeleton"), 2);
    let scenes = message_count(&summary, "/tree/scene");
    assert!(scenes > 80 && scenes == message_count(&summary, "/tree/poses"));
}

/// A camera is not made to wait for the disk. Whether the queue is ever full hangs on both; where it
/// is, what is missing is counted and told. A unit test of the recorder fills it for certain.
#[test]
fn what_the_recorder_cannot_keep_up_with_is_counted() {
    let dir = tempfile::tempdir().expect("tempdir");
    let path = dir.path().join("flood.mcap");
    let source = Box::new(Replayed {
        next: 0,
        live: true,
        name: "flood".into(),
        flood: Some(1 << 20),
    });
    // Room for two.
    let to = RecordTo {
        head: head(),
        queue_bytes: 2 << 20,
        ..record_to(&path)
    };
    let job = RecordJob {
        to,
        pace: Pace::Live,
        camera: Default::default(),
    };
    let running = runtime::record(source, job).expect("start");
    while !running.finished() {
        std::thread::sleep(Duration::from_millis(5));
    }
    let ((seen, lost, _, missing), warnings) = (running.counts(), running.warnings());
    let (recorded, failure) = running.join();
    let recorded = recorded.expect("recorded");
    assert!(failure.is_none() && seen == 400 && lost == 0, "{failure:?}");
    assert_eq!(
        recorded.frames + missing,
        400,
        "each frame is either there or counted"
    );
    let is_told = warnings.iter().any(|w| w.contains("does not keep up"));
    assert_eq!(is_told, missing > 0, "{missing} missing: {warnings:?}");
    let mut reader = Reader::open(&path).expect("opened");
    assert_eq!(
        std::iter::from_fn(|| reader.next_picture()).count() as u64,
        recorded.frames
    );
}

/// The largest file that is allowed stands for a disk without room: one line that says it, and a
/// file that reads.
#[test]
fn a_disk_without_room_ends_the_recording_in_words_and_leaves_it_readable() {
    let dir = tempfile::tempdir().expect("tempdir");
    let path = dir.path().join("full.mcap");
    let limited = "trap '' XFSZ; ulimit -f 3000; exec \"$0\" record \"$1\" \"$2\"";
    let mut command = std::process::Command::new("sh");
    command
        .args(["-c", limited, env!("CARGO_BIN_EXE_arborcam"), support::CLIP])
        .arg(&path);
    let output = command.output().expect("sh");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(
        said.contains("disk is full") && said.contains("readable"),
        "{said}"
    );
    let (read, _) = pictures(&std::fs::read(&path).expect("file"));
    assert!(read.len() > 10 && read.len() < 330, "{} frames", read.len());
    assert!(
        read.iter()
            .zip(support::recording())
            .all(|(p, raw)| p.bytes == raw.bytes)
    );
}

#[test]
fn what_cannot_be_recorded_or_played_is_refused_before_anything_is_done() {
    let dir = tempfile::tempdir().expect("tempdir");
    let taken = dir.path().join("taken.mcap");
    std::fs::write(&taken, b"mine").expect("write");
    let taken = taken.to_str().expect("path");
    let new = dir.path().join("new.mcap");
    let new = new.to_str().expect("path");
    let cases: [(&[&str], i32, &str); 7] = [
        (&["record", support::CLIP, taken], 2, "exists already"),
        (
            &["replay", support::CLIP, "--headless", "--record", taken],
            2,
            "exists already",
        ),
        (&["record", support::CLIP, "film.mkv"], 2, ".mcap"),
        (
            &["record", support::CLIP, new, "--max-size", "much"],
            2,
            "2GB",
        ),
        (
            &["record", support::CLIP, "/no/such/place.mcap"],
            1,
            "name a place",
        ),
        (&["record", "/dev/video987", new], 3, "not there"),
        (
            &["play", support::CLIP, "--to", "/dev/video987"],
            3,
            "modprobe v4l2loopback",
        ),
    ];
    for (arguments, status, word) in cases {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_arborcam"))
            .args(arguments)
            .output()
            .expect("run");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(status), "{arguments:?}: {said}");
        assert!(said.contains(word), "{arguments:?}: {said}");
    }
    assert_eq!(std::fs::read(taken).expect("file"), b"mine");
    assert!(!Path::new(new).exists());
}
