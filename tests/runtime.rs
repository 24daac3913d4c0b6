//! The pipeline on threads: the same result as without them, wishes honoured, losses counted, and
//! an end in any case.

#[path = "support/strokes.rs"]
mod strokes;
mod support;

use arborcam::cancel::CancelToken;
use arborcam::config::{Config, Dynamics};
use arborcam::model::{
    Control, FormatNote, LocalTime, NodeName, Outline, PixelFormat, RawFrame, Size, SwayNow,
    Swaying, TrackId,
};
use arborcam::outline::{Given, Mark, Scribbles};
use arborcam::pipeline::Pipeline;
use arborcam::runtime::{self, Failure, Job, Pace, Running, Summary};
use arborcam::source::{Source, SourceError, SourceInfo};
use nalgebra::Point2;
use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, mpsc};
use std::time::{Duration, Instant};
use strokes::{ACROSS, ALONG_SKY, covered};
use support::{SIZE, recording};

/// A run that has not ended after so long hangs.
const HANGS: Duration = Duration::from_secs(60);

/// What a source does when it is asked for frame `n`.
type Script = Box<dyn FnMut(u64) -> Result<Option<RawFrame>, SourceError> + Send>;

struct Fake {
    next: u64,
    live: bool,
    script: Script,
}

impl Source for Fake {
    fn next_frame(&mut self) -> Result<Option<RawFrame>, SourceError> {
        self.next += 1;
        (self.script)(self.next - 1)
    }

    fn describe(&self) -> SourceInfo {
        SourceInfo {
            name: "fake".into(),
            format: FormatNote::default(),
            size: SIZE,
            nominal_rate_hz: Some(30.0),
            frames_total: None,
            live: self.live,
            depth: None,
        }
    }
}

fn frame(n: u64) -> Option<RawFrame> {
    recording().get(n as usize).cloned()
}

fn fake(
    live: bool,
    script: impl FnMut(u64) -> Result<Option<RawFrame>, SourceError> + Send + 'static,
) -> Box<Fake> {
    Box::new(Fake {
        next: 0,
        live,
        script: Box::new(script),
    })
}

/// The recording, waiting before frame `at` until it is let go on.
fn gated(at: u64) -> (Box<Fake>, Gate) {
    gated_film(at, frame)
}

/// The same with a film of these frames.
fn gated_film(
    at: u64,
    frame: impl Fn(u64) -> Option<RawFrame> + Send + 'static,
) -> (Box<Fake>, Gate) {
    let (reached_in, reached) = mpsc::channel();
    let (open, opened) = mpsc::channel::<()>();
    let taken = Arc::new(AtomicU64::new(0));
    let count = taken.clone();
    let source = fake(false, move |n| {
        count.store(n, Ordering::SeqCst);
        if n == at {
            let _ = reached_in.send(());
            let _ = opened.recv();
        }
        Ok(frame(n))
    });
    (
        source,
        Gate {
            reached,
            open,
            taken,
        },
    )
}

struct Gate {
    reached: mpsc::Receiver<()>,
    open: mpsc::Sender<()>,
    /// Number of the frame that was asked for last.
    taken: Arc<AtomicU64>,
}

/// Standard output of a test.
#[derive(Clone, Default)]
struct Lines(Arc<Mutex<Vec<u8>>>);

