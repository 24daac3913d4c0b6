//! The tree in 3D, from two sides at right angles, moving.

use super::{titled, waiting};
use crate::draw::{Camera, Rgba, View};
use crate::model::{NodeId, Phase, Size, Skeleton, Snapshot};
use crate::tui::solid::{BRAILLE, braille};
use crate::tui::state::{State, TURN_DEGREES};
use crate::tui::theme::Theme;
use nalgebra::{Point2, Point3, Vector2};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::Color;
use ratatui::symbols::Marker;
use ratatui::widgets::canvas::{Canvas, Line};

/// Both views in the same scale, or what they wait for.
pub fn render(frame: &mut Frame, state: &State, area: Rect, theme: Theme) {
    let s = &state.snapshot;
    let Some(skeleton) = s.skeleton.as_deref().filter(|k| k.nodes.len() > 1) else {
        let inner = titled(frame, area, "Tree", theme);
        waiting(frame, inner, reason(s), theme);
        return;
    };
    let degrees = [0, 90].map(|more| (state.turned * TURN_DEGREES + more) % 360);
    let views = degrees.map(|d| View {
        turn: f64::from(d).to_radians(),
        down: 0.0,
    });
    let [Some(first), Some(second)] = views.map(|view| Extent::of(skeleton, view)) else {
        return;
    };
    let extents = [first, second];
    let (areas, unit) = arranged(&extents, area);
    for (i, extent) in extents.iter().enumerate() {
        let room = titled(frame, areas[i], &name(degrees[i]), theme);
        if unit <= 0.0 || room.is_empty() {
            continue;
        }
        let camera = extent.camera(views[i], unit, room);
        let solid = state.solid.as_ref();
        match solid.and_then(|solid| solid.picture(s, &camera, theme)) {
            None => lines(frame, &branches(state, skeleton, theme), &camera, room),
            Some(picture) => dots_of(frame, &picture, room, theme),
        }
    }
}

/// Places of both views, side by side or one above the other, as the tree comes out larger; and the
/// size of a dot, model units.
fn arranged(extents: &[Extent; 2], area: Rect) -> ([Rect; 2], f64) {
    let halves = [Constraint::Fill(1), Constraint::Fill(1)];
    let beside = Layout::horizontal(halves).spacing(1).areas(area);
    let above = Layout::vertical(halves).areas(area);
    let [beside_unit, above_unit] = [beside, above].map(|rooms: [Rect; 2]| {
        let units = extents.iter().zip(rooms).map(|(e, room)| e.unit(room));
        units.fold(0.0, f64::max)
    });
    if above_unit < beside_unit {
        (above, above_unit)
    } else {
        (beside, beside_unit)
    }
}

/// A picture as dots of braille.
fn dots_of(frame: &mut Frame, picture: &Rgba, room: Rect, theme: Theme) {
    for (at, cell) in room.positions().zip(braille(picture)) {
        if let (Some((letter, rgb)), Some(onto)) = (cell, frame.buffer_mut().cell_mut(at)) {
            onto.set_char(letter).set_fg(theme.colour(rgb));
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

/// A branch as a line, model axes.
struct BranchLine {
    from: Point3<f64>,
    to: Point3<f64>,
    colour: Color,
}

fn lines(frame: &mut Frame, branches: &[BranchLine], camera: &Camera, room: Rect) {
    let size = Vector2::new(f64::from(camera.size.width), f64::from(camera.size.height));
    let canvas = Canvas::default()
        .marker(Marker::Braille)
        .x_bounds([0.0, size.x])
        .y_bounds([0.0, size.y])
        .paint(|context| {
            for line in branches {
                let [x1, y1, _] = camera.project(&line.from);
                let [x2, y2, _] = camera.project(&line.to);
                context.draw(&Line::new(x1, size.y - y1, x2, size.y - y2, line.colour));
            }
        });
    frame.render_widget(canvas, room);
}

/// Branches as lines: the copies first, so that what was measured lies on top; at the very top the
/// chosen one, in the colour of text, which is none of the branches'.
fn branches(state: &State, skeleton: &Skeleton, theme: Theme) -> Vec<BranchLine> {
    let s = &state.snapshot;
    let chosen = s.branches.get(state.chosen()).map(|b| b.node);
    let pose = s
        .pose
        .as_deref()
        .filter(|pose| pose.joints.len() == skeleton.nodes.len());
    let places: Vec<Point3<f64>> = match pose {
        Some(pose) => pose.joints.iter().map(|j| j.position).collect(),
        None => skeleton.nodes.iter().map(|n| n.position).collect(),
    };
    let mut copies = Vec::new();
    let mut measured = Vec::new();
    let mut top = Vec::new();
    for (i, node) in skeleton.nodes.iter().enumerate() {
        let Some(&from) = node.parent.and_then(|p| places.get(p.index())) else {
            continue;
        };
        let to = places[i];
        let mut coordinates = from.iter().chain(to.iter());
        if !coordinates.all(|c| c.is_finite()) {
            continue;
        }
        let mover = skeleton.mover(NodeId(i as u32));
        let branch = s.node_colour.get(i).copied().flatten();
        let (onto, colour) = match node.copy_of {
            None if skeleton.name_of(mover) == chosen => (&mut top, Color::Reset),
            Some(_) => (&mut copies, theme.branch_faded(branch)),
            None => (&mut measured, theme.branch(branch)),
        };
        onto.push(BranchLine { from, to, colour });
    }
    copies.extend(measured.into_iter().chain(top));
    copies
}

/// Why none is shown. Until it is built, with what a user who pulls the tree has to know before;
/// what is awaited is said above.
fn reason(s: &Snapshot) -> &'static str {
    match s.phase {
        Phase::Live => "no tree",
        _ if s.is_live => "shown once it is built\nbegin to film before the pull",
        _ => "shown once it is built",
    }
}

/// Extent of the tree at rest in a view: taken from the pose, the scale would breathe with the
/// wind.
struct Extent {
    /// Model units to the right and up from the foot.
    low: Point2<f64>,
    high: Point2<f64>,
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
        let mut extent: Option<Self> = None;
        for p in sound {
            let p = Point2::new(p.dot(&right), p.dot(&up));
            let all = extent.get_or_insert(Self { low: p, high: p });
            all.low = all.low.inf(&p);
            all.high = all.high.sup(&p);
        }
        extent
    }

    /// Least size of a dot with which the tree fits into the panel below its title.
    fn unit(&self, panel: Rect) -> f64 {
        let dots = dots(Rect {
            height: panel.height.saturating_sub(1).max(1),
            width: panel.width.max(1),
            ..panel
        });
        let extent = self.high - self.low;
        let across = extent.x / f64::from(dots.width);
        let upwards = extent.y / f64::from(dots.height);
        let unit = Self::MARGIN * across.max(upwards);
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
        let middle = scale * (self.low.coords + self.high.coords) / 2.0;
        let middle_px = Point2::new(
            f64::from(size.width) / 2.0 - middle.x,
            f64::from(size.height) / 2.0 + middle.y,
        );
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
