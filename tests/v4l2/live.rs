//! A capture in a real terminal: what it shows, what its keys do, and what it leaves of the
//! terminal.

use crate::guest::{Group, Results, claim, clip, end_limit_s};

pub const GROUP: Group = Group {
    name: "live",
    script: "live.sh",
    first: "script",
    limit_s: 400,
    provide: clip,
    cases: &[
        ("the_screen_while_it_gathers_motion", |r| {
            shows(r, "watching")
        }),
        ("the_help", |r| shows(r, "help")),
        ("the_screen_after_the_build", |r| shows(r, "built")),
        ("the_message_of_an_export", |r| shows(r, "exported")),
        ("an_export_is_written_while_filming", exported),
        ("q_ends_with_a_whole_capture", quit),
        ("the_terminal_is_given_back", given_back),
        ("poses_are_streamed", streamed),
    ],
};

/// The screen without what is told of the sway, in the rows of the table of branches and in the
/// panel of one of them: it is another thing in every run.
fn without_sway(screen: &str) -> String {
    let lines: Vec<Vec<char>> = screen.lines().map(|l| l.chars().collect()).collect();
    let find = |line: &[char], what: &str| {
        let what: Vec<char> = what.chars().collect();
        line.windows(what.len()).position(|w| *w == what[..])
    };
    // The panel is between its title and those of the views; the table between the names of its
    // columns and the messages.
    let at = |what: &str| {
        lines
            .iter()
            .enumerate()
            .find_map(|(row, l)| Some((row, find(l, what)?)))
    };
    let (Some((panel, left)), Some((views, _)), Some((head, _))) =
        (at(" Branch "), at(" Front "), at("ampl/px"))
    else {
        return screen.to_owned();
    };
    let messages = lines.len().saturating_sub(6);
    let cut = |(row, line): (usize, &Vec<char>)| -> String {
        let in_panel = row > panel && row < views;
        let in_table = row > head && row < messages;
        let kept = |column: usize| !(in_panel && column >= left || in_table && column < left);
        line.iter()
            .enumerate()
            .map(|(column, c)| if kept(column) { *c } else { ' ' })
            .collect()
    };
    lines
        .iter()
        .enumerate()
        .map(cut)
        .collect::<Vec<_>>()
        .join("\n")
}

/// The screen with a plain word in its third line, where there stands what is awaited: how far a
/// film has come by now hangs on how fast the machine is. Its texts are tested in `tui::awaited`.
fn without_awaited(screen: &str) -> String {
    let mut lines: Vec<&str> = screen.lines().collect();
    if let Some(line) = lines.get_mut(2).filter(|line| !line.trim().is_empty()) {
        *line = "awaited";
    }
    lines.join("\n")
}

/// The screen without what changes from run to run: digits, and the drawings in the panels of
/// pictures and curves.
fn still(screen: &str) -> String {
    let screen = without_awaited(&without_sway(screen));
    let masked = screen.chars().map(|c| match c {
        '0'..='9' => '#',
        // Half blocks, blocks and braille.
        '\u{2580}'..='\u{259f}' | '\u{2800}'..='\u{28ff}' => ' ',
        c => c,
    });
    let masked: String = masked.collect();
    let squeeze = |line: &str| {
        // A number of one digit more must not move what follows it.
        let mut out = String::new();
        for word in line.split_whitespace() {
            let word: String = word
                .split('#')
                .filter(|p| !p.is_empty())
                .collect::<Vec<_>>()
                .join("#");
            if !word.is_empty() && word.chars().any(char::is_alphabetic) {
                out.push_str(&word);
                out.push(' ');
            }
        }
        out.trim_end().to_owned()
    };
    // Which branch the panel is of, trunk or limb, is another one in every run.
    let without_name = |line: String| match line.strip_prefix("Branch ") {
        Some(rest) if rest.ends_with(" points") => "Branch points".to_owned(),
        // Whether an emulated machine has lost frames by now is another thing in every run.
        _ if line == "lost nothing" => "lost camera queue".to_owned(),
        // What the film is worth by now hangs on how fast the machine is.
        _ if line.starts_with("Verdict ") => "Verdict".to_owned(),
        // So does which modes are known by now, and whether all branches have room.
        _ if line.starts_with("Branches, ") => "Branches,".to_owned(),
        _ => line,
    };
    let is_of_losses = |l: &String| l == "broken unshown";
    // A refinement is told when it is through, however long it took.
    let refined = |l: &String| l.starts_with("the tree was refined");
    // Where the two views of the tree stand depends on its shape: they are named last, whichever
    // there are.
    let views = ["Front", "Side"];
    let is_view = |l: &String| l.split(' ').all(|word| views.contains(&word));
    let (of_views, mut lines): (Vec<String>, Vec<String>) = masked
        .lines()
        .map(squeeze)
        .map(without_name)
        .filter(|l| !l.is_empty() && !refined(l) && !is_of_losses(l))
        .partition(is_view);
    lines.extend(
        views
            .into_iter()
            .filter(|v| of_views.iter().any(|l| l.contains(v)))
            .map(str::to_owned),
    );
    without_warnings(&mut lines);
    lines.join("\n")
}

