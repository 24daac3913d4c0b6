//! Average linkage: the two groups of the highest mean affinity over their pairs are joined, again
//! and again.
//!
//! A normalised cut prefers halves of equal weight, and a trunk that gives off one branch after the
//! other has none.

use nalgebra::DMatrix;

/// Joins all points; merge k is of points (below n) or earlier merges (n, n + 1, …), see
/// [`super::dendrogram::Dendrogram`]. `affinity` is symmetric and used up.
///
/// Chains of nearest neighbours (Murtagh 1983): from any group to the one nearest to it, until two
/// are each other's nearest. For the mean over pairs these may be joined at once, so that all takes
/// of the order of n^2 steps.
pub fn average_linkage(mut affinity: DMatrix<f32>) -> Vec<[usize; 2]> {
    let n = affinity.nrows();
    let mut merges = Vec::with_capacity(n.saturating_sub(1));
    // Each group lives on in the column of one of its points.
    let mut ids: Vec<usize> = (0..n).collect();
    let mut sizes = vec![1.0f32; n];
    let mut left: Vec<usize> = (0..n).collect();
    let mut chain: Vec<usize> = Vec::new();
    while left.len() > 1 {
        if chain.is_empty() {
            chain.push(left[0]);
        }
        let last = chain[chain.len() - 1];
        let before = chain.len().checked_sub(2).map(|k| chain[k]);
        let column = affinity.column(last);
        // The one before wins ties, else the chain could go round in circles.
        let (mut best, mut most) = (before, before.map_or(f32::NEG_INFINITY, |b| column[b]));
        for &k in left.iter().filter(|&&k| k != last) {
            if column[k] > most {
                (best, most) = (Some(k), column[k]);
            }
        }
        // Nothing compares greater only among values that are no numbers; any partner will do.
        let Some(other) = best.or_else(|| left.iter().copied().find(|&k| k != last)) else {
            break;
        };
        if before != Some(other) {
            chain.push(other);
            continue;
        }
        chain.truncate(chain.len() - 2);
        let (keep, gone) = (last.min(other), last.max(other));
        let (a, b) = (sizes[keep], sizes[gone]);
        for &k in left.iter().filter(|&&k| k != keep && k != gone) {
            let mean = (a * affinity[(k, keep)] + b * affinity[(k, gone)]) / (a + b);
            affinity[(k, keep)] = mean;
            affinity[(keep, k)] = mean;
        }
        merges.push([ids[keep], ids[gone]]);
        ids[keep] = n + merges.len() - 1;
        sizes[keep] = a + b;
        left.retain(|&k| k != gone);
    }
    merges
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hierarchy::dendrogram::Dendrogram;
    use std::collections::BTreeSet;

    fn affinities(n: usize) -> DMatrix<f32> {
        DMatrix::from_fn(n, n, |i, j| {
            let (a, b) = (i.min(j) as f32, i.max(j) as f32);
            ((a * 0.754_877 + b * 0.569_84) * 7.3).fract()
        })
    }

    fn mean_affinity(w: &DMatrix<f32>, a: &BTreeSet<usize>, b: &BTreeSet<usize>) -> f64 {
        let mut sum = 0.0;
        for &i in a {
            for &j in b {
                sum += f64::from(w[(i, j)]);
            }
        }
        sum / (a.len() * b.len()) as f64
    }

    /// Against the definition: all pairs of groups looked at before each merge.
    #[test]
    fn joins_what_the_plain_method_joins() {
        for n in [1usize, 2, 5, 30] {
            let w = affinities(n);
            let mut groups: Vec<BTreeSet<usize>> = (0..n).map(|i| BTreeSet::from([i])).collect();
            let mut expected = BTreeSet::new();
            while groups.len() > 1 {
                let (mut best, mut i, mut j) = (f64::NEG_INFINITY, 0, 0);
                for a in 0..groups.len() {
                    for b in a + 1..groups.len() {
                        let mean = mean_affinity(&w, &groups[a], &groups[b]);
                        if mean > best {
                            (best, i, j) = (mean, a, b);
                        }
                    }
                }
                let gone = groups.remove(j);
                groups[i].extend(gone);
                expected.insert(groups[i].clone());
            }
            let tree = Dendrogram::merged(n, &average_linkage(w.clone()));
            let found: BTreeSet<BTreeSet<usize>> = (0..tree.parts.len())
                .filter(|&p| tree.parts[p].len() > 1)
                .map(|p| tree.points(p).iter().copied().collect())
                .collect();
            assert_eq!(found, expected, "{n} points");
        }
    }

    /// Values that are no numbers, or all the same, must not hang it.
    #[test]
    fn ends_on_useless_values() {
        for value in [f32::NAN, 0.0, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(
                average_linkage(DMatrix::from_element(9, 9, value)).len(),
                8,
                "{value}"
            );
        }
    }
}
