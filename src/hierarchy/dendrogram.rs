//! The dendrogram: a binary tree of groups of points, the common form of both methods.

/// A part of the points, and the two that it comes apart into.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Range of [`Dendrogram::order`] that holds the points of the part.
    pub from: usize,
    pub to: usize,
    pub halves: Option<[usize; 2]>,
}

impl Part {
    /// The points `from..to` of the order, not divided.
    pub fn undivided(from: usize, to: usize) -> Self {
        Self {
            from,
            to,
            halves: None,
        }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.to - self.from
    }
}

/// A tree of parts; the first is everything, each stands before its halves.
#[derive(Clone, Debug, PartialEq)]
pub struct Dendrogram {
    /// The points, those of every part next to each other.
    pub order: Vec<usize>,
    pub parts: Vec<Part>,
}

impl Dendrogram {
    /// Divides `points` again and again; `halve` says for each of some points whether it is in the
    /// first half, or nothing if they are not to be divided. It is given the depth as well, 0 for
    /// all points.
    pub fn divided(
        points: Vec<usize>,
        mut halve: impl FnMut(&[usize], u32) -> Option<Vec<bool>>,
    ) -> Self {
        let mut parts = vec![Part::undivided(0, points.len())];
        let (mut order, mut depths, mut next) = (points, vec![0u32], 0);
        while next < parts.len() {
            let (from, to, depth) = (parts[next].from, parts[next].to, depths[next]);
            if let Some(in_first) = halve(&order[from..to], depth) {
                let (mut first, mut second) = (Vec::new(), Vec::new());
                for (&point, in_first) in order[from..to].iter().zip(in_first) {
                    let half = if in_first { &mut first } else { &mut second };
                    half.push(point);
                }
                let middle = from + first.len();
                order[from..middle].copy_from_slice(&first);
                order[middle..to].copy_from_slice(&second);
                parts[next].halves = Some([parts.len(), parts.len() + 1]);
                parts.extend([Part::undivided(from, middle), Part::undivided(middle, to)]);
                depths.extend([depth + 1; 2]);
            }
            next += 1;
        }
        Self { order, parts }
    }

    /// The tree of `n` points that were merged pair by pair: merge k joins two of the points 0 to n
    /// - 1 or of the earlier merges n, n + 1, …, n + k - 1 into n + k. There are n - 1 merges.
    pub fn merged(n: usize, merges: &[[usize; 2]]) -> Self {
        let mut sizes = vec![1; n];
        for m in merges {
            sizes.push(sizes[m[0]] + sizes[m[1]]);
        }
        let Some(top) = sizes.len().checked_sub(1) else {
            return Self {
                order: vec![],
                parts: vec![],
            };
        };
        let mut order = vec![0; n];
        let mut parts = vec![Part::undivided(0, n)];
        let mut ids = vec![top];
        let mut next = 0;
        while next < parts.len() {
            let (id, from, to) = (ids[next], parts[next].from, parts[next].to);
            if id < n {
                order[from] = id;
            } else {
                let [a, b] = merges[id - n];
                let middle = from + sizes[a];
                parts[next].halves = Some([parts.len(), parts.len() + 1]);
                parts.extend([Part::undivided(from, middle), Part::undivided(middle, to)]);
                ids.extend([a, b]);
            }
            next += 1;
        }
        Self { order, parts }
    }

    /// The points of a part.
    pub fn points(&self, part: usize) -> &[usize] {
        &self.order[self.parts[part].from..self.parts[part].to]
    }
}
