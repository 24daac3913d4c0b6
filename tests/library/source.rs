//! Frames from files: nothing is lost, invented or re-timed, and a bad input is refused in words.

use arborcam::config::Config;
use arborcam::model::{Luma, PixelFormat, RawFrame, Size};
use arborcam::source::{DecodeError, Decoder, Source, SourceError, open};
use std::path::{Path, PathBuf};
use std::process::Command;

const CLIP: &str = "recordings/sparse_winter.mkv";

fn ffmpeg(arguments: &[&str], out: &Path) {
    let status = Command::new("ffmpeg")
        .args(["-v", "error", "-nostdin", "-y"])
        .args(arguments)
        .arg(out)
        .status();
    assert!(status.expect("ffmpeg").success(), "ffmpeg {arguments:?}");
}

fn opened(input: &Path) -> Box<dyn Source> {
    open(input, &Config::default(), None).unwrap_or_else(|e| panic!("{e}"))
}

fn refused(input: &Path) -> SourceError {
    let error = open(input, &Config::default(), None)
        .err()
        .expect("an error");
    let line = error.to_string();
    assert!(
        !line.contains('\n') && line.contains(&input.display().to_string()),
        "one line that names the input: {line}"
    );
    error
}

fn all(source: &mut dyn Source) -> Vec<RawFrame> {
    std::iter::from_fn(|| source.next_frame().unwrap_or_else(|e| panic!("{e}"))).collect()
}

fn empty_luma() -> Luma {
    Luma {
        size: Size::new(0, 0),
        pixels: Vec::new(),
    }
}

fn luma(frame: &RawFrame) -> Result<Luma, DecodeError> {
    let mut picture = empty_luma();
    Decoder::new()?.luma(frame, &mut picture).map(|()| picture)
}

/// Mean absolute difference of two pictures.
fn difference(a: &[u8], b: &[u8]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter()
        .zip(b)
        .map(|(a, b)| f64::from(a.abs_diff(*b)))
        .sum::<f64>()
        / a.len() as f64
}

/// A smooth coloured picture.
fn sample(width: u32, height: u32) -> image::RgbImage {
    image::RgbImage::from_fn(width, height, |x, y| {
        image::Rgb([
            (x * 255 / width) as u8,
            (y * 255 / height) as u8,
            ((x + y) * 255 / (width + height)) as u8,
        ])
    })
}

fn jpeg(width: u32, height: u32) -> Vec<u8> {
    let mut bytes = Vec::new();
    image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 95)
        .encode_image(&sample(width, height))
        .expect("jpeg");
    bytes
}

fn mjpeg_frame(bytes: Vec<u8>, width: u32, height: u32) -> RawFrame {
    RawFrame {
        sequence: Some(7),
        sensor_time_s: 0.0,
        size: Size::new(width, height),
        format: PixelFormat::Mjpeg,
        bytes,
        depth: None,
    }
}

/// Presentation times as ffprobe reads them from the file, s, in order.
fn times_in(file: &Path) -> Vec<f64> {
    let out = Command::new("ffprobe")
        .args([
            "-v",
            "error",
            "-show_entries",
            "packet=pts_time",
            "-of",
            "csv=p=0",
        ])
        .arg(file)
        .output()
        .expect("ffprobe");
    let text = String::from_utf8(out.stdout).expect("text");
    let mut times: Vec<f64> = text
        .lines()
        .map(|l| l.trim_matches(',').parse().expect("a time"))
        .collect();
    times.sort_by(f64::total_cmp);
    times
}

#[test]
fn the_shipped_recording_is_read_frame_by_frame_as_it_is() {
    let mut source = opened(Path::new(CLIP));
    let info = source.describe();
    assert_eq!(
        (info.size, info.frames_total, info.live),
        (Size::new(640, 360), Some(330), false)
    );
    assert_eq!(info.format.given, "MJPG 640x360 @ 30");
    let frames = all(source.as_mut());
    assert_eq!(source.warnings(), Vec::<String>::new());
    assert!(frames.iter().map(|f| f.sequence).eq((0..330).map(Some)));
    let mut decoder = Decoder::new().expect("decoder");
    let mut picture = empty_luma();
    for frame in &frames {
        assert_eq!(frame.format, PixelFormat::Mjpeg);
        decoder
            .luma(frame, &mut picture)
            .unwrap_or_else(|e| panic!("{e}"));
    }
    assert!(
        matches!(source.next_frame(), Ok(None)),
        "the end stays the end"
    );
}

