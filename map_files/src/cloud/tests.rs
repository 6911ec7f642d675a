//! Walls, free space and notes of point clouds.

use super::*;
use crate::ImportOptions;
use voxels::Cell;

fn map(spec: &ImportSpec, points: &[[f64; 3]], sensors: Sensors, notes: Vec<Note>) -> Result<Imported, FormatError> {
    super::map(spec, Cloud { points: points.to_vec().into(), sensors, notes, ..Cloud::default() })
}

fn spec(options: ImportOptions, cell_m: f64) -> ImportSpec {
    ImportSpec { options, cell_m: Some(cell_m), ..ImportSpec::new("a.pcd", Vec::new()) }
}

#[test]
fn points_are_walls_and_the_rest_of_their_box_is_free() {
    let points = [[0.0, 0.0, 0.0], [1.2, 0.2, 0.1], [0.6, f64::NAN, 0.0], [1.4, 0.9, 0.4]];
    let Imported { terrain, notes, stores_cell_m, .. } =
        map(&spec(ImportOptions::default(), 0.5), &points, Sensors::None, Vec::new()).unwrap();
    let wall = "#####\n#####\n#####\n#####\n";
    assert_eq!(terrain.to_text(), format!("{wall}\n#####\n#..##\n##.##\n#####\n\n{wall}"));
    assert_eq!(terrain.extent().cell_m(), 0.5);
    assert!(!stores_cell_m);
    assert_eq!(notes[0].text, "3 in 3 cells, 1 dropped because they are not finite");
    assert_eq!(notes[2].text, "the map begins at (-0.5, -0.5, -0.5) m of the file");
}

#[test]
fn y_may_point_upwards_and_units_may_be_millimetres() {
    let options = ImportOptions { up: Some(crate::options::Up::Y), scale: Some(0.001), ..ImportOptions::default() };
    let points = [[0.0, 0.0, 0.0], [0.0, 2000.0, -1000.0]];
    let terrain = map(&spec(options, 1.0), &points, Sensors::None, Vec::new()).unwrap().terrain;
    assert_eq!(terrain.extent().size(), [3, 4, 5]);
    assert_eq!(terrain.get(Cell::new(1, 2, 3)), Some(&Terrain::Wall));
    assert_eq!(terrain.get(Cell::new(1, 1, 2)), Some(&Terrain::Free));
}

#[test]
fn unconnected_cells_are_filled() {
    let points: Vec<[f64; 3]> =
        [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [2.0, 2.0], [5.0, 2.0]].into_iter().map(|[x, y]| [x, y, 0.0]).collect();
    let from = |place| spec(ImportOptions { free_from: Some(place), ..ImportOptions::default() }, 1.0);
    let Imported { terrain, notes, .. } = map(&from([1.5, 1.5, 0.5]), &points, Sensors::None, Vec::new()).unwrap();
    assert_eq!(mapgen::free_cells(&terrain), 5);
    assert_eq!(notes[3].text, "8 free cells filled that are not connected with it");
    let refused = map(&from([2.5, 1.5, 0.5]), &points, Sensors::None, Vec::new()).unwrap_err().to_string();
    assert_eq!(refused, "free_from = 2.5,1.5,0.5 lies in wall, expected a place in a free cell");
    let refused = map(&from([9.5, 1.5, 0.5]), &points, Sensors::None, Vec::new()).unwrap_err().to_string();
    assert!(refused.contains("lies outside the map"), "{refused}");
}

