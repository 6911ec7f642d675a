//! The context of a decision, with the names of `agent_node::controllers::Ctx`, and the agent's
//! map as NumPy arrays.
//!
//! The array of the map lives as long as the controller. It is brought up to date from the journal
//! of the map when it is asked for, so that a decision costs what has changed, not the whole map.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex};

use agent_node::bodies::{self, BodyKind, BodyModel};
use agent_node::controllers::{Ctx, collision_recovery};
use agent_node::exploration_map::{CellState, Finding};
use agent_node::navigation::{NavigationStatus, SearchTime};
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray3};
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use voxels::Cell;

use crate::borrowed::Loan;
use crate::command::{PyCommand, PyMotion, PyWakeCondition};
use crate::observation::energy_dict;
use crate::rng::PyRng;
use crate::search::{self, PyPath};

/// A cell by its indices along x, y and z.
pub(crate) type CellIndices = (i32, i32, i32);

pub(crate) fn cell_of((x, y, z): CellIndices) -> Cell {
    Cell { x, y, z }
}

pub(crate) fn indices_of(Cell { x, y, z }: Cell) -> CellIndices {
    (x, y, z)
}

/// The states of all cells, in memory that NumPy owns.
pub(crate) struct CellsArray {
    /// By index of the cell.
    base: Py<PyArray1<u8>>,
    /// The memory of the map, read-only, by x, y and z.
    view: Py<PyAny>,
    /// Entries of the journal that it has.
    journal_len: usize,
}

/// What outlives a decision: the loan of its context, and the array of the map.
#[derive(Default)]
pub(crate) struct SharedCtx {
    pub(crate) loan: Loan,
    cells: Mutex<Option<CellsArray>>,
}

/// What a controller can query besides the observation, and helpers for its motion. It is valid
/// until `decide` returns.
#[pyclass(name = "Ctx", module = "maes", frozen)]
pub(crate) struct PyCtx(pub(crate) Arc<SharedCtx>);

impl PyCtx {
    pub(crate) fn with<T>(&self, use_it: impl FnOnce(&mut Ctx<'_>) -> T) -> PyResult<T> {
        self.0.loan.with(use_it)
    }
}

fn navigated<'py>(py: Python<'py>, status: NavigationStatus) -> PyResult<Bound<'py, PyAny>> {
    match status {
        NavigationStatus::Go(motion) => PyMotion(motion).into_bound_py_any(py),
        NavigationStatus::Searching(wake) => PyWakeCondition(wake).into_bound_py_any(py),
        NavigationStatus::NoPath => Ok(py.None().into_bound(py)),
    }
}

fn search_time(word: &str) -> PyResult<SearchTime> {
    match word {
        "instant" => Ok(SearchTime::Instant),
        "budgeted" => Ok(SearchTime::BUDGETED),
        "background" => Ok(SearchTime::Background(25)),
        other => Err(PyValueError::new_err(format!(
            "search_time = {other:?}: expected \"instant\", \"budgeted\" or \"background\""
        ))),
    }
}

pub(crate) fn finite(name: &str, value: f64) -> PyResult<f64> {
    if value.is_finite() {
        return Ok(value);
    }
    Err(PyValueError::new_err(format!("{name} = {value}: expected a finite number")))
}

/// A body model as a dictionary.
fn body_dict<'py>(py: Python<'py>, body: &BodyModel) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    let kind = match body.kind {
        BodyKind::Submarine => "submarine",
        BodyKind::Aerial => "aerial",
        BodyKind::Ground => "ground",
    };
    dict.set_item("kind", kind)?;
    dict.set_item("radius_m", body.radius_m)?;
    dict.set_item("speed_max_m_s", body.speed_max_m_s)?;
    dict.set_item("acceleration_m_s2", body.acceleration_m_s2)?;
    dict.set_item("deceleration_m_s2", body.deceleration_m_s2)?;
    dict.set_item("turn_rate_max_rad_s", body.turn_rate_max_rad_s)?;
    dict.set_item("turn_acceleration_rad_s2", body.turn_acceleration_rad_s2)?;
    dict.set_item("turn_deceleration_rad_s2", body.turn_deceleration_rad_s2)?;
    if body.kind == BodyKind::Ground {
        dict.set_item("turns_first", body.turns_first())?;
        dict.set_item("step_max_m", body.step_max_m)?;
        dict.set_item("slope_max_rad", body.slope_max_rad)?;
    }
    Ok(dict)
}

#[pymethods]
impl PyCtx {
    /// The id of the agent.
    #[getter]
    fn agent(&self) -> PyResult<u32> {
        self.with(|ctx| ctx.agent().0)
    }

