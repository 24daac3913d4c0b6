//! The least cut of a picture: every pixel gets one of two labels, so that the odds of the pixels
//! and the links between neighbours of different labels cost least together (Boykov and Kolmogorov
//! 2004, "An Experimental Comparison of Min-Cut/Max-Flow Algorithms").
//!
//! Two trees of pixels grow, one from either label, along links that still have room. Where they
//! touch, as much as fits flows along the way between the labels, and the pixels whose way to
//! their label is full then look for another. Where the trees cannot touch any more, they are the
//! labels.

use crate::cancel::CancelToken;
use crate::model::Size;
use std::collections::VecDeque;

/// Steps to the eight neighbours of a pixel, to the right and down. The opposite of each is
/// [`opposite`].
const STEPS: [[i32; 2]; 8] = [
    [1, 0],
    [1, 1],
    [0, 1],
    [-1, 1],
    [-1, 0],
    [-1, -1],
    [0, -1],
    [1, -1],
];
/// The first half of [`STEPS`] leads to every pair of neighbours once.
pub const PAIRS: usize = 4;
/// Costs are counted in this share of one: with whole numbers, the result does not depend on the
/// order of additions.
const GRAIN: f32 = 1.0 / 256.0;
/// No odds count more than this; it is beyond all links of a pixel together.
pub const SURE: f32 = 1e4;
/// The cancel token is looked at after so many steps.
const STEPS_BETWEEN_LOOKS: usize = 1 << 14;

fn opposite(direction: u8) -> u8 {
    (direction + 4) % 8
}

/// A pixel's neighbour in one of the first [`PAIRS`] directions; `None` beyond the picture.
pub fn neighbour(pixel: usize, pair: usize, size: Size) -> Option<usize> {
    let [du, dv] = STEPS[pair];
    let (width, height) = (size.width as i32, size.height as i32);
    let (u, v) = (pixel as i32 % width + du, pixel as i32 / width + dv);
    let is_in = (0..width).contains(&u) && (0..height).contains(&v);
    is_in.then(|| (v * width + u) as usize)
}

/// The links of [`least_cut`] between the pixels within `region` (one byte a pixel, 0 outside): `cost`
/// says what it costs that a pixel and its neighbour, in this of the four directions, differ. Nothing
/// links what is beyond the region.
pub fn links_within(
    region: &[u8],
    size: Size,
    cost: impl Fn(usize, usize, usize) -> f64,
) -> Vec<[f32; PAIRS]> {
    let mut links = vec![[0.0; PAIRS]; region.len()];
    let inside = links.iter_mut().enumerate();
    for (i, links) in inside.filter(|(i, _)| region[*i] != 0) {
        for (pair, link) in links.iter_mut().enumerate() {
            if let Some(next) = neighbour(i, pair, size).filter(|next| region[*next] != 0) {
                *link = cost(i, next, pair) as f32;
            }
        }
    }
    links
}

/// Whether a direction of [`neighbour`] leads to a diagonal one: every second does.
pub fn is_diagonal(pair: usize) -> bool {
    pair % 2 == 1
}

/// Whether each pixel gets the first label. `odds` are those of the first label, as a logarithm;
/// `links` is what it costs that a pixel and its [`neighbour`] in each of the four directions
/// differ, at least 0. Row by row. `None` where `cancel` ends the work.
pub fn least_cut(
    size: Size,
    odds: &[f32],
    links: &[[f32; PAIRS]],
    cancel: &CancelToken,
) -> Option<Vec<bool>> {
    Flow::new(size, odds, links).labels(cancel)
}

/// How a pixel is joined to its tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Origin {
    /// It is in no tree.
    Free,
    /// Its way to its label is full.
    Orphan,
    /// At its label itself.
    Label,
    /// By its neighbour in this direction.
    By(u8),
}