/// Takes out the warnings before the message of an export: the clip is played again and again, which
/// is a cut film, and what has been noticed by then hangs on how fast the machine is.
fn without_warnings(lines: &mut Vec<String>) {
    let find = |what: &str| lines.iter().position(|l| l.starts_with(what));
    if let (Some(verdict), Some(written)) = (find("Verdict"), find("capture written"))
        && verdict < written
    {
        lines.drain(verdict + 1..written);
    }
}

fn shows(r: &Results, name: &str) -> Result<(), String> {
    let found = still(&r.text(&format!("{name}.screen"))?);
    let path = format!("tests/v4l2/screens/{name}.txt");
    if std::env::var_os("INSTA_UPDATE").is_some_and(|v| v == "always") {
        return std::fs::write(&path, found + "\n").map_err(|e| format!("{path}: {e}"));
    }
    let wanted = std::fs::read_to_string(&path).map_err(|e| format!("{path}: {e}"))?;
    claim(found.trim() == wanted.trim(), || {
        format!("{path}:\n--- wanted\n{wanted}\n--- found\n{found}")
    })
}

fn exported(r: &Results) -> Result<(), String> {
    for file in [
        "capture.json",
        "tracks.csv",
        "nodes.csv",
        "motion.csv",
        "tree.glb",
        "frame.jpg",
    ] {
        claim(r.path("live/exported").join(file).exists(), || {
            format!("{file} is missing")
        })?;
    }
    let last = |dir: &str| -> Result<u64, String> {
        let text = r.text(&format!("live/{dir}/tracks.csv"))?;
        Ok(text
            .lines()
            .skip(1)
            .filter_map(|l| l.split(',').nth(1)?.parse().ok())
            .max()
            .unwrap_or(0))
    };
    let (then, at_the_end) = (last("exported")?, last("capture")?);
    claim(then < at_the_end, || {
        format!("exported up to frame {then}, ended at {at_the_end}")
    })
}

fn quit(r: &Results) -> Result<(), String> {
    let (status, took) = (r.status("live")?, r.seconds("live", "asked", "ended")?);
    claim(status == "0", || {
        format!(
            "status {status}: {}",
            r.text("after.screen").unwrap_or_default()
        )
    })?;
    claim(took < end_limit_s(), || {
        format!("{took} s from q to the end")
    })?;
    claim(r.path("live/capture/tree.glb").exists(), || {
        "no model".into()
    })
}

fn given_back(r: &Results) -> Result<(), String> {
    let (modes, screen) = (r.text("live/terminal")?, r.text("after.screen")?);
    claim(
        modes.contains("echo") && !modes.contains("-echo") && modes.contains("icanon"),
        || modes.clone(),
    )?;
    claim(
        screen.contains("after>") && screen.contains("capture: "),
        || screen.clone(),
    )?;
    claim(!screen.contains("Camera ─"), || {
        format!("the program's screen is still there:\n{screen}")
    })
}

fn streamed(r: &Results) -> Result<(), String> {
    let text = r.text("stream/stdout")?;
    let mut last = None;
    let mut poses = 0;
    // A line that was cut by the end is none.
    for line in text.lines() {
        let pose: serde_json::Value =
            serde_json::from_str(line).map_err(|e| format!("{e}: {line}"))?;
        let Some(frame) = pose["frame"].as_u64() else {
            continue;
        };
        claim(last.is_none_or(|l| frame > l), || {
            format!("frame {frame} after {last:?}")
        })?;
        claim(
            pose["nodes"].as_array().is_some_and(|n| n.len() > 3),
            || format!("few nodes: {line}"),
        )?;
        last = Some(frame);
        poses += 1;
    }
    claim(poses >= 10, || {
        format!(
            "{poses} poses: {}",
            r.messages("stream").unwrap_or_default()
        )
    })
}
