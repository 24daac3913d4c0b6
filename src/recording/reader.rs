//! Reads the frames of a recording, its own or another program's (MCAP, or a bag of ROS 1), in their
//! order.

use super::bag::{self, Bag, Connection, Found};
use super::channel::{Channel, Role, camera_topic, is_of_realsense, is_registered};
use super::cursor::Cursor;
use super::error::RecordingError;
use super::image::{Decoded, Picture, decode, decode_depth};
use super::pairing::Pairing;
use super::ros::{self, Kind, Layout, ROS_UNIT_M};
use super::schema::{
    ABOUT, CAPTURED_AT, CLOCK, COUNTED, DEPTH_CAMERA_PX, DEPTH_UNIT_M, FILE_CLOCK, FIRST_SEQUENCE,
    NOTE, SEQUENCE, SHIFT_NS,
};
use super::transforms::Transforms;
use super::walk::{Damage, Walk, read_up_to};
use crate::model::{
    CameraModel, DepthImage, DepthRig, LocalTime, Origin, Pinhole, Size, UserNote, UserNotes,
};
use mcap::records::op;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Bytes of the footer with its head and the mark behind it.
const FOOTER: u64 = 9 + 20 + 8;
/// A summary beyond this is not read; the file can be without.
const MAX_SUMMARY: u64 = 1 << 28;
/// By how much two cameras of the same view may differ, as a share.
const SAME_CAMERA: f64 = 0.01;

/// What a recording says of itself, by the keys of `docs/recordings.md`; empty for another
/// program's.
pub type About = BTreeMap<String, String>;

/// A depth image of a recording of ours, until its frame comes.
struct OwnDepth {
    publish_ns: u64,
    image: Arc<DepthImage>,
}

/// What is known of another program's depth.
#[derive(Default)]
struct ForeignDepth {
    /// The topic that is taken.
    topic: Option<String>,
    /// Cameras by topic.
    cameras: BTreeMap<String, CameraModel>,
    pairing: Pairing<Picture>,
    /// Frames of reference that depth and pictures name.
    depth_frame: Option<String>,
    picture_frame: Option<String>,
    transforms: Transforms,
    /// Metres for each count, as the first depth image says, and whether that is for us to say.
    unit_m: Option<f64>,
    is_in_metres: bool,
}

/// The records of a file.
enum Records<R> {
    Mcap(Box<Walk<R>>),
    Bag(Box<Bag<R>>),
}

/// A record as both formats have it.
enum Record {
    Message(MessageHead),
    Connection(Connection),
    /// A record of this kind of MCAP that is no message.
    Note(u8),
}

impl<R: Read + Seek> Records<R> {
    fn next(&mut self) -> io::Result<Option<Record>> {
        match self {
            Self::Mcap(walk) => {
                let Some(kind) = walk.next()? else {
                    return Ok(None);
                };
                if kind != op::MESSAGE {
                    return Ok(Some(Record::Note(kind)));
                }
                let head = MessageHead::read(&mut Cursor(walk.body()));
                Ok(Some(head.map_or(Record::Note(kind), Record::Message)))
            }
            Self::Bag(bag) => Ok(bag.next()?.map(|found| match found {
                Found::Connection(connection) => Record::Connection(connection),
                Found::Message {
                    connection,
                    time_ns,
                } => Record::Message(MessageHead::of_bag(connection, time_ns)),
            })),
        }
    }

    /// All of a record that is no message.
    fn body(&self) -> &[u8] {
        match self {
            Self::Mcap(walk) => walk.body(),
            Self::Bag(bag) => bag.content(),
        }
    }

    /// The content of a message.
    fn content(&self) -> &[u8] {
        match self {
            Self::Mcap(walk) => {
                let mut body = Cursor(walk.body());
                MessageHead::read(&mut body).map_or(&[], |_| body.0)
            }
            Self::Bag(bag) => bag.content(),
        }
    }

