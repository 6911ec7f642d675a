//! Layers of maps: one cell by cell, a few side by side on a terminal, and many as a picture.

use std::path::Path;

use voxels::{Cell, Grid, Terrain, is_wall_at};

use super::MapCliError;

/// Layers of an overview by default.
pub(super) const SHOWN: u32 = 3;

/// Columns of text if there is no terminal that has a number of them.
pub(super) const COLUMNS: usize = 80;

/// Least columns for each layer of an overview, two of them free: its name has up to six
/// characters.
const LAYER_COLUMNS_MIN: u32 = 10;

/// Most layers of a picture.
const PICTURE_LAYERS: u32 = 16;

/// Least pixels along the longer side of a layer: cells of small maps are several pixels wide.
const PICTURE_SIDE_MIN: u32 = 200;

/// Pixels between two layers.
const PICTURE_GAP: u32 = 4;

/// Brightness of wall, of free space and of what is between layers.
const WALL: u8 = 40;
const FREE: u8 = 235;
const GAP: u8 = 128;

/// Names of the axes, by index.
const AXES: [char; 3] = ['x', 'y', 'z'];

/// One layer of cells: those whose coordinate along `axis` (0 is x, 2 is z) is `at`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Slice {
    axis: usize,
    at: u32,
}

/// A layer as it is written on a command line.
pub(super) fn parse(text: &str) -> Result<Slice, String> {
    let parse = || {
        let (axis, at) = text.split_once('=')?;
        let axis = AXES.into_iter().position(|known| axis == known.to_string())?;
        Some(Slice { axis, at: at.parse().ok()? })
    };
    parse().ok_or_else(|| "a slice is x=K, y=K or z=K with the coordinate K of a layer of cells".to_owned())
}

impl Slice {
    /// Its axis and the share of a map's length that lies before it.
    pub(super) fn share(self, terrain: &Grid<Terrain>, file: &Path) -> Result<(char, f64), MapCliError> {
        let Self { axis, at } = self;
        let cells = terrain.extent().size()[axis];
        if !(1..cells).contains(&at) {
            return Err(MapCliError::Cut { file: file.to_path_buf(), axis: AXES[axis], at, last: cells - 1 });
        }
        Ok((AXES[axis], f64::from(at) / f64::from(cells)))
    }

    /// The layer as text: the higher of the two remaining axes grows upwards, the other one to the
    /// right.
    pub(super) fn draw(self, terrain: &Grid<Terrain>, file: &Path) -> Result<String, MapCliError> {
        let size = terrain.extent().size();
        let Self { axis, at } = self;
        if at >= size[axis] {
            let last = size[axis] - 1;
            return Err(MapCliError::Slice { file: file.to_path_buf(), axis: AXES[axis], at, last });
        }
        let (right, up) = [(1, 2), (0, 2), (0, 1)][axis];
        let mut text = format!("{} = {at}, {} to the right, {} upwards\n", AXES[axis], AXES[right], AXES[up]);
        for row in (0..size[up]).rev() {
            for column in 0..size[right] {
                let mut cell = [0; 3];
                (cell[axis], cell[right], cell[up]) = (at as i32, column as i32, row as i32);
                let [x, y, z] = cell;
                text.push(if is_wall_at(terrain, Cell::new(x, y, z)) { '#' } else { '.' });
            }
            text.push('\n');
        }
        Ok(text)
    }
}

/// The coordinates of `count` layers in the middles of equal parts of `size`, or of all layers if
/// there are no more.
fn spread(count: u32, size: u32) -> Vec<u32> {
    if count >= size {
        return (0..size).collect();
    }
    (0..count).map(|number| (2 * number + 1) * size / (2 * count)).collect()
}

