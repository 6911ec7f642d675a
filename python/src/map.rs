//! Maps: generated, read, written, and as NumPy arrays.

use std::path::PathBuf;

use map_files::{ImportSpec, MapWriter};
use mapgen::ImportOptions;
use numpy::{PyArray1, PyArray3, PyArrayMethods, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::exceptions::PyOSError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use sim_server::map_file;
use voxels::{Extent, Grid, Terrain};

use crate::error::bad_input;

/// A true map.
#[pyclass(name = "NativeMap", module = "maes._maes", frozen)]
pub(crate) struct PyMap {
    pub(crate) terrain: Grid<Terrain>,
}

#[pymethods]
impl PyMap {
    /// Reads a map file of any known format; closes its shell and fills pockets unless `as_is`.
    #[staticmethod]
    #[pyo3(signature = (file, cell_m=None, as_is=false))]
    fn load(py: Python<'_>, file: PathBuf, cell_m: Option<f64>, as_is: bool) -> PyResult<Self> {
        py.detach(|| {
            let name = file.display().to_string();
            let spec = map_file::load(&file, &ImportOptions::default())
                .map_err(|error| PyOSError::new_err(format!("{name}: {error}")))?;
            let terrain = ImportSpec { cell_m, ..spec }.read().map_err(bad_input)?.terrain;
            let terrain = if as_is { terrain } else { mapgen::repair(&name, terrain, 0).map_err(bad_input)?.terrain };
            Ok(Self { terrain })
        })
    }

    /// A map of an array of shape (x, y, z), true for wall.
    #[staticmethod]
    #[pyo3(signature = (walls, cell_m, as_is))]
    fn from_walls(py: Python<'_>, walls: PyReadonlyArray3<'_, bool>, cell_m: f64, as_is: bool) -> PyResult<Self> {
        let cells = |axis: usize| u32::try_from(walls.shape()[axis]).unwrap_or(u32::MAX);
        let extent = Extent::new([cells(0), cells(1), cells(2)], cell_m).map_err(bad_input)?;
        let walls = walls.as_array();
        let terrain = |is_wall: &bool| if *is_wall { Terrain::Wall } else { Terrain::Free };
        // Transposed, the first axis of the array is the one that runs fastest.
        let values: Vec<Terrain> = walls.t().iter().map(terrain).collect();
        let terrain = Grid::from_vec(extent, values).map_err(bad_input)?;
        let repair = || mapgen::repair("the array", terrain.clone(), 0).map_err(bad_input);
        let terrain = if as_is { terrain } else { py.detach(repair)?.terrain };
        Ok(Self { terrain })
    }

    /// The bytes of a map file with this ending, such as "m3dm", "obj" or "stl".
    fn encode<'py>(&self, py: Python<'py>, ending: &str) -> PyResult<Bound<'py, PyBytes>> {
        let writer = MapWriter::of(&PathBuf::from(format!("map.{ending}"))).map_err(bad_input)?;
        let bytes = py.detach(|| writer.write(&self.terrain)).map_err(bad_input)?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// Whether each cell is wall: bool, shape (x, y, z).
    fn walls<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<bool>>> {
        let [x, y, z] = self.terrain.extent().size().map(|cells| cells as usize);
        let walls: Vec<bool> = self.terrain.as_slice().iter().map(|&cell| cell == Terrain::Wall).collect();
        PyArray1::from_vec(py, walls).reshape_with_order([x, y, z], numpy::npyffi::NPY_ORDER::NPY_FORTRANORDER)
    }

    /// Cells along x, y and z.
    #[getter]
    fn size(&self) -> [u32; 3] {
        self.terrain.extent().size()
    }

    /// Edge of a cell, metres.
    #[getter]
    fn cell_m(&self) -> f64 {
        self.terrain.extent().cell_m()
    }

    /// Number of free cells.
    #[getter]
    fn free_cells(&self) -> u64 {
        mapgen::free_cells(&self.terrain)
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.terrain == other.terrain
    }
}
