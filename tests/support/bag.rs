//! Bags of ROS 1, made here.

use std::io::Write;

/// How chunks are packed.
pub const PACKED: [&str; 3] = ["none", "lz4", "bz2"];

/// A bag that is being made: each chunk has all that came since the last one.
pub struct Bag {
    bytes: Vec<u8>,
    chunk: Vec<u8>,
    packed: &'static str,
    connections: Vec<Vec<u8>>,
    counts: Vec<u32>,
}

/// A length in front of bytes.
fn counted(bytes: &[u8]) -> Vec<u8> {
    let count = (bytes.len() as u32).to_le_bytes();
    [&count, bytes].concat()
}

fn field(name: &str, value: &[u8]) -> Vec<u8> {
    counted(&[name.as_bytes(), b"=", value].concat())
}

fn record(fields: &[Vec<u8>], data: &[u8]) -> Vec<u8> {
    [counted(&fields.concat()), counted(data)].concat()
}

fn head_of_bag(index_at: u64) -> Vec<u8> {
    let fields = [
        field("op", &[3]),
        field("index_pos", &index_at.to_le_bytes()),
    ];
    record(&fields, &[b' '; 100])
}

impl Bag {
    pub fn new(packed: &'static str) -> Self {
        let head = head_of_bag(0);
        Self {
            bytes: [b"#ROSBAG V2.0\n", head.as_slice()].concat(),
            chunk: Vec::new(),
            packed,
            connections: Vec::new(),
            counts: Vec::new(),
        }
    }

    /// Number of a new series of messages.
    pub fn connection(&mut self, topic: &str, kind: &str) -> u32 {
        let id = self.connections.len() as u32;
        let fields = [
            field("op", &[7]),
            field("conn", &id.to_le_bytes()),
            field("topic", topic.as_bytes()),
        ];
        let data = [
            field("topic", topic.as_bytes()),
            field("type", kind.as_bytes()),
        ]
        .concat();
        let connection = record(&fields, &data);
        self.chunk.extend(&connection);
        self.connections.push(connection);
        self.counts.push(0);
        id
    }

    pub fn message(&mut self, connection: u32, time_ns: u64, data: &[u8]) {
        let time = [
            ((time_ns / 1_000_000_000) as u32).to_le_bytes(),
            ((time_ns % 1_000_000_000) as u32).to_le_bytes(),
        ];
        let fields = [
            field("op", &[2]),
            field("conn", &connection.to_le_bytes()),
            field("time", &time.concat()),
        ];
        self.chunk.extend(record(&fields, data));
        self.counts[connection as usize] += 1;
    }

    pub fn end_chunk(&mut self) {
        let chunk = std::mem::take(&mut self.chunk);
        let packed = match self.packed {
            "lz4" => {
                let mut packing = lz4::EncoderBuilder::new().build(Vec::new()).expect("lz4");
                packing.write_all(&chunk).expect("packed");
                let (packed, done) = packing.finish();
                done.expect("packed");
                packed
            }
            "bz2" => {
                let level = bzip2::Compression::fast();
                let mut packing = bzip2::write::BzEncoder::new(Vec::new(), level);
                packing.write_all(&chunk).expect("packed");
                packing.finish().expect("packed")
            }
            _ => chunk.clone(),
        };
        let fields = [
            field("op", &[5]),
            field("compression", self.packed.as_bytes()),
            field("size", &(chunk.len() as u32).to_le_bytes()),
        ];
        self.bytes.extend(record(&fields, &packed));
        // The place of each message, which nobody needs here.
        self.bytes.extend(record(&[field("op", &[4])], &[0; 12]));
    }

    /// The whole file, ended properly.
    pub fn done(mut self) -> Vec<u8> {
        let index_at = self.bytes.len() as u64;
        for connection in &self.connections {
            self.bytes.extend(connection);
        }
        let mut counts = Vec::new();
        for (id, count) in self.counts.iter().enumerate() {
            counts.extend((id as u32).to_le_bytes());
            counts.extend(count.to_le_bytes());
        }
        self.bytes.extend(record(&[field("op", &[6])], &counts));
        let head = head_of_bag(index_at);
        self.bytes[13..13 + head.len()].copy_from_slice(&head);
        self.bytes
    }
}