#[test]
fn ways_from_the_sensor_are_free() {
    // A sensor in a corridor of two walls, of which it sees one and the end.
    let points = [[4.5, 0.5, 0.5], [4.5, 1.5, 0.5], [2.5, 0.5, 0.5]];
    let sensor = ImportOptions { sensor: Some([0.5, 1.5, 0.5]), ..ImportOptions::default() };
    let Imported { terrain, notes, .. } = map(&spec(sensor.clone(), 1.0), &points, Sensors::None, Vec::new()).unwrap();
    let wall = "#######\n".repeat(4);
    assert_eq!(terrain.to_text(), format!("{wall}\n#######\n#....##\n##.#.##\n#######\n\n{wall}"));
    assert!(notes[1].text.starts_with("cells on 3 ways from the sensor to points; all others are unknown"));
    let unknown = ImportOptions { unknown: Some(Kind::Free), ..sensor.clone() };
    let each = Sensors::Each(vec![[0.5, 1.5, 0.5]; 3]);
    let free = map(&spec(ImportOptions { sensor: None, ..unknown.clone() }, 1.0), &points, each, Vec::new()).unwrap();
    assert_eq!(mapgen::free_cells(&free.terrain), 5 * 2 - 3);
    let far = ImportOptions { sensor: Some([0.5, 1.5, 0.5]), steps_max: Some(4), ..ImportOptions::default() };
    let error = map(&spec(far, 1.0), &points, Sensors::None, Vec::new()).unwrap_err().to_string();
    assert!(error.starts_with("the file takes more than 4 steps of work"), "{error}");
}

#[test]
fn a_cloud_without_an_extent_is_refused() {
    let refuse = |points: &[[f64; 3]]| {
        map(&spec(ImportOptions::default(), 0.1), points, Sensors::None, Vec::new()).unwrap_err().to_string()
    };
    assert_eq!(refuse(&[[0.0, f64::INFINITY, 0.0]]), "the file has no point with finite coordinates");
    assert_eq!(
        refuse(&[[0.0; 3], [0.0, 1e300, 0.0]]),
        "map size along y is 4294967295 cells, allowed are 1 to 1024, with cells of 0.1 m; it spans 0 m x 1.000e300 m x \
         0 m, with scale = 1: millimetres? --scale 0.001; else choose cells of 9.90e296 m or longer (--cell-m)"
    );
    assert_eq!(
        refuse(&[[0.0; 3], [0.04, 0.05, 0.0]]),
        "the file spans 0.04000 m x 0.05000 m x 0 m, with scale = 1: no more than a cell of 0.1 m; choose shorter cells \
         (--cell-m), or give the unit of the file (--scale)"
    );
}

/// A room of 6 x 4 x 3 m, with points every half metre on its walls, floor and ceiling.
fn room() -> Vec<[f64; 3]> {
    let all = (0..=12).flat_map(|x| (0..=8).flat_map(move |y| (0..=6).map(move |z| [x, y, z])));
    let is_wall = |&[x, y, z]: &[i32; 3]| x % 12 == 0 || y % 8 == 0 || z % 6 == 0;
    all.filter(is_wall).map(|place| place.map(|along| f64::from(along) / 2.0)).collect()
}

#[test]
fn stray_points_are_dropped_and_counted() {
    let of = |points: &[[f64; 3]]| map(&spec(ImportOptions::default(), 0.5), points, Sensors::None, Vec::new());
    let clean = of(&room()).unwrap();
    assert!(clean.notes.iter().all(|note| note.name != "stray"));
    for stray in [[40.0, 1.0, 1.0], [3.0, 1.0, -500.0], [1e30, 1e30, 1e30]] {
        let with_stray = of(&[room(), vec![stray]].concat()).unwrap();
        assert_eq!(with_stray.terrain, clean.terrain, "{stray:?}");
        let note = with_stray.notes.iter().find(|note| note.name == "stray").unwrap();
        assert!(note.text.starts_with("1 point(s) dropped that lie far from all others"), "{}", note.text);
    }
    // Another room is no stray, and neither is a point that is near.
    let moved = room().into_iter().map(|[x, y, z]| [x + 40.0, y, z]).collect();
    assert_eq!(of(&[room(), moved].concat()).unwrap().terrain.extent().size()[0], 95);
    assert_eq!(of(&[room(), vec![[9.0, 1.0, 1.0]]].concat()).unwrap().terrain.extent().size()[0], 21);
}

#[test]
fn rays_through_points_are_counted() {
    let seen_from = |sensor| {
        let options = ImportOptions { sensor: Some(sensor), ..ImportOptions::default() };
        let notes = map(&spec(options, 0.5), &room(), Sensors::None, Vec::new()).unwrap().notes;
        notes.into_iter().find(|note| note.name == "rays")
    };
    assert_eq!(seen_from([3.0, 2.0, 1.5]), None);
    let outside = seen_from([-4.0, 2.0, 1.5]).unwrap();
    assert!(outside.is_warning && outside.text.contains("% of the rays pass through cells with points"), "{outside:?}");
}

