//! The HTML page in a browser: Playwright presses its controls in Chromium
//! (`tests/viewer/checks.mjs`).
//!
//! Without Chromium, Node, the modules of `scripts/test-modules.sh` or the viewer itself the test
//! says so and does nothing; with `ARBORCAM_REQUIRE_TOOLS=1` it fails. `ARBORCAM_VIEWER_DIR=DIR`
//! keeps the pages.

use arborcam::export::html::{self, Branch, Data, Page};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use std::{env, fs};

/// A file's name that would do harm if it were taken for HTML.
const TITLE: &str = "Winter <b>tree<!-- & \"co\" <script>";
/// 3 MB beside the model.
const LARGEST_VIEWER: usize = 3_000_000;

fn arborcam(args: &[&Path], more: &[&str]) {
    let run = Command::new(env!("CARGO_BIN_EXE_arborcam"))
        .args(args)
        .args(more)
        .output()
        .expect("arborcam runs");
    assert!(
        run.status.success(),
        "{}",
        String::from_utf8_lossy(&run.stderr)
    );
}

/// Fills a folder with the page of a replay of a clip, in px and in metres.
fn pages(dir: &Path, clip: &Path, outline: &Path) {
    let [replay, with, out, export, format, capture] = [
        "replay",
        "--outline",
        "--out",
        "export",
        "--format",
        "capture",
    ]
    .map(Path::new);
    let capture = dir.join(capture);
    arborcam(
        &[replay, clip, with, outline, out, &capture],
        &["--fast", "--headless"],
    );
    for (name, more) in [("px", &[][..]), ("m", &["--metres-per-px", "0.02"])] {
        let export = |kind: &str, to: &Path| {
            arborcam(&[export, &capture, format, Path::new(kind), out, to], more);
            fs::read(to).expect("what was exported")
        };
        let pages = [1, 2].map(|k| {
            let folder = dir.join(format!("{name}-{k}"));
            fs::create_dir_all(&folder).expect("folder");
            export("html", &folder.join(format!("{TITLE}.html")))
        });
        assert!(pages[0] == pages[1], "the same tree gives another page");
        let [text, _] = pages;
        let suffix = if name == "px" { "" } else { "-m" };
        let glb = export("glb", &dir.join(format!("tree{suffix}.glb")));
        assert!(
            text.len() < LARGEST_VIEWER + glb.len(),
            "{} bytes",
            text.len()
        );
        println!(
            "page {} kB, model {} kB",
            text.len() / 1000,
            glb.len() / 1000
        );
        fs::write(dir.join(format!("page{suffix}.html")), text).expect("page");
    }
    fs::write(dir.join("page-one.html"), one_node()).expect("page");
    let [grow, forest, page] = ["grow", "forest", "page-forest.html"].map(Path::new);
    let forest = dir.join(forest);
    arborcam(
        &[grow, &capture, out, &forest],
        &["--forest", "--count", "5", "--templates", "2"],
    );
    let html = Path::new("html");
    arborcam(&[export, &forest, format, html, out, &dir.join(page)], &[]);
    fs::copy(outline, dir.join("outline.json")).expect("outline");
    fs::write(dir.join("title.txt"), TITLE).expect("title");
}

/// The page of a skeleton with one node, which has no branch, no mesh and no motion.
fn one_node() -> String {
    let branch = Branch {
        id: 0,
        name: "tree".into(),
        order: 0,
        parent: None,
        copy_of: None,
        moves_with: None,
        level: 0,
        main_branch: None,
        n_tracks: 0,
        end: [0.0; 3],
        sway: None,
        why: None,
        participation: Vec::new(),
        angle_deg: None,
    };
    let data = Data {
        source: String::new(),
        software: "arborcam".into(),
        captured_at: None,
        notes: Default::default(),
        metres_per_px: 0.0,
        image: [64, 48],
        foot_px: [32.0, 40.0],
        outline_px: Vec::new(),
        picture_time_s: None,
        start_s: 0.0,
        times_s: Vec::new(),
        main_branch_rgb: arborcam::model::MAIN_BRANCH_RGB,
        branches: vec![branch],
        modes: Vec::new(),
        forest: None,
    };
    let mut json =
        br#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"name":"tree","extras":{"node_id":0}}]}"#.to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let number = |n: usize| (n as u32).to_le_bytes();
    let glb = [
        b"glTF",
        &number(2)[..],
        &number(20 + json.len()),
        &number(json.len()),
        b"JSON",
        &json,
    ]
    .concat();
    html::page(&Page {
        title: "one",
        glb: &glb,
        data: &data,
        picture: None,
    })
    .expect("page")
}

