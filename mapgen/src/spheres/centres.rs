//! The centres of new spheres.
//!
//! MAES3D draws a radius and a centre until the centre is a wall cell, which never ends once none
//! is left. Here the same loop runs for a bounded number of draws; after that the remaining wall
//! cells are listed and one is drawn from the list, with the probability that the endless loop
//! would have given it. So the bound decides only how fast a map is made. With the random numbers
//! of MAES3D's engine ([`SphereRandom`]) the loop is the reference's, draw by draw, up to the
//! bound.

use std::ops::RangeInclusive;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use voxels::{Cell, Extent, Grid, Terrain};

use super::unity::Unity;
use super::{MapError, Sphere, SphereRandom, SpheresSpec};

/// Draws without success before the remaining wall cells are listed. At this bound the list of even
/// the largest map is short (wall cells are rarer than about one in ten thousand), and all draws
/// together take a few milliseconds.
const REJECTIONS_MAX: u32 = 1 << 16;

/// The source of new spheres for one map.
pub(super) struct Centres {
    extent: Extent,
    radii: RangeInclusive<u32>,
    rng: ChaCha8Rng,
    /// The source of the loop, if it is not `rng`.
    unity: Option<Unity>,
    /// Once drawing has failed: the wall cells that can be a centre of at least the smallest
    /// sphere.
    left: Option<Vec<Cell>>,
}

impl Centres {
    /// Spheres of the radii of a spec, which must all fit into the extent.
    ///
    /// # Errors
    /// If the generator of MAES3D's engine cannot take the seed.
    pub(super) fn new(extent: Extent, spec: &SpheresSpec, seed: u64) -> Result<Self, MapError> {
        let unity = match spec.random {
            SphereRandom::Chacha => None,
            SphereRandom::Unity => Some(Unity::of_seed(seed)?),
            SphereRandom::UnityNamed => Some(Unity::of_named_map(seed)?),
        };
        let rng = voxels::random_streams::stream(seed, 0, "map.spheres");
        Ok(Self { extent, radii: spec.radius_min..=spec.radius_max, rng, unity, left: None })
    }

    /// A sphere whose centre is a wall cell, or `None` if no radius has such a centre left.
    pub(super) fn draw(&mut self, terrain: &Grid<Terrain>) -> Option<Sphere> {
        if self.left.is_none() {
            let by_rejection = (0..REJECTIONS_MAX).find_map(|_| self.try_draw(terrain));
            if by_rejection.is_some() {
                return by_rejection;
            }
        }
        self.draw_from_list(terrain)
    }

    fn try_draw(&mut self, terrain: &Grid<Terrain>) -> Option<Sphere> {
        let (radius, centre) = match &mut self.unity {
            None => {
                let radius = self.rng.random_range(self.radii.clone());
                let [x, y, z] = legal_centres(self.extent, radius).map(|axis| self.rng.random_range(axis));
                (radius, Cell::new(x, y, z))
            }
            Some(unity) => {
                let radius = unity.integer(self.radii.start().cast_signed()..=self.radii.end().cast_signed());
                let radius = radius.cast_unsigned();
                // The reference's y is up, and drawn before its z.
                let [x, y, z] = legal_centres(self.extent, radius);
                let [x, z, y] = [x, z, y].map(|axis| unity.integer(axis));
                (radius, Cell::new(x, y, z))
            }
        };
        (terrain.get(centre) == Some(&Terrain::Wall)).then_some(Sphere { centre, radius })
    }

    fn draw_from_list(&mut self, terrain: &Grid<Terrain>) -> Option<Sphere> {
        let extent = self.extent;
        let smallest = *self.radii.start();
        let left = self.left.get_or_insert_with(|| wall_cells(terrain, legal_centres(extent, smallest)));
        left.retain(|&cell| terrain.get(cell) == Some(&Terrain::Wall));

        // The loop meets radius r in a given legal cell with a probability proportional to 1 /
        // (number of legal cells of r). `up_to[i]` is the sum of these over the smallest i + 1
        // radii: the weight of a cell in which just those fit.
        let up_to: Vec<f64> = self
            .radii
            .clone()
            .map(|radius| legal_centres(extent, radius).map(|axis| axis.count() as f64).iter().product::<f64>().recip())
            .scan(0.0, |sum, weight| {
                *sum += weight;
                Some(*sum)
            })
            .collect();
        let largest_fitting = |cell: Cell| {
            let room = [cell.x, cell.y, cell.z].into_iter().zip(extent.size());
            let radius = room.map(|(at, size)| (at - 1).min(size as i32 - 3 - at)).fold(i32::MAX, i32::min);
            (radius as usize - smallest as usize).min(up_to.len() - 1)
        };

        let total: f64 = left.iter().map(|&cell| up_to[largest_fitting(cell)]).sum();
        let mut mark = self.rng.random::<f64>() * total;
        let mut chosen = *left.last()?;
        for &cell in left.iter() {
            let weight = up_to[largest_fitting(cell)];
            if mark < weight {
                chosen = cell;
                break;
            }
            mark -= weight;
        }
        let fitting = &up_to[..=largest_fitting(chosen)];
        let mark = self.rng.random::<f64>() * fitting[fitting.len() - 1];
        let above_smallest = fitting.partition_point(|&sum| sum <= mark).min(fitting.len() - 1);
        Some(Sphere { centre: chosen, radius: smallest + above_smallest as u32 })
    }
}

