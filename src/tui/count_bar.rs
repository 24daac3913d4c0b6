//! How many pieces of a known number are done, on standard error.

use super::progress::standard_error;
use indicatif::{ProgressBar, ProgressStyle};

/// A bar that shows how many pieces are done; nothing where standard error is no terminal.
#[derive(Debug)]
pub struct CountBar {
    bar: ProgressBar,
}

impl CountBar {
    /// A bar for so many pieces, with what they are.
    pub fn new(count: u64, what: &'static str) -> Self {
        let style = ProgressStyle::with_template("{pos}/{len} {msg} {wide_bar} {eta}");
        let bar = ProgressBar::with_draw_target(Some(count), standard_error())
            .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
            .with_message(what);
        Self { bar }
    }

    /// So many are done. A number below one that was given before changes nothing: threads may
    /// give theirs in another order.
    pub fn set(&self, done: u64) {
        if done > self.bar.position() {
            self.bar.set_position(done);
        }
    }
}

impl Drop for CountBar {
    /// Takes the bar away.
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bar_never_goes_back() {
        let bar = CountBar::new(9, "trees");
        bar.set(4);
        bar.set(3);
        assert_eq!(bar.bar.position(), 4);
        assert_eq!(bar.bar.length(), Some(9));
    }
}