/// What flows through the pixels. They have a frame of one pixel to which nothing flows, so that
/// all others have eight neighbours.
struct Flow {
    size: Size,
    /// Steps to the neighbours in the framed picture.
    steps: [isize; 8],
    /// What more can flow from each pixel to its neighbours.
    room: Vec<[i32; 8]>,
    /// What more can flow from the first label to each pixel, negative: from it to the second.
    from_label: Vec<i32>,
    origin: Vec<Origin>,
    /// Whether it is in the tree of the second label.
    is_second: Vec<bool>,
    /// When the distance was looked at, and how many steps it is from its label.
    seen_at: Vec<u32>,
    steps_away: Vec<u32>,
    now: u32,
    active: VecDeque<usize>,
    is_active: Vec<bool>,
    orphans: VecDeque<usize>,
}

/// Two pixels where the trees touch: a step in this direction leads from the first label's tree to
/// the second's.
struct Touch {
    first: usize,
    direction: u8,
}

impl Flow {
    fn new(size: Size, odds: &[f32], links: &[[f32; PAIRS]]) -> Self {
        let width = size.width as usize + 2;
        let count = width * (size.height as usize + 2);
        let mut flow = Self {
            size,
            steps: STEPS.map(|[du, dv]| dv as isize * width as isize + du as isize),
            room: vec![[0; 8]; count],
            from_label: vec![0; count],
            origin: vec![Origin::Free; count],
            is_second: vec![false; count],
            seen_at: vec![0; count],
            steps_away: vec![0; count],
            now: 0,
            active: VecDeque::new(),
            is_active: vec![false; count],
            orphans: VecDeque::new(),
        };
        for pixel in 0..size.area() {
            // What is neither one nor the other and is linked to nothing stays so; memory that is not written
            // to takes no time.
            if odds[pixel] == 0.0 && links[pixel] == [0.0; PAIRS] {
                continue;
            }
            let at = flow.framed(pixel);
            flow.from_label[at] = grains(odds[pixel].clamp(-SURE, SURE));
            for (direction, cost) in (0..).zip(links[pixel]) {
                if neighbour(pixel, usize::from(direction), size).is_some() {
                    let next = flow.next(at, direction);
                    flow.room[at][usize::from(direction)] = grains(cost.clamp(0.0, SURE));
                    flow.room[next][usize::from(opposite(direction))] =
                        grains(cost.clamp(0.0, SURE));
                }
            }
        }
        for at in 0..count {
            if flow.from_label[at] != 0 {
                flow.is_second[at] = flow.from_label[at] < 0;
                flow.origin[at] = Origin::Label;
                flow.steps_away[at] = 1;
                flow.activate(at);
            }
        }
        flow
    }

    /// The place of a pixel in the framed picture.
    fn framed(&self, pixel: usize) -> usize {
        let width = self.size.width as usize;
        (pixel / width + 1) * (width + 2) + pixel % width + 1
    }

    fn next(&self, at: usize, direction: u8) -> usize {
        at.wrapping_add_signed(self.steps[usize::from(direction)])
    }

    fn activate(&mut self, at: usize) {
        if !self.is_active[at] {
            self.is_active[at] = true;
            self.active.push_back(at);
        }
    }

    fn labels(mut self, cancel: &CancelToken) -> Option<Vec<bool>> {
        let mut until_look = 0;
        while let Some(&at) = self.active.front() {
            if until_look == 0 {
                if cancel.is_cancelled() {
                    return None;
                }
                until_look = STEPS_BETWEEN_LOOKS;
            }
            until_look -= 1;
            let touch = match self.origin[at] {
                Origin::Free => None,
                _ => self.grow(at),
            };
            let Some(touch) = touch else {
                self.active.pop_front();
                self.is_active[at] = false;
                continue;
            };
            self.now += 1;
            self.augment(&touch);
            while let Some(orphan) = self.orphans.pop_front() {
                self.adopt(orphan);
            }
        }
        let pixels = 0..self.size.area();
        Some(pixels.map(|pixel| self.is_first(pixel)).collect())
    }

    fn is_first(&self, pixel: usize) -> bool {
        let at = self.framed(pixel);
        self.origin[at] != Origin::Free && !self.is_second[at]
    }

    /// What more can flow along the step that leads from the label of `at`'s tree outwards: from
    /// `at` on in the tree of the first, to `at` in that of the second.
    fn room_outwards(&self, at: usize, direction: u8) -> i32 {
        if self.is_second[at] {
            let next = self.next(at, direction);
            self.room[next][usize::from(opposite(direction))]
        } else {
            self.room[at][usize::from(direction)]
        }
    }