/// Per axis, the coordinates at which a sphere of this radius may be centred: r + 1 to size - 3 - r
/// (docs/reference-model.md, "Map generators: Random Connected Spheres").
fn legal_centres(extent: Extent, radius: u32) -> [RangeInclusive<i32>; 3] {
    extent.size().map(|size| radius as i32 + 1..=size as i32 - 3 - radius as i32)
}

fn wall_cells(terrain: &Grid<Terrain>, [x, y, z]: [RangeInclusive<i32>; 3]) -> Vec<Cell> {
    let mut cells = Vec::new();
    for z in z {
        for y in y.clone() {
            let row = x.clone().map(|x| Cell::new(x, y, z));
            cells.extend(row.filter(|&cell| terrain.get(cell) == Some(&Terrain::Wall)));
        }
    }
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    fn centres(extent: Extent, radii: RangeInclusive<u32>, seed: u64) -> Centres {
        let spec = SpheresSpec { radius_min: *radii.start(), radius_max: *radii.end(), ..SpheresSpec::default() };
        Centres::new(extent, &spec, seed).unwrap()
    }

    #[test]
    fn no_wall_left_is_none() {
        let extent = Extent::new([9; 3], 1.0).unwrap();
        let mut terrain = Grid::new(extent, Terrain::Free);
        // Solid, and yet no legal centre of radius 1, which are 2 to 5.
        terrain.set(Cell::new(1, 4, 4), Terrain::Wall);
        assert_eq!(centres(extent, 1..=2, 1).draw(&terrain), None);
    }

    #[test]
    fn a_single_remaining_cell_is_found() {
        let extent = Extent::new([100; 3], 1.0).unwrap();
        let mut terrain = Grid::new(extent, Terrain::Free);
        let corner = Cell::new(4, 4, 94);
        terrain.set(corner, Terrain::Wall);
        let mut last = centres(extent, 3..=8, 1);
        assert_eq!(last.draw(&terrain), Some(Sphere { centre: corner, radius: 3 }));
        terrain.set(corner, Terrain::Free);
        assert_eq!(last.draw(&terrain), None);
    }

    /// Both ways of drawing give every (centre, radius) the same probability.
    #[test]
    fn the_list_has_the_distribution_of_the_loop() {
        const DRAWS: u32 = 40_000;
        let extent = Extent::new([9, 9, 9], 1.0).unwrap();
        let mut terrain = Grid::new(extent, Terrain::Free);
        // One cell for radius 1 only, two for radii 1 and 2 (legal: 3 to 4).
        let walls = [Cell::new(2, 4, 4), Cell::new(3, 4, 4), Cell::new(4, 3, 3)];
        for wall in walls {
            terrain.set(wall, Terrain::Wall);
        }
        let count = |mut draw: Box<dyn FnMut() -> Sphere>| {
            let mut counts = std::collections::BTreeMap::new();
            for _ in 0..DRAWS {
                let sphere = draw();
                *counts.entry((sphere.centre, sphere.radius)).or_insert(0u32) += 1;
            }
            counts
        };
        let (for_loop, for_list) = (terrain.clone(), terrain);
        let mut first = centres(extent, 1..=2, 1);
        let by_loop = count(Box::new(move || first.draw(&for_loop).unwrap()));
        let mut second = centres(extent, 1..=2, 2);
        let by_list = count(Box::new(move || second.draw_from_list(&for_list).unwrap()));

        // 64 legal cells of radius 1 and 8 of radius 2: the five pairs weigh 1, 1, 1, 8 and 8.
        let pairs = [(walls[0], 1), (walls[1], 1), (walls[2], 1), (walls[1], 2), (walls[2], 2)];
        for (pair, weight) in pairs.into_iter().zip([1.0, 1.0, 1.0, 8.0, 8.0]) {
            let expected = f64::from(DRAWS) * weight / 19.0;
            for counts in [&by_loop, &by_list] {
                let got = f64::from(counts[&pair]);
                assert!((got - expected).abs() < 5.0 * expected.sqrt(), "{pair:?}: {got}, expected {expected}");
            }
        }
        assert_eq!(by_list.len(), 5);
    }
}