#[test]
fn frames_keep_the_times_of_the_file_also_where_the_rate_varies() {
    let dir = tempfile::tempdir().expect("tempdir");
    let varying = "settb=1/90000,setpts='(N+N*N/20)*1000'";
    // The names must not be taken for options or protocols.
    for (name, codec, format) in [
        ("-v.mkv", "mjpeg", PixelFormat::Mjpeg),
        ("http:x.mp4", "mjpeg", PixelFormat::Mjpeg),
        ("a b%03d.mp4", "libx264", PixelFormat::Yuyv),
    ] {
        let file = dir.path().join(name);
        let input = [
            "-f",
            "lavfi",
            "-i",
            "testsrc2=s=320x180:r=30:d=2",
            "-vf",
            varying,
            "-c:v",
            codec,
        ];
        let made = dir.path().join(if name.ends_with("mkv") {
            "made.mkv"
        } else {
            "made.mp4"
        });
        let passthrough = [
            "-vsync",
            "passthrough",
            "-enc_time_base",
            "1/90000",
            "-pix_fmt",
        ];
        let pixels = if codec == "mjpeg" {
            "yuvj420p"
        } else {
            "yuv420p"
        };
        ffmpeg(&[&input[..], &passthrough[..], &[pixels]].concat(), &made);
        std::fs::rename(&made, &file).expect("rename");
        let wanted = times_in(&file);
        assert!(
            wanted
                .windows(3)
                .any(|t| (t[2] - 2.0 * t[1] + t[0]).abs() > 1e-3),
            "the clip's rate varies"
        );
        let frames = all(opened(&file).as_mut());
        assert_eq!(frames.len(), wanted.len(), "{name}");
        for (frame, time_s) in frames.iter().zip(&wanted) {
            assert_eq!(frame.format, format);
            let off = frame.sensor_time_s - frames[0].sensor_time_s - (time_s - wanted[0]);
            assert!(
                off.abs() < 2e-6,
                "{name}: frame {:?} is off by {off} s",
                frame.sequence
            );
        }
    }
}

#[test]
fn containers_and_odd_sizes_are_read() {
    let dir = tempfile::tempdir().expect("tempdir");
    for (name, arguments, size, count) in [
        (
            "a.avi",
            &[
                "-i",
                "testsrc2=s=320x180:r=25:d=1",
                "-c:v",
                "mjpeg",
                "-pix_fmt",
                "yuvj422p",
            ][..],
            (320, 180),
            25,
        ),
        (
            "b.mkv",
            &[
                "-i",
                "testsrc=s=321x181:r=25:d=1",
                "-c:v",
                "ffv1",
                "-pix_fmt",
                "yuv420p",
            ][..],
            (320, 181),
            25,
        ),
        (
            "c.mp4",
            &[
                "-i",
                "testsrc2=s=320x180:r=50:d=1",
                "-c:v",
                "libx264",
                "-bf",
                "3",
            ][..],
            (320, 180),
            50,
        ),
    ] {
        let file = dir.path().join(name);
        ffmpeg(&[&["-f", "lavfi"], arguments].concat(), &file);
        let mut source = opened(&file);
        let info = source.describe();
        assert_eq!(
            (info.size, info.frames_total),
            (Size::new(size.0, size.1), Some(count)),
            "{name}"
        );
        let frames = all(source.as_mut());
        assert_eq!(frames.len() as u64, count, "{name}");
        assert_eq!(source.warnings(), Vec::<String>::new(), "{name}");
        assert!(
            frames
                .windows(2)
                .all(|w| w[0].sensor_time_s < w[1].sensor_time_s),
            "{name}"
        );
        assert!(luma(&frames[0]).is_ok(), "{name}");
    }
}