    /// Size of the team; ids are 0 to agents - 1.
    #[getter]
    fn agents(&self) -> PyResult<u32> {
        self.with(|ctx| ctx.run_info().agents)
    }

    /// Ticks of 20 ms since the start.
    #[getter]
    fn tick(&self) -> PyResult<u64> {
        self.with(|ctx| ctx.tick().0)
    }

    /// Tick in which the run ends at the latest.
    #[getter]
    fn duration_ticks(&self) -> PyResult<u64> {
        self.with(|ctx| ctx.run_info().duration.0)
    }

    /// Centre of the body: float64, shape (3,), metres, frame `map`.
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let position = self.with(|ctx| ctx.position())?;
        Ok(PyArray1::from_slice(py, position.coords.as_slice()))
    }

    /// Heading: 0 along x, positive to the left, in (-pi, pi].
    #[getter]
    fn yaw_rad(&self) -> PyResult<f64> {
        self.with(|ctx| ctx.yaw_rad())
    }

    /// The cell that contains the centre of the body.
    #[getter]
    fn cell(&self) -> PyResult<CellIndices> {
        self.with(|ctx| indices_of(ctx.cell()))
    }

    /// The map of the agent: all it has sensed and received.
    #[getter]
    fn map(&self) -> PyExplorationMap {
        PyExplorationMap(Arc::clone(&self.0))
    }

    /// The model of the own body.
    #[getter]
    fn body<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let body = self.with(|ctx| *ctx.body())?;
        body_dict(py, &body)
    }

    /// Greatest range of the LiDAR, metres; infinity: unlimited.
    #[getter]
    fn lidar_range_m(&self) -> PyResult<f64> {
        self.with(|ctx| ctx.run_info().lidar_range_m)
    }

    /// Greatest distance of agents in contact, metres; infinity: limited by line of sight alone.
    #[getter]
    fn communication_range_m(&self) -> PyResult<f64> {
        self.with(|ctx| ctx.run_info().communication_range_m)
    }

    /// The energy of the body, as that of the observation; `None` if bodies need no energy.
    #[getter]
    fn energy<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let energy = self.with(|ctx| ctx.energy().cloned())?;
        energy.map(|energy| energy_dict(py, &energy)).transpose()
    }

    /// Whether the centre of the body is in one of its bases.
    #[getter]
    fn is_in_base(&self) -> PyResult<bool> {
        self.with(|ctx| ctx.is_in_base())
    }

    /// The motion to the nearest free place in a base through cells known to be free, and its cost
    /// in J; `None` without a path, or if bodies need no energy.
    fn way_home(&self) -> PyResult<Option<(PyMotion, f64)>> {
        self.with(|ctx| ctx.way_home().map(|way| (PyMotion(way.motion), way.cost_j)))
    }

    /// Whether the straight leg to the centre of a cell is known to be clear for the body.
    fn is_clear_to(&self, cell: CellIndices) -> PyResult<bool> {
        self.with(|ctx| ctx.is_clear_to(cell_of(cell)))
    }

    /// The neighbours of the body's cell that are clear.
    fn clear_neighbours(&self) -> PyResult<Vec<CellIndices>> {
        self.with(|ctx| ctx.clear_neighbours().into_iter().map(indices_of).collect())
    }

    /// The motion to the centre of a cell through cells known to be free; a `WakeCondition` while
    /// the search takes time: then stay at rest and ask again when it fires; `None` without a path.
    #[pyo3(signature = (cell, *, search_time="instant", neighbours=26))]
    fn go_to_cell<'py>(
        &self,
        py: Python<'py>,
        cell: CellIndices,
        search_time: &str,
        neighbours: u32,
    ) -> PyResult<Bound<'py, PyAny>> {
        let time = self::search_time(search_time)?;
        let neighbours = search::neighbours(neighbours)?;
        let status = self.with(|ctx| ctx.go_to_cell_by(cell_of(cell), neighbours, time))?;
        navigated(py, status)
    }

    /// The cheapest path to the nearest goal: any cell of a bool array with the shape of the map,
    /// or of an integer array of shape (N, 3). It leads only through cells that are known to be
    /// free, and through those of the bool array `within` if it is given. `None` without a path, or
    /// if more than `cells_max` cells had to be expanded. Takes no sim time.
    #[pyo3(signature = (goal, *, within=None, neighbours=26, cells_max=u64::MAX))]
    fn search<'py>(
        &self,
        goal: &Bound<'py, PyAny>,
        within: Option<PyReadonlyArray3<'py, bool>>,
        neighbours: u32,
        cells_max: u64,
    ) -> PyResult<Option<PyPath>> {
        let neighbours = search::neighbours(neighbours)?;
        let extent = self.with(|ctx| ctx.map().extent())?;
        let goal = search::Cells::new("goal", goal, extent)?;
        let within = within.map(|mask| search::mask("within", mask, extent)).transpose()?;
        self.with(|ctx| search::find(ctx, &goal, within.as_ref(), neighbours, cells_max))
    }

    /// The lengths of the cheapest paths to cells (an integer array of shape (N, 3)), by one
    /// search: float64, shape (N,), metres; infinity without a path.
    #[pyo3(signature = (cells, *, neighbours=26))]
    fn path_lengths_m<'py>(
        &self,
        py: Python<'py>,
        cells: &Bound<'py, PyAny>,
        neighbours: u32,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let neighbours = search::neighbours(neighbours)?;
        let extent = self.with(|ctx| ctx.map().extent())?;
        let cells = search::list("cells", cells, extent)?;
        Ok(PyArray1::from_vec(py, self.with(|ctx| search::lengths_m(ctx, &cells, neighbours))?))
    }

    /// Limits later searches of `go_to_cell` to this number of expanded cells.
    fn limit_searches(&self, cells_max: u64) -> PyResult<()> {
        self.with(|ctx| ctx.limit_searches(cells_max))
    }

    /// The frontier with the shortest path, but none of `excluded`; `None` if there is none.
    #[pyo3(signature = (excluded=None))]
    fn nearest_frontier(&self, excluded: Option<&Bound<'_, PyAny>>) -> PyResult<Option<CellIndices>> {
        let cells = excluded.map(|cells| cells.try_iter()).transpose()?;
        let cells = cells.into_iter().flatten().map(|cell| Ok(cell_of(cell?.extract()?)));
        let excluded = cells.collect::<PyResult<BTreeSet<Cell>>>()?;
        let wanted = |map: &agent_node::exploration_map::ExplorationMap, cell| {
            map.is_frontier(cell) && !excluded.contains(&cell)
        };
        self.with(|ctx| ctx.nearest(wanted).map(indices_of))
    }

    /// A turn to a heading, radians.
    fn turn_to(&self, yaw_rad: f64) -> PyResult<PyMotion> {
        let yaw_rad = finite("yaw_rad", yaw_rad)?;
        self.with(|ctx| PyMotion(ctx.turn_to(yaw_rad)))
    }

    /// Straight on in a direction until a collision, without a turn first; `None` for a body that
    /// has to turn.
    #[pyo3(signature = (heading_rad, pitch_rad=0.0))]
    fn straight_towards(&self, heading_rad: f64, pitch_rad: f64) -> PyResult<Option<PyMotion>> {
        let (heading_rad, pitch_rad) = (finite("heading_rad", heading_rad)?, finite("pitch_rad", pitch_rad)?);
        self.with(|ctx| ctx.straight_towards(heading_rad, pitch_rad).map(PyMotion))
    }

    /// Marks a cell of the own map as covered, which is shared with it.
    fn mark_covered(&self, cell: CellIndices) -> PyResult<()> {
        self.with(|ctx| ctx.mark_covered(cell_of(cell)))
    }

    /// The command after a collision with another agent: to a random clear neighbour, and hold.
    fn step_aside(&self, rng: &PyRng) -> PyResult<PyCommand> {
        self.with(|ctx| rng.with(|rng| PyCommand(collision_recovery::step_aside(rng, ctx))))
    }

    /// Time of a straight leg from rest to rest, seconds, with a turn before it if the body turns.
    #[pyo3(signature = (length_m, turn_rad=0.0))]
    fn leg_s(&self, length_m: f64, turn_rad: f64) -> PyResult<f64> {
        let (length_m, turn_rad) = (finite("length_m", length_m)?, finite("turn_rad", turn_rad)?);
        self.with(|ctx| bodies::leg_s(ctx.body(), length_m, turn_rad))
    }
}

