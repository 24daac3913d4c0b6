//! Reads the frames of a recording, its own or another program's (MCAP, or a bag of ROS 1), in their
//! order.

use super::bag::{self, Bag};
use super::channel::Role;
use super::contents::{About, Contents};
use super::cursor::Cursor;
use super::error::RecordingError;
use super::foreign::Foreign;
use super::image::{Decoded, Picture, decode, decode_depth};
use super::pairing::Pairing;
use super::records::{MessageHead, Record, Records, first_bytes, summary};
use super::ros::{self, Kind, ROS_UNIT_M};
use super::schema::{
    CAPTURED_AT, CLOCK, DEPTH_CAMERA_PX, DEPTH_DISTORTION, DEPTH_UNIT_M, FILE_CLOCK,
    FIRST_SEQUENCE, SHIFT_NS,
};
use super::walk::Walk;
use crate::model::{CameraModel, DepthImage, DepthRig, LocalTime, Origin, Pinhole, Size};
use std::fs::File;
use std::io::{self, Read, Seek};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A depth image of a recording of ours, until its frame comes.
struct OwnDepth {
    publish_ns: u64,
    image: Arc<DepthImage>,
}

/// A recording that is being read.
pub struct Reader<R = File> {
    path: PathBuf,
    records: Records<R>,
    contents: Contents,
    sequence: Option<u64>,
    /// The first picture's time by the calendar, ns since 1970, in a file of ours.
    first_log_ns: Option<i64>,
    unreadable: u64,
    broken: Option<String>,
    /// Depth images are taken.
    wants_depth: bool,
    /// Depth of our own recordings is paired with pictures by its times, too.
    pairs_anew: bool,
    own_depth: Option<OwnDepth>,
    foreign: Foreign,
}

impl Reader {
    /// Opens a file.
    ///
    /// # Errors
    /// It cannot be read, is no recording, or holds several series of pictures.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let file = File::open(path).map_err(|e| RecordingError::unreadable(path, e))?;
        Self::new(path, file)
    }
}

impl<R: Read + Seek> Reader<R> {
    /// Reads what begins in `file`; `path` is for messages.
    ///
    /// # Errors
    /// As for [`Reader::open`].
    pub fn new(path: &Path, mut file: R) -> Result<Self, RecordingError> {
        let first = first_bytes(&mut file).map_err(|e| RecordingError::unreadable(path, e))?;
        let is_bag = first.starts_with(bag::ANY_MAGIC);
        if is_bag && first != bag::MAGIC {
            return Err(RecordingError::unusable(
                path,
                "it is a bag of an old format; convert it with `rosbag migrate`",
            ));
        }
        let (reader, filter) = match is_bag {
            true => (
                Self::of_bag(path, file),
                "rosbag filter IN.bag OUT.bag 'topic == \"TOPIC\"'",
            ),
            false => (Self::of_mcap(path, file), "mcap filter -y TOPIC"),
        };
        let reader = reader.map_err(|e| RecordingError::unreadable(path, e))?;
        let Some(reader) = reader else {
            return Err(RecordingError::unusable(
                path,
                "it does not begin as a recording (MCAP, or a bag of ROS 1) does; give a file that \
                 `record` made",
            ));
        };
        reader.contents.check_series(path, filter)?;
        Ok(reader)
    }

    /// Reads an MCAP file; `None` if it is none.
    fn of_mcap(path: &Path, mut file: R) -> io::Result<Option<Self>> {
        // The summary at the end is a help, not a condition.
        let summary = summary(&mut file)?.unwrap_or_default();
        let Some(walk) = Walk::new(file)? else {
            return Ok(None);
        };
        let mut reader = Self::of_records(path, Records::Mcap(Box::new(walk)));
        let mut rest = Cursor(&summary);
        while let Some((kind, body)) = rest.record() {
            reader.contents.note(kind, body);
        }
        Ok(Some(reader))
    }

    /// Reads a bag of ROS 1.
    fn of_bag(path: &Path, file: R) -> io::Result<Option<Self>> {
        let mut bag = Bag::new(file)?;
        let index = bag.index()?;
        let mut reader = Self::of_records(path, Records::Bag(Box::new(bag)));
        reader.contents.note_index(index);
        Ok(Some(reader))
    }

    fn of_records(path: &Path, records: Records<R>) -> Self {
        Self {
            path: path.to_owned(),
            records,
            contents: Contents::default(),
            sequence: None,
            first_log_ns: None,
            unreadable: 0,
            broken: None,
            wants_depth: true,
            pairs_anew: false,
            own_depth: None,
            foreign: Foreign::default(),
        }
    }

    /// Takes pictures alone from now on.
    pub fn leave_depth_out(&mut self) {
        self.wants_depth = false;
    }

