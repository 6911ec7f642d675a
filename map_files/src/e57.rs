//! Survey scans of E57 (ASTM E2807): the points of all scans of a file, with the poses of these.
//!
//! A scan lies where its pose puts it, and its scanner in the origin of the scan; so the pose is
//! also from where its points were seen. A scan without a pose, or with one at 0 0 0 where no scan
//! of the file has another, may have been put together from several: from where it was seen is not
//! known. Points that are marked as invalid, or have only a direction, are dropped and counted.
//!
//! The crate `e57` (0.11) decodes; its author keeps it, and reads files of a dozen scanners. It
//! checks no sizes against the file, so points are bounded by bytes here, and it may not panic
//! further than here. Angles become coordinates by libm and not by the crate, so that a file is the
//! same map on every machine.

use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

use e57::{CartesianCoordinate, E57Reader, PointCloud, SphericalCoordinate};
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion};

use super::cloud::{self, Cloud, Sensors};
use super::work_budget::WorkBudget;
use super::{FormatError, ImportSpec, Imported, MapReader, Note};

/// Scans of a survey.
pub(super) const READER: MapReader = MapReader::new("survey scans", &["e57"], cloud::OPTIONS, read);

/// Most points for each byte of a file: fields of one value take no bytes.
const POINTS_PER_BYTE_MAX: u64 = 8;

/// Steps that a point takes.
const STEPS: usize = 4;

/// Most letters of a reason of the decoder.
const REASON_MAX: usize = 200;

/// A map of an E57 file.
///
/// # Errors
/// If the file is malformed, or its points do not fit into a map.
pub(super) fn read(spec: &ImportSpec) -> Result<Imported, FormatError> {
    let mut work = WorkBudget::new(spec);
    let decoded = catch_unwind(AssertUnwindSafe(|| scans(&spec.bytes, &mut work)));
    let scans = decoded.unwrap_or_else(|_| Err(damaged("its codes have no meaning")))?;
    let Scans { points, seen_from, count, with_pose, invalid } = scans;
    let mut notes = vec![Note::new(
        "e57",
        format!("{count} scan(s), {with_pose} with a pose, from which its points were seen; {} points", points.len()),
    )];
    if invalid > 0 {
        notes.push(Note::new(
            "invalid",
            format!("{invalid} points dropped that are marked as invalid: rays that met nothing"),
        ));
    }
    let sensors = if with_pose > 0 { Sensors::Each(seen_from) } else { Sensors::None };
    cloud::map_with(spec, Cloud { points: points.into(), sensors, notes, ..Cloud::default() }, work)
}

/// What is in a file.
#[derive(Default)]
struct Scans {
    points: Vec<[f64; 3]>,
    /// From where each point was seen; not finite if that is not known.
    seen_from: Vec<[f64; 3]>,
    count: usize,
    with_pose: usize,
    invalid: u64,
}

fn damaged(reason: impl std::fmt::Display) -> FormatError {
    let reason: String = reason.to_string().escape_debug().take(REASON_MAX).collect();
    FormatError::Entry { place: "E57".to_owned(), reason }
}

fn scans(bytes: &[u8], work: &mut WorkBudget) -> Result<Scans, FormatError> {
    let mut file = E57Reader::new(Cursor::new(bytes)).map_err(damaged)?;
    let clouds = file.pointclouds();
    let total = clouds.iter().fold(0u64, |total, cloud| total.saturating_add(cloud.records));
    if total > POINTS_PER_BYTE_MAX.saturating_mul(bytes.len() as u64) {
        let reason = format!("it says that it has {total} points, allowed are {POINTS_PER_BYTE_MAX} for each byte");
        return Err(damaged(reason));
    }
    let mut scans = Scans { count: clouds.len(), ..Scans::default() };
    let poses = clouds.iter().map(pose).collect::<Result<Vec<_>, _>>()?;
    let are_known = are_known(&poses);
    for (cloud, pose) in clouds.iter().zip(poses) {
        let is_known = pose.is_some() && are_known;
        scans.with_pose += usize::from(is_known);
        let pose = pose.unwrap_or_else(Isometry3::identity);
        let seen_from = if is_known { pose.translation.vector.into() } else { [f64::NAN; 3] };
        let mut points = file.pointcloud_simple(cloud).map_err(damaged)?;
        points.apply_pose(false);
        points.spherical_to_cartesian(false);
        for point in points {
            work.spend(STEPS)?;
            let point = point.map_err(damaged)?;
            let Some(place) = place(&point.cartesian, &point.spherical) else {
                scans.invalid += 1;
                continue;
            };
            scans.points.push((pose * place).into());
            scans.seen_from.push(seen_from);
        }
    }
    Ok(scans)
}