/// The map of an agent. It is valid until `decide` returns, and so are its arrays: later they keep
/// the state of the last time that `cells` was asked for.
#[pyclass(name = "ExplorationMap", module = "maes", frozen)]
pub(crate) struct PyExplorationMap(Arc<SharedCtx>);

#[pymethods]
impl PyExplorationMap {
    /// Cells along x, y and z.
    #[getter]
    fn size(&self) -> PyResult<[u32; 3]> {
        self.0.loan.with(|ctx| ctx.map().extent().size())
    }

    /// Edge of a cell, metres.
    #[getter]
    fn cell_m(&self) -> PyResult<f64> {
        self.0.loan.with(|ctx| ctx.map().extent().cell_m())
    }

    /// The state of each cell: uint8, read-only, shape `size`, indexed [x, y, z]; see `CellState`.
    /// No copy: the same memory in each decision, brought up to date.
    #[getter]
    fn cells(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        // It refuses other threads, so that nothing waits for the lock.
        let size = self.size()?;
        let in_use = |_| PyValueError::new_err("the map is in use");
        let mut kept = self.0.cells.try_lock().map_err(in_use)?;
        if kept.is_none() {
            let [x, y, z] = size.map(|cells| cells as usize);
            let base = PyArray1::<u8>::zeros(py, [x * y * z], false);
            let view = base.reshape([z, y, x])?.call_method0("transpose")?;
            let flags = PyDict::new(py);
            flags.set_item("write", false)?;
            view.call_method("setflags", (), Some(&flags))?;
            *kept = Some(CellsArray { base: base.unbind(), view: view.unbind(), journal_len: 0 });
        }
        let Some(array) = kept.as_mut() else { unreachable!("it was made above") };
        let from = array.journal_len;
        let (changes, journal_len) = self.0.loan.with(|ctx| {
            let map = ctx.map();
            // A map that was begun again has a shorter journal: all of it is new.
            let from = if map.journal_len() < from { 0 } else { from };
            (map.changes_since(from).collect::<Vec<_>>(), map.journal_len())
        })?;
        if !changes.is_empty() {
            let mut cells =
                array.base.bind(py).try_readwrite().map_err(|error| PyValueError::new_err(error.to_string()))?;
            let cells = cells.as_slice_mut().map_err(|error| PyValueError::new_err(error.to_string()))?;
            for change in changes {
                cells[change.cell as usize] = change.finding as u8;
            }
        }
        array.journal_len = journal_len;
        Ok(array.view.clone_ref(py))
    }

