//! Faults that vivid injects: for each the count, the message, the exit status or the recovery.

use crate::guest::{Group, Results, claim, end_limit_s};

pub const GROUP: Group = Group {
    name: "faults",
    script: "faults.sh",
    first: "script",
    limit_s: 600,
    provide: |_| Ok(()),
    cases: &[
        ("a_camera_without_faults_loses_nothing", clean),
        ("a_tenth_of_the_buffers_dropped_is_counted", |r| {
            dropped(r, "dropped-10", 0.03..=0.20)
        }),
        ("two_fifths_of_the_buffers_dropped_are_counted", |r| {
            dropped(r, "dropped-40", 0.30..=0.50)
        }),
        (
            "frames_with_the_error_flag_are_counted_and_left_out",
            flagged,
        ),
        ("no_buffers_ends_with_status_3", |r| {
            refused(r, "reqbufs", "asking for buffers")
        }),
        ("no_stream_ends_with_status_3", |r| {
            refused(r, "streamon", "starting")
        }),
        ("a_fatal_error_is_recovered_from", |r| recovered(r, "fatal")),
        ("a_fatal_error_ends_a_capture_that_is_to_end_with_it", |r| {
            ended_at_once(r, "fatal-once")
        }),
        ("a_disconnected_camera_is_taken_again", |r| {
            recovered(r, "disconnect")
        }),
        (
            "a_disconnected_camera_ends_a_capture_that_is_to_end_with_it",
            |r| ended_at_once(r, "disconnect-once"),
        ),
        ("a_count_that_wraps_is_no_loss", |r| {
            wrapped(r, "wrapped-count", 30.0)
        }),
        ("a_clock_of_64_bits_that_wraps_is_no_loss", |r| {
            wrapped(r, "wrapped-clock-64", 15.0)
        }),
        ("a_clock_of_32_bits_that_wraps_is_no_loss", |r| {
            wrapped(r, "wrapped-clock-32", 15.0)
        }),
        ("a_size_that_the_driver_lacks_is_refused", |r| {
            refused(r, "size", "--accept-format")
        }),
        ("a_size_that_the_driver_lacks_can_be_accepted", accepted),
        ("a_camera_in_use_is_said_to_be", |r| {
            refused(r, "busy", "in use by v4l2-ctl")
        }),
        ("a_camera_that_is_not_there_is_said_to_be", |r| {
            refused(r, "absent", "is not there")
        }),
    ],
};

/// Stopped by the user, in good time, with a whole capture.
fn stopped(r: &Results, case: &str) -> Result<(), String> {
    let status = r.status(case)?;
    claim(status == "130", || {
        format!(
            "{case}: status {status}: {}",
            r.messages(case).unwrap_or_default()
        )
    })?;
    let took = r.seconds(case, "asked", "ended")?;
    claim(took < end_limit_s(), || {
        format!("{case}: stopped after {took} s")
    })?;
    let seen = r.count(case, "frames_seen")?;
    claim(seen >= 15, || format!("{case}: {seen} frames"))
}

fn clean(r: &Results) -> Result<(), String> {
    stopped(r, "clean")?;
    let (seen, lost) = (
        r.count("clean", "frames_seen")?,
        r.count("clean", "frames_dropped_camera")?,
    );
    // An emulated machine with other things to do may lose some.
    claim(lost * 10 <= seen, || {
        format!("{lost} of {seen} frames lost")
    })?;
    let rate = r.capture("clean")?["timing"]["measured_rate_hz"]
        .as_f64()
        .unwrap_or(0.0);
    claim((14.0..16.0).contains(&rate), || {
        format!("{rate} Hz instead of 15")
    })
}

