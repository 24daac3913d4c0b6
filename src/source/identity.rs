//! Which camera is which, whatever number the system gave it today: by sysfs.
//!
//! `/dev/videoN` goes to the camera that is plugged in first. A USB camera is known by
//! vendor, product and serial number; one without a serial number, and any other, by the socket
//! that it sits in.

use std::path::{Path, PathBuf};

/// Where the system tells of its devices; elsewhere only in tests.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Places {
    pub sys: PathBuf,
    pub dev: PathBuf,
}

impl Default for Places {
    fn default() -> Self {
        Self {
            sys: "/sys".into(),
            dev: "/dev".into(),
        }
    }
}

/// What stays when the number changes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity {
    /// E.g. `usb-046d:0825-8A3F21-0.0`: no blanks, the same after every plugging in.
    /// [`crate::source::open`] takes it.
    pub id: String,
    /// The socket, e.g. `usb 1-1.2` or `platform vivid.0`.
    pub port: String,
    /// Vendor and product of a USB camera, e.g. `046d:0825`.
    pub product: Option<String>,
    pub serial: Option<String>,
}

/// A video device by its number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Node {
    pub path: PathBuf,
    /// What the driver calls it; empty where that is not to be had.
    pub name: String,
    pub identity: Option<Identity>,
}

/// All video devices, by number. A system without sysfs still has its nodes.
pub(super) fn nodes(places: &Places) -> Vec<Node> {
    let mut all = numbers(&places.sys.join("class/video4linux"));
    all.extend(numbers(&places.dev));
    all.sort_unstable();
    all.dedup();
    all.into_iter()
        .map(|n| node(places, &format!("video{n}")))
        .collect()
}

/// Of the entries `videoN`.
fn numbers(folder: &Path) -> Vec<u32> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let number = name.to_str().and_then(|n| n.strip_prefix("video"));
        found.extend(number.and_then(|n| n.parse::<u32>().ok()));
    }
    found
}

fn node(places: &Places, name: &str) -> Node {
    let class = places.sys.join("class/video4linux").join(name);
    let card = attribute(&class, "name").unwrap_or_default();
    let identity = std::fs::canonicalize(&class)
        .ok()
        .and_then(|device| identify(&device, &card));
    Node {
        path: places.dev.join(name),
        name: card,
        identity,
    }
}

fn attribute(device: &Path, name: &str) -> Option<String> {
    let text = std::fs::read_to_string(device.join(name)).ok()?;
    let text = text.trim();
    (!text.is_empty()).then(|| text.to_owned())
}

/// Reads what `device` (`…/1-1.2/1-1.2:1.0/video4linux/video0`) and the folders above it say.
fn identify(device: &Path, card: &str) -> Option<Identity> {
    let index = attribute(device, "index").unwrap_or_else(|| "0".into());
    let parent = device.parent()?.parent()?;
    if let Some(usb) = parent.ancestors().find(|a| a.join("idVendor").exists()) {
        let product = format!(
            "{}:{}",
            attribute(usb, "idVendor")?,
            attribute(usb, "idProduct")?
        );
        let (serial, socket) = (attribute(usb, "serial"), base_name(usb)?);
        // One camera may have two of them: the number of the interface tells, and the same after
        // every plugging in.
        let part = attribute(parent, "bInterfaceNumber")
            .map_or(0, |n| u32::from_str_radix(&n, 16).unwrap_or(0));
        let who = serial
            .as_deref()
            .map_or_else(|| format!("at-{socket}"), plain);
        let id = format!("usb-{product}-{who}-{part}.{index}");
        return Some(Identity {
            id,
            port: format!("usb {socket}"),
            product: Some(product),
            serial,
        });
    }
    let (product, serial) = (None, None);
    if base_name(parent)? == "virtual" {
        // Nothing is plugged in anywhere; the number is the only socket there is.
        return Some(Identity {
            id: format!("virtual-{}-{index}", plain(card)),
            port: base_name(device)?,
            product,
            serial,
        });
    }
    let bus = std::fs::canonicalize(parent.join("subsystem"))
        .ok()
        .and_then(|s| base_name(&s));
    let (bus, socket) = (bus.unwrap_or_else(|| "bus".into()), base_name(parent)?);
    Some(Identity {
        id: format!("{bus}-{}-{index}", plain(&socket)),
        port: format!("{bus} {socket}"),
        product,
        serial,
    })
}

