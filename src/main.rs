use arborcam::*;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let config = if a.len() > 4 { config::Config::load(a[4].as_ref()).unwrap() } else { config::Config::default() };
    let source = source::open(a[1].as_ref(), &config.camera, None).unwrap();
    let outline =
        if a[2] == "auto" { None } else { Some(outline::load(a[2].as_ref(), source.describe().size).unwrap()) };
    let t = std::time::Instant::now();
    let job = runtime::Job {
        config,
        outline,
        pace: runtime::Pace::Fast,
        stream: None,
        out: Some(a[3].clone().into()),
        preview_every: std::time::Duration::from_secs(1),
    };
    let r = runtime::start(source, job).ok().unwrap();
    while !r.finished() {
        std::thread::sleep(std::time::Duration::from_millis(20));
        if let Some(s) = r.latest() {
            if std::env::var("V").is_ok() {
                eprintln!("{} {:?} {:.3} {} {:.2}", s.frame, s.phase, s.progress, s.tracks_alive, s.latency_p50_ms);
            }
        }
    }
    let w = r.warnings();
    let (s, f) = r.join();
    if let Some(s) = s {
        eprintln!(
            "{} frames {:.1} fps tracks {} moving {} acc {:.3} {:?} {:?}",
            s.frames,
            s.frames as f64 / t.elapsed().as_secs_f64(),
            s.tracks_total,
            s.moving,
            s.accumulation,
            s.tree.map(|t| (t.frame, t.forced, t.skeleton.nodes.len(), t.evidence.motion, t.evidence.stability)),
            w
        );
    }
    eprintln!("{f:?}");
}
