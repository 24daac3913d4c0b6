//! How many frames of a film have their depth, and what the user hears of the others.

use crate::model::DepthImage;

/// A depth stream that ends so long before the pictures has stopped, s.
const STOPPED_S: f64 = 1.0;
/// Where more than this share of the frames lacks its depth the user should know.
const MISSING_SHARE: f64 = 0.1;

/// Frames with and without depth.
#[derive(Clone, Debug, Default)]
pub struct DepthTally {
    frames: u64,
    with_depth: u64,
    /// With an image that has nothing but holes.
    empty: u64,
    first_s: Option<f64>,
    last_s: f64,
    last_with_depth_s: Option<f64>,
    unreadable: u64,
    first_unreadable: Option<String>,
}

impl DepthTally {
    /// One more frame, by its sensor's time, s. An image of nothing but holes is none: a sensor that failed may go on
    /// so.
    pub fn frame(&mut self, time_s: f64, depth: Option<&DepthImage>) {
        let has_depth = depth.is_some_and(|image| image.counts.iter().any(|count| *count > 0));
        self.empty += u64::from(depth.is_some() && !has_depth);
        self.frames += 1;
        self.first_s.get_or_insert(time_s);
        self.last_s = time_s;
        if has_depth {
            self.with_depth += 1;
            self.last_with_depth_s = Some(time_s);
        }
    }

    /// A depth image that cannot be used, and why.
    pub fn unreadable(&mut self, why: String) {
        self.unreadable += 1;
        self.first_unreadable.get_or_insert(why);
    }

    /// What the user should hear of the film `name`, a line each; once.
    pub fn take_warnings(&mut self, name: &str) -> Vec<String> {
        let tally = std::mem::take(self);
        let mut lines = Vec::new();
        if let Some(why) = &tally.first_unreadable {
            let n = tally.unreadable;
            lines.push(format!(
                "{name}: depth images left out because they cannot be used: {n} (the first: {why})"
            ));
        }
        let (Some(first_s), missing) = (tally.first_s, tally.frames - tally.with_depth) else {
            return lines;
        };
        if tally.with_depth == 0 && tally.empty > 0 {
            lines.push(format!(
                "{name}: the depth images have nothing but holes, and depth was not used; is the tree within the range \
                 of the camera?"
            ));
            return lines;
        }
        if tally.with_depth == 0 {
            lines.push(format!(
                "{name}: no depth image is of the time of a picture: the clocks of colour and depth do \
                 not meet, and depth was not used"
            ));
            return lines;
        }
        let stopped = tally
            .last_with_depth_s
            .filter(|last_s| tally.last_s - last_s > STOPPED_S);
        if let Some(last_s) = stopped {
            lines.push(format!(
                "{name}: depth stops after {:.1} of {:.1} s; from there on places in depth are \
                 guesses",
                last_s - first_s,
                tally.last_s - first_s
            ));
        } else if missing as f64 > MISSING_SHARE * tally.frames as f64 {
            lines.push(format!(
                "{name}: {missing} of {} frames have no depth image of their time, or one of nothing but holes",
                tally.frames
            ));
        }
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Size;

    #[test]
    fn a_stream_that_stops_or_has_gaps_is_reported_once() {
        let mut whole = DepthTally::default();
        let mut stops = DepthTally::default();
        let mut gaps = DepthTally::default();
        let mut empty = DepthTally::default();
        let [sound, holes] =
            [[0, 2000], [0, 0]].map(|counts| DepthImage::new(Size::new(2, 1), counts.to_vec()));
        for k in 0..90 {
            let time_s = 50.0 + f64::from(k) / 30.0;
            whole.frame(time_s, (k != 7).then_some(&sound));
            stops.frame(time_s, Some(if k < 30 { &sound } else { &holes }));
            gaps.frame(time_s, (k % 3 > 0).then_some(&sound));
            empty.frame(time_s, Some(&holes));
        }
        assert_eq!(whole.take_warnings("film"), [""; 0]);
        let said = stops.take_warnings("film");
        assert!(
            said[0].contains("depth stops after 1.0 of 3.0 s"),
            "{said:?}"
        );
        assert_eq!(stops.take_warnings("film"), [""; 0]);
        let said = gaps.take_warnings("film");
        assert!(
            said[0].contains("30 of 90 frames have no depth"),
            "{said:?}"
        );
        let said = empty.take_warnings("film");
        assert!(said[0].contains("nothing but holes"), "{said:?}");
    }
}
