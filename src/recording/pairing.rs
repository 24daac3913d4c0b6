//! Pictures and depth images that come in turns, each with its own time: which belong together.

use super::image::Picture;
use crate::model::{DEPTH_APART_S, DepthImage, RawFrame, nanoseconds, seconds};
use std::collections::VecDeque;
use std::sync::Arc;

/// Images that are further apart in time do not belong together, ns.
const APART_NS: u64 = (1e9 * DEPTH_APART_S) as u64;
/// A picture waits for its depth until something is so much later, ns; longer where depth is known to be late.
const PATIENCE_NS: i64 = 100_000_000;
/// So many pictures and so many depth images are held at most, and those of the time by which depth is late at a
/// rate of so many frames/s.
const HELD: usize = 8;
const HIGHEST_RATE_HZ: f64 = 120.0;

/// What waits for its depth image.
pub trait AwaitsDepth {
    /// When it was taken, by the clock of the depth images, ns.
    fn time_ns(&self) -> i64;
    /// Gets the depth image that belongs to it.
    fn set_depth(&mut self, depth: Arc<DepthImage>);
}

impl AwaitsDepth for Picture {
    fn time_ns(&self) -> i64 {
        self.sensor_time_ns
    }

    fn set_depth(&mut self, depth: Arc<DepthImage>) {
        self.depth = Some(depth);
    }
}

impl AwaitsDepth for RawFrame {
    fn time_ns(&self) -> i64 {
        nanoseconds(self.sensor_time_s)
    }

    fn set_depth(&mut self, depth: Arc<DepthImage>) {
        self.depth = Some(depth);
    }
}

/// Holds pictures back until it is known which depth image belongs to each.
#[derive(Debug)]
pub struct Pairing<P> {
    pictures: VecDeque<P>,
    depths: VecDeque<Timed>,
    newest_ns: Option<i64>,
    /// How much later depth images are stamped than they were taken, ns.
    late_ns: i64,
    patience_ns: i64,
    held: usize,
}

#[derive(Debug)]
struct Timed {
    time_ns: i64,
    image: Arc<DepthImage>,
}

impl Timed {
    /// How far it is from a time, ns.
    fn apart_ns(&self, time_ns: i64) -> u64 {
        self.time_ns.abs_diff(time_ns)
    }
}

impl<P> Default for Pairing<P> {
    fn default() -> Self {
        Self {
            pictures: VecDeque::new(),
            depths: VecDeque::new(),
            newest_ns: None,
            late_ns: 0,
            patience_ns: PATIENCE_NS,
            held: HELD,
        }
    }
}

impl<P: AwaitsDepth> Pairing<P> {
    /// For depth images that are stamped so much later than they were taken, s.
    pub fn late_by(late_s: f64) -> Self {
        let late_ns = nanoseconds(late_s);
        Self {
            late_ns,
            patience_ns: PATIENCE_NS + late_ns.max(0),
            held: HELD + (HIGHEST_RATE_HZ * late_s.max(0.0)).ceil() as usize,
            ..Self::default()
        }
    }

    /// For two streams of one file, which are read in turns: pictures wait until the depth image after them is read.
    pub fn in_turns(late_s: f64) -> Self {
        Self {
            patience_ns: i64::MAX,
            ..Self::late_by(late_s)
        }
    }

    /// Takes a picture.
    pub fn picture(&mut self, picture: P) {
        self.seen(picture.time_ns());
        self.pictures.push_back(picture);
    }

    /// Takes a depth image with its stamp.
    pub fn depth(&mut self, stamp_ns: i64, image: Arc<DepthImage>) {
        let time_ns = stamp_ns.saturating_sub(self.late_ns);
        self.seen(time_ns);
        if self.depths.len() == self.held {
            self.depths.pop_front();
        }
        self.depths.push_back(Timed { time_ns, image });
    }

    fn seen(&mut self, time_ns: i64) {
        self.newest_ns = Some(self.newest_ns.map_or(time_ns, |newest| newest.max(time_ns)));
    }

    /// The oldest picture with its depth image, if that is decided.
    pub fn ready(&mut self) -> Option<P> {
        let time_ns = self.pictures.front()?.time_ns();
        let is_passed = self.depths.iter().any(|depth| depth.time_ns >= time_ns);
        let waited = self
            .newest_ns
            .map_or(0, |newest| newest.saturating_sub(time_ns));
        if is_passed || waited > self.patience_ns || self.pictures.len() > self.held {
            self.oldest()
        } else {
            None
        }
    }