    /// Takes the free neighbours of a pixel into its tree, until it touches the other.
    fn grow(&mut self, at: usize) -> Option<Touch> {
        for direction in 0..8 {
            if self.room_outwards(at, direction) == 0 {
                continue;
            }
            let next = self.next(at, direction);
            if self.origin[next] == Origin::Free {
                self.is_second[next] = self.is_second[at];
                self.join(next, opposite(direction), at);
                self.activate(next);
            } else if self.is_second[next] != self.is_second[at] {
                return Some(if self.is_second[at] {
                    let direction = opposite(direction);
                    Touch {
                        first: next,
                        direction,
                    }
                } else {
                    Touch {
                        first: at,
                        direction,
                    }
                });
            } else if self.seen_at[next] <= self.seen_at[at]
                && self.steps_away[next] > self.steps_away[at]
                && matches!(self.origin[next], Origin::By(_))
            {
                // A shorter way to the label.
                self.join(next, opposite(direction), at);
            }
        }
        None
    }

    /// Joins `next` to its tree by `at`, its neighbour in this direction.
    fn join(&mut self, next: usize, direction: u8, at: usize) {
        self.origin[next] = Origin::By(direction);
        self.seen_at[next] = self.seen_at[at];
        self.steps_away[next] = self.steps_away[at] + 1;
    }

    /// Lets as much flow as fits on the way between the labels.
    fn augment(&mut self, touch: &Touch) {
        let second = self.next(touch.first, touch.direction);
        let between = self.room[touch.first][usize::from(touch.direction)];
        let most = between
            .min(self.room_to_label(touch.first))
            .min(self.room_to_label(second));
        self.room[touch.first][usize::from(touch.direction)] -= most;
        self.room[second][usize::from(opposite(touch.direction))] += most;
        self.flow_to_label(touch.first, most);
        self.flow_to_label(second, most);
    }

    /// The least room on the way from a pixel to the label of its tree.
    fn room_to_label(&self, from: usize) -> i32 {
        let (mut at, mut least) = (from, i32::MAX);
        while let Origin::By(direction) = self.origin[at] {
            let parent = self.next(at, direction);
            least = least.min(self.room_outwards(parent, opposite(direction)));
            at = parent;
        }
        least.min(self.from_label[at].abs())
    }

    /// Takes `amount` from the room on that way. A pixel whose step is full becomes an orphan.
    fn flow_to_label(&mut self, from: usize, amount: i32) {
        let mut at = from;
        while let Origin::By(direction) = self.origin[at] {
            let parent = self.next(at, direction);
            let (there, here) = (usize::from(direction), usize::from(opposite(direction)));
            if self.is_second[at] {
                self.room[at][there] -= amount;
                self.room[parent][here] += amount;
            } else {
                self.room[parent][here] -= amount;
                self.room[at][there] += amount;
            }
            if self.room_outwards(parent, opposite(direction)) == 0 {
                self.orphan(at);
            }
            at = parent;
        }
        self.from_label[at] -= amount * self.from_label[at].signum();
        if self.from_label[at] == 0 {
            self.orphan(at);
        }
    }

    fn orphan(&mut self, at: usize) {
        self.origin[at] = Origin::Orphan;
        self.orphans.push_back(at);
    }

    /// Joins an orphan to its tree by another neighbour, the one nearest to the label; where there
    /// is none, it is free.
    fn adopt(&mut self, orphan: usize) {
        let mut best: Option<u8> = None;
        let mut least = u32::MAX;
        for direction in 0..8 {
            let next = self.next(orphan, direction);
            if !self.is_kin(next, orphan) || self.room_outwards(next, opposite(direction)) == 0 {
                continue;
            }
            if let Some(steps) = self.steps_to_label(next)
                && steps < least
            {
                (best, least) = (Some(direction), steps);
            }
        }
        if let Some(direction) = best {
            self.origin[orphan] = Origin::By(direction);
            self.seen_at[orphan] = self.now;
            self.steps_away[orphan] = least + 1;
            return;
        }
        for direction in 0..8 {
            let next = self.next(orphan, direction);
            if !self.is_kin(next, orphan) {
                continue;
            }
            if self.room_outwards(next, opposite(direction)) > 0 {
                self.activate(next);
            }
            if self.origin[next] == Origin::By(opposite(direction)) {
                self.orphan(next);
            }
        }
        self.origin[orphan] = Origin::Free;
    }