    /// For depth images that are stamped so much later than they were taken, s. Those of our own recordings, which lie
    /// with their pictures, are paired anew then.
    pub fn set_depth_late(&mut self, late_s: f64) {
        self.foreign.pairing = Pairing::late_by(late_s);
        self.pairs_anew = late_s != 0.0;
    }

    /// Whether there is depth that is wanted, as far as is known by now.
    pub fn has_depth(&self) -> bool {
        let mut channels = self.contents.channels();
        self.wants_depth && channels.any(|c| c.role() == Role::Depth)
    }

    /// Metres for each count of depth; `None` where the recording does not say.
    pub fn depth_unit_m(&self) -> Option<f64> {
        let mut channels = self.contents.channels();
        let has_ros = channels.any(|c| c.role() == Role::Depth && c.layout.is_some());
        let said = self.contents.number(DEPTH_UNIT_M);
        said.or(self.foreign.unit_m)
            .or(has_ros.then_some(ROS_UNIT_M))
    }

    /// Whether the depth came in metres, and its unit is how they are counted here.
    pub fn is_depth_in_metres(&self) -> bool {
        self.foreign.is_in_metres
    }

    /// The colour camera for pictures of this size; `None` where the recording does not say.
    pub fn depth_camera(&self, picture: Size) -> Option<CameraModel> {
        let mut own_px = [0.0; 4];
        for (px, key) in own_px.iter_mut().zip(DEPTH_CAMERA_PX) {
            *px = self.contents.number(key).unwrap_or(0.0);
        }
        let mut own = CameraModel::new(
            picture,
            Pinhole {
                focal_px: [own_px[0], own_px[1]].into(),
                middle_px: [own_px[2], own_px[3]].into(),
            },
        );
        let distortion = self.contents.about.get(DEPTH_DISTORTION);
        let numbers = distortion.iter().flat_map(|text| text.split_whitespace());
        for (own, number) in own.distortion.iter_mut().zip(numbers) {
            *own = number.parse().unwrap_or(f64::NAN);
        }
        if own.is_valid() {
            return Some(own);
        }
        let camera = self.foreign.camera()?;
        Some(camera.for_size(picture))
    }

    /// The cameras of depth and of pictures, where the depth is not registered with the pictures and
    /// the recording says where both stand.
    pub fn depth_rig(&self) -> Option<DepthRig> {
        self.foreign.rig()
    }

    /// What shows that the depth is not registered with the pictures: both name other frames of
    /// reference, or have other cameras.
    pub fn depth_misfit(&self) -> Option<String> {
        self.foreign.misfit()
    }

    /// What the recording says of itself; complete from the first picture on.
    pub fn about(&self) -> &About {
        &self.contents.about
    }

    /// When it was filmed and what the user noted; complete from the first picture on.
    pub fn origin(&self) -> Origin {
        let about = &self.contents.about;
        let said = about.get(CAPTURED_AT).and_then(|at| at.parse().ok());
        Origin {
            captured_at: said.or_else(|| self.filmed_at()),
            notes: self.contents.notes(),
        }
    }

    /// When a camera has filmed the first picture, by a recording that does not say it in words:
    /// without the time zone.
    fn filmed_at(&self) -> Option<LocalTime> {
        let clock = self.contents.about.get(CLOCK);
        clock.filter(|clock| *clock != FILE_CLOCK)?;
        LocalTime::from_unix_ns(self.first_log_ns?)
    }

    /// Pictures in the file, if it was ended properly.
    pub fn pictures_total(&self) -> Option<u64> {
        self.contents.pictures_total()
    }

    /// Channels seen so far, `topic (schema)`, for saying what there is instead of pictures.
    pub fn topics(&self) -> Vec<String> {
        self.contents.topics()
    }

    /// The next picture; `None` at the end, and after an error of the disk, which the warnings then
    /// name.
    pub fn next_picture(&mut self) -> Option<Picture> {
        loop {
            if let Some(picture) = self.foreign.pairing.ready() {
                return Some(picture);
            }
            let record = match self.records.next() {
                Ok(Some(record)) => record,
                Ok(None) => return self.foreign.pairing.oldest(),
                Err(e) => {
                    self.broken = Some(e.to_string());
                    return self.foreign.pairing.oldest();
                }
            };
            match record {
                Record::Message(head) => {
                    if let Some(picture) = self.message(&head) {
                        return Some(picture);
                    }
                }
                Record::Connection(connection) => self.contents.note_connection(connection),
                Record::Note(kind) => self.contents.note(kind, self.records.body()),
            }
        }
    }

