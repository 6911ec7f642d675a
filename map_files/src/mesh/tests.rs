use super::*;
use crate::ImportOptions;
use mapgen::free_cells;
use proptest::prelude::*;
use voxels::{Cell, Grid};

/// Two triangles for each side of a box.
fn cuboid(low: [f64; 3], high: [f64; 3]) -> Mesh {
    let mut mesh = Mesh::default();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for side in [low[axis], high[axis]] {
            let corner = |at_u: f64, at_v: f64| {
                let mut corner = [0.0; 3];
                (corner[axis], corner[u], corner[v]) = (side, at_u, at_v);
                corner
            };
            let [a, b, c, d] =
                [corner(low[u], low[v]), corner(high[u], low[v]), corner(high[u], high[v]), corner(low[u], high[v])];
            mesh.add([a, b, c]);
            mesh.add([a, c, d]);
        }
    }
    mesh
}

fn read(mesh: &Mesh, options: ImportOptions) -> Imported {
    map(&ImportSpec { options, ..ImportSpec::new("a.obj", Vec::new()) }, mesh.clone(), Vec::new()).unwrap()
}

/// The text of a note.
fn note<'a>(imported: &'a Imported, name: &str) -> Option<&'a str> {
    imported.notes.iter().find(|note| note.name == name).map(|note| note.text.as_str())
}

fn options(fill: Fill, inside: Kind) -> ImportOptions {
    ImportOptions { fill: Some(fill), inside: Some(inside), ..ImportOptions::default() }
}

#[test]
fn a_box_is_solid_in_the_open_a_cave_or_a_shell() {
    let mesh = cuboid([1.0, 2.0, -3.0], [4.0, 4.0, 2.0]);
    let cave = read(&mesh, options(Fill::Solid, Kind::Free));
    assert_eq!((cave.terrain.extent().size(), free_cells(&cave.terrain)), ([5, 4, 7], 3 * 2 * 5));
    assert!(note(&cave, "holes").is_none());
    assert_eq!(note(&cave, "origin"), Some("the map begins at (0, 1, -4) m of the file"));
    assert_eq!(note(&cave, "spans"), Some("3.000 m x 2.000 m x 5.000 m, with scale = 1"));
    assert_eq!(note(&cave, "turned"), Some("6 triangles that did not face outwards with the others"));
    assert_eq!(note(&cave, "fill"), Some("solid: 30 cells inside become free, 0 cells decided by winding number"));

    let around = ImportOptions { margin_cells: Some(2), ..options(Fill::Solid, Kind::Wall) };
    let solid = read(&mesh, around).terrain;
    assert_eq!((solid.extent().size(), free_cells(&solid)), ([9, 8, 11], 7 * 6 * 9 - 3 * 2 * 5));

    // The upper sides lie in the cells above them.
    let shell = read(&mesh, options(Fill::Shell, Kind::Free)).terrain;
    assert_eq!((shell.extent().size(), free_cells(&shell)), ([6, 5, 8], 2 * 4));
    let open = read(&mesh, options(Fill::Shell, Kind::Wall)).terrain;
    assert_eq!(free_cells(&open), 2 * 4 + (3 + 2 + 5 + 1), "within the shell, and beyond its upper edges");
}

/// The mesh and its back: each face of two triangles once more, the other way round, in one of the
/// orders and with one of the diagonals that programs write.
fn two_sided(mesh: &Mesh, writes: usize) -> Mesh {
    let corners = |triangle: &[u32; 3]| triangle.map(|corner| mesh.vertices[corner as usize]);
    let triangles: Vec<Triangle> = mesh.triangles.iter().map(corners).collect();
    let mut both = Mesh::default();
    let backs: Vec<Triangle> = triangles
        .chunks(2)
        .flat_map(|quad| {
            let ([a, b, c], d) = (quad[0], quad[1][2]);
            match writes {
                0 => [[d, c, b], [d, b, a]],
                1 => [[c, b, a], [d, c, a]],
                _ => [[d, c, b], [b, a, d]],
            }
        })
        .collect();
    for (front, back) in triangles.chunks(2).zip(backs.chunks(2)) {
        front.iter().for_each(|&triangle| both.add(triangle));
        if writes == 2 {
            back.iter().for_each(|&triangle| both.add(triangle));
        }
    }
    if writes != 2 {
        backs.iter().rev().for_each(|&triangle| both.add(triangle));
    }
    both
}