fn base_name(path: &Path) -> Option<String> {
    path.file_name().map(|n| n.to_string_lossy().into_owned())
}

/// The text with everything that a shell might take for something else made `_`.
fn plain(text: &str) -> String {
    text.chars()
        .map(|c| {
            if c.is_ascii_alphanumeric() || ".:+-".contains(c) {
                c
            } else {
                '_'
            }
        })
        .collect()
}

/// The name under `/dev/v4l/by-id` (else `by-path`) that leads to `path`.
pub(super) fn link(places: &Places, path: &Path) -> Option<PathBuf> {
    link_in(places, path, &["v4l/by-id", "v4l/by-path"])
}

/// The name by the socket alone, which no two cameras share.
pub(super) fn link_by_path(places: &Places, path: &Path) -> Option<PathBuf> {
    link_in(places, path, &["v4l/by-path"])
}

fn link_in(places: &Places, path: &Path, folders: &[&str]) -> Option<PathBuf> {
    let target = std::fs::canonicalize(path).ok()?;
    folders.iter().find_map(|folder| {
        let entries = std::fs::read_dir(places.dev.join(folder)).ok()?.flatten();
        let mut links: Vec<PathBuf> = entries.map(|e| e.path()).collect();
        links.sort();
        links
            .into_iter()
            .find(|link| std::fs::canonicalize(link).is_ok_and(|t| t == target))
    })
}

/// The camera that was opened, as it is to be found again.
#[derive(Clone, Debug)]
pub(super) struct Known {
    places: Places,
    path: PathBuf,
    identity: Option<Identity>,
    /// Sockets of others that say they are the same: cheap cameras share a serial number.
    twins: Vec<String>,
}

impl Known {
    pub(super) fn new(places: Places, path: &Path) -> Self {
        // A link under by-id is another name of the node.
        let path = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let all = nodes(&places);
        let identity = all
            .iter()
            .find(|n| n.path == path)
            .and_then(|n| n.identity.clone());
        let mut twins = Vec::new();
        for node in all.iter().filter(|n| n.path != path) {
            if let (Some(own), Some(other)) = (&identity, &node.identity)
                && own.id == other.id
            {
                twins.push(other.port.clone());
            }
        }
        Self {
            places,
            path,
            identity,
            twins,
        }
    }

    pub(super) fn identity(&self) -> Option<&Identity> {
        self.identity.as_ref()
    }

    /// The folder below /sys of the USB interface that `node` belongs to: it vanishes when the
    /// kernel is done with taking an unplugged device away. `None` for what is not on USB.
    pub(super) fn interface_of(&self, node: &Path) -> Option<PathBuf> {
        let node = std::fs::canonicalize(node).unwrap_or_else(|_| node.to_owned());
        let class = self
            .places
            .sys
            .join("class/video4linux")
            .join(node.file_name()?);
        let device = std::fs::canonicalize(class).ok()?;
        let interface = device.parent()?.parent()?;
        interface
            .join("bInterfaceNumber")
            .exists()
            .then(|| interface.to_owned())
    }

