//! Everything that is found out about the machine, before anything is judged.

use super::camera::{self, Film, Node, Seen};
use super::measure::{self, Disk};
use super::service::{self, Installed};
use crate::config::Config;
use crate::model::Size;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// What the user wants to know about.
#[derive(Clone, Debug)]
pub struct Asked {
    pub device: Option<PathBuf>,
    /// The settings, or why there are none.
    pub config: Result<Config, String>,
    /// Where captures will go.
    pub folder: PathBuf,
    /// What was learned of the terminal by the caller, which may ask it.
    pub screen: Screen,
}

/// The terminal.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Screen {
    /// Columns and rows; `None` without a terminal.
    pub cells: Option<(u16, u16)>,
    pub utf8: bool,
    /// `none`, `256` or `all`.
    pub colours: &'static str,
    /// How pictures are shown, e.g. `kitty`.
    pub pictures: &'static str,
}

/// The processor.
#[derive(Clone, Debug, PartialEq)]
pub struct Load {
    pub cores: usize,
    /// Frames a second that one core tracks at the configured size.
    pub frames_per_s: f64,
    /// The hottest part that can be read, degrees Celsius.
    pub celsius: Option<f64>,
    /// What the clock of the first core may be at most now, as a share of what it can be.
    pub clock_share: Option<f64>,
}

/// What was found.
#[derive(Clone, Debug)]
pub struct Facts {
    /// The settings, those of the program where the user's cannot be read.
    pub config: Config,
    /// Why the user's settings cannot be read.
    pub config_error: Option<String>,
    pub seen: Seen,
    /// `None` where there is no camera to try.
    pub node: Option<Node>,
    pub film: Option<Film>,
    /// Time to decode a picture of the configured size, ms.
    pub decode_ms: Result<f64, String>,
    /// First line of what ffmpeg says about itself.
    pub ffmpeg: Option<String>,
    pub disk: Result<Disk, String>,
    pub load: Load,
    pub screen: Screen,
    pub installed: Installed,
}

/// Looks at the machine; takes about three seconds, and more with a slow camera.
pub fn gather(asked: Asked) -> Facts {
    let (config, config_error) = match asked.config {
        Ok(config) => (config, None),
        Err(e) => (Config::default(), Some(e)),
    };
    let seen = camera::seen(asked.device.as_deref());
    let node = seen.chosen.as_deref().map(camera::node);
    let film = match (&seen.chosen, &node) {
        (Some(device), Some(Node::Opens)) => Some(camera::film(device, &config.camera)),
        _ => None,
    };
    Facts {
        seen,
        node,
        film,
        decode_ms: measure::decode_ms(Size::new(config.camera.width, config.camera.height)),
        ffmpeg: ffmpeg(),
        disk: measure::disk(&asked.folder).map_err(|e| format!("{}: {e}", asked.folder.display())),
        load: load(&config),
        screen: asked.screen,
        installed: service::installed(Path::new("/")),
        config,
        config_error,
    }
}

fn ffmpeg() -> Option<String> {
    let output = Command::new("ffmpeg")
        .arg("-version")
        .stdin(Stdio::null())
        .output()
        .ok()?;
    let text = String::from_utf8_lossy(&output.stdout);
    text.lines()
        .next()
        .filter(|_| output.status.success())
        .map(|l| l.split(" Copyright").next().unwrap_or(l).to_owned())
}

fn load(config: &Config) -> Load {
    let frames_per_s = measure::frames_per_s(config);
    Load {
        cores: std::thread::available_parallelism().map_or(1, usize::from),
        frames_per_s,
        // Read after the work, when it is warm.
        celsius: hottest_celsius(),
        clock_share: clock_share(),
    }
}

/// The highest of the kernel's thermal zones.
fn hottest_celsius() -> Option<f64> {
    let mut hottest: Option<f64> = None;
    for zone in std::fs::read_dir("/sys/class/thermal").ok()?.flatten() {
        if !zone
            .file_name()
            .to_string_lossy()
            .starts_with("thermal_zone")
        {
            continue;
        }
        if let Some(millidegrees) = number_in(&zone.path().join("temp")) {
            let celsius = millidegrees / 1000.0;
            hottest = Some(hottest.map_or(celsius, |other| other.max(celsius)));
        }
    }
    hottest
}

/// The present limit of the first core's clock, as a share of the highest.
fn clock_share() -> Option<f64> {
    let clock = Path::new("/sys/devices/system/cpu/cpu0/cpufreq");
    let limit = number_in(&clock.join("scaling_max_freq"))?;
    let highest = number_in(&clock.join("cpuinfo_max_freq"))?;
    Some(limit / highest.max(1.0))
}

/// The number that a file of the kernel holds.
fn number_in(path: &Path) -> Option<f64> {
    std::fs::read_to_string(path).ok()?.trim().parse().ok()
}