    /// The oldest picture with its depth image; there is nothing more to wait for.
    pub fn oldest(&mut self) -> Option<P> {
        let mut picture = self.pictures.pop_front()?;
        let time_ns = picture.time_ns();
        let nearest = (0..self.depths.len()).min_by_key(|k| self.depths[*k].apart_ns(time_ns));
        let nearest = nearest.filter(|k| self.depths[*k].apart_ns(time_ns) <= APART_NS);
        // The next picture may be nearer to it.
        let next = self.pictures.front().map(P::time_ns);
        let nearest = nearest.filter(|k| {
            let depth = &self.depths[*k];
            next.is_none_or(|next| depth.apart_ns(time_ns) <= depth.apart_ns(next))
        });
        if let Some(k) = nearest {
            // It and those before it belong to no later picture.
            if let Some(mut depth) = self.depths.drain(..=k).next_back() {
                let later_ns = depth.time_ns.saturating_sub(time_ns);
                Arc::make_mut(&mut depth.image).later_s = seconds(later_ns);
                picture.set_depth(depth.image);
            }
        }
        Some(picture)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{PixelFormat, Size};
    use crate::recording::Encoding;

    const MS: i64 = 1_000_000;

    fn picture(time_ms: i64) -> Picture {
        Picture {
            sequence: None,
            sensor_time_ns: time_ms * MS,
            encoding: Encoding::Pixels(PixelFormat::Grey, Size::new(1, 1)),
            bytes: vec![0],
            depth: None,
        }
    }

    fn depth(count: u16) -> Arc<DepthImage> {
        Arc::new(DepthImage::new(Size::new(1, 1), vec![count]))
    }

    fn of(picture: Option<Picture>) -> Option<u16> {
        picture
            .expect("a picture")
            .depth
            .map(|depth| depth.counts[0])
    }

    #[test]
    fn depth_may_come_before_or_after_its_picture() {
        let mut pairing = Pairing::default();
        pairing.depth(3 * MS, depth(1));
        pairing.picture(picture(0));
        assert_eq!(of(pairing.ready()), Some(1));
        pairing.picture(picture(33));
        assert!(pairing.ready().is_none());
        pairing.picture(picture(66));
        pairing.depth(35 * MS, depth(2));
        assert_eq!(of(pairing.ready()), Some(2));
        assert!(pairing.ready().is_none());
        pairing.depth(120 * MS, depth(3));
        assert_eq!(of(pairing.ready()), None);
        pairing.picture(picture(115));
        assert_eq!(of(pairing.oldest()), Some(3));
        assert!(pairing.oldest().is_none());
    }

    #[test]
    fn late_stamps_are_set_right() {
        let mut pairing = Pairing::late_by(0.2);
        let mut pairs = Vec::new();
        for k in 0..30 {
            pairing.picture(picture(33 * k));
            // It was taken 200 ms before.
            if k >= 6 {
                pairing.depth((33 * (k - 6) + 200) * MS, depth((k - 6) as u16));
            }
            while let Some(picture) = pairing.ready() {
                let time_ns = picture.sensor_time_ns;
                pairs.push((time_ns / MS / 33, of(Some(picture))));
            }
        }
        assert!(pairs.len() >= 23, "{}", pairs.len());
        assert!(
            pairs
                .iter()
                .all(|(k, depth)| depth.map(i64::from) == Some(*k)),
            "{pairs:?}"
        );
    }

    /// A film of 15 frames/s: the patience of a camera ended before any depth was read.
    #[test]
    fn pictures_of_a_file_wait_for_depth_that_is_read_in_turns() {
        let mut pairing = Pairing::in_turns(0.05);
        for k in 0..5 {
            pairing.picture(picture(67 * k));
        }
        assert!(pairing.ready().is_none());
        pairing.depth((67 + 50 + 3) * MS, depth(7));
        assert_eq!(of(pairing.ready()), None);
        let second = pairing
            .ready()
            .expect("a picture")
            .depth
            .expect("its depth");
        assert_eq!(second.counts[0], 7);
        assert!((second.later_s - 0.003).abs() < 1e-9);
    }

    #[test]
    fn pictures_do_not_wait_for_a_stream_that_has_stopped() {
        let mut pairing = Pairing::default();
        let mut given = 0;
        for k in 0..100 {
            pairing.picture(picture(33 * k));
            while let Some(picture) = pairing.ready() {
                assert_eq!(picture.sensor_time_ns, 33 * given * MS);
                given += 1;
            }
        }
        assert!(given > 90, "{given}");
    }
}
