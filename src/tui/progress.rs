//! Progress on standard error for runs without a screen.

use super::format;
use crate::model::Snapshot;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{IsTerminal, Write};

/// A line that shows how far the work has come; nothing where standard error is no terminal.
#[derive(Debug)]
pub struct Progress {
    bar: ProgressBar,
}

impl Progress {
    /// Nothing is shown before the first [`update`](Self::update).
    pub fn new() -> Self {
        Self {
            bar: ProgressBar::with_draw_target(None, standard_error()).with_style(style(false)),
        }
    }

    /// Shows a newer state.
    pub fn update(&self, snapshot: &Snapshot) {
        if self.bar.length() != snapshot.frames_total {
            if let Some(total) = snapshot.frames_total {
                self.bar.set_length(total);
            }
            self.bar.set_style(style(snapshot.frames_total.is_some()));
        }
        self.bar.set_message(text(snapshot));
        self.bar.set_position(snapshot.frame);
    }

    /// Prints a line of text on standard error, above the line that shows the progress.
    pub fn tell(&self, line: &str) {
        // Where nobody reads it any more, that is no reason to fail.
        self.bar
            .suspend(|| drop(writeln!(std::io::stderr(), "{line}")));
    }

    /// Takes the line away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl Default for Progress {
    fn default() -> Self {
        Self::new()
    }
}

/// Where bars are drawn: standard error, and nowhere where that is no terminal.
pub(super) fn standard_error() -> ProgressDrawTarget {
    if std::io::stderr().is_terminal() {
        ProgressDrawTarget::stderr_with_hz(10)
    } else {
        ProgressDrawTarget::hidden()
    }
}

fn text(snapshot: &Snapshot) -> String {
    let (rate, tracks) = (format::value(snapshot.work_rate_hz), snapshot.tracks_alive);
    format!("{rate} Hz · {tracks} points · {}", snapshot.phase.name())
}

fn style(total_known: bool) -> ProgressStyle {
    let template = if total_known {
        "{pos}/{len} {wide_bar} {eta} · {msg}"
    } else {
        "{spinner} frame {pos} · {msg}"
    };
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Phase;

    #[test]
    fn tells_phase_rate_and_points() {
        let snapshot = Snapshot {
            phase: Phase::Live,
            work_rate_hz: 29.97,
            tracks_alive: 312,
            ..Snapshot::default()
        };
        assert_eq!(text(&snapshot), "29.97 Hz · 312 points · live");
        let progress = Progress::default();
        for total in [None, Some(0), Some(900), None] {
            progress.update(&Snapshot {
                frames_total: total,
                frame: 901,
                ..Snapshot::default()
            });
        }
        progress.finish();
    }
}