/// Layers along z side by side, in at most `columns` columns: a character is a block of cells,
/// twice as high as wide.
pub(super) fn overview(terrain: &Grid<Terrain>, count: u32, columns: usize) -> String {
    let [size_x, size_y, size_z] = terrain.extent().size();
    let columns = u32::try_from(columns).unwrap_or(u32::MAX).max(LAYER_COLUMNS_MIN);
    let layers = spread(count.clamp(1, columns / LAYER_COLUMNS_MIN), size_z);
    let wide = size_x.div_ceil(columns / layers.len() as u32 - 2);
    let high = if wide == 1 { 1 } else { 2 * wide };
    let (across, names) = (size_x.div_ceil(wide), layers.iter().map(|z| format!("z={z}")));
    let width = names.clone().map(|name| name.len()).max().unwrap_or_default().max(across as usize);
    let mut text = format!(
        "layers, x to the right, y upwards; # wall, . free, + mostly wall, : mostly free; a character is {wide}x{high} cells\n"
    );
    let mut add = |parts: Vec<String>| {
        let line: Vec<String> = parts.into_iter().map(|part| format!("{part:<width$}")).collect();
        text.push_str(line.join("  ").trim_end());
        text.push('\n');
    };
    add(names.collect());
    for row in (0..size_y.div_ceil(high)).rev() {
        let block = |z: u32, column: u32| {
            let cells = || {
                let ys = row * high..((row + 1) * high).min(size_y);
                ys.flat_map(move |y| (column * wide..((column + 1) * wide).min(size_x)).map(move |x| (x, y)))
            };
            let is_wall = |&(x, y): &(u32, u32)| is_wall_at(terrain, Cell::new(x as i32, y as i32, z as i32));
            match (cells().filter(is_wall).count(), cells().count()) {
                (0, _) => '.',
                (walls, all) if walls == all => '#',
                (walls, all) if 2 * walls > all => '+',
                _ => ':',
            }
        };
        add(layers.iter().map(|&z| (0..across).map(|column| block(z, column)).collect()).collect());
    }
    text
}

/// A PNG picture of layers along z, the lowest first, row by row; x to the right, y upwards.
pub(super) fn png(terrain: &Grid<Terrain>) -> Result<Vec<u8>, png::EncodingError> {
    let [size_x, size_y, size_z] = terrain.extent().size();
    let layers = spread(PICTURE_LAYERS, size_z);
    let across = (1..).find(|across| across * across >= layers.len() as u32).unwrap_or(1);
    let down = (layers.len() as u32).div_ceil(across);
    let scale = PICTURE_SIDE_MIN.div_ceil(size_x.max(size_y));
    let pitch = [size_x, size_y].map(|cells| cells * scale + PICTURE_GAP);
    let [width, height] = [across * pitch[0] + PICTURE_GAP, down * pitch[1] + PICTURE_GAP];
    let mut pixels = vec![GAP; width as usize * height as usize];
    for (number, &z) in layers.iter().enumerate() {
        let number = number as u32;
        let [left, top] = [number % across * pitch[0], number / across * pitch[1]].map(|pixel| pixel + PICTURE_GAP);
        for row in 0..size_y * scale {
            for column in 0..size_x * scale {
                let cell = Cell::new((column / scale) as i32, (size_y - 1 - row / scale) as i32, z as i32);
                let at = (top + row) as usize * width as usize + (left + column) as usize;
                pixels[at] = if is_wall_at(terrain, cell) { WALL } else { FREE };
            }
        }
    }
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.write_header()?.write_image_data(&pixels)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use voxels::Extent;

    #[test]
    fn layers_are_spread_over_the_map() {
        assert_eq!(spread(3, 30), [5, 15, 25]);
        assert_eq!(spread(1, 3), [1]);
        assert_eq!(spread(9, 2), [0, 1]);
    }

    #[test]
    fn small_maps_are_drawn_cell_by_cell() {
        let terrain = Grid::from_text("##\n##\n\n#.\n##\n\n##\n##\n").unwrap();
        let text = overview(&terrain, 3, 80);
        let drawn = "z=0  z=1  z=2\n##   #.   ##\n##   ##   ##\n";
        assert!(text.ends_with(&format!("cells\n{drawn}")), "{text}");
        assert!(text.contains("a character is 1x1 cells"));
    }

    #[test]
    fn large_maps_are_drawn_in_blocks() {
        let mut terrain = Grid::new(Extent::new([100, 80, 9], 1.0).unwrap(), Terrain::Wall);
        for y in 0..40 {
            for x in 0..99 {
                terrain.set(Cell::new(x, y, 4), Terrain::Free);
            }
        }
        let text = overview(&terrain, 1, 52);
        assert!(text.contains("a character is 2x4 cells"), "{text}");
        let rows: Vec<&str> = text.lines().skip(2).collect();
        assert_eq!(rows.len(), 20);
        assert_eq!(rows[0], "#".repeat(50));
        assert_eq!(rows[19], format!("{}:", ".".repeat(49)));
        assert!(overview(&terrain, 1000, 40).lines().skip(1).all(|line| line.len() <= 40));
    }

    #[test]
    fn a_picture_has_a_pixel_or_more_for_each_cell() {
        let terrain = Grid::from_text("##\n.#\n\n##\n##\n").unwrap();
        let bytes = png(&terrain).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        assert_eq!((info.width, info.height), (2 * 204 + 4, 204 + 4));
        let at = |x: usize, y: usize| pixels[y * info.width as usize + x];
        assert_eq!([at(0, 0), at(4, 4), at(4, 203), at(104, 203), at(208, 203)], [GAP, WALL, FREE, WALL, WALL]);
    }
}