#[test]
fn a_clip_cut_in_the_middle_is_used_as_far_as_it_goes_and_says_so() {
    let dir = tempfile::tempdir().expect("tempdir");
    let whole = std::fs::read(CLIP).expect("clip");
    let moved = dir.path().join("moved.mp4");
    ffmpeg(
        &["-i", CLIP, "-c", "copy", "-movflags", "+faststart"],
        &moved,
    );
    let avi = dir.path().join("whole.avi");
    ffmpeg(&["-i", CLIP, "-c", "copy"], &avi);
    let [moved, avi] = [&moved, &avi].map(|f| std::fs::read(f).expect("file"));
    for (name, bytes) in [("cut.mkv", whole), ("cut.mp4", moved), ("cut.avi", avi)] {
        let file = dir.path().join(name);
        std::fs::write(&file, &bytes[..bytes.len() / 2]).expect("write");
        let mut source = opened(&file);
        let frames = all(source.as_mut());
        assert!(
            (150..=170).contains(&frames.len()),
            "{name}: {} frames",
            frames.len()
        );
        for frame in &frames {
            luma(frame).unwrap_or_else(|e| panic!("{name}: {e}"));
        }
        let said = source.warnings();
        assert!(
            said.len() == 1 && said[0].contains("clip ends early"),
            "{name}: {said:?}"
        );
        assert!(
            said[0].contains(&frames.len().to_string()),
            "{name}: {said:?}"
        );
    }
}

#[test]
fn what_cannot_be_read_is_refused_by_kind() {
    let dir = tempfile::tempdir().expect("tempdir");
    let file = |name: &str, content: &[u8]| -> PathBuf {
        let path = dir.path().join(name);
        std::fs::write(&path, content).expect("write");
        path
    };
    assert!(matches!(
        refused(Path::new("/no/such/clip.mkv")),
        SourceError::Absent { .. }
    ));
    assert!(matches!(
        refused(Path::new("/dev/video987")),
        SourceError::Absent { .. }
    ));
    assert!(matches!(
        refused(Path::new("/dev/null")),
        SourceError::BadFormat { .. }
    ));
    assert!(matches!(
        refused(&file("text.txt", b"Hello, this is no video.\n")),
        SourceError::BadFormat { .. }
    ));
    assert!(matches!(
        refused(&file("text.mkv", &b"words ".repeat(5000))),
        SourceError::BadFormat { .. }
    ));
    assert!(matches!(
        refused(&file("empty.mkv", b"")),
        SourceError::BadFormat { .. }
    ));
    assert!(matches!(
        refused(&file("photo.jpg", &jpeg(64, 48))),
        SourceError::BadFormat { .. }
    ));
    let mcap = refused(&file("film.mcap", b"\x89MCAP0\r\n"));
    assert!(
        matches!(mcap, SourceError::BadFormat { .. })
            && mcap.to_string().contains("no picture in it"),
        "{mcap}"
    );
    let sound = dir.path().join("sound.mkv");
    ffmpeg(&["-f", "lavfi", "-i", "sine=d=1"], &sound);
    assert!(refused(&sound).to_string().contains("no video"));
    // An .mp4 has its index at the end: cut, nothing of it can be read.
    let cut = dir.path().join("whole.mp4");
    ffmpeg(&["-i", CLIP, "-c", "copy"], &cut);
    let bytes = std::fs::read(&cut).expect("read");
    assert!(
        refused(&file("cut.mp4", &bytes[..bytes.len() / 2]))
            .to_string()
            .contains("cut short")
    );
}

#[test]
fn a_video_without_frames_is_empty() {
    let dir = tempfile::tempdir().expect("tempdir");
    let (head, clip) = (
        dir.path().join("head.mkv"),
        std::fs::read(CLIP).expect("clip"),
    );
    // Everything up to the first cluster: a stream is announced and nothing follows.
    let cluster = clip
        .windows(4)
        .position(|w| w == [0x1F, 0x43, 0xB6, 0x75])
        .expect("a cluster");
    std::fs::write(&head, &clip[..cluster]).expect("write");
    assert!(matches!(
        refused(&head),
        SourceError::Empty { .. } | SourceError::BadFormat { .. }
    ));
    let none = dir.path().join("none.avi");
    ffmpeg(&["-i", CLIP, "-c", "copy", "-frames:v", "0"], &none);
    assert!(matches!(refused(&none), SourceError::Empty { .. }));
}

