//! Path searches of a controller in Python with a goal of its own: those of `agent_node::path`,
//! with an array as the goal, so that no Python code runs for each cell.
//!
//! A search is at once, takes no sim time, and leaves the pending one of `go_to_cell` alone.

use agent_node::bodies::{BodyModel, leg_s};
use agent_node::command::Motion;
use agent_node::controllers::Ctx;
use agent_node::navigation::NavigationStatus;
use agent_node::path::{EDGE_COST, Goal, Neighbours, Path, Search, distances};
use nalgebra::Point3;
use numpy::ndarray::ArrayView3;
use numpy::{
    AllowTypeChange, PyArray1, PyArray2, PyArrayLike2, PyArrayMethods, PyReadonlyArray3, PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use voxels::{Cell, Extent};

use crate::command::PyMotion;

/// The cheapest path to a goal.
#[pyclass(name = "Path", module = "maes", frozen)]
pub(crate) struct PyPath {
    cells: Vec<Cell>,
    length_m: f64,
    motion: Option<Motion>,
    time_s: f64,
}

#[pymethods]
impl PyPath {
    /// From the cell of the body to the goal, both included: int32, shape (N, 3).
    #[getter]
    fn cells<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i32>>> {
        let flat = self.cells.iter().flat_map(|cell| [cell.x, cell.y, cell.z]).collect();
        PyArray1::from_vec(py, flat).reshape([self.cells.len(), 3])
    }

    /// Length along the centres of the cells, metres: the cost that the search has minimised.
    #[getter]
    fn length_m(&self) -> f64 {
        self.length_m
    }

    /// The motion along the path, with as few straight legs as possible; `None` if it has but one
    /// cell, whose centre the body cannot reach.
    #[getter]
    fn motion(&self) -> Option<PyMotion> {
        self.motion.clone().map(PyMotion)
    }

    /// Estimate of the time of that motion from rest, seconds: `leg_s` of each leg, with the turn
    /// before it; bodies mostly take some per cent less. 0 without a motion.
    #[getter]
    fn time_s(&self) -> f64 {
        self.time_s
    }

    fn __repr__(&self) -> String {
        format!("Path({} cells, {:.2} m, {:.2} s)", self.cells.len(), self.length_m, self.time_s)
    }
}

/// The estimated time from rest along waypoints, seconds.
fn time_s(body: &BodyModel, from: Point3<f64>, yaw_rad: f64, waypoints: &[Point3<f64>]) -> f64 {
    let (mut here, mut heading_rad, mut total_s) = (from, yaw_rad, 0.0);
    for &next in waypoints {
        let leg = next - here;
        // A vertical leg needs no turn.
        let bearing_rad = if leg.x == 0.0 && leg.y == 0.0 { heading_rad } else { libm::atan2(leg.y, leg.x) };
        let turn_rad = libm::remainder(bearing_rad - heading_rad, std::f64::consts::TAU).abs();
        total_s += leg_s(body, leg.norm(), turn_rad);
        (here, heading_rad) = (next, bearing_rad);
    }
    total_s
}

/// 6 or 26 neighbours.
pub(crate) fn neighbours(count: u32) -> PyResult<Neighbours> {
    match count {
        6 => Ok(Neighbours::Six),
        26 => Ok(Neighbours::TwentySix),
        other => Err(PyValueError::new_err(format!("neighbours = {other}: expected 6 or 26"))),
    }
}

/// Cells as an array names them: by a mark for each cell of the map, or one by one.
pub(crate) enum Cells<'py> {
    Mask(PyReadonlyArray3<'py, bool>),
    List(Vec<Cell>),
}

impl<'py> Cells<'py> {
    /// # Errors
    /// If it is neither a mask with the shape of the map nor an array of its cells.
    pub(crate) fn new(name: &str, value: &Bound<'py, PyAny>, extent: Extent) -> PyResult<Self> {
        match value.extract() {
            Ok(array) => Ok(Self::Mask(mask(name, array, extent)?)),
            Err(_) => Ok(Self::List(list(name, value, extent)?)),
        }
    }
}

/// A mark for each cell of the map.
///
/// # Errors
/// If it has another shape.
pub(crate) fn mask<'py>(
    name: &str,
    array: PyReadonlyArray3<'py, bool>,
    extent: Extent,
) -> PyResult<PyReadonlyArray3<'py, bool>> {
    let size = extent.size();
    if array.shape().iter().zip(size).all(|(&along, cells)| along == cells as usize) {
        return Ok(array);
    }
    Err(PyValueError::new_err(format!("{name} has shape {:?}: expected that of the map, {size:?}", array.shape())))
}

