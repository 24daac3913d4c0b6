//! `arborcam devices`: lists the connected cameras.

use super::command_error::CommandError;
use super::output::print;
use crate::config::Config;
use crate::source::{self, Device, Mode, Places};
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub struct DevicesArgs {
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// Settings that differ from the defaults (TOML); they decide which format would be used.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
}

pub fn run(args: &DevicesArgs) -> Result<(), CommandError> {
    let config = Config::default().layered(args.config.as_deref(), |_| {})?;
    let devices = source::list_for(&config.camera, &Places::default());
    let text = if args.json {
        format!(
            "{}\n",
            devices.iter().map(json).collect::<serde_json::Value>()
        )
    } else {
        devices.iter().map(shown).collect()
    };
    let printed = print(&text);
    if devices.is_empty() {
        return Err(CommandError::NoInput(anyhow::anyhow!(
            "no camera found; plug one in, and look whether /dev/video0 appears"
        )));
    }
    printed
}

fn mode_json(m: &Mode) -> serde_json::Value {
    serde_json::json!({
        "format": m.format.fourcc(),
        "width": m.size.width,
        "height": m.size.height,
        "rates_hz": m.rates_hz,
    })
}

fn json(d: &Device) -> serde_json::Value {
    let identity = d.identity.as_ref();
    serde_json::json!({
        "path": d.path,
        "name": d.name,
        "description": d.description,
        "identity": identity.map(|i| &i.id),
        "port": identity.map(|i| &i.port),
        "product": identity.and_then(|i| i.product.as_ref()),
        "serial": identity.and_then(|i| i.serial.as_ref()),
        "link": d.link,
        "films": d.films,
        "modes": d.modes.iter().map(mode_json).collect::<Vec<_>>(),
        "depth_modes": d.depth_modes.iter().map(mode_json).collect::<Vec<_>>(),
        "chosen": d.chosen.as_ref().map(|(mode, why)| serde_json::json!({ "mode": mode, "why": why })),
        "closed": d.closed,
    })
}

/// A line for the camera; below it its identity, its formats and the format that would be used.
fn shown(d: &Device) -> String {
    let mut text = format!(
        "{:<14} {}  ({})\n",
        d.path.display().to_string(),
        d.name,
        d.description
    );
    if let Some(identity) = &d.identity {
        let serial = identity
            .serial
            .as_ref()
            .map_or(String::new(), |s| format!(", serial number {s}"));
        let known = format!("{} ({}{serial})", identity.id, identity.port);
        text += &detail("identity", &known);
    }
    if let Some(link) = &d.link {
        text += &detail("link", &link.display().to_string());
    }
    for row in rows(&d.modes) {
        text += &detail("offers", &row);
    }
    for row in rows(&d.depth_modes) {
        text += &detail("depth", &row);
    }
    if let Some((mode, why)) = &d.chosen {
        text += &detail("would be", &format!("{mode}: {why}"));
    }
    if let Some(closed) = &d.closed {
        text += &detail("closed", closed);
    }
    text
}

fn detail(name: &str, what: &str) -> String {
    format!("    {name:<9} {what}\n")
}

/// A row for each pixel format, e.g. `MJPG 1280x720 @ 60 30, 640x480 @ 30`.
fn rows(modes: &[Mode]) -> Vec<String> {
    let mut rows: Vec<(&str, String)> = Vec::new();
    for mode in modes {
        let rates: String = mode
            .rates_hz
            .iter()
            .map(|hz| format!(" {}", (hz * 100.0).round() / 100.0))
            .collect();
        let at = if rates.is_empty() { "" } else { " @" };
        let size = format!("{}{at}{rates}", mode.size);
        match rows
            .iter_mut()
            .find(|(format, _)| *format == mode.format.fourcc())
        {
            Some((_, row)) => row.push_str(&format!(", {size}")),
            None => rows.push((mode.format.fourcc(), size)),
        }
    }
    rows.into_iter()
        .map(|(format, row)| format!("{format} {row}"))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{PixelFormat, Size};

    fn mode(format: PixelFormat, width: u32, height: u32, rates_hz: &[f64]) -> Mode {
        Mode {
            format,
            size: Size::new(width, height),
            rates_hz: rates_hz.to_vec(),
        }
    }

    #[test]
    fn a_camera_is_shown_with_all_that_is_needed_to_name_and_to_choose_it() {
        let modes = vec![
            mode(PixelFormat::Mjpeg, 1280, 720, &[30.0, 29.97]),
            mode(PixelFormat::Yuyv, 640, 480, &[]),
            mode(PixelFormat::Mjpeg, 640, 480, &[60.0]),
        ];
        assert_eq!(
            rows(&modes),
            ["MJPG 1280x720 @ 30 29.97, 640x480 @ 60", "YUYV 640x480"]
        );
        let device = Device {
            path: "/dev/video2".into(),
            name: "Cam".into(),
            description: "uvcvideo at usb-1".into(),
            identity: Some(source::Identity {
                id: "usb-046d:0825-A1-0.0".into(),
                port: "usb 1-1".into(),
                product: Some("046d:0825".into()),
                serial: Some("A1".into()),
            }),
            link: None,
            films: true,
            modes,
            depth_modes: vec![mode(PixelFormat::Z16, 848, 480, &[30.0])],
            chosen: Some(("MJPG 1280x720 @ 30".into(), "why".into())),
            closed: None,
        };
        let text = shown(&device);
        for what in [
            "/dev/video2",
            "usb-046d:0825-A1-0.0 (usb 1-1, serial number A1)",
            "would be  MJPG 1280x720 @ 30: why",
            "depth     Z16 848x480 @ 30",
        ] {
            assert!(text.contains(what), "{text}");
        }
        let json = json(&device);
        assert_eq!(
            (&json["identity"], &json["serial"]),
            (&"usb-046d:0825-A1-0.0".into(), &"A1".into())
        );
        assert_eq!(
            (
                json["modes"][0]["width"].as_u64(),
                json["chosen"]["mode"].as_str()
            ),
            (Some(1280), Some("MJPG 1280x720 @ 30"))
        );
    }
}
