//! Colours: few, of middle brightness so that they can be read on dark and on light, none at all
//! under `NO_COLOR`.

use crate::model::MAIN_BRANCH_RGB;
use ratatui::style::{Color, Modifier, Style};

/// How many colours the terminal shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    /// The user wants no colour (`NO_COLOR`).
    None,
    /// The 256 colours that nearly every terminal knows.
    Indexed,
    /// Red, green and blue as they are.
    True,
}

impl Depth {
    /// What the environment says. `TMUX` counts as full colour because tmux itself reduces what the
    /// terminal lacks.
    pub fn from_env() -> Self {
        if is_set("NO_COLOR") {
            Depth::None
        } else if is_set("TMUX")
            || holds("COLORTERM", &["truecolor", "24bit"])
            || holds(
                "TERM",
                &["direct", "kitty", "ghostty", "alacritty", "wezterm", "foot"],
            )
        {
            Depth::True
        } else {
            Depth::Indexed
        }
    }
}

/// Whether an environment variable has a value.
pub(super) fn is_set(name: &str) -> bool {
    std::env::var(name).is_ok_and(|v| !v.is_empty())
}

/// Whether an environment variable has one of these in it, in small letters or large.
fn holds(name: &str, parts: &[&str]) -> bool {
    std::env::var(name).is_ok_and(|v| parts.iter().any(|p| v.to_lowercase().contains(p)))
}

const GREY: [u8; 3] = [0x80, 0x80, 0x80];
const WOOD: [u8; 3] = [0xb0, 0x98, 0x78];
const WARNING: [u8; 3] = [0xd8, 0x60, 0x00];

/// Turns what a thing means into how it looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Theme {
    depth: Depth,
}

impl Theme {
    /// A theme for a terminal of this colour depth.
    pub fn new(depth: Depth) -> Self {
        Self { depth }
    }

    /// The nearest colour that the terminal has.
    pub fn colour(self, [r, g, b]: [u8; 3]) -> Color {
        match self.depth {
            Depth::None => Color::Reset,
            Depth::Indexed => Color::Indexed(index_from_rgb([r, g, b])),
            Depth::True => Color::Rgb(r, g, b),
        }
    }

    /// Colour of a main branch as it is mixed into a picture; white where a point belongs to none
    /// yet.
    pub fn branch_rgb(self, branch: Option<u8>) -> [u8; 3] {
        branch.map_or([0xff; 3], |b| {
            MAIN_BRANCH_RGB[b as usize % MAIN_BRANCH_RGB.len()]
        })
    }

    /// Colour of a main branch on the terminal's own ground; the ground's text colour for the
    /// trunk.
    pub fn branch(self, branch: Option<u8>) -> Color {
        branch.map_or(Color::Reset, |b| self.colour(self.branch_rgb(Some(b))))
    }

    /// The same, half way to grey: what was not measured but repeated.
    pub fn branch_faded(self, branch: Option<u8>) -> Color {
        let full = branch.map_or(GREY, |b| self.branch_rgb(Some(b)));
        self.colour([0, 1, 2].map(|i| ((full[i] as u16 + 2 * GREY[i] as u16) / 3) as u8))
    }

    /// Colour of a branch's wood before light falls on it; the trunk's is that of wood, and what
    /// was not measured is half way to grey.
    pub fn wood_rgb(self, branch: Option<u8>, copied: bool) -> [u8; 3] {
        let full = branch.map_or(WOOD, |b| self.branch_rgb(Some(b)));
        if copied {
            [0, 1, 2].map(|i| ((full[i] as u16 + GREY[i] as u16) / 2) as u8)
        } else {
            full
        }
    }

    /// Titles of panels.
    pub fn title(self) -> Style {
        Style::new()
            .fg(self.colour(MAIN_BRANCH_RGB[5]))
            .add_modifier(Modifier::BOLD)
    }

    /// Names beside values, rules, things of the second rank.
    pub fn faint(self) -> Style {
        Style::new().fg(self.colour(GREY))
    }

    /// What to look at first.
    pub fn strong(self) -> Style {
        Style::new().add_modifier(Modifier::BOLD)
    }

    /// What is going wrong.
    pub fn warning(self) -> Style {
        Style::new()
            .fg(self.colour(WARNING))
            .add_modifier(Modifier::BOLD)
    }

    /// Where the program is now; reversed, so that it shows without colour as well.
    pub fn here(self) -> Style {
        Style::new()
            .fg(self.colour(MAIN_BRANCH_RGB[5]))
            .add_modifier(Modifier::BOLD | Modifier::REVERSED)
    }
}

/// Nearest entry of the 6x6x6 cube or of the grey ramp of the 256 colours.
fn index_from_rgb(rgb: [u8; 3]) -> u8 {
    let rgb = rgb.map(i32::from);
    let cube = rgb.map(|c| if c < 48 { 0 } else { ((c - 35) / 40).min(5) });
    let of_cube = cube.map(|l| if l == 0 { 0 } else { 55 + 40 * l });
    let mean = (rgb[0] + rgb[1] + rgb[2]) / 3;
    let step = ((mean - 3) / 10).clamp(0, 23);
    let of_greys = [8 + 10 * step; 3];
    if square_distance(rgb, of_greys) < square_distance(rgb, of_cube) {
        232 + step as u8
    } else {
        (16 + 36 * cube[0] + 6 * cube[1] + cube[2]) as u8
    }
}

fn square_distance(a: [i32; 3], b: [i32; 3]) -> i32 {
    (0..3).map(|i| (a[i] - b[i]).pow(2)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indexed_colours_are_near() {
        for (rgb, index) in [
            ([0, 0, 0], 16),
            ([255, 255, 255], 231),
            ([128, 128, 128], 244),
            ([255, 0, 0], 196),
            ([0, 95, 175], 25),
        ] {
            assert_eq!(index_from_rgb(rgb), index, "{rgb:?}");
        }
    }

    #[test]
    fn without_colour_nothing_is_coloured() {
        let theme = Theme::new(Depth::None);
        for branch in [None, Some(0), Some(255)] {
            assert_eq!(
                (theme.branch(branch), theme.branch_faded(branch)),
                (Color::Reset, Color::Reset)
            );
        }
    }
}