struct Tools {
    node: PathBuf,
    chromium: PathBuf,
    modules: PathBuf,
}

/// What is there, or what is missing.
fn tools() -> Result<Tools, String> {
    let in_path = |names: &[&str]| {
        let path = env::var_os("PATH").unwrap_or_default();
        let folders: Vec<PathBuf> = env::split_paths(&path).collect();
        names
            .iter()
            .flat_map(|n| folders.iter().map(move |f| f.join(n)))
            .find(|p| p.is_file())
    };
    let node = in_path(&["node"]).ok_or("node is not installed")?;
    let chromium = env::var_os("ARBORCAM_CHROMIUM").map(PathBuf::from);
    let chromium = chromium.or_else(|| in_path(&["chromium", "chromium-browser", "google-chrome"]));
    let modules =
        env::var_os("CARGO_TARGET_DIR").map_or_else(|| PathBuf::from("target"), PathBuf::from);
    let modules = std::path::absolute(modules.join("test-npm")).map_err(|e| e.to_string())?;
    if !modules.join("node_modules/playwright-core").is_dir() {
        return Err("playwright-core is not there; run scripts/test-modules.sh".into());
    }
    Ok(Tools {
        node,
        chromium: chromium.ok_or("chromium is not installed")?,
        modules,
    })
}

/// One browser at a time: the pages are asked for how fast they are.
static BROWSER: Mutex<()> = Mutex::new(());

/// Presses every control of the page of a clip.
fn press_all(name: &str, clip: &Path, outline: &Path) {
    let viewer = include_str!(concat!(env!("OUT_DIR"), "/viewer.html"));
    let built = if viewer.is_empty() {
        Err("the viewer is not built in; run `make viewer`".into())
    } else {
        Ok(())
    };
    let tools = match built.and_then(|()| tools()) {
        Ok(tools) => tools,
        Err(why) if env::var_os("ARBORCAM_REQUIRE_TOOLS").is_some() => panic!("{why}"),
        Err(why) => return eprintln!("SKIPPED: {why}"),
    };
    let kept = env::var_os("ARBORCAM_VIEWER_DIR").map(|dir| Path::new(&dir).join(name));
    let made = tempfile::tempdir().expect("folder");
    let dir = kept.as_deref().unwrap_or(made.path());
    fs::create_dir_all(dir).expect("folder");
    pages(dir, clip, outline);
    let _alone = BROWSER.lock();
    let run = Command::new(&tools.node)
        .arg("tests/viewer/checks.mjs")
        .arg(dir)
        .env("ARBORCAM_NPM", &tools.modules)
        .env("ARBORCAM_CHROMIUM", &tools.chromium)
        .output()
        .expect("node runs");
    let said = String::from_utf8_lossy(&run.stdout);
    println!("{said}");
    let failed: Vec<&str> = said.lines().filter(|l| l.starts_with("FAIL")).collect();
    assert!(
        run.status.success(),
        "{failed:#?}\n{}",
        String::from_utf8_lossy(&run.stderr)
    );
    assert!(
        said.lines().filter(|l| l.starts_with("ok")).count() >= 15,
        "{said}"
    );
}

#[test]
fn the_page_of_the_shipped_clip_does_what_its_controls_say() {
    press_all(
        "winter",
        "recordings/sparse_winter.mkv".as_ref(),
        "recordings/sparse_winter.outline.json".as_ref(),
    );
}

/// The other public clip lies outside the repository, in the folder that `ARBORCAM_CLIPS` names.
#[test]
fn the_page_of_the_oak_does_what_its_controls_say() {
    let Some(clips) = env::var_os("ARBORCAM_CLIPS") else {
        return eprintln!("SKIPPED: ARBORCAM_CLIPS does not say where oak_release is");
    };
    let oak = Path::new(&clips).join("oak_release");
    press_all("oak", &oak.join("video.mkv"), &oak.join("outline.json"));
}

/// Size, licence, and nothing that is fetched from elsewhere when it is opened.
#[test]
fn the_viewer_is_small_and_names_its_licence() {
    let viewer = include_str!(concat!(env!("OUT_DIR"), "/viewer.html"));
    if viewer.is_empty() {
        return eprintln!("SKIPPED: the viewer is not built in; run `make viewer`");
    }
    assert!(viewer.len() < LARGEST_VIEWER, "{} bytes", viewer.len());
    assert!(
        viewer.contains("Permission is hereby granted, free of charge"),
        "three.js' licence is not in the page"
    );
    for word in [
        "src=\"http",
        "href=\"http",
        "@import",
        "<link rel=\"stylesheet",
    ] {
        assert!(!viewer.contains(word), "{word}");
    }
}