#[test]
fn a_file_without_permission_is_denied() {
    use std::os::unix::fs::PermissionsExt;
    let dir = tempfile::tempdir().expect("tempdir");
    let file = dir.path().join("mine.mkv");
    std::fs::write(&file, b"secret").expect("write");
    std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o000)).expect("chmod");
    // Root may read everything: then there is nothing to be seen here.
    if std::fs::File::open(&file).is_err() {
        let error = refused(&file);
        assert!(
            matches!(error, SourceError::Denied { .. }) && error.to_string().contains("chmod"),
            "{error}"
        );
    }
}

#[test]
fn pictures_come_in_the_order_of_their_numbers_at_the_given_rate() {
    let dir = tempfile::tempdir().expect("tempdir");
    for n in [1, 2, 9, 10, 11, 100] {
        let grey = image::GrayImage::from_pixel(32, 24, image::Luma([n as u8]));
        grey.save(dir.path().join(format!("f{n}.{}", ["PNG", "bmp"][n % 2])))
            .expect("save");
    }
    std::fs::write(dir.path().join("notes.txt"), "not a picture").expect("write");
    let mut source =
        open(dir.path(), &Config::default(), Some(20.0)).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(
        (
            source.describe().frames_total,
            source.describe().nominal_rate_hz
        ),
        (Some(6), Some(20.0))
    );
    let frames = all(source.as_mut());
    let shades: Vec<u8> = frames
        .iter()
        .map(|f| luma(f).expect("luma").pixels[0])
        .collect();
    assert_eq!(shades, [1, 2, 9, 10, 11, 100]);
    assert!(frames.iter().map(|f| f.sequence).eq((0..6).map(Some)));
    assert!((frames[5].sensor_time_s - 0.25).abs() < 1e-12);
}

#[test]
fn a_folder_names_the_picture_that_does_not_fit() {
    let dir = tempfile::tempdir().expect("tempdir");
    assert!(matches!(refused(dir.path()), SourceError::Empty { .. }));
    std::fs::write(dir.path().join("a1.jpg"), jpeg(64, 48)).expect("write");
    for (name, bytes, word) in [
        ("a2.jpg", jpeg(80, 48), "80x48"),
        ("a2.png", b"no picture".to_vec(), "a2.png"),
    ] {
        let path = dir.path().join(name);
        std::fs::write(&path, bytes).expect("write");
        let mut source = opened(dir.path());
        assert!(source.next_frame().expect("the first is good").is_some());
        let error = source
            .next_frame()
            .expect_err("the second is not")
            .to_string();
        assert!(error.contains(name) && error.contains(word), "{error}");
        std::fs::remove_file(path).expect("remove");
    }
    for rate in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = open(dir.path(), &Config::default(), Some(rate))
            .err()
            .expect("no rate");
        assert!(error.to_string().contains("--fps"), "{error}");
    }
}