/// A box that faces outwards.
fn outwards(low: [f64; 3], high: [f64; 3]) -> Mesh {
    let sides = cuboid(low, high);
    let mut mesh = Mesh::default();
    for (number, side) in sides.triangles.chunks(2).enumerate() {
        let [a, b, c] = side[0].map(|corner| sides.vertices[corner as usize]);
        let d = sides.vertices[side[1][2] as usize];
        let [a, b, c, d] = if number % 2 == 0 { [d, c, b, a] } else { [a, b, c, d] };
        mesh.add([a, b, c]);
        mesh.add([a, c, d]);
    }
    mesh
}

fn joined(meshes: &[Mesh]) -> Mesh {
    let mut all = Mesh::default();
    for mesh in meshes {
        mesh.triangles.iter().for_each(|triangle| all.add(triangle.map(|corner| mesh.vertices[corner as usize])));
    }
    all
}

#[test]
fn two_sided_surfaces_are_those_with_one_side() {
    let room = |low: f64, high: f64| outwards([low; 3], [high; 3]);
    let slab = outwards;
    let slabs = joined(&[
        slab([0.0; 3], [8.0, 6.0, 1.0]),
        slab([0.0, 0.0, 4.0], [8.0, 6.0, 5.0]),
        slab([0.0; 3], [1.0, 6.0, 5.0]),
        slab([7.0, 0.0, 0.0], [8.0, 6.0, 5.0]),
        slab([0.0; 3], [8.0, 1.0, 5.0]),
        slab([0.0, 5.0, 0.0], [8.0, 6.0, 5.0]),
    ]);
    let mut open = room(0.0, 6.0);
    open.triangles.truncate(10);
    let touching = joined(&[room(0.0, 4.0), slab([4.0, 0.0, 0.0], [8.0, 4.0, 4.0])]);
    let corners = [[9.0, 9.0, 9.0], [9.0, 12.0, 9.0], [9.0, 12.0, 12.0], [9.0, 9.0, 12.0]];
    let mut sheet = Mesh::default();
    sheet.add([corners[0], corners[1], corners[2]]);
    sheet.add([corners[0], corners[2], corners[3]]);
    for writes in 0..3 {
        for mesh in [&slabs, &room(0.0, 6.0), &open, &touching] {
            let both = two_sided(mesh, writes);
            for kind in [Kind::Wall, Kind::Free] {
                let (one, both) = (read(mesh, options(Fill::Solid, kind)), read(&both, options(Fill::Solid, kind)));
                assert!(one.terrain == both.terrain, "{writes}, {kind:?}: {:?}", both.notes);
                assert!(note(&both, "doubled").is_some(), "{writes}");
                assert_eq!(note(&one, "doubled"), None, "of two boxes that touch the common side stays");
            }
        }
        // One side of a room has a back, or a sheet beside it has one.
        let (mut five, mut side) = (room(0.0, 6.0), room(0.0, 6.0));
        five.triangles.truncate(10);
        side.triangles.drain(..10);
        let partly = read(&joined(&[five, two_sided(&side, writes)]), options(Fill::Solid, Kind::Free));
        assert_eq!((free_cells(&partly.terrain), note(&partly, "holes")), (6 * 6 * 6, None), "{:?}", partly.notes);
        let with_sheet = joined(&[room(0.0, 6.0), two_sided(&sheet, writes)]);
        let with_sheet = read(&with_sheet, options(Fill::Solid, Kind::Free));
        assert_eq!(free_cells(&with_sheet.terrain), 6 * 6 * 6, "{:?}", with_sheet.notes);
        assert_eq!((note(&with_sheet, "doubled"), note(&with_sheet, "holes")), (None, None));
    }
}

#[test]
fn span_is_that_of_the_file_whatever_the_cells() {
    for cell_m in [7.0, 1e3, 1e5, 1e6, 1e9] {
        let spec = ImportSpec { cell_m: Some(cell_m), ..ImportSpec::new("a.obj", Vec::new()) };
        let error = map(&spec, cuboid([0.0; 3], [6.0, 4.0, 3.0]), Vec::new()).unwrap_err().to_string();
        assert!(error.starts_with("the file spans 6.000 m x 4.000 m x 3.000 m, with scale = 1: no more"), "{error}");
    }
}

