//! The tree in 3D, from two sides at right angles, moving.

use super::{titled, waiting};
use crate::draw::{Camera, View};
use crate::model::{Phase, Size, Skeleton, Snapshot};
use crate::tui::solid::{BRAILLE, braille};
use crate::tui::state::{State, TURN_DEGREES};
use crate::tui::theme::Theme;
use nalgebra::Point3;
use ratatui::Frame;
use ratatui::layout::{Constraint, Direction, Layout, Rect};
use ratatui::style::Color;
use ratatui::symbols::Marker;
use ratatui::widgets::canvas::{Canvas, Line};

/// Both views in the same scale, or what they wait for.
pub fn render(frame: &mut Frame, state: &State, area: Rect, theme: Theme) {
    let s = &state.snapshot;
    let Some(skeleton) = s.skeleton.as_deref().filter(|k| k.nodes.len() > 1) else {
        let inner = titled(frame, area, "Tree", theme);
        waiting(frame, inner, &reason(s), theme);
        return;
    };
    let degrees = [0, 90].map(|more| (state.turned * TURN_DEGREES + more) % 360);
    let views = degrees.map(|d| View {
        turn: f64::from(d).to_radians(),
        down: 0.0,
    });
    let Some(seen) = views
        .iter()
        .map(|view| Extent::of(skeleton, *view))
        .collect::<Option<Vec<_>>>()
    else {
        return;
    };
    // Side by side or one above the other, as the tree comes out larger.
    let arrange = |direction: Direction| {
        let layout = Layout::new(direction, [Constraint::Fill(1), Constraint::Fill(1)]).spacing(
            match direction {
                Direction::Horizontal => 1,
                Direction::Vertical => 0,
            },
        );
        let areas: [Rect; 2] = layout.areas(area);
        let unit = seen
            .iter()
            .zip(areas)
            .map(|(extent, room)| extent.unit(room))
            .fold(0.0, f64::max);
        (areas, unit)
    };
    let (beside, above) = (arrange(Direction::Horizontal), arrange(Direction::Vertical));
    let (areas, unit) = if above.1 < beside.1 { above } else { beside };
    for ((area, view), (extent, degrees)) in
        areas.into_iter().zip(views).zip(seen.iter().zip(degrees))
    {
        let room = titled(frame, area, &name(degrees), theme);
        if unit <= 0.0 || room.is_empty() {
            continue;
        }
        let camera = extent.camera(view, unit, room);
        match state
            .solid
            .as_ref()
            .and_then(|solid| solid.picture(s, &camera, theme))
        {
            None => lines(frame, &branches(state, skeleton, theme), &camera, room),
            Some(picture) => {
                for (at, cell) in room.positions().zip(braille(&picture)) {
                    if let (Some((letter, rgb)), Some(onto)) =
                        (cell, frame.buffer_mut().cell_mut(at))
                    {
                        onto.set_char(letter).set_fg(theme.colour(rgb));
                    }
                }
            }
        }
    }
}

/// What is seen of the tree by who has walked round it by so much to the right.
fn name(degrees: u16) -> String {
    match degrees {
        0 => "Front".to_owned(),
        90 => "Side".to_owned(),
        180 => "Back".to_owned(),
        270 => "Other side".to_owned(),
        _ => format!("Turned {degrees}°"),
    }
}

fn lines(
    frame: &mut Frame,
    branches: &[(Point3<f64>, Point3<f64>, Color)],
    camera: &Camera,
    room: Rect,
) {
    let size = [camera.size.width, camera.size.height].map(f64::from);
    let canvas = Canvas::default()
        .marker(Marker::Braille)
        .x_bounds([0.0, size[0]])
        .y_bounds([0.0, size[1]])
        .paint(|context| {
            for (from, to, color) in branches {
                let ([x1, y1, _], [x2, y2, _]) = (camera.project(from), camera.project(to));
                context.draw(&Line::new(x1, size[1] - y1, x2, size[1] - y2, *color));
            }
        });
    frame.render_widget(canvas, room);
}