/// The pose of a scan, if it has one.
fn pose(cloud: &PointCloud) -> Result<Option<Isometry3<f64>>, FormatError> {
    let Some(transform) = &cloud.transform else { return Ok(None) };
    let e57::Transform { rotation, translation } = transform;
    let turn = Quaternion::new(rotation.w, rotation.x, rotation.y, rotation.z);
    let place = Translation3::new(translation.x, translation.y, translation.z);
    let is_finite = place.vector.iter().chain(turn.coords.iter()).all(|number| number.is_finite());
    if !is_finite || turn.norm_squared() == 0.0 {
        return Err(damaged("the pose of a scan is none"));
    }
    Ok(Some(Isometry3::from_parts(place, UnitQuaternion::from_quaternion(turn))))
}

/// Whether poses say from where points were seen: those of scans that were brought into one frame
/// lie all in its origin.
fn are_known(poses: &[Option<Isometry3<f64>>]) -> bool {
    poses.iter().flatten().any(|pose| pose.translation.vector.norm_squared() > 0.0)
}

/// Where a point lies in its scan; `None` if it met nothing.
fn place(cartesian: &CartesianCoordinate, spherical: &SphericalCoordinate) -> Option<Point3<f64>> {
    match (cartesian, spherical) {
        (&CartesianCoordinate::Valid { x, y, z }, _) => Some(Point3::new(x, y, z)),
        (_, &SphericalCoordinate::Valid { range, azimuth, elevation }) => {
            let (sine, cosine) = libm::sincos(elevation);
            let (across, along) = libm::sincos(azimuth);
            Some(Point3::new(range * cosine * along, range * cosine * across, range * sine))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A room of 6 x 4 x 3 m of points every half metre, seen by two scanners, one of which is
    /// turned; each has points that are marked as invalid. Written by pye57 0.4.19.
    const ROOM: &[u8] = include_bytes!("../tests/files/room.e57");

    fn with(options: crate::ImportOptions) -> Imported {
        let spec = ImportSpec { options, cell_m: Some(0.5), ..ImportSpec::new("room.e57", ROOM.to_vec()) };
        spec.read().unwrap_or_else(|error| panic!("{error}"))
    }

    #[test]
    fn scans_lie_where_their_poses_put_them() {
        let imported = with(crate::ImportOptions::default());
        assert_eq!(imported.terrain.extent().size(), [15, 11, 9]);
        assert_eq!(imported.origin_m, Some([-0.5; 3]));
        let walls = imported.notes.iter().find(|note| note.name == "points").unwrap();
        assert!(walls.text.contains("in 434 cells, 0 dropped"), "{}", walls.text);
        assert!(imported.notes[0].text.starts_with("2 scan(s), 2 with a pose"), "{}", imported.notes[0].text);
        assert!(
            imported.notes[1].text.starts_with("4 points dropped that are marked as invalid"),
            "{:?}",
            imported.notes
        );
        assert!(imported.notes.iter().all(|note| !note.is_warning), "{:?}", imported.notes);
        let free = mapgen::free_cells(&imported.terrain);
        assert!((11 * 7 * 5 * 9 / 10..=11 * 7 * 5).contains(&free), "{free}");
        // All of it seen from another place.
        let wrong = with(crate::ImportOptions { sensor: Some([-9.0, 2.0, 2.0]), ..Default::default() });
        assert!(wrong.notes.iter().any(|note| note.name == "rays" && note.is_warning));
    }

    #[test]
    fn scans_in_one_frame_have_no_sensors() {
        let at = |x: f64| Some(Isometry3::translation(x, 0.0, 0.0));
        assert!(!are_known(&[]) && !are_known(&[None]));
        assert!(!are_known(&[at(0.0)]) && !are_known(&[at(0.0), None, at(0.0)]));
        assert!(are_known(&[at(2.0)]) && are_known(&[at(0.0), at(2.0)]));
    }

    #[test]
    fn angles_are_places() {
        let spherical = SphericalCoordinate::Valid { range: 2.0, azimuth: 0.0, elevation: std::f64::consts::FRAC_PI_6 };
        let found = place(&CartesianCoordinate::Invalid, &spherical).unwrap();
        assert!((found - Point3::new(3f64.sqrt(), 0.0, 1.0)).norm() < 1e-12, "{found}");
        let direction = CartesianCoordinate::Direction { x: 1.0, y: 0.0, z: 0.0 };
        assert_eq!(place(&direction, &SphericalCoordinate::Direction { azimuth: 0.0, elevation: 0.0 }), None);
    }

    #[test]
    fn malformed_files_are_refused_in_a_line() {
        for bytes in [&b""[..], b"ASTM-E57", &ROOM[..100], &ROOM[..ROOM.len() / 2]] {
            let error = read(&ImportSpec::new("a.e57", bytes.to_vec())).unwrap_err().to_string();
            assert!(error.starts_with("E57: ") && !error.contains('\n'), "{error}");
        }
        // Every byte matters to its checksum, or to nothing.
        let mut refused = 0;
        for at in (0..ROOM.len()).step_by(7) {
            let mut bytes = ROOM.to_vec();
            bytes[at] ^= 0x55;
            if let Err(error) = read(&ImportSpec::new("a.e57", bytes)) {
                refused += 1;
                assert!(!error.to_string().contains('\n'), "{error}");
            }
        }
        assert!(refused > 0);
    }
}