#[test]
fn every_format_decodes_to_the_same_brightness() {
    let (width, height) = (160, 120);
    let picture = sample(width, height);
    let size = Size::new(width, height);
    let grey: Vec<u8> = picture
        .pixels()
        .map(|p| {
            (0.299 * f64::from(p[0]) + 0.587 * f64::from(p[1]) + 0.114 * f64::from(p[2])).round()
                as u8
        })
        .collect();
    let yuyv: Vec<u8> = grey.iter().flat_map(|&y| [y, 128]).collect();
    let uyvy: Vec<u8> = grey.iter().flat_map(|&y| [128, y]).collect();
    let nv12 = [grey.clone(), vec![128; grey.len() / 2]].concat();
    for (format, bytes, limit) in [
        (PixelFormat::Uyvy, uyvy, 0.0),
        (PixelFormat::Nv12, nv12, 0.0),
        (PixelFormat::Rgb24, picture.clone().into_raw(), 0.5),
        (PixelFormat::Yuyv, yuyv, 0.0),
        (PixelFormat::Grey, grey.clone(), 0.0),
        (PixelFormat::Mjpeg, jpeg(width, height), 1.5),
    ] {
        let frame = RawFrame {
            sequence: Some(0),
            sensor_time_s: 0.0,
            size,
            format,
            bytes,
            depth: None,
        };
        let found = luma(&frame).expect("luma");
        let off = difference(&found.pixels, &grey);
        assert!(
            found.size == size && off <= limit,
            "{format} is off by {off}"
        );
        for max_width in [1000, 100, 20, 7] {
            let small = Decoder::new()
                .expect("decoder")
                .preview(&frame, max_width)
                .expect("preview");
            assert!(
                small.size.width <= max_width.min(width)
                    && small.size.width * 3 > max_width.min(width),
                "{format}"
            );
            assert_eq!(small.pixels.len(), 3 * small.size.area());
        }
    }
}

#[test]
fn the_preview_shows_the_colours_of_the_picture() {
    // Red on the left, blue on the right, in BT.601 with limited range.
    let line = |left: &[u8], right: &[u8]| [left.repeat(16), right.repeat(16)].concat();
    let nv12_luma = line(&[81, 81], &[41, 41]).repeat(8);
    let nv12_colour = line(&[90, 240], &[240, 110]).repeat(4);
    for (format, bytes) in [
        (
            PixelFormat::Yuyv,
            line(&[81, 90, 81, 240], &[41, 240, 41, 110]).repeat(8),
        ),
        (
            PixelFormat::Uyvy,
            line(&[90, 81, 240, 81], &[240, 41, 110, 41]).repeat(8),
        ),
        (PixelFormat::Nv12, [nv12_luma, nv12_colour].concat()),
    ] {
        let frame = RawFrame {
            sequence: None,
            sensor_time_s: 0.0,
            size: Size::new(64, 8),
            format,
            bytes,
            depth: None,
        };
        let small = Decoder::new()
            .expect("decoder")
            .preview(&frame, 32)
            .expect("preview");
        assert_eq!(small.size, Size::new(32, 4));
        for (u, wanted) in [(3, [255, 0, 0]), (28, [0, 0, 255])] {
            assert!(
                difference(&small.at(u, 2), &wanted) < 3.0,
                "{format}: {:?}",
                small.at(u, 2)
            );
        }
    }
}

#[test]
fn a_damaged_jpeg_is_an_error_and_never_a_grey_picture() {
    let whole = jpeg(160, 120);
    let end = whole.len();
    let mut decoder = Decoder::new().expect("decoder");
    let mut into = empty_luma();
    for cut in [0, 2, 10, 300, end / 2, end - 20] {
        let frame = mjpeg_frame(whole[..cut].to_vec(), 160, 120);
        let error = decoder.luma(&frame, &mut into).expect_err("cut");
        assert!(
            matches!(error, DecodeError::Damaged { .. }),
            "cut at {cut}: {error}"
        );
        assert!(decoder.preview(&frame, 80).is_err(), "cut at {cut}");
    }
    let mut holed = whole.clone();
    holed[end / 2..end / 2 + 64].fill(0);
    assert!(
        decoder
            .luma(&mjpeg_frame(holed, 160, 120), &mut into)
            .is_err()
    );
    // The decoder is as good as new, and a camera's filling bytes do no harm.
    decoder
        .luma(&mjpeg_frame(whole.clone(), 160, 120), &mut into)
        .expect("whole");
    let filled = [&whole[..end - 2], &[0, 0], &whole[end - 2..], &[0; 500]].concat();
    let mut same = empty_luma();
    decoder
        .luma(&mjpeg_frame(filled, 160, 120), &mut same)
        .expect("filled");
    assert_eq!(into, same);
    let short = RawFrame {
        format: PixelFormat::Yuyv,
        bytes: vec![0; 1000],
        ..mjpeg_frame(Vec::new(), 160, 120)
    };
    assert!(matches!(
        decoder.luma(&short, &mut into),
        Err(DecodeError::Damaged { .. })
    ));
}