/// The cells of an array of shape (N, 3), or of a sequence.
///
/// # Errors
/// If it has another shape or numbers that are no indices of cells.
pub(crate) fn list(name: &str, value: &Bound<'_, PyAny>, extent: Extent) -> PyResult<Vec<Cell>> {
    let size = extent.size();
    let bad = |what: String| {
        let cells = format!("cells of the map, whose size is {size:?}, as an array of shape (N, 3)");
        PyValueError::new_err(format!("{name} has {what}: expected {cells}"))
    };
    if value.len().is_ok_and(|count| count == 0) {
        return Ok(Vec::new());
    }
    // As floats, of which those with a fraction are refused instead of cut.
    let Ok(array) = value.extract::<PyArrayLike2<'_, f64, AllowTypeChange>>() else {
        return Err(bad(format!("the type {}", value.get_type().name()?)));
    };
    let array = array.as_array();
    if array.ncols() != 3 {
        return Err(bad(format!("shape {:?}", array.shape())));
    }
    let index = |value: f64, cells: u32| {
        (value >= 0.0 && value < f64::from(cells) && value.fract() == 0.0).then_some(value as i32)
    };
    let cell = |row: [f64; 3]| {
        Some(Cell { x: index(row[0], size[0])?, y: index(row[1], size[1])?, z: index(row[2], size[2])? })
    };
    let rows = array.rows().into_iter().map(|row| [row[0], row[1], row[2]]);
    rows.map(|row| cell(row).ok_or_else(|| bad(format!("the cell {row:?}")))).collect()
}

/// Whether a cell of the map is marked.
fn is_marked(mask: &ArrayView3<'_, bool>, Cell { x, y, z }: Cell) -> bool {
    mask[[x as usize, y as usize, z as usize]]
}

/// The cheapest path to the nearest goal, through cells of `within` if that is given; `None`
/// without one, or beyond `cells_max` expanded cells.
pub(crate) fn find(
    ctx: &mut Ctx<'_>,
    goal: &Cells<'_>,
    within: Option<&PyReadonlyArray3<'_, bool>>,
    neighbours: Neighbours,
    cells_max: u64,
) -> Option<PyPath> {
    let open = within.map(PyReadonlyArray3::as_array);
    let is_open = |cell| open.as_ref().is_none_or(|open| is_marked(open, cell));
    let marked = match goal {
        Cells::Mask(mask) => Some(mask.as_array()),
        Cells::List(_) => None,
    };
    let is_goal = |cell| marked.as_ref().is_some_and(|marked| is_marked(marked, cell));
    let goal = match goal {
        Cells::Mask(_) => Goal::Where(&is_goal),
        // With a heuristic, as in `Ctx::go_to_cell`.
        Cells::List(cells) => match cells[..] {
            [cell] => Goal::Cell(cell),
            _ => Goal::AnyOf(cells),
        },
    };
    let mut search = Search::new(ctx.graph(neighbours), ctx.cell(), goal).at_most(cells_max);
    if open.is_some() {
        search = search.within(&is_open);
    }
    let path = search.run()?;
    Some(measured(ctx, path))
}

/// A path with its motion and time.
fn measured(ctx: &Ctx<'_>, path: Path) -> PyPath {
    let motion = match ctx.follow(&path) {
        NavigationStatus::Go(motion) => Some(motion),
        NavigationStatus::Searching(_) | NavigationStatus::NoPath => None,
    };
    let waypoints: &[Point3<f64>] = match &motion {
        Some(Motion::Path(waypoints)) => waypoints,
        _ => &[],
    };
    let time_s = time_s(ctx.body(), ctx.position(), ctx.yaw_rad(), waypoints);
    PyPath { length_m: path.length_m(ctx.map().extent()), cells: path.cells, motion, time_s }
}

/// The lengths of the cheapest paths to cells, metres; infinity without one.
pub(crate) fn lengths_m(ctx: &mut Ctx<'_>, cells: &[Cell], neighbours: Neighbours) -> Vec<f64> {
    let cell_m = ctx.map().extent().cell_m();
    let costs = distances(ctx.graph(neighbours), ctx.cell(), cells);
    costs.into_iter().map(|cost| cost.map_or(f64::INFINITY, |cost| cost as f64 / EDGE_COST as f64 * cell_m)).collect()
}