impl Write for Lines {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().expect("lines").extend(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn job(outline: Option<Outline>, out: Option<&Path>) -> Job {
    Job {
        config: Config::default(),
        outline: outline.map(Given::Region),
        pace: Pace::Fast,
        length_s: None,
        stream: None,
        out: out.map(Path::to_path_buf),
        record: None,
        notes: Default::default(),
        preview_every: Some(Duration::from_secs(2)),
    }
}

/// How a run ended; fails if it does not.
fn ended(running: Running) -> (Option<Summary>, Option<Failure>, Vec<String>) {
    let (done, wait) = mpsc::channel();
    std::thread::spawn(move || {
        while !running.finished() {
            std::thread::sleep(Duration::from_millis(5));
        }
        let warnings = running.warnings();
        let (summary, failure) = running.join();
        let _ = done.send((summary, failure, warnings));
    });
    wait.recv_timeout(HANGS).expect("the run hangs")
}

fn run(source: Box<Fake>, job: Job) -> (Option<Summary>, Option<Failure>, Vec<String>) {
    ended(runtime::start(source, job).expect("start"))
}

/// Sends `wishes` before frame `at` is taken, and waits for the end.
fn wish(at: u64, wishes: &[Control], out: &Path) -> (Summary, Vec<String>) {
    wish_in(gated(at), wishes, out)
}

/// The same while another film waits at its gate.
fn wish_in(
    (source, gate): (Box<Fake>, Gate),
    wishes: &[Control],
    out: &Path,
) -> (Summary, Vec<String>) {
    let running = runtime::start(source, job(Some(support::outline()), Some(out))).expect("start");
    gate.reached
        .recv_timeout(HANGS)
        .expect("the gate is reached");
    wishes.iter().for_each(|w| running.send(w.clone()));
    gate.open.send(()).expect("the source waits");
    let (summary, failure, warnings) = ended(running);
    assert!(failure.is_none(), "{failure:?}");
    (summary.expect("a summary"), warnings)
}

/// Track id and frame of every row of `tracks.csv`.
fn tracks(out: &Path) -> Vec<(u64, u64)> {
    let text = std::fs::read_to_string(out.join("tracks.csv")).expect("tracks.csv");
    let cell = |l: &str, c: usize| {
        l.split(',')
            .nth(c)
            .and_then(|x| x.parse().ok())
            .expect("a number")
    };
    text.lines()
        .skip(1)
        .map(|l| (cell(l, 0), cell(l, 1)))
        .collect()
}

/// The sways of a stream, by the frame up to which each was analysed.
fn streamed_sways(stream: &str) -> BTreeMap<u64, serde_json::Value> {
    let mut told = BTreeMap::new();
    for line in stream.lines() {
        let line: serde_json::Value = serde_json::from_str(line).expect("JSON");
        if let Some(frame) = line["sway"]["frame"].as_u64() {
            told.insert(frame, line["sway"].clone());
        }
    }
    told
}

/// The same numbers to the digits of the stream, or the same reason why there are none.
fn same_swaying(told: &serde_json::Value, found: Swaying) {
    match found {
        Ok(sway) => {
            let damping = sway.damping_ratio.map(|d| d.value);
            let numbers = [
                ("frequency_hz", Some(sway.frequency_hz.value)),
                ("frequency_lo_hz", Some(sway.frequency_hz.lo)),
                ("damping_ratio", damping),
                ("amplitude_deg", Some(sway.amplitude_deg)),
            ];
            for (name, expected) in numbers {
                let off = told[name].as_f64().zip(expected).map(|(a, b)| a - b);
                let is_same = match off {
                    Some(off) => off.abs() < 1e-5,
                    None => told[name].is_null() && expected.is_none_or(|x| !x.is_finite()),
                };
                assert!(is_same, "{name} is {expected:?}, the stream has {told}");
            }
        }
        Err(why) => assert_eq!(told["unidentified"], why.word(), "{told}"),
    }
}

/// The last stage, too: the stream has the answer of the analysis up to the frame that it names.
#[test]
fn threads_stream_the_same_sway_as_none() {
    let mut config = Config::default();
    config.dynamics.every_s = 0.5;
    let lines = Lines::default();
    let streamed = Job {
        config: config.clone(),
        stream: Some(Box::new(lines.clone())),
        ..job(Some(support::outline()), None)
    };
    let (_, failure, _) = run(fake(false, |n| Ok(frame(n))), streamed);
    assert!(failure.is_none(), "{failure:?}");
    let text = String::from_utf8(lines.0.lock().expect("lines").clone()).expect("text");
    let told = streamed_sways(&text);

    let mut pipeline = Pipeline::new(&config, Some(support::outline())).expect("decoder");
    let (mut compared, mut identified) = (0, 0);
    for k in 0..recording().len() {
        for moved in pipeline.step(&support::timed(k)).expect("picture") {
            let Some(told) = told.get(&moved.tracks.frame) else {
                continue;
            };
            let sway = pipeline.sway(&moved, &CancelToken::new()).expect("a tree");
            assert_eq!(told["excitation"], excitation_word(&sway), "{told}");
            for branch in told["branches"].as_array().expect("branches") {
                let name = NodeName(branch["node_id"].as_u64().expect("a number") as u32);
                let found = sway.branches[&name].swaying;
                same_swaying(branch, found);
                compared += 1;
                identified += usize::from(found.is_ok());
            }
        }
    }
    assert!(told.len() > 2 && compared > 10, "{compared} branches");
    assert!(identified > 2, "{identified} of {compared} branches");
}

fn excitation_word(sway: &SwayNow) -> serde_json::Value {
    sway.excitation.map(|e| e.word()).into()
}

/// What the program means is one synchronous step a frame; threads must not change it.
#[test]
fn threads_give_the_same_poses_as_none() {
    for outline in [Some(support::outline()), None] {
        let lines = Lines::default();
        let streamed = Job {
            stream: Some(Box::new(lines.clone())),
            ..job(outline.clone(), None)
        };
        let (summary, failure, _) = run(fake(false, |n| Ok(frame(n))), streamed);
        assert!(failure.is_none(), "{failure:?}");
        let text = String::from_utf8(lines.0.lock().expect("lines").clone()).expect("text");

        let mut pipeline = Pipeline::new(&Config::default(), outline.clone()).expect("decoder");
        let (mut moved, mut trees) = (Vec::new(), Vec::new());
        for k in 0..recording().len() {
            let done = pipeline.step(&support::timed(k)).expect("picture");
            trees.extend(done.iter().map(|_| pipeline.back.model().cloned()));
            moved.extend(done);
        }
        moved.extend(pipeline.finish());
        trees.resize(moved.len(), pipeline.back.model().cloned());
        assert!(
            moved
                .iter()
                .map(|m| m.tracks.frame)
                .eq(0..recording().len() as u64),
            "every frame, in order"
        );

        let (tree, threaded) = (
            pipeline.back.model().expect("tree"),
            summary.and_then(|s| s.tree).expect("tree"),
        );
        assert_eq!(*tree.skeleton, *threaded.skeleton);
        assert_eq!(
            (tree.frame, &tree.evidence),
            (threaded.frame, &threaded.evidence)
        );
        assert!(
            tree.refinements > 0 && tree.refinements == threaded.refinements,
            "{} refinements",
            tree.refinements
        );

        let mut lines = text.lines();
        let mut poses = 0;
        for (pose, tree) in moved
            .iter()
            .zip(&trees)
            .filter_map(|(m, tree)| m.pose.as_ref().zip(tree.as_ref()))
        {
            let nodes: Vec<String> = tree.skeleton.nodes[..tree.skeleton.measured()]
                .iter()
                .zip(&pose.joints)
                .map(|(n, j)| {
                    format!(
                        "[{},{:.3},{:.3},{:.3}]",
                        n.name.0, j.position.x, j.position.y, j.position.z
                    )
                })
                .collect();
            let expected = format!(
                "{{\"frame\":{},\"time_s\":{:.6},\"nodes\":[{}]}}",
                pose.frame,
                pose.time_s,
                nodes.join(",")
            );
            let line = lines.next().unwrap_or_default();
            // After the nodes a line may have the sway and the verdict.
            let alone = line
                .split_once("]],")
                .map_or(line.to_owned(), |(poses, _)| format!("{poses}]]}}"));
            assert_eq!(alone, expected, "frame {}", pose.frame);
            poses += 1;
        }
        assert!(poses > 80 && lines.next().is_none(), "{poses} poses");
    }
}

/// Whoever reads the sway of a recording gets the same however fast its frames come.
#[test]
fn the_sway_is_told_in_the_same_frames_however_slow_the_source_is() {
    let streamed = |pause: Duration| {
        let lines = Lines::default();
        let job = Job {
            stream: Some(Box::new(lines.clone())),
            ..job(Some(support::outline()), None)
        };
        let source = fake(false, move |n| {
            std::thread::sleep(pause);
            Ok(frame(n))
        });
        let (_, failure, _) = run(source, job);
        assert!(failure.is_none(), "{failure:?}");
        let text = lines.0.lock().expect("lines").clone();
        String::from_utf8(text).expect("text")
    };
    let (fast, slow) = (
        streamed(Duration::ZERO),
        streamed(Duration::from_millis(20)),
    );
    assert!(fast.contains(",\"sway\":{"), "no sway is told");
    assert!(fast == slow, "the stream depends on the clock");
}

/// A sway is looked at in most of the film's last second: a wish to stop must not wait for it, nor
/// for the whole analysis of a film that nobody writes.
#[test]
fn a_stop_while_the_sway_is_looked_at_ends_quickly() {
    for at in [245, 290] {
        let (source, gate) = gated(at);
        let config = Config {
            dynamics: Dynamics {
                every_s: 0.05,
                ..Dynamics::default()
            },
            ..Config::default()
        };
        let lines = Lines::default();
        let job = Job {
            config,
            stream: Some(Box::new(lines.clone())),
            ..job(Some(support::outline()), None)
        };
        let running = runtime::start(source, job).expect("start");
        gate.reached
            .recv_timeout(HANGS)
            .expect("the gate is reached");
        running.send(Control::Quit);
        gate.open.send(()).expect("the source waits");
        let began = Instant::now();
        let (summary, failure, _) = ended(running);
        assert!(failure.is_none() && summary.is_some(), "{failure:?}");
        assert!(
            began.elapsed() < Duration::from_secs(5),
            "{:?} from the wish to the end",
            began.elapsed()
        );
    }
}

#[test]
fn build_now_builds_early() {
    let dir = tempfile::tempdir().expect("tempdir");
    let (summary, _) = wish(60, &[Control::BuildNow], &dir.path().join("out"));
    let tree = summary.tree.expect("a tree");
    assert!(
        tree.first.forced && (55..=62).contains(&tree.first.frame),
        "built after frame {}",
        tree.first.frame
    );
}

#[test]
fn restart_starts_over_with_new_ids() {
    let (dir, whole) = (
        tempfile::tempdir().expect("tempdir"),
        recording().len() as u64,
    );
    let out = dir.path().join("out");
    let (summary, _) = wish(150, &[Control::Restart], &out);
    let tracks = tracks(&out);
    let first = tracks.iter().map(|t| t.1).min().expect("tracks");
    assert!(
        (140..=151).contains(&first),
        "tracks begin in frame {first}"
    );
    assert_eq!(tracks.iter().map(|t| t.1).max(), Some(whole - 1));
    // Some 390 points were followed before; none of their names comes back.
    let lowest = tracks.iter().map(|t| t.0).min().expect("tracks");
    assert!(lowest >= 380, "id {lowest} was in use before");
    assert!(summary.tree.expect("a tree").frame > first);
}

#[test]
fn a_new_outline_is_used_and_a_bad_one_is_refused_in_words() {
    let dir = tempfile::tempdir().expect("tempdir");
    let bad = Control::SetOutline(vec![Point2::new(10.0, 10.0), Point2::new(90.0, 90.0)]);
    let (summary, warnings) = wish(20, &[bad], &dir.path().join("bad"));
    assert!(
        warnings.iter().any(|w| w.contains("at least 3")),
        "{warnings:?}"
    );
    assert_eq!(
        summary.tree.expect("a tree").outline.polygon_px,
        support::outline().polygon_px
    );
    assert_eq!(
        tracks(&dir.path().join("bad")).first().map(|t| t.1),
        Some(0),
        "what was followed is kept"
    );

    let crown = [[240.0, 0.0], [480.0, 0.0], [480.0, 250.0], [240.0, 250.0]];
    let crown = crown.map(Point2::from).to_vec();
    let (summary, warnings) = wish(20, &[Control::SetOutline(crown)], &dir.path().join("good"));
    // The crown alone: where its trunk stands nobody knows.
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(
        warnings[0].starts_with("the foot of the trunk is a guess"),
        "{warnings:?}"
    );
    assert_eq!(
        summary.tree.expect("a tree").outline.bounds_px(),
        Some([240, 0, 480, 250])
    );
}

/// A replay does not depend on how fast the machine is: it ends with the same frame every time.
#[test]
fn a_replay_ends_after_the_length_that_was_asked_for() {
    for (length_s, frames) in [(1.0, 31), (1.01, 32), (2.5, 76)] {
        let job = Job {
            length_s: Some(length_s),
            ..job(Some(support::outline()), None)
        };
        let (summary, failure, _) = run(fake(false, |n| Ok(frame(n))), job);
        assert!(failure.is_none(), "{failure:?}");
        assert_eq!(summary.expect("a summary").frames, frames, "{length_s} s");
    }
}

/// Lines along branches that come after the last refinement. The name of the capture is taken
/// meanwhile, so that the run cannot write it: what is finished from its log has them, too.
#[test]
fn strokes_are_used_shown_kept_and_finished_with() {
    let dir = tempfile::tempdir().expect("tempdir");
    let out = dir.path().join("out");
    let (source, gate) = gated(200);
    let mut job = job(Some(support::outline()), Some(&out));
    (job.config.accumulate.min_s, job.config.accumulate.threshold) = (4.0, 0.2);
    job.config.accumulate.refine_s = 0.0;
    let running = runtime::start(source, job).expect("start");
    gate.reached
        .recv_timeout(HANGS)
        .expect("the gate is reached");
    let [across, along_sky] = [ACROSS, ALONG_SKY].map(|s| s.map(Point2::from).to_vec());
    for wish in [
        Control::AddStroke(across),
        Control::AddStroke(vec![Point2::new(10.0, 10.0)]),
        Control::AddStroke(along_sky),
        Control::TakeBackStroke,
    ] {
        running.send(wish);
    }
    gate.open.send(()).expect("the source waits");
    std::fs::create_dir(&out).expect("folder");
    let begun = Instant::now();
    let shown = loop {
        assert!(begun.elapsed() < HANGS, "the model hangs");
        std::thread::sleep(Duration::from_millis(5));
        if let Some(shown) = running.latest().filter(|s| s.frame > 200) {
            break shown.strokes_px.clone();
        }
    };
    assert_eq!(shown, [ACROSS.to_vec()]);
    let (summary, failure, warnings) = ended(running);
    assert!(matches!(failure, Some(Failure::Kept { .. })), "{failure:?}");
    let refused = |w: &String| w.contains("2 to 1000 points in each line");
    assert!(
        warnings.iter().any(refused) && warnings.len() == 1,
        "{warnings:?}"
    );
    let tree = summary.expect("a summary").tree.expect("a tree");
    assert!(covered(&tree, ACROSS) >= 7 && tree.refinements == 1);

    let asked = dir.path().join("out.unfinished/asked.csv");
    let asked = std::fs::read_to_string(asked).expect("when lines were drawn");
    assert!(asked.starts_with("frame\n") && asked.lines().count() > 1);
    std::fs::remove_dir(&out).expect("folder");
    let written = runtime::finish_unfinished(&out, &CancelToken::new()).expect("finished");
    let finished = written.tree.expect("a tree");
    assert_eq!(
        (finished.frame, finished.refinements),
        (tree.frame, tree.refinements)
    );
    assert_eq!(finished.skeleton.nodes, tree.skeleton.nodes);
    let capture: serde_json::Value =
        serde_json::from_slice(&std::fs::read(out.join("capture.json")).expect("capture.json"))
            .expect("json");
    let kept = &capture["config"]["skeleton"]["strokes_px"];
    assert_eq!(*kept, serde_json::json!([ACROSS]));
    assert_eq!(tracks(&out).first().map(|t| t.1), Some(0));
}

/// Where two red discs are in a film of 3 s, px.
fn discs_px(n: u64) -> [Point2<f64>; 2] {
    let swing = 6.0 * (0.2 * n as f64).sin();
    [
        Point2::new(320.0 + 0.5 * swing, 260.0),
        Point2::new(360.0 + swing, 120.0),
    ]
}

/// Frame `n` of that film: the discs before a wall.
fn with_discs(n: u64) -> Option<RawFrame> {
    let mut bytes = Vec::with_capacity(3 * SIZE.area());
    for v in 0..SIZE.height {
        for u in 0..SIZE.width {
            let here = Point2::new(f64::from(u), f64::from(v));
            let is_disc = discs_px(n)
                .iter()
                .any(|at| nalgebra::distance(at, &here) < 7.0);
            let wall = (100 + (u / 16 * 7 + v / 16 * 5) % 9 * 5) as u8;
            bytes.extend(if is_disc { [200, 30, 40] } else { [wall; 3] });
        }
    }
    (n < 90).then(|| RawFrame {
        sequence: Some(n),
        sensor_time_s: 5.0 + n as f64 / 30.0,
        size: SIZE,
        format: PixelFormat::Rgb24,
        bytes,
        depth: None,
    })
}

#[test]
fn markers_that_are_picked_and_hung_on_each_other_are_in_the_capture() {
    let dir = tempfile::tempdir().expect("tempdir");
    let out = dir.path().join("out");
    let near: Vec<Point2<f64>> = discs_px(30).to_vec();
    let wishes = [
        Control::PickMarkers(near.clone()),
        Control::HangMarkers(near),
        // What is wrong is said, and changes nothing.
        Control::HangMarkers(vec![Point2::new(20.0, 20.0), Point2::new(320.0, 260.0)]),
    ];
    let (_, warnings) = wish_in(gated_film(30, with_discs), &wishes, &out);
    let note = std::fs::read_to_string(out.join("capture.json")).expect("a capture");
    let note: serde_json::Value = serde_json::from_str(&note).expect("JSON");
    let windows = &note["config"]["markers"]["windows"];
    assert_eq!(windows[0]["name"], "m1", "{windows}");
    assert_eq!(
        (&windows[1]["name"], &windows[1]["parent"]),
        (&"m2".into(), &"m1".into())
    );
    assert!(windows[2].is_null(), "{windows}");
    assert!(
        warnings
            .iter()
            .any(|w| w.contains("no marker is near 20, 20 px")),
        "{warnings:?}"
    );
    let first = u64::from(TrackId::of_marker(0).0);
    let followed = tracks(&out).iter().filter(|(id, _)| *id >= first).count();
    assert!(followed >= 110, "{followed}");
}

/// The strokes of `tests/matting` lie on a part of the first frame; from the first frame on the
/// tree is followed, in the region and off the sky between its branches.
#[test]
fn scribbles_are_solved_on_the_first_picture() {
    let strokes = image::open("tests/matting/scribbles.png")
        .expect("scribbles")
        .into_luma8();
    let mut marks = vec![Mark::Undecided; support::SIZE.area()];
    for (u, v, shade) in strokes.enumerate_pixels() {
        marks[((v + 60) * support::SIZE.width + u + 180) as usize] = match shade.0[0] {
            0 => Mark::Background,
            255 => Mark::Tree,
            _ => Mark::Undecided,
        };
    }
    let scribbles = Scribbles {
        name: "strokes".into(),
        size: support::SIZE,
        marks: marks.clone(),
    };
    let dir = tempfile::tempdir().expect("tempdir");
    let out = dir.path().join("out");
    let given = Some(Given::Scribbles(scribbles));
    let (summary, failure, warnings) = run(
        fake(false, |n| Ok(frame(n))),
        Job {
            outline: given,
            ..job(None, Some(&out))
        },
    );
    assert!(
        failure.is_none() && !warnings.iter().any(|w| w.contains("strokes")),
        "{failure:?} {warnings:?}"
    );
    assert_eq!(
        tracks(&out).first().map(|t| t.1),
        Some(0),
        "from the first frame on"
    );
    let outline = summary
        .expect("a summary")
        .tree
        .expect("a tree")
        .outline
        .clone();
    let matte = outline.matte.as_ref().expect("a matte");
    assert!(
        marks
            .iter()
            .zip(matte)
            .all(|(mark, alpha)| *mark != Mark::Tree || *alpha == 255)
    );
    let drawn = support::outline();
    let count = |both: fn(bool, bool) -> bool| {
        outline
            .mask
            .iter()
            .zip(&drawn.mask)
            .filter(|(a, b)| both(**a != 0, **b != 0))
            .count() as f64
    };
    let iou = count(|a, b| a && b) / count(|a, b| a || b);
    assert!(
        iou >= 0.5,
        "{iou:.2} with the outline that a person drew, which is wider"
    );
}

#[test]
fn export_writes_a_capture_and_goes_on() {
    let dir = tempfile::tempdir().expect("tempdir");
    let out = dir.path().join("capture");
    let (summary, warnings) = wish(280, &[Control::Export], &out);
    assert_eq!(warnings, Vec::<String>::new(), "a notice is no warning");
    let last = |dir: &Path| tracks(dir).iter().map(|t| t.1).max().expect("tracks");
    let exported = last(&dir.path().join("capture-1"));
    assert!(
        (270..=281).contains(&exported),
        "exported up to frame {exported}"
    );
    assert!(dir.path().join("capture-1/tree.glb").exists());
    let picture = |dir: &std::path::Path| std::fs::read(dir.join("frame.jpg")).expect("picture");
    let first = picture(&dir.path().join("capture-1"));
    assert_eq!((last(&out), summary.frames), (329, 330), "frames go on");
    assert!(
        first == picture(&out),
        "it is one picture, however often a capture is written"
    );
}

#[test]
fn quit_ends_with_a_whole_capture() {
    let dir = tempfile::tempdir().expect("tempdir");
    let out = dir.path().join("out");
    let (summary, _) = wish(200, &[Control::Quit], &out);
    assert!(
        (200..=201).contains(&summary.frames),
        "{} frames",
        summary.frames
    );
    assert!(summary.written.expect("written").tree.is_some() && out.join("tree.glb").exists());
}

/// All files are of one tree, the newest, and the closing lines speak of that one, whether somebody
/// stops the capture or it ends as planned.
#[test]
fn a_stop_right_after_a_refinement_is_written_by_the_newest_tree() {
    for planned in [false, true] {
        let dir = tempfile::tempdir().expect("tempdir");
        let out = dir.path().join("out");
        // The refinement comes after 8.3 s; a trial may last until 6 s after it.
        let (source, gate) = gated(280);
        let mut job = job(Some(support::outline()), Some(&out));
        (job.config.accumulate.min_s, job.config.accumulate.threshold) = (4.0, 0.2);
        let running = runtime::start(source, job).expect("start");
        gate.reached
            .recv_timeout(HANGS)
            .expect("the gate is reached");
        let begun = Instant::now();
        let shown = loop {
            assert!(begun.elapsed() < HANGS, "the model hangs");
            std::thread::sleep(Duration::from_millis(5));
            if let Some(shown) = running.latest().filter(|s| s.frame >= 279) {
                break shown;
            }
        };
        assert!(
            shown
                .messages
                .iter()
                .any(|m| m.contains("the tree was refined")),
            "{:?}",
            shown.messages
        );
        if planned {
            running.end()
        } else {
            running.stop()
        }
        gate.open.send(()).expect("the source waits");
        let (summary, failure, _) = ended(running);
        assert!(failure.is_none(), "{failure:?}");
        let tree = summary.expect("a summary").tree.expect("a tree");
        assert!(tree.refinements > 0, "planned: {planned}");
        let capture: serde_json::Value =
            serde_json::from_slice(&std::fs::read(out.join("capture.json")).expect("capture.json"))
                .expect("json");
        assert_eq!(
            capture["refinement"]["count"].as_u64(),
            Some(tree.refinements.into())
        );
        let certainty = tree.hierarchy.median_certainty().map(|c| format!("{c:.6}"));
        assert_eq!(
            capture["quality"]["median_certainty"]
                .as_f64()
                .map(|c| format!("{c:.6}")),
            certainty
        );
        let nodes = std::fs::read_to_string(out.join("nodes.csv")).expect("nodes.csv");
        assert_eq!(nodes.lines().count(), 1 + tree.skeleton.nodes.len());
        let mut frames: Vec<u64> = tracks(&out).iter().map(|t| t.1).collect();
        frames.dedup();
        assert!(
            frames.iter().copied().eq(0..frames.len() as u64) && frames.len() >= 240,
            "every frame has its rows"
        );
    }
}

#[test]
fn pause_stops_a_replay_and_loses_nothing() {
    let (source, gate) = gated(50);
    let running = runtime::start(source, job(Some(support::outline()), None)).expect("start");
    gate.reached
        .recv_timeout(HANGS)
        .expect("the gate is reached");
    running.send(Control::Pause(true));
    gate.open.send(()).expect("the source waits");
    // Time enough to take many frames for one that is not paused; a paused one takes none however
    // long it waits.
    std::thread::sleep(Duration::from_millis(400));
    assert_eq!(
        gate.taken.load(Ordering::SeqCst),
        50,
        "a paused replay goes on"
    );
    running.send(Control::Pause(false));
    let (summary, failure, _) = ended(running);
    assert!(failure.is_none());
    assert_eq!(summary.expect("a summary").frames, 330);
}

/// A camera does not wait. What the tracker has no time for is dropped, the oldest first, and
/// counted.
#[test]
fn a_camera_that_is_too_fast_loses_frames_and_says_how_many() {
    let dir = tempfile::tempdir().expect("tempdir");
    let out = dir.path().join("out");
    let live = Job {
        pace: Pace::Live,
        ..job(Some(support::outline()), Some(&out))
    };
    let (summary, failure, _) = run(fake(true, |n| Ok(frame(n))), live);
    assert!(failure.is_none());
    let capture: serde_json::Value =
        serde_json::from_slice(&std::fs::read(out.join("capture.json")).expect("capture.json"))
            .expect("json");
    // It is filmed now, in the time zone of here.
    let at = capture["captured_at"].as_str().expect("when it was filmed");
    let at: LocalTime = at.parse().expect("a moment");
    assert!(at.year() >= 2025, "{at}");
    let dropped = capture["timing"]["frames_dropped_tracker"]
        .as_u64()
        .expect("count");
    let mut frames: Vec<u64> = tracks(&out).iter().map(|t| t.1).collect();
    assert!(frames.is_sorted(), "never back in time");
    frames.dedup();
    assert!(dropped > 0, "without a loss this shows nothing");
    assert_eq!(
        frames.len() as u64 + dropped,
        330,
        "each frame is either followed or counted as lost"
    );
    assert!(
        frames.ends_with(&[327, 328, 329]),
        "the newest are kept: {:?}",
        frames.last()
    );
    assert_eq!(summary.expect("a summary").frames, 330);
}

/// Holes in the driver's count are losses before us.
#[test]
fn frames_that_the_camera_lost_are_counted_with_their_place() {
    let dir = tempfile::tempdir().expect("tempdir");
    let out = dir.path().join("out");
    let (_, failure, _) = run(
        fake(false, |n| Ok(frame(if n < 40 { n } else { n + 5 }))),
        job(Some(support::outline()), Some(&out)),
    );
    assert!(failure.is_none());
    let capture: serde_json::Value =
        serde_json::from_slice(&std::fs::read(out.join("capture.json")).expect("capture.json"))
            .expect("json");
    assert_eq!(capture["timing"]["frames_dropped_camera"], 5);
    assert_eq!(capture["timing"]["gaps"][0]["after_frame"], 39);
    assert_eq!(
        tracks(&out).last().map(|t| t.1),
        Some(329),
        "later frames keep their places in time"
    );
}

fn unplugged() -> SourceError {
    SourceError::Disconnected {
        input: "fake".into(),
        reason: "test".into(),
    }
}

/// Ends that nobody wanted: each is reported as what it is, and what was captured until then is
/// written.
#[test]
fn a_bad_end_is_reported_and_keeps_what_was_captured() {
    let small = |n: u64| {
        frame(n).map(|raw| RawFrame {
            size: Size::new(320, 180),
            ..raw
        })
    };
    let broken = |n: u64| {
        frame(n).map(|raw| RawFrame {
            bytes: b"not a picture".to_vec(),
            format: PixelFormat::Mjpeg,
            ..raw
        })
    };
    type End = (&'static str, Script, fn(&Failure) -> bool, u64);
    let ends: [End; 4] = [
        (
            "unplugged",
            Box::new(|n| {
                if n < 150 {
                    Ok(frame(n))
                } else {
                    Err(unplugged())
                }
            }),
            |f| matches!(f, Failure::Source(SourceError::Disconnected { .. })),
            150,
        ),
        (
            "another size",
            Box::new(move |n| Ok(if n < 150 { frame(n) } else { small(n) })),
            |f| matches!(f, Failure::Frame { .. }),
            150,
        ),
        (
            "a panic",
            Box::new(|n| {
                if n < 150 {
                    Ok(frame(n))
                } else {
                    panic!("test")
                }
            }),
            |f| matches!(f, Failure::Panicked),
            150,
        ),
        (
            "no picture at all",
            Box::new(move |n| Ok(broken(n))),
            |f| matches!(f, Failure::NothingDecoded(_)),
            0,
        ),
    ];
    for (name, script, expected, frames) in ends {
        let dir = tempfile::tempdir().expect("tempdir");
        let out = dir.path().join("out");
        let source = Box::new(Fake {
            next: 0,
            live: false,
            script,
        });
        let (summary, failure, _) = run(source, job(Some(support::outline()), Some(&out)));
        assert!(
            failure.as_ref().is_some_and(expected),
            "{name}: {failure:?}"
        );
        assert!(
            summary.is_some_and(|s| s.written.is_some() && s.tree.is_some() == (frames > 0)),
            "{name}"
        );
        assert_eq!(tracks(&out).last().map_or(0, |t| t.1 + 1), frames, "{name}");
    }
}

/// Damage in between costs the damaged frames and nothing else.
#[test]
fn damaged_frames_are_left_out_and_counted() {
    let dir = tempfile::tempdir().expect("tempdir");
    let out = dir.path().join("out");
    let source = fake(false, |n| {
        Ok(frame(n).map(|mut raw| {
            if n % 50 == 7 {
                raw.bytes.truncate(raw.bytes.len() / 2);
            }
            raw
        }))
    });
    let (summary, failure, warnings) = run(source, job(Some(support::outline()), Some(&out)));
    assert!(failure.is_none() && summary.is_some_and(|s| s.tree.is_some()));
    assert!(
        warnings
            .iter()
            .any(|w| w.contains("frame 7 ") && w.contains("damaged")),
        "{warnings:?}"
    );
    let text = std::fs::read_to_string(out.join("capture.json")).expect("capture.json");
    assert!(text.contains("\"frames_undecodable\": 7"), "{text}");
}

/// A reader of the stream that fails, and one that brings its thread down: the run ends.
#[test]
fn a_worker_that_fails_does_not_make_the_run_hang() {
    struct Failing(bool);
    impl Write for Failing {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            if self.0 {
                panic!("test")
            } else {
                Err(io::Error::other("no more room"))
            }
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }
    for panics in [false, true] {
        let stream: Box<dyn Write + Send> = Box::new(Failing(panics));
        let job = Job {
            stream: Some(stream),
            ..job(Some(support::outline()), None)
        };
        // A source without an end: only an ended run ends it.
        let endless = fake(true, |n| {
            let mut raw = frame(n % 330);
            raw.iter_mut()
                .for_each(|f| (f.sequence, f.sensor_time_s) = (Some(n), n as f64 / 30.0));
            Ok(raw)
        });
        let (summary, failure, warnings) = run(endless, job);
        assert_eq!(
            matches!(failure, Some(Failure::Panicked)),
            panics,
            "{failure:?}"
        );
        assert_eq!(summary.is_none(), panics);
        assert_eq!(
            warnings
                .iter()
                .any(|w| w.contains("stream of poses has ended")),
            !panics,
            "{warnings:?}"
        );
    }
}
