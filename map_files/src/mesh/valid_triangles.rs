//! The triangles of a mesh that have an area, in the coordinates of the map.
//!
//! Vertices are converted once, however many triangles share them.

use super::super::frame::{Bounds, Frame, Units};
use super::{Mesh, Triangle, lattice, normal};

/// The triangles of a mesh that have an area.
pub(super) struct ValidTriangles {
    /// The places of all vertices of the mesh, in lengths of cells.
    places: Vec<[f64; 3]>,
    /// The vertices of each triangle.
    vertices: Vec<[u32; 3]>,
}

impl ValidTriangles {
    /// The triangles of a mesh that have an area and are finite.
    pub(super) fn of(mesh: Mesh, units: Units) -> Self {
        let Mesh { vertices: mut places, triangles: vertices, .. } = mesh;
        for place in &mut places {
            *place = units.cells(*place);
        }
        let mut valid = Self { places, vertices };
        valid.drop_flat();
        valid
    }

    /// Puts the vertices on the lattice, and drops triangles that have no area there. `bounds` are
    /// those of the triangles.
    pub(super) fn put_on_lattice(&mut self, bounds: Bounds) {
        lattice::put_on(&mut self.places, bounds);
        self.drop_flat();
    }

    /// Moves the vertices into a map.
    pub(super) fn put_into(&mut self, frame: &Frame) {
        for place in &mut self.places {
            *place = frame.in_map(*place);
        }
    }

    /// The bounds of the triangles; `None` without triangles.
    pub(super) fn bounds(&self) -> Option<Bounds> {
        Bounds::of(self.triangles().flatten())
    }

    /// The corners of the triangles.
    pub(super) fn triangles(&self) -> impl Iterator<Item = Triangle> {
        self.vertices.iter().map(|triangle| corners(&self.places, triangle))
    }

    /// The places of all vertices, and the vertices of each triangle.
    pub(super) fn into_parts(self) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
        (self.places, self.vertices)
    }

    fn drop_flat(&mut self) {
        let places = &self.places;
        self.vertices.retain(|triangle| {
            let corners = corners(places, triangle);
            let normal = normal(&corners);
            corners.iter().flatten().chain(&normal).all(|along| along.is_finite()) && normal != [0.0; 3]
        });
    }
}

fn corners(places: &[[f64; 3]], triangle: &[u32; 3]) -> Triangle {
    triangle.map(|vertex| places[vertex as usize])
}