/// Meshes of several volumes have the surface between two of them once.
#[test]
fn surfaces_between_solids_are_named() {
    let mut mesh = cuboid([0.0; 3], [3.0; 3]);
    let mut other = cuboid([3.0, 0.0, 0.0], [6.0, 3.0, 3.0]);
    // The first two triangles are the side that touches.
    mesh.triangles.extend(other.triangles.drain(2..));
    let imported = read(&mesh, options(Fill::Solid, Kind::Wall));
    let told = note(&imported, "interfaces").unwrap();
    assert!(told.starts_with("three faces or more meet at 4 edges"), "{told}");
    let alone = read(&cuboid([0.0; 3], [3.0; 3]), options(Fill::Solid, Kind::Wall));
    assert_eq!(note(&alone, "interfaces"), None);
}

#[test]
fn lines_through_holes_have_no_say() {
    let mut mesh = cuboid([0.0; 3], [6.0; 3]);
    // The lid: the last two triangles.
    mesh.triangles.truncate(10);
    let imported = read(&mesh, options(Fill::Solid, Kind::Free));
    assert_eq!(free_cells(&imported.terrain), 6 * 6 * 6);
    assert_eq!(
        note(&imported, "holes"),
        Some(
            "the mesh is not closed: 0, 0 and 36 lines along x, y and z come through holes and have no vote; \
             1 opening(s): 36.000 m2 around (3.000, 3.000, 6.000) m"
        )
    );
}

#[test]
fn triangles_without_an_area_are_dropped() {
    let mut mesh = cuboid([0.0; 3], [2.0; 3]);
    mesh.add([[0.0; 3], [1.0; 3], [2.0; 3]]);
    mesh.add([[0.0; 3], [1.0, 0.0, f64::NAN], [2.0, 1.0, 5.0]]);
    let Imported { terrain, notes, .. } = read(&mesh, options(Fill::Solid, Kind::Free));
    assert_eq!(free_cells(&terrain), 8);
    assert_eq!(notes[0].text, "14 triangles in 1 part(s), 2 dropped because they have no area or are not finite");
    let nothing = Mesh { vertices: vec![[0.0; 3]], triangles: vec![[0; 3]], ..Mesh::default() };
    let error = map(&ImportSpec::new("a.obj", Vec::new()), nothing, Vec::new()).unwrap_err();
    assert_eq!(error.to_string(), "the file has no triangle");
}