/// Branches as lines: the copies first, so that what was measured lies on top; at the very top the
/// chosen one, in the colour of text, which is none of the branches'.
fn branches(
    state: &State,
    skeleton: &Skeleton,
    theme: Theme,
) -> Vec<(Point3<f64>, Point3<f64>, Color)> {
    let s = &state.snapshot;
    let chosen = s.branches.get(state.chosen()).map(|b| b.node);
    let pose = s
        .pose
        .as_deref()
        .filter(|pose| pose.joints.len() == skeleton.nodes.len());
    let at = |i: usize| match pose {
        Some(pose) => pose.joints.get(i).map(|j| j.position),
        None => skeleton.nodes.get(i).map(|n| n.position),
    };
    let mut copies = Vec::new();
    let mut measured = Vec::new();
    let mut top = None;
    for (i, node) in skeleton.nodes.iter().enumerate() {
        let Some((Some(from), Some(to))) = node.parent.map(|p| (at(p.index()), at(i))) else {
            continue;
        };
        if !from
            .coords
            .iter()
            .chain(to.coords.iter())
            .all(|c| c.is_finite())
        {
            continue;
        }
        let branch = s.node_colour.get(i).copied().flatten();
        match node.copy_of {
            None if Some(node.name) == chosen => top = Some((from, to, Color::Reset)),
            Some(_) => copies.push((from, to, theme.branch_faded(branch))),
            None => measured.push((from, to, theme.branch(branch))),
        }
    }
    copies.extend(measured.into_iter().chain(top));
    copies
}

fn reason(s: &Snapshot) -> String {
    match s.phase {
        Phase::Outline => "waits for the outline; o draws one".to_owned(),
        Phase::Detect => "waits for points".to_owned(),
        Phase::Accumulate => "waits for enough motion; b builds now".to_owned(),
        Phase::Build => "is being built".to_owned(),
        Phase::Live => "no tree".to_owned(),
    }
}

/// Extent of the tree at rest in a view: taken from the pose, the scale would breathe with the
/// wind.
struct Extent {
    /// Model units to the right and up from the foot.
    low: [f64; 2],
    high: [f64; 2],
}

impl Extent {
    /// Room left around the tree at rest for its sway.
    const MARGIN: f64 = 1.12;

    fn of(skeleton: &Skeleton, view: View) -> Option<Self> {
        let [right, up, _] = view.axes();
        let sound = skeleton
            .nodes
            .iter()
            .map(|n| n.position.coords)
            .filter(|p| p.iter().all(|c| c.is_finite()));
        sound
            .map(|p| [p.dot(&right), p.dot(&up)])
            .fold(None, |all, p| {
                let Some(Self { low, high }) = all else {
                    return Some(Self { low: p, high: p });
                };
                let with = |of: [f64; 2], pick: fn(f64, f64) -> f64| {
                    [pick(of[0], p[0]), pick(of[1], p[1])]
                };
                Some(Self {
                    low: with(low, f64::min),
                    high: with(high, f64::max),
                })
            })
    }

    /// Least size of a dot with which the tree fits into the panel below its title.
    fn unit(&self, panel: Rect) -> f64 {
        let dots = dots(Rect {
            height: panel.height.saturating_sub(1).max(1),
            width: panel.width.max(1),
            ..panel
        });
        let fit = |axis: usize, dots: u32| (self.high[axis] - self.low[axis]) / f64::from(dots);
        let unit = Self::MARGIN * fit(0, dots.width).max(fit(1, dots.height));
        // A tree without extent is drawn as what it is, a dot.
        if unit.is_finite() && unit > 1e-9 {
            unit
        } else {
            1.0
        }
    }

    /// The camera that shows it in the middle of `room`, one dot a `unit`.
    fn camera(&self, view: View, unit: f64, room: Rect) -> Camera {
        let (size, scale) = (dots(room), 1.0 / unit);
        let middle = [0, 1].map(|i| scale * (self.low[i] + self.high[i]) / 2.0);
        let middle_px = [
            f64::from(size.width) / 2.0 - middle[0],
            f64::from(size.height) / 2.0 + middle[1],
        ];
        Camera {
            view,
            aim: Point3::origin(),
            middle_px,
            scale,
            size,
        }
    }
}

/// Dots of braille in an area.
fn dots(area: Rect) -> Size {
    Size::new(
        u32::from(area.width) * BRAILLE.width,
        u32::from(area.height) * BRAILLE.height,
    )
}
