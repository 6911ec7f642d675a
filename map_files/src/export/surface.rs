//! The surface between wall and free cells as triangles of rectangles, merged greedily.
//!
//! Layer by layer along each axis, and for each side: the first face that is left grows to the
//! right as long as it can, and then upwards. All faces of the surface are covered once, those at
//! the edge of the map included, because outside is wall.
//!
//! A rectangle that has corners of others on its edges becomes a fan around its middle, with all of
//! them: so every edge of a triangle is a whole edge of another one, and the surface is watertight.
//! It is that of the free space, seen from outside: triangles face the wall.
//!
//! Where two free cells touch at an edge alone, four rectangles meet. Those of one of the two cells
//! have a corner in the middle of the edge, so that every edge is one of exactly two triangles,
//! also for programs that merge vertices at the same place, and no place moves.

use std::cmp::Ordering;
use std::collections::BTreeSet;

use voxels::{Cell, Grid, Terrain, is_wall_at};

/// A rectangle of faces of cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Rectangle {
    axis: usize,
    /// Whether the free space is above it.
    is_up: bool,
    /// Its lowest corner, in cells.
    low: [u32; 3],
    /// Its edges along the two axes after `axis`.
    edges: [u32; 2],
}

impl Rectangle {
    /// Its corners in cells, anticlockwise as seen from the wall.
    pub(super) fn corners(&self) -> [[u32; 3]; 4] {
        let (u, v) = ((self.axis + 1) % 3, (self.axis + 2) % 3);
        let corner = |along_u: u32, along_v: u32| {
            let mut corner = self.low;
            corner[u] += along_u;
            corner[v] += along_v;
            corner
        };
        let [along_u, along_v] = self.edges;
        let corners = [corner(0, 0), corner(along_u, 0), corner(along_u, along_v), corner(0, along_v)];
        let [a, b, c, d] = corners;
        if self.is_up { [a, d, c, b] } else { corners }
    }

    /// The steps of one cell around it, in the order of [`Self::corners`].
    fn steps(&self) -> impl Iterator<Item = Step> {
        let corners = self.corners();
        let sides = (0..corners.len()).map(move |at| (corners[at], corners[(at + 1) % corners.len()]));
        sides.flat_map(|(from, to)| {
            let length = (0..3).map(|axis| from[axis].abs_diff(to[axis])).max().unwrap_or(0);
            let place = move |step: u32| {
                [0, 1, 2].map(|axis| match to[axis].cmp(&from[axis]) {
                    Ordering::Less => from[axis] - step,
                    Ordering::Equal => from[axis],
                    Ordering::Greater => from[axis] + step,
                })
            };
            (0..length).map(move |step| Step { from: place(step), to: place(step + 1) })
        })
    }

    /// Its corners and those of others on its edges, in half cells, in the order of
    /// [`Self::corners`].
    fn outline(&self, all: &BTreeSet<[u32; 3]>, terrain: &Grid<Terrain>) -> Vec<[u32; 3]> {
        let mut outline = Vec::new();
        for step in self.steps() {
            if all.contains(&step.from) {
                outline.push(step.from.map(|along| 2 * along));
            }
            if self.touch(terrain, step) == Some(Side::Upper) {
                outline.push([0, 1, 2].map(|axis| step.from[axis] + step.to[axis]));
            }
        }
        outline
    }

    /// Whether the free cell at a step around it touches another one there at an edge alone, and
    /// which of the two it is.
    fn touch(&self, terrain: &Grid<Terrain>, Step { from, to }: Step) -> Option<Side> {
        let (u, v) = ((self.axis + 1) % 3, (self.axis + 2) % 3);
        let (along, across) = if from[u] == to[u] { (v, u) } else { (u, v) };
        let is_at_low = from[across] == self.low[across];
        let mut free = [0; 3];
        free[self.axis] = self.low[self.axis] as i32 - i32::from(!self.is_up);
        free[along] = from[along].min(to[along]) as i32;
        free[across] = from[across] as i32 - i32::from(!is_at_low);
        let mut beside = free;
        beside[across] += if is_at_low { -1 } else { 1 };
        let mut opposite = beside;
        opposite[self.axis] += if self.is_up { -1 } else { 1 };
        let is_wall = |[x, y, z]: [i32; 3]| is_wall_at(terrain, Cell::new(x, y, z));
        let side = if free > opposite { Side::Upper } else { Side::Lower };
        (is_wall(beside) && !is_wall(opposite)).then_some(side)
    }

