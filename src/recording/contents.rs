//! What a recording says that it holds: its channels, how many messages are in them, and its film.

use super::bag::{Connection, Index};
use super::channel::{Channel, Role, is_registered};
use super::cursor::Cursor;
use super::error::RecordingError;
use super::ros::Layout;
use super::schema::{ABOUT, COUNTED, NOTE, SEQUENCE};
use crate::model::{UserNote, UserNotes};
use mcap::records::op;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// What a recording says of itself, by the keys of `docs/recordings.md`; empty for another
/// program's.
pub type About = BTreeMap<String, String>;

/// What is known so far.
#[derive(Default)]
pub(super) struct Contents {
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u16, Channel>,
    pub about: About,
    counts: BTreeMap<u16, u64>,
}

impl Contents {
    pub fn channel(&self, id: u16) -> Option<&Channel> {
        self.channels.get(&id)
    }

    pub fn channels(&self) -> impl Iterator<Item = &Channel> {
        self.channels.values()
    }

    /// Makes sure that it is known which series of pictures and of depth are meant; `filter` keeps
    /// one.
    pub fn check_series(&self, path: &Path, filter: &str) -> Result<(), RecordingError> {
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
    pub fn depth_topics(&self) -> Vec<&str> {
        let of_depth = self.channels.values().filter(|c| c.role() == Role::Depth);
        let mut topics: Vec<&str> = of_depth.map(|c| c.topic.as_str()).collect();
        topics.sort_unstable();
        topics.dedup();
        if topics.iter().any(|topic| is_registered(topic)) {
            topics.retain(|topic| is_registered(topic));
        }
        topics
    }

    /// The notes in it, but for those that are none: anybody may have written the file.
    pub fn notes(&self) -> UserNotes {
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

    /// A number that the recording says of itself.
    pub fn number<T: std::str::FromStr>(&self, key: &str) -> Option<T> {
        self.about.get(key)?.parse().ok()
    }

    /// Takes in a record that is no message.
    pub fn note(&mut self, kind: u8, body: &[u8]) {
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

    /// Takes in the index of a bag.
    pub fn note_index(&mut self, index: Index) {
        for connection in index.connections {
            self.note_connection(connection);
        }
        for count in index.counts {
            if let Ok(id) = u16::try_from(count.connection) {
                *self.counts.entry(id).or_insert(0) += count.messages;
            }
        }
    }

    /// Takes in a connection of a bag.
    pub fn note_connection(&mut self, connection: Connection) {
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
}
