//! Cameras that are plugged in: which they are, what they can do, and what would be filmed with
//! them.

use super::choice::Mode;
use super::error::SourceError;
use super::identity::{Identity, Node, Places, link, link_by_path, nodes};
use super::v4l2::prospect;
use crate::config;
use std::path::PathBuf;

/// A video device of this machine; not every one of them films.
#[derive(Clone, Debug, PartialEq)]
pub struct Device {
    pub path: PathBuf,
    /// What the driver calls it.
    pub name: String,
    /// Driver and bus where they can be asked, e.g. `uvcvideo at usb-0000:00:14.0-1`, else what is
    /// known.
    pub description: String,
    /// Which it is, whatever its number; `None` where the system does not tell.
    pub identity: Option<Identity>,
    /// Its name under `/dev/v4l`, where there is one.
    pub link: Option<PathBuf>,
    /// Whether it delivers pictures at all.
    pub films: bool,
    /// What it says it can do, of what we can read.
    pub modes: Vec<Mode>,
    /// What it says it can do as a depth camera; with nothing else in `modes` it is none that films.
    pub depth_modes: Vec<Mode>,
    /// What would be filmed, e.g. `MJPG 1280x720 @ 30`, and why.
    pub chosen: Option<(String, String)>,
    /// Why it cannot be opened, and what to do.
    pub closed: Option<String>,
}

/// All video devices, by number, and what would be filmed with the default settings; none is no
/// error.
pub fn list() -> Vec<Device> {
    list_for(&config::Camera::default(), &Places::default())
}

/// The same with these settings, on a system whose `/sys` and `/dev` are at `places`.
pub fn list_for(config: &config::Camera, places: &Places) -> Vec<Device> {
    nodes(places)
        .into_iter()
        .map(|node| device(node, config, places))
        .collect()
}

fn device(node: Node, config: &config::Camera, places: &Places) -> Device {
    let link = link(places, &node.path);
    let (path, identity) = (node.path, node.identity);
    let port = identity
        .as_ref()
        .map_or_else(|| "nothing is known of it".to_owned(), |i| i.port.clone());
    match prospect(&path, config) {
        Ok(p) => {
            let only_depth = p.modes.is_empty() && !p.depth_modes.is_empty();
            let kind = match p.films {
                true if only_depth => ", depth",
                true => "",
                false => ", does not film",
            };
            Device {
                name: p.card,
                description: format!("{} at {}{kind}", p.driver, p.bus),
                films: p.films && !only_depth,
                modes: p.modes,
                depth_modes: p.depth_modes,
                chosen: p.chosen.map(|(granted, why)| (granted.to_string(), why)),
                closed: None,
                path,
                identity,
                link,
            }
        }
        Err(e) => Device {
            name: if node.name.is_empty() {
                "?".into()
            } else {
                node.name
            },
            description: port,
            // Only a program that may open it can know.
            films: true,
            modes: Vec::new(),
            depth_modes: Vec::new(),
            chosen: None,
            closed: Some(e.to_string()),
            path,
            identity,
            link,
        },
    }
}

/// Where the camera of this identity is now.
///
/// # Errors
/// It is not plugged in, or there are several that share a serial number and with it the identity.
pub(super) fn by_identity(id: &str, places: &Places) -> Result<PathBuf, SourceError> {
    let mut found = nodes(places);
    found.retain(|n| n.identity.as_ref().is_some_and(|i| i.id == id));
    let input = id.to_owned();
    match found.as_slice() {
        [] => {
            let hint = "plug the camera in; `arborcam devices` lists those that are there";
            Err(SourceError::Absent { input, hint })
        }
        [only] => Ok(only.path.clone()),
        twins => {
            let names: Vec<String> = twins.iter().map(|n| unique_name(n, places)).collect();
            let what = format!(
                "{} cameras go by this name; name the one that is meant: {}",
                twins.len(),
                names.join(", ")
            );
            Err(SourceError::BadFormat { input, what })
        }
    }
}

/// What to name a camera by that shares its identity with others.
fn unique_name(node: &Node, places: &Places) -> String {
    let path = link_by_path(places, &node.path).unwrap_or_else(|| node.path.clone());
    match &node.identity {
        Some(identity) => format!("{} ({})", path.display(), identity.port),
        None => path.display().to_string(),
    }
}

/// Whether the name is of the kind that [`Identity::id`] has.
pub(super) fn is_identity(name: &str) -> bool {
    let kinds = ["usb-", "virtual-", "platform-", "pci-", "bus-"];
    !name.contains('/') && kinds.iter().any(|kind| name.starts_with(kind))
}
