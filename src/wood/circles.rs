//! From a mask to branches by circles (Tan et al. 2008 sect. 2.2, fig. 3): a circle is moved along
//! the wood from the foot upwards. Wherever it crosses wood that is joined to its centre, the
//! branch goes on.
//!
//! The paper classifies the pixels of a circle by colour mixtures of a stroke; here the mask has
//! that answer.

use super::mask::WoodMask;
use super::ways::distances;
use crate::model::{BranchGraph, WoodNode};
use nalgebra::{Point2, Vector2, distance};
use std::collections::VecDeque;
use std::f64::consts::TAU;

/// Radius of the circle in widths of the picture: 50 px of about 1500.
const RADIUS: f64 = 1.0 / 30.0;
/// What is nearer to the centre of an earlier circle than this share of the radius has been
/// visited.
const VISITED: f64 = 0.5;
/// A joint that is no fork is left out where the branch turns by less than this, degrees.
const LEAST_TURN_DEG: f64 = 30.0;

/// The branches of the mask, rooted at the foot (px of the picture). Without nodes where there is
/// no wood. A branch ends where the last circle on it has its centre: what is shorter than a radius
/// is not traced.
///
/// # Errors
/// OpenCV fails.
pub fn branches(wood: &WoodMask, foot_px: Point2<f64>) -> opencv::Result<BranchGraph> {
    let Some(first) = nearest_wood(wood, wood.to_mask(foot_px)) else {
        return Ok(BranchGraph::default());
    };
    let tracer = Tracer {
        wood,
        radius: RADIUS * f64::from(wood.size.width),
    };
    let centres = without_straight(&tracer.trace(first));
    let inside = distances(&wood.mask, wood.size)?;
    let mut graph = BranchGraph::default();
    graph.nodes.push(WoodNode {
        parent: None,
        position_px: foot_px,
        radius_px: 0.0,
    });
    // The first circle stands at the foot, or where wood is nearest to it.
    for centre in &centres[1..] {
        let pixel = wood.pixel(centre.at).unwrap_or(0);
        graph.nodes.push(WoodNode {
            parent: centre.from,
            position_px: wood.to_picture(centre.at),
            radius_px: wood.radius_px(inside[pixel]),
        });
    }
    Ok(graph)
}

/// The place of wood that is nearest to a place, px of the mask.
fn nearest_wood(wood: &WoodMask, to: Point2<f64>) -> Option<Point2<f64>> {
    let pixels = wood.mask.iter().enumerate().filter(|(_, m)| **m != 0);
    let places = pixels.map(|(pixel, _)| wood.place(pixel));
    places.min_by(|a, b| distance(a, &to).total_cmp(&distance(b, &to)))
}

/// Centre of a circle, px of the mask.
#[derive(Clone, Copy, Debug)]
struct Centre {
    at: Point2<f64>,
    /// The circle that it was found on.
    from: Option<usize>,
}

struct Tracer<'a> {
    wood: &'a WoodMask,
    radius: f64,
}

impl Tracer<'_> {
    /// The centres of all circles, the nearest to the first one first (breadth first).
    fn trace(&self, first: Point2<f64>) -> Vec<Centre> {
        let mut centres = vec![Centre {
            at: first,
            from: None,
        }];
        let mut next = VecDeque::from([0]);
        while let Some(current) = next.pop_front() {
            let at = centres[current].at;
            for crossing in self.crossings(at) {
                let is_visited = self.is_visited(crossing, current, &centres);
                if !is_visited && self.is_joined(at, crossing) {
                    next.push_back(centres.len());
                    centres.push(Centre {
                        at: crossing,
                        from: Some(current),
                    });
                }
            }
        }
        centres
    }

    /// Whether a place is near to the centre of a circle other than that of number `but`.
    fn is_visited(&self, at: Point2<f64>, but: usize, centres: &[Centre]) -> bool {
        let mut others = (0..centres.len()).filter(|other| *other != but);
        others.any(|other| distance(&centres[other].at, &at) < VISITED * self.radius)
    }

    /// The middles of the arcs of wood on the circle about a centre.
    fn crossings(&self, centre: Point2<f64>) -> Vec<Point2<f64>> {
        let steps = (TAU * self.radius).ceil() as usize;
        let mut is_wood = Vec::with_capacity(steps);
        for step in 0..steps {
            let at = self.on_circle(centre, step as f64 / steps as f64);
            is_wood.push(self.wood.holds(at));
        }
        let mut crossings = Vec::new();
        // Arcs are followed from a gap on. A circle that is all wood crosses no branch.
        let Some(gap) = is_wood.iter().position(|is_wood| !is_wood) else {
            return crossings;
        };
        let mut begin = None;
        for step in gap + 1..=gap + steps {
            if is_wood[step % steps] {
                begin.get_or_insert(step);
            } else if let Some(begin) = begin.take() {
                let middle = 0.5 * (begin + step - 1) as f64;
                crossings.push(self.on_circle(centre, middle / steps as f64));
            }
        }
        crossings
    }

    /// The place on the circle about a centre at this share of its round.
    fn on_circle(&self, centre: Point2<f64>, share: f64) -> Point2<f64> {
        let angle = TAU * share;
        centre + self.radius * Vector2::new(angle.cos(), angle.sin())
    }

    /// Whether the straight way between two places is all wood.
    fn is_joined(&self, from: Point2<f64>, to: Point2<f64>) -> bool {
        let steps = distance(&from, &to).ceil().max(1.0) as usize;
        let mut shares = (0..=steps).map(|step| step as f64 / steps as f64);
        shares.all(|share| self.wood.holds(from + share * (to - from)))
    }
}