fn dropped(r: &Results, case: &str, share: std::ops::RangeInclusive<f64>) -> Result<(), String> {
    stopped(r, case)?;
    let (seen, lost) = (
        r.count(case, "frames_seen")? as f64,
        r.count(case, "frames_dropped_camera")? as f64,
    );
    let found = lost / (seen + lost);
    claim(share.contains(&found), || {
        format!("{case}: {lost} lost beside {seen} seen: {found:.2}")
    })?;
    let gaps = r.capture(case)?["timing"]["gaps"]
        .as_array()
        .map_or(0, Vec::len);
    claim(gaps > 0, || format!("{case}: no gap is named"))
}

fn flagged(r: &Results) -> Result<(), String> {
    stopped(r, "flagged")?;
    let broken = r.count("flagged", "frames_damaged")?;
    claim((1..=4).contains(&broken), || {
        format!("{broken} counted as broken of 4")
    })
}

/// One line that says what and what to do, and status 3.
fn refused(r: &Results, case: &str, word: &str) -> Result<(), String> {
    let (status, said) = (r.status(case)?, r.messages(case)?);
    claim(status == "3", || format!("{case}: status {status}: {said}"))?;
    let lines: Vec<&str> = said
        .lines()
        .filter(|l| !l.starts_with("arborcam: warning:"))
        .collect();
    claim(lines.len() == 1 && lines[0].contains(word), || {
        format!("{case}: {said}")
    })
}

/// Said at once, waited for, and gone on with, the hole marked.
fn recovered(r: &Results, case: &str) -> Result<(), String> {
    stopped(r, case)?;
    let timing = r.capture(case)?["timing"].clone();
    claim(timing["reconnects"] == 1, || format!("{case}: {timing}"))?;
    claim(timing["gaps"].to_string().contains("disconnected"), || {
        format!("{case}: no gap in {timing}")
    })?;
    let length = timing["duration_s"].as_f64().unwrap_or(0.0);
    claim(length > 4.5, || {
        format!("{case}: nothing after the fault, {length} s in all")
    })?;
    let said = r.messages(case)?;
    claim(
        said.contains("was lost") && said.contains("is back"),
        || format!("{case}: not told: {said}"),
    )
}

/// `--once`: the shorter capture is whole, and the status says that it is shorter.
fn ended_at_once(r: &Results, case: &str) -> Result<(), String> {
    let (status, said) = (r.status(case)?, r.messages(case)?);
    claim(status == "1" && said.contains("disconnected"), || {
        format!("{case}: status {status}: {said}")
    })?;
    let seen = r.count(case, "frames_seen")?;
    claim(seen >= 15, || format!("{case}: {seen} frames"))
}

fn wrapped(r: &Results, case: &str, rate_hz: f64) -> Result<(), String> {
    stopped(r, case)?;
    // What was seen and what was lost fill the time: the wrap is neither a loss nor does it hide
    // one.
    let (seen, lost) = (
        r.count(case, "frames_seen")?,
        r.count(case, "frames_dropped_camera")?,
    );
    let length = r.capture(case)?["timing"]["duration_s"]
        .as_f64()
        .unwrap_or(0.0);
    let filled = (seen + lost) as f64 / (length * rate_hz + 1.0);
    claim((0.93..=1.07).contains(&filled), || {
        format!("{case}: {seen} seen and {lost} lost in {length} s at {rate_hz} Hz")
    })?;
    // The capture's time goes on as the guest's own did.
    let wall = r.seconds(case, "begun", "asked")?;
    claim((wall - 4.0..=wall + 0.5).contains(&length), || {
        format!("{case}: {length} s of time in {wall} s")
    })
}

fn accepted(r: &Results) -> Result<(), String> {
    stopped(r, "size-accepted")?;
    let source = r.capture("size-accepted")?["source"].clone();
    let (asked, given) = (
        source["format_asked"].to_string(),
        source["format_given"].to_string(),
    );
    claim(
        asked.contains("1000x700") && !given.contains("1000x700"),
        || format!("asked {asked}, given {given}"),
    )?;
    let said = r.messages("size-accepted")?;
    claim(said.contains("1000x700"), || {
        format!("the substitute is not shown: {said}")
    })
}
