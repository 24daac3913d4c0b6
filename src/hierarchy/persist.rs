//! Which branch of a tree that was built anew is which of the old one.

use crate::model::TrackId;
use std::collections::{BTreeMap, BTreeSet};

/// For every group of points in `new` the group in `old` that it goes on as; none goes on as two.
///
/// An old group goes on where most of its points went: more than half of those that both trees
/// hold. Of several new groups that hold them (a branch lies in all those above it), or several old
/// ones that went into one, the pair that is most alike counts: shared points over all points of
/// both (Jaccard), pair by pair from the best down. The best assignment of all (Hungarian) may give
/// up a certain pair for two doubtful ones, and then a branch that has not changed gets another's
/// name.
pub fn persisting(old: &[Vec<TrackId>], new: &[Vec<TrackId>]) -> Vec<Option<usize>> {
    // Points that were lost meanwhile, or are new, say nothing about what moved where.
    let old_sizes = sizes_within(old, new);
    let new_sizes = sizes_within(new, old);
    let mut groups_of: BTreeMap<TrackId, Vec<usize>> = BTreeMap::new();
    for (i, group) in old.iter().enumerate() {
        group
            .iter()
            .for_each(|id| groups_of.entry(*id).or_default().push(i));
    }
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    for (k, group) in new.iter().enumerate() {
        let mut shared: BTreeMap<usize, usize> = BTreeMap::new();
        for i in group.iter().filter_map(|id| groups_of.get(id)).flatten() {
            *shared.entry(*i).or_default() += 1;
        }
        for (i, n) in shared {
            if 2 * n > old_sizes[i] {
                let jaccard = n as f64 / (old_sizes[i] + new_sizes[k] - n) as f64;
                pairs.push((jaccard, i, k));
            }
        }
    }
    pairs.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let (mut of_new, mut taken) = (vec![None; new.len()], vec![false; old.len()]);
    for (_, i, k) in pairs {
        if of_new[k].is_none() && !taken[i] {
            (of_new[k], taken[i]) = (Some(i), true);
        }
    }
    of_new
}

/// How many points of each of `groups` are in any of `others`.
fn sizes_within(groups: &[Vec<TrackId>], others: &[Vec<TrackId>]) -> Vec<usize> {
    let known: BTreeSet<&TrackId> = others.iter().flatten().collect();
    groups
        .iter()
        .map(|group| group.iter().filter(|id| known.contains(id)).count())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn groups(sets: &[&[u32]]) -> Vec<Vec<TrackId>> {
        sets.iter()
            .map(|s| s.iter().map(|&i| TrackId(i)).collect())
            .collect()
    }

    /// Whole, two main branches, two twigs on the first.
    const OLD: [&[u32]; 5] = [
        &[1, 2, 3, 4, 5, 6, 7, 8, 9],
        &[1, 2, 3, 4, 5],
        &[6, 7, 8, 9],
        &[1, 2, 3],
        &[4, 5],
    ];

    /// A branch that loses its number for nothing makes every table and every stream of it useless.
    #[test]
    fn a_group_goes_on_where_most_of_its_points_went() {
        type Case = (
            &'static str,
            &'static [&'static [u32]],
            &'static [Option<usize>],
        );
        let cases: [Case; 5] = [
            (
                "the same tree in another order",
                &[OLD[0], OLD[2], OLD[1], OLD[4], OLD[3]],
                &[Some(0), Some(2), Some(1), Some(4), Some(3)],
            ),
            (
                "a point has changed sides",
                &[OLD[0], &[1, 2, 3, 4, 5, 6], &[7, 8, 9], &[1, 2], &[3, 4, 5]],
                &[Some(0), Some(1), Some(2), Some(3), Some(4)],
            ),
            (
                "points were lost and found",
                &[
                    &[1, 2, 4, 5, 6, 7, 20],
                    &[1, 2, 4, 5, 20],
                    &[6, 7],
                    &[1, 2, 20],
                    &[4, 5],
                ],
                &[Some(0), Some(1), Some(2), Some(3), Some(4)],
            ),
            (
                "a split is not made any more",
                &[OLD[0], OLD[1], OLD[2]],
                &[Some(0), Some(1), Some(2)],
            ),
            (
                "a branch falls into two halves: neither is it",
                &[OLD[0], &[6, 7], &[8, 9], OLD[1]],
                &[Some(0), None, None, Some(1)],
            ),
        ];
        for (what, new, expected) in cases {
            let found = persisting(&groups(&OLD), &groups(new));
            assert_eq!(found, expected, "{what}");
        }
        assert_eq!(persisting(&[], &groups(&OLD)), vec![None; 5]);
    }

    /// All that is left of the whole tree is one branch, so that both names fit.
    #[test]
    fn a_group_of_new_points_alone_is_none_of_the_old_ones() {
        let new: [&[u32]; 3] = [&[6, 7, 8, 9, 30, 31], &[6, 7, 8, 9], &[30, 31]];
        let found = persisting(&groups(&OLD), &groups(&new));
        assert_eq!(
            found.iter().flatten().count(),
            1 + usize::from(found[0].is_some()),
            "{found:?}"
        );
        assert_eq!(found[2], None);
    }
}