    /// The state of a cell; outside the map all is wall.
    fn state(&self, cell: CellIndices) -> PyResult<u8> {
        self.0.loan.with(|ctx| ctx.map().state(cell_of(cell)) as u8)
    }

    /// Whether a cell is known to be free and has an unexplored face neighbour.
    fn is_frontier(&self, cell: CellIndices) -> PyResult<bool> {
        self.0.loan.with(|ctx| ctx.map().is_frontier(cell_of(cell)))
    }

    /// All frontiers, ascending by index: int32, shape (N, 3). One copy.
    #[getter]
    fn frontiers<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i32>>> {
        let flat = self.0.loan.with(|ctx| {
            let (map, extent) = (ctx.map(), ctx.map().extent());
            let cells = map.frontiers().map(|index| extent.cell_at(index as usize));
            cells.flat_map(|cell| [cell.x, cell.y, cell.z]).collect::<Vec<i32>>()
        })?;
        let count = flat.len() / 3;
        PyArray1::from_vec(py, flat).reshape([count, 3])
    }

    /// Number of frontiers.
    #[getter]
    fn frontier_count(&self) -> PyResult<usize> {
        self.0.loan.with(|ctx| ctx.map().frontier_count())
    }

    /// Number of known free cells, covered ones included.
    #[getter]
    fn free(&self) -> PyResult<usize> {
        self.0.loan.with(|ctx| ctx.map().free())
    }

    /// Number of known walls.
    #[getter]
    fn wall(&self) -> PyResult<usize> {
        self.0.loan.with(|ctx| ctx.map().wall())
    }

    /// Number of covered cells.
    #[getter]
    fn covered(&self) -> PyResult<usize> {
        self.0.loan.with(|ctx| ctx.map().covered())
    }

    /// Number of entries of the journal of changes.
    #[getter]
    fn journal_len(&self) -> PyResult<usize> {
        self.0.loan.with(|ctx| ctx.map().journal_len())
    }

    /// The changes from a position of the journal on: int64, shape (N, 3), with the index of the
    /// cell, its new state, and the agent that reported it, -1 for the own sensor. One copy.
    fn changes_since<'py>(&self, py: Python<'py>, position: usize) -> PyResult<Bound<'py, PyArray2<i64>>> {
        let flat = self.0.loan.with(|ctx| {
            let changes = ctx.map().changes_since(position);
            let row = |change: agent_node::exploration_map::Change| {
                let from = change.from.map_or(-1, |agent| i64::from(agent.0));
                [i64::from(change.cell), i64::from(change.finding as u8), from]
            };
            changes.flat_map(row).collect::<Vec<i64>>()
        })?;
        let count = flat.len() / 3;
        PyArray1::from_vec(py, flat).reshape([count, 3])
    }

    /// Centre of a cell: float64, shape (3,), metres, frame `map`.
    fn centre<'py>(&self, py: Python<'py>, cell: CellIndices) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let centre = self.0.loan.with(|ctx| ctx.map().extent().centre(cell_of(cell)))?;
        Ok(PyArray1::from_slice(py, centre.coords.as_slice()))
    }
}

const _: () = assert!(CellState::Wall as u8 == Finding::Wall as u8 && CellState::Free as u8 == Finding::Free as u8);