    /// The picture in the message that was just found, if it is one and wanted. Depth is kept for its
    /// picture, and a picture of another program for its depth.
    fn message(&mut self, head: &MessageHead) -> Option<Picture> {
        let channel = self.contents.channel(head.channel)?;
        let content = self.records.content();
        match channel.role() {
            Role::Picture => {
                let is_own = channel.counted.is_some();
                let picture = self.picture(head)?;
                if (is_own && !self.pairs_anew) || !self.has_depth() {
                    return Some(picture);
                }
                self.foreign.pairing.picture(picture);
            }
            Role::Depth if self.wants_depth && channel.is_own_depth() => {
                let decoded = decode_depth(content);
                self.unreadable += u64::from(decoded.is_none());
                let image = decoded.map(|decoded| Arc::new(decoded.image));
                if self.pairs_anew {
                    let time_ns = self.sensor_time_ns(head.publish_ns);
                    if let (Some(image), Some(time_ns)) = (image, time_ns) {
                        self.foreign.pairing.depth(time_ns, image);
                    }
                    return None;
                }
                self.own_depth = image.map(|image| OwnDepth {
                    publish_ns: head.publish_ns,
                    image,
                });
            }
            Role::Depth if self.wants_depth => {
                let topics = self.contents.depth_topics();
                let foreign = &mut self.foreign;
                let is_read = foreign.note_depth(channel, &topics, content, head.log_ns);
                self.unreadable += u64::from(!is_read);
            }
            Role::Camera if self.wants_depth => self.foreign.note_camera(channel, content),
            Role::Transform if self.wants_depth => self.foreign.note_transform(channel, content),
            Role::Depth | Role::Camera | Role::Transform | Role::Other => {}
        }
        None
    }

    /// The picture in the message that was just found.
    fn picture(&mut self, head: &MessageHead) -> Option<Picture> {
        let channel = self.contents.channel(head.channel)?;
        let counted = channel.counted;
        if counted.is_none() && !self.foreign.takes_pictures_of(&channel.topic) {
            return None;
        }
        let content = self.records.content();
        let decoded = match (channel.layout, Kind::of(&channel.schema)) {
            (Some(layout), Some(kind)) => ros::picture(kind, layout, content).map(|read| {
                self.foreign.note_picture_frame(read.stamp.frame_id);
                Decoded::new(read.encoding, read.stamp.time_ns, read.bytes)
            }),
            _ => decode(&channel.schema, content),
        };
        let Some(decoded) = decoded else {
            self.unreadable += 1;
            return None;
        };
        let sensor_time_ns = match counted {
            Some(_) => self.sensor_time_ns(head.publish_ns)?,
            // What other programs mean by their times differs; the picture's own is the nearest to
            // the sensor's.
            None => decoded
                .time_ns
                .filter(|ns| *ns != 0)
                .or(i64::try_from(head.log_ns).ok())?,
        };
        if counted.is_some() && self.first_log_ns.is_none() {
            self.first_log_ns = i64::try_from(head.log_ns).ok();
        }
        let sequence = (counted == Some(true)).then(|| self.whole_sequence(head.number));
        self.sequence = sequence.or(self.sequence);
        let own_depth = self.own_depth.take();
        Some(Picture {
            sequence,
            sensor_time_ns,
            encoding: decoded.encoding,
            bytes: decoded.bytes,
            depth: own_depth
                .filter(|depth| depth.publish_ns == head.publish_ns)
                .map(|depth| depth.image),
        })
    }

    /// Of a time in one of our own files.
    fn sensor_time_ns(&self, publish_ns: u64) -> Option<i64> {
        let shift_ns = self.contents.number(SHIFT_NS).unwrap_or(0);
        i64::try_from(publish_ns).ok()?.checked_sub(shift_ns)
    }

    /// The driver's number of a picture, of which the file holds 32 bits.
    fn whole_sequence(&self, number: u32) -> u64 {
        let before = self
            .sequence
            .or_else(|| self.contents.number(FIRST_SEQUENCE))
            .unwrap_or(u64::from(number));
        before.saturating_add(u64::from(number.wrapping_sub(before as u32)))
    }

    /// What could not be read, a line each; complete after the end.
    pub fn warnings(&self) -> Vec<String> {
        let (name, damage) = (self.path.display(), self.records.damage());
        let mut lines = Vec::new();
        if damage.parts > 0 {
            let (parts, bytes) = (damage.parts, damage.bytes);
            lines.push(format!(
                "{name}: damaged parts left out: {parts} ({bytes} bytes); the rest is used"
            ));
        }
        if let Some(tail) = damage.tail {
            lines.push(format!(
                "{name}: it was not ended properly; all whole chunks are used, {tail} bytes behind them are not"
            ));
        }
        if self.unreadable > 0 {
            lines.push(format!(
                "{name}: messages left out because they hold no picture: {}",
                self.unreadable
            ));
        }
        if let Some(left_out) = self.foreign.left_out() {
            lines.push(format!("{name}: {left_out}"));
        }
        if let Some(e) = &self.broken {
            lines.push(format!(
                "{name}: reading it fails ({e}); what came before is used"
            ));
        }
        lines
    }
}