    fn damage(&self) -> Damage {
        match self {
            Self::Mcap(walk) => walk.damage,
            Self::Bag(bag) => bag.damage,
        }
    }
}

/// A recording that is being read.
pub struct Reader<R = File> {
    path: PathBuf,
    records: Records<R>,
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u16, Channel>,
    about: About,
    /// The topic of another program's file whose pictures are taken.
    chosen: Option<String>,
    others: BTreeSet<String>,
    counts: BTreeMap<u16, u64>,
    sequence: Option<u64>,
    /// The first picture's time by the calendar, ns since 1970, in a file of ours.
    first_log_ns: Option<i64>,
    unreadable: u64,
    broken: Option<String>,
    /// Depth images are taken.
    wants_depth: bool,
    own_depth: Option<OwnDepth>,
    foreign_depth: ForeignDepth,
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
        let unreadable = |source| RecordingError::unreadable(path, source);
        let first = first_bytes(&mut file).map_err(unreadable)?;
        if first.starts_with(bag::ANY_MAGIC) {
            return Self::of_bag(path, file, first == bag::MAGIC);
        }
        // The summary at the end is a help, not a condition.
        let summary = summary(&mut file).map_err(unreadable)?.unwrap_or_default();
        let Some(walk) = Walk::new(file).map_err(unreadable)? else {
            return Err(RecordingError::unusable(
                path,
                "it does not begin as a recording (MCAP, or a bag of ROS 1) does; give a file that \
                 `record` made",
            ));
        };
        let mut reader = Self::of_records(path, Records::Mcap(Box::new(walk)));
        let mut rest = Cursor(&summary);
        while let Some((kind, body)) = rest.record() {
            reader.note(kind, body);
        }
        reader.check_series("mcap filter -y TOPIC")?;
        Ok(reader)
    }

    /// Reads a bag of ROS 1.
    fn of_bag(path: &Path, file: R, is_known: bool) -> Result<Self, RecordingError> {
        if !is_known {
            return Err(RecordingError::unusable(
                path,
                "it is a bag of an old format; convert it with `rosbag migrate`",
            ));
        }
        let unreadable = |source| RecordingError::unreadable(path, source);
        let mut bag = Bag::new(file).map_err(unreadable)?;
        let index = bag.index().map_err(unreadable)?;
        let mut reader = Self::of_records(path, Records::Bag(Box::new(bag)));
        for connection in index.connections {
            reader.note_connection(connection);
        }
        for count in index.counts {
            if let Ok(id) = u16::try_from(count.connection) {
                *reader.counts.entry(id).or_insert(0) += count.messages;
            }
        }
        reader.check_series("rosbag filter IN.bag OUT.bag 'topic == \"TOPIC\"'")?;
        Ok(reader)
    }

    fn of_records(path: &Path, records: Records<R>) -> Self {
        Self {
            path: path.to_owned(),
            records,
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            about: About::new(),
            chosen: None,
            others: BTreeSet::new(),
            counts: BTreeMap::new(),
            sequence: None,
            first_log_ns: None,
            unreadable: 0,
            broken: None,
            wants_depth: true,
            own_depth: None,
            foreign_depth: ForeignDepth::default(),
        }
    }

    /// Makes sure that it is known which series of pictures and of depth are meant; `filter` keeps
    /// one.
    fn check_series(&self, filter: &str) -> Result<(), RecordingError> {
        let path = &self.path;
        let foreign: BTreeSet<&str> = self
            .channels
            .values()
            .filter(|c| c.role() == Role::Picture && c.counted.is_none())
            .map(|c| c.topic.as_str())
            .collect();
        if foreign.len() > 1 {
            let topics = foreign.into_iter().collect::<Vec<_>>().join(", ");
            let what = format!(
                "it has several series of pictures ({topics}); keep one, e.g. with `{filter}`"
            );
            return Err(RecordingError::unusable(path, what));
        }
        let depths = self.depth_topics();
        if depths.len() > 1 {
            let what = format!(
                "it has several series of depth ({}); keep the one that is registered with the \
                 pictures, e.g. with `{filter}`",
                depths.join(", ")
            );
            return Err(RecordingError::unusable(path, what));
        }
        Ok(())
    }

    /// Topics of depth that may be taken: those that say to be registered with the pictures, if there
    /// are such.
    fn depth_topics(&self) -> Vec<&str> {
        let of_depth = self.channels.values().filter(|c| c.role() == Role::Depth);
        let mut topics: Vec<&str> = of_depth.map(|c| c.topic.as_str()).collect();
        topics.sort_unstable();
        topics.dedup();
        if topics.iter().any(|topic| is_registered(topic)) {
            topics.retain(|topic| is_registered(topic));
        }
        topics
    }

    /// Takes pictures alone from now on.
    pub fn leave_depth_out(&mut self) {
        self.wants_depth = false;
    }

    /// Whether there is depth that is wanted, as far as is known by now.
    pub fn has_depth(&self) -> bool {
        self.wants_depth && self.channels.values().any(|c| c.role() == Role::Depth)
    }

    /// Metres for each count of depth; `None` where the recording does not say.
    pub fn depth_unit_m(&self) -> Option<f64> {
        let is_ros = |c: &Channel| c.role() == Role::Depth && c.layout.is_some();
        let of_ros = self.channels.values().any(is_ros).then_some(ROS_UNIT_M);
        let said = self.foreign_depth.unit_m;
        self.number(DEPTH_UNIT_M).or(said).or(of_ros)
    }

    /// Whether the depth came in metres, and its unit is how they are counted here.
    pub fn is_depth_in_metres(&self) -> bool {
        self.foreign_depth.is_in_metres
    }

    /// The colour camera for pictures of this size; `None` where the recording does not say.
    pub fn depth_camera(&self, picture: Size) -> Option<Pinhole> {
        let mut own_px = [0.0; 4];
        for (px, key) in own_px.iter_mut().zip(DEPTH_CAMERA_PX) {
            *px = self.number(key).unwrap_or(0.0);
        }
        let own = Pinhole {
            focal_px: [own_px[0], own_px[1]].into(),
            middle_px: [own_px[2], own_px[3]].into(),
        };
        if own.is_valid() {
            return Some(own);
        }
        let camera = match self.depth_misfit().is_some() {
            true => self.picture_camera(),
            false => self.own_depth_camera().or(self.picture_camera()),
        };
        camera.map(|camera| camera.for_size(picture).pinhole)
    }

    /// The camera beside the depth's topic, and that beside the pictures'.
    fn own_depth_camera(&self) -> Option<CameraModel> {
        self.camera_beside(self.foreign_depth.topic.as_deref()?)
    }

    fn picture_camera(&self) -> Option<CameraModel> {
        self.camera_beside(self.chosen.as_deref()?)
    }

    fn camera_beside(&self, topic: &str) -> Option<CameraModel> {
        let camera = camera_topic(topic)?;
        self.foreign_depth.cameras.get(&camera).copied()
    }

    /// The cameras of depth and of pictures, where the depth is not registered with the pictures and
    /// the recording says where both stand.
    pub fn depth_rig(&self) -> Option<DepthRig> {
        self.depth_misfit()?;
        let foreign = &self.foreign_depth;
        let (from, to) = (foreign.topic.as_deref()?, self.chosen.as_deref()?);
        let colour_from_depth = if is_of_realsense(from) {
            // Its frames of reference have numbers that do not place them.
            foreign.transforms.between_topics(from, to)?
        } else {
            let frames = foreign.depth_frame.as_ref();
            let (from, to) = frames.zip(foreign.picture_frame.as_ref())?;
            foreign.transforms.between_frames(from, to)?
        };
        Some(DepthRig {
            depth: self.own_depth_camera()?,
            colour: self.picture_camera()?,
            colour_from_depth,
        })
    }

    /// What shows that the depth is not registered with the pictures: both name other frames of
    /// reference, or have other cameras.
    pub fn depth_misfit(&self) -> Option<String> {
        let foreign = &self.foreign_depth;
        let frames = foreign
            .depth_frame
            .as_ref()
            .zip(foreign.picture_frame.as_ref());
        if let Some((depth, picture)) = frames.filter(|(depth, picture)| depth != picture) {
            return Some(format!("frames {depth} and {picture}"));
        }
        let topic = foreign.topic.as_deref().filter(|t| !is_registered(t))?;
        if is_of_realsense(topic) {
            return Some("a RealSense camera has its depth beside its colours".to_owned());
        }
        let (depth, picture) = (self.camera_beside(topic)?, self.picture_camera()?);
        let differ = !is_same_view(&depth.for_size(picture.size), &picture);
        differ.then(|| "its camera is another one".to_owned())
    }

    /// What the recording says of itself; complete from the first picture on.
    pub fn about(&self) -> &About {
        &self.about
    }

    /// When it was filmed and what the user noted; complete from the first picture on.
    pub fn origin(&self) -> Origin {
        let said = self.about.get(CAPTURED_AT).and_then(|at| at.parse().ok());
        Origin {
            captured_at: said.or_else(|| self.filmed_at()),
            notes: self.notes(),
        }
    }

    /// When a camera has filmed the first picture, by a recording that does not say it in words:
    /// without the time zone.
    fn filmed_at(&self) -> Option<LocalTime> {
        self.about.get(CLOCK).filter(|clock| *clock != FILE_CLOCK)?;
        LocalTime::from_unix_ns(self.first_log_ns?)
    }

    /// The notes in it, but for those that are none: anybody may have written the file.
    fn notes(&self) -> UserNotes {
        let mut notes = UserNotes::default();
        for (key, value) in &self.about {
            let note = key.strip_prefix(NOTE).map(|key| UserNote::new(key, value));
            if let Some(Ok(note)) = note {
                // Those beyond the most that there may be are left out, too.
                let _ = notes.put(note);
            }
        }
        notes
    }

    /// Pictures in the file, if it was ended properly.
    pub fn pictures_total(&self) -> Option<u64> {
        let of_pictures = self.counts.iter().filter(|(id, _)| {
            let channel = self.channels.get(id);
            channel.is_some_and(|channel| channel.role() == Role::Picture)
        });
        let total: u64 = of_pictures.map(|(_, count)| *count).sum();
        (total > 0).then_some(total)
    }

    /// Channels seen so far, `topic (schema)`, for saying what there is instead of pictures.
    pub fn topics(&self) -> Vec<String> {
        self.channels
            .values()
            .map(|c| format!("{} ({})", c.topic, c.schema))
            .collect()
    }

    /// The next picture; `None` at the end, and after an error of the disk, which the warnings then
    /// name.
    pub fn next_picture(&mut self) -> Option<Picture> {
        loop {
            if let Some(picture) = self.foreign_depth.pairing.ready() {
                return Some(picture);
            }
            let record = match self.records.next() {
                Ok(Some(record)) => record,
                Ok(None) => return self.foreign_depth.pairing.oldest(),
                Err(e) => {
                    self.broken = Some(e.to_string());
                    return self.foreign_depth.pairing.oldest();
                }
            };
            match record {
                Record::Message(head) => {
                    if let Some(picture) = self.message(&head) {
                        return Some(picture);
                    }
                }
                Record::Connection(connection) => self.note_connection(connection),
                Record::Note(kind) => {
                    let body = self.records.body().to_vec();
                    self.note(kind, &body);
                }
            }
        }
    }

    /// The picture in the message that was just found, if it is one and wanted. Depth is kept for its
    /// picture, and a picture of another program for its depth.
    fn message(&mut self, head: &MessageHead) -> Option<Picture> {
        let role = self.channels.get(&head.channel)?.role();
        match role {
            Role::Picture => {
                let picture = self.picture(head)?;
                let is_own = self.channels.get(&head.channel)?.counted.is_some();
                if is_own || !self.has_depth() {
                    return Some(picture);
                }
                self.foreign_depth.pairing.picture(picture);
            }
            Role::Depth if self.wants_depth => self.depth(head),
            Role::Camera if self.wants_depth => self.camera(head),
            Role::Transform if self.wants_depth => self.transform(head),
            Role::Depth | Role::Camera | Role::Transform | Role::Other => {}
        }
        None
    }

    /// The content of the message that was just found.
    fn content(&self) -> &[u8] {
        self.records.content()
    }

    /// Keeps a depth image.
    fn depth(&mut self, head: &MessageHead) {
        let Some(channel) = self.channels.get(&head.channel) else {
            return;
        };
        if channel.is_own_depth() {
            let decoded = decode_depth(self.content());
            self.unreadable += u64::from(decoded.is_none());
            self.own_depth = decoded.map(|decoded| OwnDepth {
                publish_ns: head.publish_ns,
                image: Arc::new(decoded.image),
            });
            return;
        }
        let topic = channel.topic.clone();
        let chosen = self.depth_topics().first().map(|topic| (*topic).to_owned());
        let chosen = self
            .foreign_depth
            .topic
            .get_or_insert(chosen.unwrap_or_default());
        if *chosen != topic {
            return;
        }
        let read = match channel.layout {
            Some(layout) => ros::depth(layout, self.content()).map(|read| TimedDepth {
                time_ns: Some(read.stamp.time_ns),
                frame: Some(read.stamp.frame_id),
                image: read.image,
                unit_m: Some(read.unit_m),
                is_in_metres: read.is_in_metres,
            }),
            None => decode_depth(self.content()).map(|read| TimedDepth {
                time_ns: read.time_ns,
                frame: None,
                image: read.image,
                unit_m: read.metres_unit_m,
                is_in_metres: read.metres_unit_m.is_some(),
            }),
        };
        let Some(read) = read else {
            self.unreadable += 1;
            return;
        };
        let foreign = &mut self.foreign_depth;
        if foreign.unit_m.is_none() {
            (foreign.unit_m, foreign.is_in_metres) = (read.unit_m, read.is_in_metres);
        }
        let frame = read.frame.filter(|frame| !frame.is_empty());
        foreign.depth_frame = foreign.depth_frame.take().or(frame);
        let log_ns = i64::try_from(head.log_ns).ok();
        if let Some(time_ns) = read.time_ns.filter(|ns| *ns != 0).or(log_ns) {
            foreign.pairing.depth(time_ns, Arc::new(read.image));
        }
    }

    /// Keeps a camera.
    fn camera(&mut self, head: &MessageHead) {
        let channel = self.channels.get(&head.channel);
        let Some((channel, layout)) = channel.and_then(|c| Some((c, c.layout?))) else {
            return;
        };
        if let Some(camera) = ros::camera(layout, self.content()) {
            let topic = channel.topic.clone();
            self.foreign_depth.cameras.entry(topic).or_insert(camera);
        }
    }

    /// Keeps where something stands.
    fn transform(&mut self, head: &MessageHead) {
        let channel = self.channels.get(&head.channel);
        let Some((channel, layout)) = channel.and_then(|c| Some((c, c.layout?))) else {
            return;
        };
        let (topic, kind) = (channel.topic.clone(), Kind::of(&channel.schema));
        if kind == Some(Kind::Transform) {
            if let Some(transform) = ros::transform(layout, self.content()) {
                self.foreign_depth.transforms.add_stream(&topic, transform);
            }
            return;
        }
        for transform in ros::transforms(layout, self.content()) {
            self.foreign_depth.transforms.add_frame(transform);
        }
    }

    /// The picture in the message that was just found.
    fn picture(&mut self, head: &MessageHead) -> Option<Picture> {
        let channel = self.channels.get(&head.channel)?;
        let counted = channel.counted;
        if counted.is_none() {
            let chosen = self.chosen.get_or_insert_with(|| channel.topic.clone());
            if *chosen != channel.topic {
                self.others.insert(channel.topic.clone());
                return None;
            }
        }
        let content = self.content();
        let decoded = match (channel.layout, Kind::of(&channel.schema)) {
            (Some(layout), Some(kind)) => ros::picture(kind, layout, content).map(|read| {
                let frame = Some(read.stamp.frame_id).filter(|frame| !frame.is_empty());
                (
                    Decoded::new(read.encoding, read.stamp.time_ns, read.bytes),
                    frame,
                )
            }),
            _ => decode(&channel.schema, content).map(|decoded| (decoded, None)),
        };
        let Some((decoded, frame)) = decoded else {
            self.unreadable += 1;
            return None;
        };
        let foreign = &mut self.foreign_depth;
        foreign.picture_frame = foreign.picture_frame.take().or(frame);
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
        let shift_ns = self.number(SHIFT_NS).unwrap_or(0);
        i64::try_from(publish_ns).ok()?.checked_sub(shift_ns)
    }

    /// The driver's number of a picture, of which the file holds 32 bits.
    fn whole_sequence(&self, number: u32) -> u64 {
        let before = self
            .sequence
            .or_else(|| self.number(FIRST_SEQUENCE))
            .unwrap_or(u64::from(number));
        before.saturating_add(u64::from(number.wrapping_sub(before as u32)))
    }

    /// A number that the recording tells of itself.
    fn number<T: std::str::FromStr>(&self, key: &str) -> Option<T> {
        self.about.get(key)?.parse().ok()
    }

    /// Takes in a record that is no message.
    fn note(&mut self, kind: u8, body: &[u8]) {
        // A damaged one is as good as none.
        let _ = match kind {
            op::SCHEMA => self.note_schema(body),
            op::CHANNEL => self.note_channel(body),
            op::METADATA => self.note_metadata(body),
            op::STATISTICS => self.note_statistics(body),
            _ => None,
        };
    }

    fn note_schema(&mut self, body: &[u8]) -> Option<()> {
        let mut body = Cursor(body);
        let (id, name) = (body.u16()?, body.text()?);
        self.schemas.insert(id, name.to_owned());
        Some(())
    }

    fn note_channel(&mut self, body: &[u8]) -> Option<()> {
        let mut body = Cursor(body);
        let (id, schema_id, topic, encoding) =
            (body.u16()?, body.u16()?, body.text()?, body.text()?);
        let metadata = body.map()?;
        let layout = match encoding {
            "ros1" => Some(Layout::Ros1),
            "cdr" => Some(Layout::Ros2),
            _ => None,
        };
        let known = if encoding == "protobuf" || layout.is_some() {
            self.schemas.get(&schema_id).cloned()
        } else {
            None
        };
        let counted = metadata
            .iter()
            .find(|(key, _)| *key == SEQUENCE)
            .map(|(_, value)| *value == COUNTED);
        let schema = known.unwrap_or_else(|| encoding.to_owned());
        self.channels.insert(
            id,
            Channel {
                topic: topic.to_owned(),
                schema,
                layout,
                counted,
            },
        );
        Some(())
    }

    fn note_connection(&mut self, connection: Connection) {
        // One of more than that many is none of a film's.
        if let Ok(id) = u16::try_from(connection.id)
            && id != u16::MAX
        {
            let channel = Channel {
                topic: connection.topic,
                schema: connection.kind,
                layout: Some(Layout::Ros1),
                counted: None,
            };
            self.channels.insert(id, channel);
        }
    }

    fn note_metadata(&mut self, body: &[u8]) -> Option<()> {
        let mut body = Cursor(body);
        if body.text()? == ABOUT {
            self.about.extend(
                body.map()?
                    .into_iter()
                    .map(|(key, value)| (key.to_owned(), value.to_owned())),
            );
        }
        Some(())
    }

    fn note_statistics(&mut self, body: &[u8]) -> Option<()> {
        let mut body = Cursor(body);
        body.take(8 + 2 + 4 * 4 + 2 * 8)?;
        let mut counts = Cursor(body.counted()?);
        while let (Some(id), Some(count)) = (counts.u16(), counts.u64()) {
            self.counts.insert(id, count);
        }
        Some(())
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
        if !self.others.is_empty() {
            let others = self
                .others
                .iter()
                .map(String::as_str)
                .collect::<Vec<_>>()
                .join(", ");
            let chosen = self.chosen.as_deref().unwrap_or_default();
            lines.push(format!(
                "{name}: the pictures of {chosen} are used, those of {others} are not"
            ));
        }
        if let Some(e) = &self.broken {
            lines.push(format!(
                "{name}: reading it fails ({e}); what came before is used"
            ));
        }
        lines
    }
}