    /// The direction of the wall.
    pub(super) fn normal(&self) -> [i8; 3] {
        let mut normal = [0; 3];
        normal[self.axis] = if self.is_up { -1 } else { 1 };
        normal
    }
}

/// The edge of a face between two places, in cells.
#[derive(Clone, Copy)]
struct Step {
    from: [u32; 3],
    to: [u32; 3],
}

/// One of two cells that touch at an edge.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Side {
    Lower,
    Upper,
}

/// A triangle of the surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surface {
    /// Its corners in half cells.
    pub(super) corners: [[u32; 3]; 3],
    /// The direction of the wall.
    pub(super) normal: [i8; 3],
}

/// The triangles of the surface of a map.
pub(super) fn triangles(terrain: &Grid<Terrain>) -> Vec<Surface> {
    let rectangles = rectangles(terrain);
    let mut corners: BTreeSet<[u32; 3]> = rectangles.iter().flat_map(Rectangle::corners).collect();
    for rectangle in &rectangles {
        let touching = rectangle.steps().filter(|&step| rectangle.touch(terrain, step).is_some());
        corners.extend(touching.flat_map(|step| [step.from, step.to]));
    }
    let mut found = Vec::new();
    for rectangle in rectangles {
        let outline = rectangle.outline(&corners, terrain);
        let normal = rectangle.normal();
        let mut add = |corners: [[u32; 3]; 3]| found.push(Surface { corners, normal });
        if let [a, b, c, d] = outline[..] {
            [[a, b, c], [a, c, d]].into_iter().for_each(&mut add);
        } else {
            let [a, _, c, _] = rectangle.corners();
            let middle = [0, 1, 2].map(|axis| a[axis] + c[axis]);
            for (at, &corner) in outline.iter().enumerate() {
                add([middle, corner, outline[(at + 1) % outline.len()]]);
            }
        }
    }
    found
}

/// The surface of a map as rectangles.
pub(super) fn rectangles(terrain: &Grid<Terrain>) -> Vec<Rectangle> {
    let size = terrain.extent().size();
    let mut found = Vec::new();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for is_up in [false, true] {
            for layer in 0..=size[axis] {
                let is_free = |offset: i32, at_u: u32, at_v: u32| {
                    let mut cell = [0; 3];
                    (cell[axis], cell[u], cell[v]) = (layer as i32 + offset, at_u as i32, at_v as i32);
                    !is_wall_at(terrain, Cell::new(cell[0], cell[1], cell[2]))
                };
                let (free, wall) = if is_up { (0, -1) } else { (-1, 0) };
                let mut faces = Faces::new([size[u], size[v]], |at_u, at_v| {
                    is_free(free, at_u, at_v) && !is_free(wall, at_u, at_v)
                });
                faces.merge(|[at_u, at_v], edges| {
                    let mut low = [0; 3];
                    (low[axis], low[u], low[v]) = (layer, at_u, at_v);
                    found.push(Rectangle { axis, is_up, low, edges });
                });
            }
        }
    }
    found
}

/// Faces in a plane that are not yet in a rectangle.
struct Faces {
    size: [u32; 2],
    is_left: Vec<bool>,
}

impl Faces {
    fn new([size_u, size_v]: [u32; 2], is_face: impl Fn(u32, u32) -> bool) -> Self {
        let is_face = &is_face;
        let is_left = (0..size_v).flat_map(|v| (0..size_u).map(move |u| is_face(u, v))).collect();
        Self { size: [size_u, size_v], is_left }
    }

    /// Removes all faces as rectangles, given as lowest corners and edges.
    fn merge(&mut self, mut found: impl FnMut([u32; 2], [u32; 2])) {
        let [size_u, size_v] = self.size;
        for v in 0..size_v {
            for u in 0..size_u {
                let row = |faces: &Self, v: u32, count: u32| (u..u + count).all(|u| faces.is_left[faces.index(u, v)]);
                let along_u = (u..size_u).take_while(|&u| self.is_left[self.index(u, v)]).count() as u32;
                if along_u == 0 {
                    continue;
                }
                let along_v = (v..size_v).take_while(|&v| row(self, v, along_u)).count() as u32;
                for v in v..v + along_v {
                    let first = self.index(u, v);
                    self.is_left[first..first + along_u as usize].fill(false);
                }
                found([u, v], [along_u, along_v]);
            }
        }
    }

    fn index(&self, u: u32, v: u32) -> usize {
        (v * self.size[0] + u) as usize
    }
}