#[test]
fn a_picture_of_another_size_is_named_with_both_sizes() {
    let mut decoder = Decoder::new().expect("decoder");
    let mut into = empty_luma();
    decoder
        .luma(&mjpeg_frame(jpeg(160, 120), 160, 120), &mut into)
        .expect("first");
    // What the source says and what the picture says differ; and: the source itself has changed.
    for frame in [
        mjpeg_frame(jpeg(80, 60), 160, 120),
        mjpeg_frame(jpeg(80, 60), 80, 60),
    ] {
        let error = decoder.luma(&frame, &mut into).expect_err("changed");
        assert!(matches!(error, DecodeError::SizeChanged { .. }));
        let line = error.to_string();
        assert!(line.contains("160x120") && line.contains("80x60"), "{line}");
    }
}

#[test]
fn a_jpeg_without_huffman_tables_decodes_as_webcams_send_it() {
    let dir = tempfile::tempdir().expect("tempdir");
    let file = dir.path().join("one.avi");
    // ffmpeg's encoder with the standard's own tables, which are those that a camera leaves out.
    let input = [
        "-f",
        "lavfi",
        "-i",
        "testsrc2=s=320x240:r=5:d=1",
        "-c:v",
        "mjpeg",
        "-huffman",
        "default",
    ];
    ffmpeg(
        &[&input[..], &["-pix_fmt", "yuvj422p", "-q:v", "3"]].concat(),
        &file,
    );
    let frame = all(opened(&file).as_mut()).swap_remove(0);
    let wanted = luma(&frame).expect("with tables");
    let mut bytes = frame.bytes.clone();
    let mut removed = 0;
    while let Some(at) = bytes.windows(2).position(|w| w == [0xFF, 0xC4]) {
        let length = usize::from(u16::from_be_bytes([bytes[at + 2], bytes[at + 3]]));
        bytes.drain(at..at + 2 + length);
        removed += 1;
    }
    assert!(removed > 0, "the test's picture had tables");
    let stripped = RawFrame {
        bytes,
        ..frame.clone()
    };
    // A decoder of its own: one that has seen tables before would remember them.
    assert_eq!(luma(&stripped).expect("without tables"), wanted);
    // Wrong tables in one damaged picture spoil that one only.
    let mut spoilt = frame.clone();
    let at = spoilt
        .bytes
        .windows(2)
        .position(|w| w == [0xFF, 0xC4])
        .expect("tables")
        + 5;
    spoilt.bytes[at..at + 16].fill(7);
    let (mut decoder, mut into) = (Decoder::new().expect("decoder"), empty_luma());
    assert!(decoder.luma(&spoilt, &mut into).is_err());
    decoder
        .luma(&stripped, &mut into)
        .expect("the next picture is whole");
    assert_eq!(into, wanted);
}

#[test]
fn no_damage_to_a_picture_reaches_the_next_one() {
    let whole = mjpeg_frame(jpeg(160, 120), 160, 120);
    let wanted = luma(&whole).expect("whole");
    let mut decoder = Decoder::new().expect("decoder");
    let mut refused = 0;
    for at in 0..whole.bytes.len() {
        for value in [0x00, 0x7F, 0xFF] {
            let mut bytes = whole.bytes.clone();
            let end = (at + 1 + at % 7).min(bytes.len());
            bytes[at..end].fill(value);
            let mut into = empty_luma();
            refused += usize::from(
                decoder
                    .luma(&mjpeg_frame(bytes, 160, 120), &mut into)
                    .is_err(),
            );
            let mut next = empty_luma();
            decoder
                .luma(&whole, &mut next)
                .unwrap_or_else(|e| panic!("after damage at {at}: {e}"));
            assert!(next == wanted, "after damage at {at}");
        }
    }
    assert!(
        refused * 2 > whole.bytes.len(),
        "{refused} of {} damages noticed",
        3 * whole.bytes.len()
    );
}