/// The head of a message.
struct MessageHead {
    channel: u16,
    number: u32,
    log_ns: u64,
    publish_ns: u64,
}

impl MessageHead {
    /// Of a message of ROS 1, which has no number.
    fn of_bag(connection: u32, time_ns: u64) -> Self {
        Self {
            // None has the last one.
            channel: u16::try_from(connection).unwrap_or(u16::MAX),
            number: 0,
            log_ns: time_ns,
            publish_ns: time_ns,
        }
    }

    fn read(body: &mut Cursor) -> Option<Self> {
        Some(Self {
            channel: body.u16()?,
            number: body.u32()?,
            log_ns: body.u64()?,
            publish_ns: body.u64()?,
        })
    }
}

/// A depth image of another program.
struct TimedDepth {
    time_ns: Option<i64>,
    frame: Option<String>,
    image: DepthImage,
    unit_m: Option<f64>,
    is_in_metres: bool,
}

/// Whether two cameras for images of one size show the same.
fn is_same_view(a: &CameraModel, b: &CameraModel) -> bool {
    let focal = a.pinhole.focal_px.component_div(&b.pinhole.focal_px);
    let shift = a.pinhole.middle_px - b.pinhole.middle_px;
    let sides = [f64::from(b.size.width), f64::from(b.size.height)];
    focal.iter().all(|share| (share - 1.0).abs() <= SAME_CAMERA)
        && shift.x.abs() <= SAME_CAMERA * sides[0]
        && shift.y.abs() <= SAME_CAMERA * sides[1]
}

