//! Whether this machine can do what it is asked to, one finding a line, each with what to do about
//! it.
//!
//! [`gather`](facts::gather) looks at the machine and measures; [`judge`] turns what was found into
//! verdicts and touches nothing, so that every remedy can be held by a test.

mod camera;
mod facts;
mod judge;
mod measure;
mod service;

pub use camera::{Film, Node, Seen};
pub use facts::{Asked, Facts, Load, Screen, gather};
pub use judge::judge;
pub use measure::Disk;
pub use service::{Installed, Part};

use serde::Serialize;

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    Ok,
    /// It works, worse than it could.
    Warn,
    /// A capture would fail.
    Fail,
}

/// One finding.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Check {
    pub name: &'static str,
    pub verdict: Verdict,
    /// What was found, one line.
    pub found: String,
    /// What to do, one line; empty where there is nothing to do.
    pub remedy: String,
}

impl Check {
    fn of(
        name: &'static str,
        verdict: Verdict,
        found: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self {
            name,
            verdict,
            found: found.into(),
            remedy: remedy.into(),
        }
    }

    pub(crate) fn ok(name: &'static str, found: impl Into<String>) -> Self {
        Self::of(name, Verdict::Ok, found, "")
    }

    pub(crate) fn warn(
        name: &'static str,
        found: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self::of(name, Verdict::Warn, found, remedy)
    }

    pub(crate) fn fail(
        name: &'static str,
        found: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self::of(name, Verdict::Fail, found, remedy)
    }
}

impl std::fmt::Display for Check {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let verdict = match self.verdict {
            Verdict::Ok => "ok  ",
            Verdict::Warn => "WARN",
            Verdict::Fail => "FAIL",
        };
        let colon = if self.remedy.is_empty() { "" } else { "; " };
        write!(
            f,
            "{verdict}  {:<12} {}{colon}{}",
            self.name, self.found, self.remedy
        )
    }
}