    /// Whether `next` is in the same tree as `orphan`.
    fn is_kin(&self, next: usize, orphan: usize) -> bool {
        self.origin[next] != Origin::Free && self.is_second[next] == self.is_second[orphan]
    }

    /// How many steps a pixel is from its label; `None` where its way leads to an orphan. The way
    /// is remembered.
    fn steps_to_label(&mut self, from: usize) -> Option<u32> {
        let (mut at, mut steps) = (from, 0);
        let whole = loop {
            if self.seen_at[at] == self.now {
                break steps + self.steps_away[at];
            }
            match self.origin[at] {
                Origin::By(direction) => at = self.next(at, direction),
                Origin::Label => {
                    self.seen_at[at] = self.now;
                    self.steps_away[at] = 1;
                    break steps + 1;
                }
                Origin::Orphan | Origin::Free => return None,
            }
            steps += 1;
        };
        let (mut at, mut left) = (from, whole);
        while self.seen_at[at] != self.now {
            self.seen_at[at] = self.now;
            self.steps_away[at] = left;
            left -= 1;
            if let Origin::By(direction) = self.origin[at] {
                at = self.next(at, direction);
            }
        }
        Some(whole)
    }
}

fn grains(cost: f32) -> i32 {
    (cost / GRAIN).round() as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::seed_of_part;

    /// What labels cost.
    fn cost(size: Size, odds: &[f32], links: &[[f32; PAIRS]], labels: &[bool]) -> f32 {
        let mut cost = 0.0;
        for (pixel, is_first) in labels.iter().enumerate() {
            cost += if *is_first { 0.0 } else { odds[pixel] };
            for (pair, link) in links[pixel].iter().enumerate() {
                let next = neighbour(pixel, pair, size);
                if next.is_some_and(|next| labels[next] != *is_first) {
                    cost += link;
                }
            }
        }
        cost
    }

    /// A number from 0 to `most`, in grains.
    fn number(seed: u64, part: u64, most: u64) -> f32 {
        (seed_of_part(seed, part) % (256 * most)) as f32 * GRAIN
    }

    #[test]
    fn no_other_labels_of_a_small_picture_cost_less() {
        let size = Size::new(4, 3);
        for seed in 0..200 {
            let mut odds = Vec::new();
            let mut links = Vec::new();
            for pixel in 0..12 {
                odds.push(number(seed, pixel, 8) - 4.0);
                links.push([0, 1, 2, 3].map(|pair| number(seed, 100 + 4 * pixel + pair, 3)));
            }
            let labels = least_cut(size, &odds, &links, &CancelToken::new()).expect("a cut");
            let found = cost(size, &odds, &links, &labels);
            for other in 0..1_u32 << 12 {
                let other: Vec<bool> = (0..12).map(|pixel| other & (1 << pixel) != 0).collect();
                assert!(found <= cost(size, &odds, &links, &other) + 1e-3, "{seed}");
            }
        }
    }

    #[test]
    fn links_even_out_what_odds_alone_would_speckle() {
        let size = Size::new(40, 30);
        let is_left = |pixel: usize| pixel % 40 < 20;
        let mut odds = Vec::new();
        for pixel in 0..size.area() {
            let wrong = seed_of_part(1, pixel as u64).is_multiple_of(5);
            odds.push(if is_left(pixel) != wrong { 1.0 } else { -1.0 });
        }
        let links = vec![[1.0; PAIRS]; size.area()];
        let labels = least_cut(size, &odds, &links, &CancelToken::new()).expect("a cut");
        let wrong = (0..size.area()).filter(|&p| labels[p] != is_left(p));
        assert!(wrong.count() < 20);
    }

    #[test]
    fn a_cut_that_is_not_wanted_any_more_ends() {
        let cancel = CancelToken::new();
        cancel.cancel();
        let cut = least_cut(Size::new(2, 1), &[1.0; 2], &[[0.0; PAIRS]; 2], &cancel);
        assert!(cut.is_none());
    }
}