/// The tree without the joints at which nothing forks and the branch hardly turns.
fn without_straight(centres: &[Centre]) -> Vec<Centre> {
    let mut found_on: Vec<Vec<usize>> = vec![Vec::new(); centres.len()];
    for (i, centre) in centres.iter().enumerate() {
        if let Some(from) = centre.from {
            found_on[from].push(i);
        }
    }
    let mut kept: Vec<Centre> = Vec::with_capacity(centres.len());
    // Where each centre is among those that are kept; for one that is not, what it was found on.
    let mut place: Vec<usize> = Vec::with_capacity(centres.len());
    for (i, centre) in centres.iter().enumerate() {
        let from = centre.from.map(|from| place[from]);
        let is_straight = match (from, &found_on[i][..]) {
            (Some(from), [next]) => {
                let arrives = centre.at - kept[from].at;
                let leaves = centres[*next].at - centre.at;
                arrives.angle(&leaves).to_degrees() < LEAST_TURN_DEG
            }
            _ => false,
        };
        match from {
            Some(from) if is_straight => place.push(from),
            _ => {
                place.push(kept.len());
                kept.push(Centre {
                    at: centre.at,
                    from,
                });
            }
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Size;

    const SIZE: Size = Size {
        width: 300,
        height: 240,
    };
    const FOOT: Point2<f64> = Point2::new(100.0, 230.0);

    fn mask(lines: &[[Point2<f64>; 2]]) -> WoodMask {
        WoodMask::made_up(SIZE, lines, 3.0)
    }

    fn tips(graph: &BranchGraph) -> Vec<Point2<f64>> {
        let mut tips = Vec::new();
        for (node, children) in graph.nodes.iter().zip(graph.children()) {
            if children.is_empty() {
                tips.push(node.position_px);
            }
        }
        tips
    }

    #[test]
    fn a_fork_is_traced_to_within_a_radius_of_both_tips() {
        let top = Point2::new(100.0, 130.0);
        let ends = [Point2::new(40.0, 40.0), Point2::new(180.0, 60.0)];
        let lines = [[FOOT, top], [top, ends[0]], [top, ends[1]]];
        let graph = branches(&mask(&lines), FOOT).expect("opencv");
        let tips = tips(&graph);
        assert_eq!(tips.len(), 2, "{graph:?}");
        let radius = RADIUS * f64::from(SIZE.width);
        for end in ends {
            let near = tips.iter().any(|tip| distance(tip, &end) < radius + 4.0);
            assert!(near, "{end} {tips:?}");
        }
        // Straight limbs are drawn by few pieces.
        assert!(graph.nodes.len() <= 6, "{graph:?}");
        for node in &graph.nodes[1..] {
            assert!((node.radius_px - 3.0).abs() < 2.0, "{node:?}");
        }
    }

    #[test]
    fn what_lies_beyond_a_gap_is_not_reached_and_a_ring_ends() {
        let (left, right) = (Point2::new(60.0, 60.0), Point2::new(160.0, 60.0));
        let beyond = [Point2::new(250.0, 200.0), Point2::new(250.0, 100.0)];
        let lines = [[FOOT, left], [left, right], [right, FOOT], beyond];
        let graph = branches(&mask(&lines), FOOT).expect("opencv");
        assert!(graph.nodes.iter().all(|node| node.position_px.x < 200.0));
        assert!(graph.length_px() < 460.0, "{graph:?}");
    }

    #[test]
    fn without_wood_there_is_no_graph() {
        assert_eq!(branches(&mask(&[]), FOOT).expect("opencv").nodes, []);
    }
}