fn note<'a>(imported: &'a Imported, name: &str) -> &'a Note {
    imported.notes.iter().find(|note| note.name == name).unwrap_or_else(|| panic!("{name}: {:?}", imported.notes))
}

/// Two rooms of 6 x 4 x 3 m side by side, with an opening of 1 x 1 m, and the air of each.
fn two_rooms() -> (Vec<[f64; 3]>, [[f64; 3]; 2]) {
    let next = room().into_iter().map(|[x, y, z]| [x + 6.0, y, z]);
    let is_opening = |&[x, y, z]: &[f64; 3]| x == 6.0 && (1.5..2.5).contains(&y) && (1.0..2.0).contains(&z);
    let points = room().into_iter().chain(next).filter(|point| !is_opening(point)).collect();
    (points, [[3.25, 1.25, 1.25], [9.25, 1.25, 1.25]])
}

#[test]
fn each_cell_is_seen_from_the_nearest_station_in_sight() {
    let (points, [here, there]) = two_rooms();
    let with = |options| map(&spec(options, 0.5), &points, Sensors::None, Vec::new()).unwrap();
    let open = 2 * 11 * 7 * 5 + 2 * 2;
    let both = with(ImportOptions { stations: Some(vec![there, here]), ..ImportOptions::default() });
    let free = mapgen::free_cells(&both.terrain);
    assert!(free <= open && free * 100 > open * 90, "{free} of {open}");
    assert!(note(&both, "free space").text.contains("the nearest of 2 positions in sight"));
    assert!(both.notes.iter().all(|note| !note.is_warning), "{:?}", both.notes);
    // From one of them, the other room is out of sight but through the opening.
    let one = with(ImportOptions { stations: Some(vec![here]), ..ImportOptions::default() });
    assert!(note(&one, "unseen").is_warning, "{:?}", note(&one, "unseen").text);
    assert!(mapgen::free_cells(&one.terrain) < free);
    // As one sensor of all points it looks through walls.
    let wrong = with(ImportOptions { sensor: Some([-20.0, 1.25, 1.25]), ..ImportOptions::default() });
    assert!(note(&wrong, "rays").is_warning);
    // Without positions, free_from and the gap part the rooms.
    let from = ImportOptions { free_from: Some(here), ..ImportOptions::default() };
    assert_eq!(mapgen::free_cells(&with(from.clone()).terrain), open);
    let closed = with(ImportOptions { gap_cells: Some(2), ..from.clone() });
    assert_eq!(mapgen::free_cells(&closed.terrain), 11 * 7 * 5);
    assert!(note(&closed, "free_from").text.ends_with("other than by openings of at most 2 cell(s)"));
    let narrow = ImportOptions { gap_cells: Some(5), ..from };
    let refused = map(&spec(narrow, 0.5), &points, Sensors::None, Vec::new()).unwrap_err().to_string();
    assert!(refused.contains("lies where a cube of 6 cells has no room"), "{refused}");
}

#[test]
fn times_of_points_choose_the_position() {
    let (points, [here, there]) = two_rooms();
    let line = |time: f64, [x, y, z]: [f64; 3]| format!("{time} {x} {y} {z} 0 0 0 1\n");
    let trajectory = [line(0.0, here), line(1.0, here), line(2.0, there), line(3.0, there)].concat();
    let options = ImportOptions { trajectory: Some("poses.txt".into()), ..ImportOptions::default() };
    let spec = ImportSpec { trajectory: Some(trajectory.into_bytes()), ..spec(options, 0.5) };
    let cloud = |times_s| Cloud { points: points.clone().into(), times_s, ..Cloud::default() };
    let timed = super::map(&spec, cloud(points.iter().map(|point| if point[0] <= 6.0 { 0.5 } else { 2.5 }).collect()));
    let timed = timed.unwrap();
    let nearest = super::map(&spec, cloud(Vec::new())).unwrap();
    let [timed_free, nearest_free] = [&timed, &nearest].map(|imported| mapgen::free_cells(&imported.terrain));
    assert!(timed_free.abs_diff(nearest_free) < 40, "{timed_free} {nearest_free}");
    assert!(note(&timed, "trajectory").text.contains("taken by the times of the points"));
    assert!(timed.notes.iter().all(|note| !note.is_warning), "{:?}", timed.notes);
    // The wrong way round, the rays go through the wall between the rooms.
    let swapped = points.iter().map(|point| if point[0] <= 6.0 { 2.5 } else { 0.5 }).collect();
    assert!(note(&super::map(&spec, cloud(swapped)).unwrap(), "rays").is_warning);
    let missing = ImportSpec { trajectory: None, ..spec };
    assert!(super::map(&missing, cloud(Vec::new())).err().unwrap().to_string().contains("it has no position"));
}

