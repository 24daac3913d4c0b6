//! The tree in 3D, from the front and from the side, moving.

use super::{titled, waiting};
use crate::model::{Phase, Skeleton, Snapshot};
use crate::tui::state::State;
use crate::tui::theme::Theme;
use nalgebra::Point3;
use ratatui::Frame;
use ratatui::layout::{Constraint, Direction, Layout, Rect};
use ratatui::style::Color;
use ratatui::symbols::Marker;
use ratatui::widgets::canvas::{Canvas, Line};

/// A panel, and which coordinate it shows from left to right.
type View = (Rect, fn(&Point3<f64>) -> f64);

/// Both views in the same scale, or what they wait for.
pub fn render(frame: &mut Frame, state: &State, area: Rect, theme: Theme) {
    let s = &state.snapshot;
    let Some(skeleton) = s.skeleton.as_deref().filter(|k| k.nodes.len() > 1) else {
        let inner = titled(frame, area, "Tree", theme);
        waiting(frame, inner, &reason(s), theme);
        return;
    };
    let Some(bounds) = Bounds::of(skeleton) else { return };
    // Side by side or one above the other, as the tree comes out larger.
    let arrange = |direction: Direction| {
        let layout = Layout::new(direction, [Constraint::Fill(1), Constraint::Fill(1)]).spacing(match direction {
            Direction::Horizontal => 1,
            Direction::Vertical => 0,
        });
        let areas: [Rect; 2] = layout.areas(area);
        let unit = [0, 1].map(|i| bounds.unit(i, areas[i])).into_iter().fold(0.0, f64::max);
        (areas, unit)
    };
    let (beside, above) = (arrange(Direction::Horizontal), arrange(Direction::Vertical));
    let ([first, second], unit) = if above.1 < beside.1 { above } else { beside };
    let views: [View; 2] =
        [(titled(frame, first, "Front", theme), |p| p.x), (titled(frame, second, "Side", theme), |p| p.z)];
    let branches = branches(s, skeleton, theme);
    for (i, (room, across)) in views.into_iter().enumerate() {
        let ([x, y], [w, h]) = (bounds.middle(i), [room.width as f64 * 2.0 * unit, room.height as f64 * 4.0 * unit]);
        let canvas = Canvas::default()
            .marker(Marker::Braille)
            .x_bounds([x - w / 2.0, x + w / 2.0])
            .y_bounds([y - h / 2.0, y + h / 2.0])
            .paint(|context| {
                for (from, to, color) in &branches {
                    context.draw(&Line::new(across(from), from.y, across(to), to.y, *color));
                }
            });
        if unit > 0.0 && !room.is_empty() {
            frame.render_widget(canvas, room);
        }
    }
}

/// Branches as lines: the copies first, so that what was measured lies on top.
fn branches(s: &Snapshot, skeleton: &Skeleton, theme: Theme) -> Vec<(Point3<f64>, Point3<f64>, Color)> {
    let pose = s.pose.as_deref().filter(|pose| pose.joints.len() == skeleton.nodes.len());
    let at = |i: usize| match pose {
        Some(pose) => pose.joints.get(i).map(|j| j.position),
        None => skeleton.nodes.get(i).map(|n| n.position),
    };
    let mut copies = Vec::new();
    let mut measured = Vec::new();
    for (i, node) in skeleton.nodes.iter().enumerate() {
        let Some((Some(from), Some(to))) = node.parent.map(|p| (at(p.index()), at(i))) else { continue };
        if !from.coords.iter().chain(to.coords.iter()).all(|c| c.is_finite()) {
            continue;
        }
        let branch = s.node_colour.get(i).copied().flatten();
        match node.copy_of {
            Some(_) => copies.push((from, to, theme.branch_faded(branch))),
            None => measured.push((from, to, theme.branch(branch))),
        }
    }
    copies.extend(measured);
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

/// Extent of the tree at rest: taken from the pose, the scale would breathe with the wind.
struct Bounds {
    low: Point3<f64>,
    high: Point3<f64>,
}

impl Bounds {
    /// Room left around the tree at rest for its sway.
    const MARGIN: f64 = 1.12;

    fn of(skeleton: &Skeleton) -> Option<Self> {
        let mut points = skeleton.nodes.iter().map(|n| n.position).filter(|p| p.coords.iter().all(|c| c.is_finite()));
        let first = points.next()?;
        let (low, high) = points.fold((first, first), |(l, h), p| (l.inf(&p), h.sup(&p)));
        Some(Self { low, high })
    }

    /// Least size of a dot in view `i` with which the tree fits into the panel below its title.
    fn unit(&self, i: usize, panel: Rect) -> f64 {
        let axis = [0, 2][i];
        let across = (self.high[axis] - self.low[axis]) / (2.0 * panel.width.max(1) as f64);
        let up = (self.high.y - self.low.y) / (4.0 * panel.height.saturating_sub(1).max(1) as f64);
        let unit = Self::MARGIN * across.max(up);
        // A tree without extent is drawn as what it is, a dot.
        if unit.is_finite() && unit > 1e-9 { unit } else { 1.0 }
    }

    fn middle(&self, i: usize) -> [f64; 2] {
        let axis = [0, 2][i];
        [(self.low[axis] + self.high[axis]) / 2.0, (self.low.y + self.high.y) / 2.0]
    }
}