/// As many bytes from the beginning of a file as a bag of ROS says what it is with.
fn first_bytes(file: &mut (impl Read + Seek)) -> io::Result<Vec<u8>> {
    file.seek(SeekFrom::Start(0))?;
    let mut bytes = vec![0; bag::MAGIC.len()];
    let read = read_up_to(file, &mut bytes)?;
    bytes.truncate(read);
    file.seek(SeekFrom::Start(0))?;
    Ok(bytes)
}

/// The records at the end of a file that was ended properly.
fn summary(file: &mut (impl Read + Seek)) -> io::Result<Option<Vec<u8>>> {
    let length = file.seek(SeekFrom::End(0))?;
    let Some(footer_at) = length.checked_sub(FOOTER) else {
        return Ok(None);
    };
    file.seek(SeekFrom::Start(footer_at))?;
    let mut footer = [0; FOOTER as usize];
    let read = read_up_to(file, &mut footer)?;
    let mut cursor = Cursor(&footer[..read]);
    let Some((op::FOOTER, mut body)) = cursor.record().map(|(kind, body)| (kind, Cursor(body)))
    else {
        return Ok(None);
    };
    let start = body.u64().filter(|start| *start > 0 && *start < footer_at);
    let Some(start) =
        start.filter(|start| cursor.0 == mcap::MAGIC && footer_at - start <= MAX_SUMMARY)
    else {
        return Ok(None);
    };
    file.seek(SeekFrom::Start(start))?;
    let mut bytes = vec![0; (footer_at - start) as usize];
    let read = read_up_to(file, &mut bytes)?;
    bytes.truncate(read);
    Ok(Some(bytes))
}
