//! The colours of a tree's leaves in few numbers, for other trees like it.

use super::template::Template;
use crate::geometry::foliage::Foliage;
use crate::model::brightness;
use crate::random::seed_of_part;
use nalgebra::Point3;

/// Colours in a palette.
const COLOURS: usize = 32;

/// Colours of the leaves as the film shows them (sRGB), evenly by rank of brightness, the darkest
/// first; none where there are no leaves. `template` is the leaf that stands at every seed.
pub fn leaf_palette(foliage: &Foliage, template: &Template) -> Vec<[u8; 3]> {
    let groups = foliage.groups.iter();
    let mut all: Vec<[u8; 3]> = groups.flat_map(|g| &g.colours).copied().collect();
    // By the colour itself where two are as bright: the same whatever their order was.
    all.sort_by_key(|rgb| (brightness(*rgb), *rgb));
    let count = COLOURS.min(all.len());
    let mut palette = Vec::with_capacity(count);
    for k in 0..count {
        let of_leaf = all[(2 * k + 1) * all.len() / (2 * count)];
        // Colour times texture is what the film shows.
        let seen = [0, 1, 2].map(|c| f64::from(of_leaf[c]) * template.texture_mean[c]);
        palette.push(seen.map(|x| x.round().clamp(0.0, 255.0) as u8));
    }
    palette
}

/// One of the colours by chance, the same for all that is at one place (px); `None` of none.
pub(super) fn any_of(palette: &[[u8; 3]], at: &Point3<f64>) -> Option<[u8; 3]> {
    let count = palette.len() as u64;
    if count == 0 {
        return None;
    }
    let mut place = 0_u64;
    for x in at.coords.iter() {
        place = seed_of_part(place, x.round() as i64 as u64);
    }
    palette.get((place % count) as usize).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::FoliageGroup;

    #[test]
    fn a_palette_holds_dark_and_bright_leaves_in_their_shares() {
        let mut group = FoliageGroup::default();
        group.colours.resize(300, [10, 40, 10]);
        group.colours.resize(400, [90, 200, 60]);
        let foliage = Foliage {
            groups: vec![group],
            ..Foliage::default()
        };
        let palette = leaf_palette(&foliage, &Template::ours());
        assert_eq!(palette.len(), COLOURS);
        let dark = palette.iter().filter(|rgb| rgb[1] < 100).count();
        assert_eq!(dark, 3 * COLOURS / 4);
        assert!(palette.iter().all(|rgb| rgb[1] > rgb[0]));
        assert!(leaf_palette(&Foliage::default(), &Template::ours()).is_empty());
    }

    #[test]
    fn places_have_colours_of_the_palette_and_all_of_them_occur() {
        let palette = [[1, 0, 0], [2, 0, 0], [3, 0, 0]];
        let mut seen = [0; 3];
        for k in 0..60 {
            let at = Point3::new(f64::from(k) * 3.0, 7.0, f64::from(k));
            let colour = any_of(&palette, &at).expect("a colour");
            assert_eq!(Some(colour), any_of(&palette, &at));
            seen[usize::from(colour[0]) - 1] += 1;
        }
        assert!(seen.iter().all(|n| *n > 5), "{seen:?}");
        assert_eq!(any_of(&[], &Point3::origin()), None);
    }
}