#[test]
fn a_box_is_cut_out_of_a_cloud() {
    let crop = |corners, sensor| {
        let options = ImportOptions { crop: Some(corners), sensor, ..ImportOptions::default() };
        map(&spec(options, 0.5), &room(), Sensors::None, Vec::new())
    };
    let whole = map(&spec(ImportOptions::default(), 0.5), &room(), Sensors::None, Vec::new()).unwrap();
    let part = crop([-9.0, -9.0, -9.0, 3.0, 9.0, 9.0], None).unwrap();
    assert_eq!(part.terrain.extent().size(), [8, 11, 9]);
    for (cell, here) in part.terrain.iter().filter(|(cell, _)| cell.x < 7) {
        assert_eq!(whole.terrain.get(cell), Some(here), "{cell:?}");
    }
    assert_eq!(part.origin_m, whole.origin_m);
    let dropped = room().iter().filter(|point| point[0] >= 3.0).count();
    assert_eq!(note(&part, "crop").text, format!("{dropped} points outside the box dropped"));
    // The box holds no point, but rays.
    let air = [1.0, 1.0, 1.0, 5.0, 3.0, 3.5];
    assert_eq!(
        crop([1.0, 1.0, 1.0, 5.0, 3.0, 2.0], None).unwrap_err().to_string(),
        "the file has no point inside the box of crop"
    );
    let seen = crop(air, Some([3.0, 2.0, 1.5])).unwrap();
    assert_eq!(seen.terrain.extent().size(), [10, 6, 7]);
    assert!(mapgen::free_cells(&seen.terrain) > 8 * 4 * 3, "{}", seen.terrain.to_text());
}

#[test]
fn few_points_and_small_groups_are_dropped() {
    let dust: Vec<[f64; 3]> = [[3.0, 2.0, 1.0], [3.5, 2.5, 1.5], [4.5, 1.0, 1.0]].into();
    // Several points at 0 0 0 would be rays without return.
    let moved = |points: Vec<[f64; 3]>| points.into_iter().map(|point| point.map(|along| along + 1.0));
    let room: Vec<[f64; 3]> = moved(room()).collect();
    let all = [room.clone(), room.clone(), moved(dust).collect()].concat();
    let with = |outliers, voxel_min_points| {
        let options = ImportOptions { outliers, voxel_min_points, ..ImportOptions::default() };
        map(&spec(options, 0.5), &all, Sensors::None, Vec::new()).unwrap()
    };
    let clean = map(&spec(ImportOptions::default(), 0.5), &room, Sensors::None, Vec::new()).unwrap();
    let free = mapgen::free_cells(&clean.terrain);
    assert_eq!(mapgen::free_cells(&with(None, None).terrain), free - 3);
    let lone = with(Some(1), None);
    assert_eq!(mapgen::free_cells(&lone.terrain), free - 2);
    assert_eq!(note(&lone, "outliers").text, "1 points in 1 group(s) of at most 1 cells dropped");
    let pair = with(Some(2), None);
    assert_eq!(pair.terrain, clean.terrain);
    assert_eq!(note(&pair, "outliers").text, "3 points in 2 group(s) of at most 2 cells dropped");
    let sparse = with(None, Some(2));
    assert_eq!(sparse.terrain, clean.terrain);
    assert_eq!(note(&sparse, "few points").text, "3 points in cells with less than 2 dropped");
}
