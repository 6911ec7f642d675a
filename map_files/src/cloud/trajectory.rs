//! Positions of a sensor over time, in the format of TUM: lines of `timestamp tx ty tz qx qy qz
//! qw`, and comments that begin with `#`.
//!
//! Positions are those of the sensor, in the coordinates of the cloud; how it was turned is not
//! needed. Between two times the sensor moves in a straight line.

use std::path::Path;

use super::super::bytes::{Bytes, parse_float, shown};
use super::super::{FormatError, Note};
use super::Sensors;

/// Numbers of a line: with the turn, or without.
const NUMBERS: [usize; 2] = [8, 4];

/// Numbers of a line of KITTI, whose poses have no time.
const KITTI: usize = 12;

/// Share of the points whose time must be one of the trajectory for times to count.
const MATCHED: f64 = 0.5;

/// Time before the first position and after the last one for which these hold, seconds.
const BESIDE_S: f64 = 0.1;

/// Where a sensor was, in the order of time.
pub(super) struct Trajectory {
    /// Seconds, and the position.
    places: Vec<(f64, [f64; 3])>,
}

impl Trajectory {
    /// The trajectory of a file.
    ///
    /// # Errors
    /// If a line is none of a trajectory, or there is none.
    pub(super) fn read(file: &Path, bytes: &[u8]) -> Result<Self, FormatError> {
        let refuse = |reason: String| FormatError::Entry {
            place: format!("trajectory {:?}", file.display().to_string()),
            reason,
        };
        let mut text = Bytes::new(bytes);
        let mut places = Vec::new();
        while let Some((line, content)) = text.line() {
            let content = content.trim_ascii();
            if content.is_empty() || content.starts_with(b"#") {
                continue;
            }
            let is_between = |byte: &u8| byte.is_ascii_whitespace() || *byte == b',';
            let words = content.split(is_between).filter(|word| !word.is_empty());
            let numbers: Option<Vec<f64>> = words.map(parse_float).collect();
            match numbers {
                Some(numbers) if NUMBERS.contains(&numbers.len()) && numbers[..4].iter().all(|one| one.is_finite()) => {
                    places.push((numbers[0], [numbers[1], numbers[2], numbers[3]]));
                }
                // The names of columns.
                None if places.is_empty() => {}
                Some(numbers) if numbers.len() == KITTI => {
                    let reason = "12 numbers, as poses of KITTI have, which have no time; expected timestamp tx ty tz qx qy \
                                  qz qw (evo_traj kitti --save_as_tum)";
                    return Err(refuse(format!("line {line}: {reason}")));
                }
                _ => {
                    let reason = format!("line {line}: {} is not timestamp tx ty tz qx qy qz qw", shown(content));
                    return Err(refuse(reason));
                }
            }
        }
        if places.is_empty() {
            return Err(refuse("it has no position, expected lines of timestamp tx ty tz qx qy qz qw".to_owned()));
        }
        places.sort_by(|one, other| one.0.total_cmp(&other.0));
        Ok(Self { places })
    }

    /// The sensors of points that were seen at these times, or at times that are not known.
    pub(super) fn sensors(&self, times_s: &[f64]) -> (Sensors, Note) {
        let count = self.places.len();
        let (first, last) = (self.places[0].0, self.places[count - 1].0);
        let anywhere = || Sensors::any_of(self.places.iter().map(|&(_, place)| place).collect());
        if times_s.is_empty() {
            let text =
                format!("{count} positions; the points have no times, so each counts as seen from the nearest one");
            return (anywhere(), Note::new("trajectory", text));
        }
        let is_within = |time: &f64| (first - BESIDE_S..=last + BESIDE_S).contains(time);
        let within = times_s.iter().filter(|time| is_within(time)).count();
        if (within as f64) < MATCHED * times_s.len() as f64 {
            let (low, high) = times_s
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &time| (low.min(time), high.max(time)));
            let text = format!(
                "{count} positions from {first} s to {last} s, the points are from {low} s to {high} s: as these do not fit, \
                 each counts as seen from the nearest one in sight"
            );
            return (anywhere(), Note::warning("trajectory", text));
        }
        let unknown = [f64::NAN; 3];
        let positions = times_s.iter().map(|time| if is_within(time) { self.at(*time) } else { unknown }).collect();
        let without = times_s.len() - within;
        let text =
            format!("{count} positions, taken by the times of the points, {without} of which are outside its times");
        (Sensors::Each(positions), Note::new("trajectory", text))
    }

    /// The position at a time.
    fn at(&self, time_s: f64) -> [f64; 3] {
        let next = self.places.partition_point(|&(time, _)| time <= time_s);
        let Some(&(before_s, before)) = next.checked_sub(1).and_then(|last| self.places.get(last)) else {
            return self.places[0].1;
        };
        let Some(&(after_s, after)) = self.places.get(next) else { return before };
        let share = (time_s - before_s) / (after_s - before_s);
        [0, 1, 2].map(|axis| before[axis] + share * (after[axis] - before[axis]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Trajectory, String> {
        Trajectory::read(Path::new("poses.txt"), text.as_bytes()).map_err(|error| error.to_string())
    }

    #[test]
    fn positions_follow_the_times_of_points() {
        let text = "# timestamp tx ty tz qx qy qz qw\n12.0 4 0 1 0 0 0 1\r\n10.0 0 0 1 0 0 0 1\n";
        let trajectory = read(text).unwrap();
        let (sensors, note) = trajectory.sensors(&[10.0, 11.0, 12.05, 9.0]);
        let Sensors::Each(places) = sensors else { panic!("{note:?}") };
        assert_eq!(places[..3], [[0.0, 0.0, 1.0], [2.0, 0.0, 1.0], [4.0, 0.0, 1.0]]);
        assert!(places[3][0].is_nan());
        assert_eq!(note.text, "2 positions, taken by the times of the points, 1 of which are outside its times");
        assert!(matches!(trajectory.sensors(&[]).0, Sensors::AnyOf(places) if places.len() == 2));
        // Times since the start of the scan are no times of the trajectory.
        let (sensors, note) = trajectory.sensors(&[0.0, 0.1]);
        assert!(matches!(sensors, Sensors::AnyOf(_)) && note.is_warning, "{note:?}");
    }

    #[test]
    fn other_files_are_refused_with_the_line() {
        let kitti = read("1 0 0 1 0 1 0 2 0 0 1 3\n").err().unwrap();
        assert!(kitti.starts_with("trajectory \"poses.txt\": line 1: 12 numbers, as poses of KITTI"), "{kitti}");
        let short = read("0 1 2 3 0 0 0 1\n1 2 3\n").err().unwrap();
        assert_eq!(short, "trajectory \"poses.txt\": line 2: \"1 2 3\" is not timestamp tx ty tz qx qy qz qw");
        assert!(read("# nothing\n").err().unwrap().contains("it has no position"));
        assert!(read("time,x,y,z\n1,2,3,4\n").is_ok());
    }
}