    /// Where it is now: it may have got another number. Without an identity the path is all that is
    /// known of it.
    pub(super) fn find(&self) -> Option<PathBuf> {
        let Some(known) = &self.identity else {
            return self.path.exists().then(|| self.path.clone());
        };
        let mut found: Vec<(PathBuf, Identity)> = Vec::new();
        for node in nodes(&self.places) {
            if let Some(identity) = node.identity
                && identity.id == known.id
                && !self.twins.contains(&identity.port)
            {
                found.push((node.path, identity));
            }
        }
        let at_its_port = found.iter().find(|(_, i)| i.port == known.port);
        at_its_port.or(found.first()).map(|(path, _)| path.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::os::unix::fs::symlink;

    /// A made-up /sys and /dev.
    struct System {
        folder: tempfile::TempDir,
        places: Places,
    }

    impl System {
        fn new() -> Self {
            let folder = tempfile::tempdir().expect("tempdir");
            let root = fs::canonicalize(folder.path()).expect("path");
            let places = Places {
                sys: root.join("sys"),
                dev: root.join("dev"),
            };
            fs::create_dir_all(places.sys.join("class/video4linux")).expect("class");
            fs::create_dir_all(places.dev.join("v4l/by-id")).expect("dev");
            Self { folder, places }
        }

        /// Plugs in a device below `parent` as `videoN`; `files` are its attributes, by path below
        /// sys/devices.
        fn plug(&self, parent: &str, number: u32, files: &[(&str, &str)]) {
            let node = format!("video{number}");
            let device = self
                .places
                .sys
                .join("devices")
                .join(parent)
                .join("video4linux")
                .join(&node);
            fs::create_dir_all(&device).expect("device");
            fs::write(device.join("name"), "Cam: a cam\n").expect("name");
            fs::write(device.join("index"), "0\n").expect("index");
            for (name, text) in files {
                fs::write(self.places.sys.join("devices").join(name), text).expect("attribute");
            }
            symlink(
                &device,
                self.places.sys.join("class/video4linux").join(&node),
            )
            .expect("link");
            fs::write(self.places.dev.join(&node), "").expect("node");
        }

        fn usb(&self, socket: &str, number: u32, serial: Option<&str>) {
            let usb = format!("pci0/usb1/{socket}");
            let files = [
                (format!("{usb}/idVendor"), "046d\n"),
                (format!("{usb}/idProduct"), "0825\n"),
            ];
            let files: Vec<(&str, &str)> = files.iter().map(|(a, b)| (a.as_str(), *b)).collect();
            self.plug(&format!("{usb}/{socket}:1.0"), number, &files);
            if let Some(serial) = serial {
                fs::write(
                    self.places.sys.join("devices").join(&usb).join("serial"),
                    serial,
                )
                .expect("serial");
            }
        }

        fn unplug(&self, number: u32) {
            let class = self
                .places
                .sys
                .join(format!("class/video4linux/video{number}"));
            let device = fs::canonicalize(&class).expect("device");
            fs::remove_file(class).expect("link");
            fs::remove_dir_all(device).expect("device");
            fs::remove_file(self.places.dev.join(format!("video{number}"))).expect("node");
        }

        fn known(&self, number: u32) -> Known {
            Known::new(self.places.clone(), &self.dev(number))
        }

        fn dev(&self, number: u32) -> PathBuf {
            self.places.dev.join(format!("video{number}"))
        }

        fn id(&self, number: u32) -> String {
            self.known(number)
                .identity()
                .expect("an identity")
                .id
                .clone()
        }
    }

    #[test]
    fn the_interface_of_a_usb_camera_is_a_folder_that_goes_with_it() {
        let system = System::new();
        system.usb("1-1", 0, None);
        let usb = system.known(0);
        assert_eq!(usb.interface_of(&system.dev(0)), None, "not on USB");
        let interface = system.places.sys.join("devices/pci0/usb1/1-1/1-1:1.0");
        fs::write(interface.join("bInterfaceNumber"), "00\n").expect("attribute");
        assert_eq!(usb.interface_of(&system.dev(0)), Some(interface));
        assert_eq!(usb.interface_of(&system.dev(1)), None, "no such node");
    }

    #[test]
    fn cameras_are_named_by_what_stays() {
        let system = System::new();
        system.usb("1-1.2", 0, Some("8A 3F\n"));
        system.usb("1-3", 4, None);
        system.plug("platform/vivid.0", 5, &[]);
        system.plug("virtual", 10, &[]);
        assert!(system.folder.path().exists());
        let ids = [0, 4, 5, 10].map(|n| system.id(n));
        let expected = [
            "usb-046d:0825-8A_3F-0.0",
            "usb-046d:0825-at-1-3-0.0",
            "bus-vivid.0-0",
            "virtual-Cam:_a_cam-0",
        ];
        assert_eq!(ids, expected);
        let numbers: Vec<PathBuf> = nodes(&system.places).into_iter().map(|n| n.path).collect();
        assert_eq!(
            numbers,
            [0, 4, 5, 10].map(|n| system.dev(n)),
            "by number, not by letters"
        );
    }

    #[test]
    fn a_camera_is_found_again_under_another_number_and_no_other_is_taken_for_it() {
        let system = System::new();
        system.usb("1-1", 0, Some("A1"));
        let known = system.known(0);
        assert_eq!(known.find(), Some(system.dev(0)));
        system.unplug(0);
        assert_eq!(known.find(), None);
        // Another camera of the same make has its old number now.
        system.usb("1-2", 0, Some("B2"));
        assert_eq!(known.find(), None);
        system.usb("1-4", 3, Some("A1"));
        assert_eq!(known.find(), Some(system.dev(3)));
    }

    #[test]
    fn twins_with_one_serial_number_are_told_apart_by_their_sockets() {
        let system = System::new();
        system.usb("1-1", 0, Some("SN0001"));
        system.usb("1-2", 1, Some("SN0001"));
        let known = system.known(0);
        system.unplug(0);
        assert_eq!(known.find(), None, "the twin was there all the time");
        system.usb("1-3", 2, Some("SN0001"));
        assert_eq!(known.find(), Some(system.dev(2)));
    }

    #[test]
    fn a_name_that_two_cameras_share_is_refused_with_the_names_that_they_do_not() {
        let system = System::new();
        system.usb("1-1", 0, Some("SN0001"));
        let id = system.id(0);
        let named = || crate::source::devices::by_identity(&id, &system.places);
        assert_eq!(named().ok(), Some(system.dev(0)));
        system.usb("1-2", 1, Some("SN0001"));
        let by_path = system
            .places
            .dev
            .join("v4l/by-path/pci-usb-1-2-video-index0");
        fs::create_dir_all(system.places.dev.join("v4l/by-path")).expect("dev");
        symlink(system.dev(1), &by_path).expect("link");
        let said = named().expect_err("either might be meant").to_string();
        for what in [&id, "2 cameras", "usb 1-1", "usb 1-2"] {
            assert!(said.contains(what), "{said}");
        }
        assert!(
            said.contains(&by_path.display().to_string()) && !said.contains('\n'),
            "{said}"
        );
        system.unplug(0);
        assert_eq!(named().ok(), Some(system.dev(1)), "alone it is the one");
    }

    #[test]
    fn a_link_is_another_name_of_its_camera() {
        let system = System::new();
        system.usb("1-1", 2, Some("A1"));
        let name = system.places.dev.join("v4l/by-id/usb-Cam-video-index0");
        symlink(system.dev(2), &name).expect("link");
        assert_eq!(link(&system.places, &system.dev(2)), Some(name.clone()));
        assert_eq!(
            Known::new(system.places.clone(), &name)
                .identity()
                .map(|i| i.id.clone()),
            Some(system.id(2))
        );
    }

    #[test]
    fn without_sysfs_the_path_is_all_there_is() {
        let system = System::new();
        fs::write(system.dev(0), "").expect("node");
        let known = system.known(0);
        assert_eq!(
            (known.identity(), known.find()),
            (None, Some(system.dev(0)))
        );
    }
}