/// A ball of triangles, twice subdivided from an octahedron.
fn ball(centre: [f64; 3], radius: f64) -> Mesh {
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut faces = Vec::new();
    for signs in 0..8 {
        let sign = |axis: usize| if signs >> axis & 1 == 1 { -1.0 } else { 1.0 };
        faces.push([0, 1, 2].map(|axis: usize| axes[axis].map(|along: f64| along * sign(axis))));
    }
    for _ in 0..3 {
        faces = faces
            .into_iter()
            .flat_map(|[a, b, c]: Triangle| {
                let middle = |a: [f64; 3], b: [f64; 3]| {
                    let sum = [0, 1, 2].map(|along| a[along] + b[along]);
                    let length = libm::sqrt(sum.iter().map(|along| along * along).sum());
                    sum.map(|along| along / length)
                };
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    let mut mesh = Mesh::default();
    for face in faces {
        mesh.add(face.map(|corner| [0, 1, 2].map(|along| centre[along] + radius * corner[along])));
    }
    mesh
}

/// The surface of cells of a lattice as two triangles for each face between a cell and none, whose
/// diagonals `diagonals` chooses; `place` gives the corners of the lattice their places.
fn surface(cells: &Grid<bool>, diagonals: &[bool], place: impl Fn([i32; 3]) -> [f64; 3]) -> Mesh {
    let has = |[x, y, z]: [i32; 3]| cells.get(Cell::new(x, y, z)) == Some(&true);
    let mut mesh = Mesh::default();
    let mut faces = 0;
    for (cell, _) in cells.iter().filter(|&(_, &is_solid)| is_solid) {
        let here = [cell.x, cell.y, cell.z];
        for (axis, side) in (0..3).flat_map(|axis| [(axis, 0), (axis, 1)]) {
            let mut beside = here;
            beside[axis] += 2 * side - 1;
            if has(beside) {
                continue;
            }
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let mut corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[at_u, at_v]| {
                let mut corner = here;
                (corner[axis], corner[u], corner[v]) = (here[axis] + side, here[u] + at_u, here[v] + at_v);
                place(corner)
            });
            if side == 0 {
                corners.reverse();
            }
            if diagonals[faces % diagonals.len()] {
                corners.rotate_left(1);
            }
            faces += 1;
            let [a, b, c, d] = corners;
            mesh.add([a, b, c]);
            mesh.add([a, c, d]);
        }
    }
    mesh
}

/// The wall of a map, by the place of its cells in the file's lattice of cells.
fn walls(imported: &Imported, cell_m: f64) -> std::collections::BTreeSet<[i32; 3]> {
    let low = imported.origin_m.unwrap().map(|along| libm::round(along / cell_m) as i32);
    let last = imported.terrain.extent().size().map(|cells| cells as i32 - 1);
    let inner = |at: [i32; 3]| (0..3).all(|axis| (1..last[axis]).contains(&at[axis]));
    let walls = imported.terrain.iter().filter(|&(_, &here)| here == Terrain::Wall);
    let walls = walls.map(|(cell, _)| [cell.x, cell.y, cell.z]).filter(|&at| inner(at));
    walls.map(|at| [0, 1, 2].map(|axis| at[axis] + low[axis])).collect()
}

#[test]
fn faces_through_centres_are_no_walls() {
    let cave = read(&cuboid([-6.5, -4.5, -3.5], [6.5, 4.5, 3.5]), options(Fill::Solid, Kind::Free));
    assert_eq!(free_cells(&cave.terrain), 13 * 9 * 7);
    assert_eq!(note(&cave, "fill"), Some("solid: 819 cells inside become free, 0 cells decided by winding number"));
    // Without its lid the same, by winding numbers.
    let mut open = cuboid([-6.5, -4.5, -3.5], [6.5, 4.5, 3.5]);
    open.triangles.truncate(11);
    assert_eq!(free_cells(&read(&open, options(Fill::Solid, Kind::Free)).terrain), 13 * 9 * 7);
}

proptest! {
    #[test]
    fn a_mesh_of_cells_comes_back_as_these_cells(
        solid in prop::collection::vec(prop::bool::weighted(0.6), 60),
        diagonals in prop::collection::vec(any::<bool>(), 1..50),
        halves in prop::array::uniform3(-40i32..40),
        offset in prop::sample::select(vec![0.0, 0.25, 0.375, -0.001]),
        cell_m in prop::sample::select(vec![1.0, 0.1, 0.2, 0.3, 0.05, 2.5, 1.0 / 3.0, 1e-3, 120.0]),
        is_single in any::<bool>(),
        fill in prop::sample::select(vec![Fill::Solid, Fill::Shell]),
    ) {
        prop_assume!(solid.iter().any(|&is_solid| is_solid));
        let cells = Grid::from_vec(voxels::Extent::new([4, 3, 5], 1.0).unwrap(), solid).unwrap();
        let place = |corner: [i32; 3]| [0, 1, 2].map(|axis| {
            let along = (f64::from(corner[axis]) + f64::from(halves[axis]) / 2.0 + offset) * cell_m;
            if is_single { f64::from(along as f32) } else { along }
        });
        let mesh = surface(&cells, &diagonals, place);
        let spec = ImportSpec { cell_m: Some(cell_m), options: options(fill, Kind::Wall), ..ImportSpec::new("a.obj", Vec::new()) };
        let imported = map(&spec, mesh, Vec::new()).unwrap();
        // A centre between two cells of the lattice lies in the upper one.
        let shift = |axis: usize| libm::ceil(f64::from(halves[axis]) / 2.0 + offset - 0.5) as i32;
        let expected: std::collections::BTreeSet<[i32; 3]> = cells
            .iter()
            .filter(|&(_, &is_solid)| is_solid)
            .map(|(cell, _)| [cell.x + shift(0), cell.y + shift(1), cell.z + shift(2)])
            .collect();
        if fill == Fill::Solid {
            prop_assert_eq!(walls(&imported, cell_m), expected);
            prop_assert!(note(&imported, "fill").unwrap().ends_with(" 0 cells decided by winding number"));
        } else {
            // Whatever the diagonals and the numbers, the same cells.
            let plain = surface(&cells, &[false], |corner| [0, 1, 2].map(|axis| f64::from(corner[axis]) + f64::from(halves[axis]) / 2.0 + offset));
            let spec = ImportSpec { cell_m: Some(1.0), ..spec };
            prop_assert_eq!(walls(&imported, cell_m), walls(&map(&spec, plain, Vec::new()).unwrap(), 1.0));
        }
    }

    #[test]
    fn turned_triangles_of_cells_that_share_edges_are_turned_back(
        solid in prop::collection::vec(prop::bool::weighted(0.4), 36),
        diagonals in prop::collection::vec(any::<bool>(), 1..50),
        turned in prop::collection::vec(prop::bool::weighted(0.3), 1..200),
    ) {
        prop_assume!(solid.iter().any(|&is_solid| is_solid));
        // A closed surface alone does not tell whether it is a solid or a cavity.
        let is_enclosed = |at: usize| !solid[at] && [1, 4, 12].iter().all(|step| {
            at.checked_sub(*step).is_some_and(|below| solid[below]) && solid.get(at + step) == Some(&true)
        });
        prop_assume!(!(0..solid.len()).any(is_enclosed));
        let cells = Grid::from_vec(voxels::Extent::new([4, 3, 3], 1.0).unwrap(), solid).unwrap();
        let mut mesh = surface(&cells, &diagonals, |corner| corner.map(f64::from));
        let plain = read(&mesh, options(Fill::Solid, Kind::Wall));
        for (triangle, _) in mesh.triangles.iter_mut().zip(turned.iter().cycle()).filter(|(_, is_turned)| **is_turned) {
            triangle.swap(1, 2);
        }
        let imported = read(&mesh, options(Fill::Solid, Kind::Wall));
        prop_assert_eq!(walls(&imported, 1.0), walls(&plain, 1.0), "{:?}", imported.notes);
    }

    #[test]
    fn a_closed_ball_has_no_holes_and_its_cells(
        centre in prop::array::uniform3(-2.0f64..2.0), radius in 2.0f64..6.0,
    ) {
        let imported = read(&ball(centre, radius), options(Fill::Solid, Kind::Free));
        prop_assert!(note(&imported, "holes").is_none(), "{:?}", imported.notes);
        let terrain = imported.terrain;
        // An end that lies almost at a whole cell counts as one that lies there.
        let whole = |along: f64| if (along - along.round()).abs() < 1.1e-3 { along.round() } else { along.floor() };
        let is_near = |along: f64| ((along - along.round()).abs() - 1e-3).abs() < 1e-4;
        prop_assume!(centre.iter().all(|along| !is_near(along - radius)));
        let begin: Vec<f64> = centre.iter().map(|along| whole(along - radius) - 1.0).collect();
        for (cell, &here) in terrain.iter() {
            let at = [cell.x, cell.y, cell.z];
            let square: f64 = (0..3).map(|axis| begin[axis] + f64::from(at[axis]) + 0.5 - centre[axis]).map(|d| d * d).sum();
            // The triangles are a little inside the ball.
            if square.sqrt() < 0.93 * radius {
                prop_assert_eq!(here, Terrain::Free);
            } else if square.sqrt() > radius {
                prop_assert_eq!(here, Terrain::Wall);
            }
        }
    }

    #[test]
    fn no_path_leads_through_a_shell(centre in prop::array::uniform3(-2.0f64..2.0), radius in 3.0f64..6.0) {
        let inside = ImportOptions { margin_cells: Some(1), free_from: Some(centre), ..options(Fill::Shell, Kind::Wall) };
        let terrain = read(&ball(centre, radius), inside).terrain;
        prop_assert!(mapgen::free_cells(&terrain) > 0);
        prop_assert_eq!(terrain.get(Cell::new(1, 1, 1)), Some(&Terrain::Wall));
    }
}

#[test]
fn a_box_is_cut_out_of_a_mesh() {
    let read = |crop| {
        let text = "v 0 0 0\nv 9 0 0\nv 9 8 0\nv 0 8 0\nv 0 0 7\nv 9 0 7\nv 9 8 7\nv 0 8 7\nf 1 4 3 2\nf 5 6 7 8\n\
                    f 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
        let options = ImportOptions { inside: Some(Kind::Free), crop, ..ImportOptions::default() };
        ImportSpec { options, ..ImportSpec::new("a.obj", text.into()) }.read()
    };
    let part = read(Some([-5.0, 2.0, 1.0, 4.0, 6.5, 99.0])).unwrap();
    assert_eq!(part.terrain.extent().size(), [7, 7, 9]);
    assert_eq!(mapgen::free_cells(&part.terrain), 4 * 5 * 6);
    assert_eq!(part.origin_m, Some([-2.0, 1.0, 0.0]));
    let refused = read(Some([20.0, 0.0, 0.0, 30.0, 9.0, 9.0])).unwrap_err().to_string();
    assert!(refused.ends_with("the file has no cell inside the box of crop"), "{refused}");
    let refused = read(Some([1.0, 0.0, 0.0, 0.0, 9.0, 9.0])).unwrap_err().to_string();
    assert!(refused.contains("crop = 1,0,0,0,9,9, allowed is six finite numbers"), "{refused}");
}
