//! Many worlds at once for learning: one call steps all of them, on all cores, without the GIL.

use std::sync::{Arc, Mutex, PoisonError};

use msgs::ids::AgentId;
use numpy::{PyArray1, PyReadonlyArray1, PyReadwriteArray1};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::{bad_input, failed};
use crate::interrupt::internal;
use crate::scenario::PyScenario;
use crate::worlds::{Actions, Environment, Gain, OWN_WIDTH, PLACE_WIDTH, Shape, View};

/// The threads that step worlds. A process that was forked has none of them, and makes its own.
static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

fn pool() -> PyResult<Arc<ThreadPool>> {
    let mut pool = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    let process = std::process::id();
    if let Some((_, present)) = pool.as_ref().filter(|(owner, _)| *owner == process) {
        return Ok(Arc::clone(present));
    }
    let made = Arc::new(ThreadPoolBuilder::new().build().map_err(failed)?);
    // To drop the pool of the parent process would wait for threads that are not there.
    std::mem::forget(pool.replace((process, Arc::clone(&made))));
    Ok(made)
}

/// The results of all worlds, or the error of the first world that has one: rayon's own collecting
/// into a `Result` reports whichever thread fails first.
fn in_order<T>(results: Vec<PyResult<T>>) -> PyResult<Vec<T>> {
    results.into_iter().collect()
}

/// Worlds of one scenario with different seeds.
#[pyclass(name = "Worlds", module = "maes._maes", frozen)]
pub(crate) struct PyWorlds {
    worlds: Mutex<Option<Vec<Environment>>>,
    shape: Shape,
    agents: usize,
    #[pyo3(get)]
    size: [u32; 3],
}

/// Arrays of one kind for all agents of all worlds, which a step overwrites.
type Crops<'py> = PyReadwriteArray1<'py, u8>;
type Numbers<'py> = PyReadwriteArray1<'py, f32>;

/// Shares and answers, one for each world.
type Status<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<bool>>, Bound<'py, PyArray1<bool>>);

fn slice<'a, T: numpy::Element>(
    name: &str,
    array: &'a mut PyReadwriteArray1<'_, T>,
    length: usize,
) -> PyResult<&'a mut [T]> {
    let slice = array.as_slice_mut().map_err(|error| PyValueError::new_err(format!("{name}: {error}")))?;
    if slice.len() == length {
        Ok(slice)
    } else {
        Err(PyValueError::new_err(format!("{name} has {} numbers: expected {length}", slice.len())))
    }
}

/// Where the observations of all agents of one world are written, each part agent by agent.
struct Views<'a> {
    crops: &'a mut [u8],
    own: &'a mut [f32],
    contacts: &'a mut [f32],
    frontiers: &'a mut [f32],
}

impl Views<'_> {
    fn show(self, world: &mut Environment) {
        let Self { crops, own, contacts, frontiers } = self;
        let agents = own.len() / OWN_WIDTH;
        let parts = (crops.len() / agents, contacts.len() / agents, frontiers.len() / agents);
        let crops = crops.chunks_exact_mut(parts.0);
        let places = contacts.chunks_exact_mut(parts.1).zip(frontiers.chunks_exact_mut(parts.2));
        for (agent, ((crop, own), (contacts, frontiers))) in
            crops.zip(own.chunks_exact_mut(OWN_WIDTH)).zip(places).enumerate()
        {
            world.show(AgentId::from_index(agent), View { crop, own, contacts, frontiers });
        }
    }
}

impl PyWorlds {
    /// The arrays by world: own state, contacts and frontiers, and crops.
    ///
    /// # Errors
    /// If an array has another length.
    fn views<'a, 'py>(
        &self,
        py: Python<'_>,
        [own, contacts, frontiers]: [&'a mut Numbers<'py>; 3],
        crops: &'a mut Crops<'py>,
    ) -> PyResult<impl IndexedParallelIterator<Item = Views<'a>> + use<'a, 'py>> {
        let side = 2 * self.shape.crop_radius as usize + 1;
        let (cells, others) = (side * side * side, PLACE_WIDTH * self.agents.saturating_sub(1).max(1));
        let (places, agents) = (PLACE_WIDTH * self.shape.frontiers, self.agents);
        let all = self.count(py)? * agents;
        let crops = slice("crops", crops, all * cells)?.par_chunks_exact_mut(cells * agents);
        let own = slice("own", own, all * OWN_WIDTH)?.par_chunks_exact_mut(OWN_WIDTH * agents);
        let contacts = slice("contacts", contacts, all * others)?.par_chunks_exact_mut(others * agents);
        let frontiers = slice("frontiers", frontiers, all * places)?.par_chunks_exact_mut(places * agents);
        let of_world = move |(((crops, own), contacts), frontiers)| Views { crops, own, contacts, frontiers };
        Ok(crops.zip(own).zip(contacts).zip(frontiers).map(of_world))
    }

    fn cells<'py>(
        &self,
        py: Python<'py>,
        world: usize,
        of: impl FnOnce(&Environment) -> Vec<u8> + Send,
    ) -> PyResult<Bound<'py, PyArray1<u8>>> {
        let cells = self.with(py, |worlds| {
            let count = worlds.len();
            let outside = || bad_input(format!("world {world}: expected 0 to {}", count - 1));
            Ok(of(worlds.get(world).ok_or_else(outside)?))
        })?;
        Ok(PyArray1::from_vec(py, cells))
    }

    fn with<T>(&self, py: Python<'_>, use_them: impl FnOnce(&mut Vec<Environment>) -> PyResult<T> + Send) -> PyResult<T>
    where
        T: Send,
    {
        let busy = || PyRuntimeError::new_err("the environment is in use in another thread: give each thread its own");
        py.detach(|| {
            let mut worlds = self.worlds.try_lock().map_err(|_| busy())?;
            let closed = || PyRuntimeError::new_err("the environment is closed: make another one");
            let worlds = worlds.as_mut().ok_or_else(closed)?;
            let done = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| use_them(worlds)));
            done.map_err(|panic| internal(panic.as_ref()))?
        })
    }
}

#[pymethods]
impl PyWorlds {
    /// One world for each of `seeds`.
    #[new]
    #[pyo3(signature = (scenario, seeds, *, ticks_per_step, crop_radius, frontiers, actions, waypoint_m))]
    #[allow(clippy::too_many_arguments, reason = "they are named in Python")]
    fn new(
        py: Python<'_>,
        scenario: &PyScenario,
        seeds: Vec<u64>,
        ticks_per_step: u64,
        crop_radius: u32,
        frontiers: usize,
        actions: &str,
        waypoint_m: f64,
    ) -> PyResult<Self> {
        let actions = match actions {
            "velocity" => Actions::Velocity,
            "waypoint" => Actions::Waypoint,
            "frontier" => Actions::Frontier,
            other => {
                let text = format!("actions = {other:?}: expected \"velocity\", \"waypoint\" or \"frontier\"");
                return Err(bad_input(text));
            }
        };
        let checks = [
            ("period_s", (1..=5000).contains(&ticks_per_step), "0.02 to 100 s"),
            ("crop_radius", crop_radius <= 32, "at most 32 cells"),
            ("frontiers", (1..=1024).contains(&frontiers), "1 to 1024"),
            ("waypoint_m", waypoint_m > 0.0 && waypoint_m <= 1000.0, "above 0 and at most 1000 m"),
            ("worlds", (1..=4096).contains(&seeds.len()), "1 to 4096"),
        ];
        if let Some((name, _, expected)) = checks.into_iter().find(|(_, holds, _)| !holds) {
            return Err(bad_input(format!("{name}: expected {expected}")));
        }
        let shape = Shape { ticks_per_step, crop_radius, frontiers, actions, waypoint_m };
        let agents = scenario.scenario.agents.count as usize;
        let pool = pool()?;
        let worlds = py.detach(|| {
            let one = |seed: u64| Environment::new(&scenario.scenario, seed, shape).map_err(bad_input);
            in_order(pool.install(|| seeds.into_par_iter().map(one).collect()))
        })?;
        let size = worlds[0].world().terrain().extent().size();
        Ok(Self { worlds: Mutex::new(Some(worlds)), shape, agents, size })
    }

    /// Begins some worlds again, each with a seed.
    fn reset(&self, py: Python<'_>, worlds: Vec<(usize, u64)>) -> PyResult<()> {
        let pool = pool()?;
        self.with(py, |all| {
            let count = all.len();
            if let Some((number, _)) = worlds.iter().find(|(number, _)| *number >= count) {
                return Err(bad_input(format!("world {number}: expected 0 to {}", count - 1)));
            }
            let seeds: std::collections::BTreeMap<usize, u64> = worlds.into_iter().collect();
            let reset = |(number, world): (usize, &mut Environment)| {
                seeds.get(&number).map_or(Ok(()), |&seed| world.reset(seed).map_err(bad_input))
            };
            in_order(pool.install(|| all.par_iter_mut().enumerate().map(reset).collect())).map(drop)
        })
    }

    /// Steps every world; `actions` has the numbers of each agent of each world in turn. Writes
    /// what all agents are shown then, see [`Self::show`]. Returns, by agent and world: explored
    /// share gained, path length in m, and 1 for a collision. Raises `ValueError` for the first
    /// action by world and agent that is not legal, and steps no world then.
    fn step<'py>(
        &self,
        py: Python<'py>,
        actions: PyReadonlyArray1<'_, f32>,
        mut crops: Crops<'py>,
        mut own: Numbers<'py>,
        mut contacts: Numbers<'py>,
        mut frontiers: Numbers<'py>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let actions = actions.as_slice().map_err(|error| PyValueError::new_err(format!("actions: {error}")))?;
        let width = self.shape.actions.width() * self.agents;
        let expected = self.count(py)? * width;
        if actions.len() != expected {
            return Err(PyValueError::new_err(format!("actions has {} numbers: expected {expected}", actions.len())));
        }
        let views = self.views(py, [&mut own, &mut contacts, &mut frontiers], &mut crops)?;
        let named = |number: usize, why: String| PyValueError::new_err(format!("world {number}: {why}"));
        let step = |(number, ((world, views), actions)): (usize, ((&mut Environment, Views<'_>), &[f32]))| {
            let gains = world.step(actions).map_err(|why| named(number, why))?;
            views.show(world);
            Ok(gains)
        };
        let pool = pool()?;
        let gains: Vec<Vec<Gain>> = self.with(py, |worlds| {
            // All before any: an action that is not legal leaves every world as it was.
            for (number, (world, actions)) in worlds.iter().zip(actions.chunks_exact(width)).enumerate() {
                world.check(actions).map_err(|why| named(number, why))?;
            }
            let steps = worlds.par_iter_mut().zip(views).zip(actions.par_chunks_exact(width)).enumerate();
            in_order(pool.install(|| steps.with_max_len(1).map(step).collect()))
        })?;
        let rows = gains.into_iter().flatten();
        let flat: Vec<f64> =
            rows.flat_map(|gain| [gain.explored, gain.distance_m, f64::from(u8::from(gain.collided))]).collect();
        Ok(PyArray1::from_vec(py, flat))
    }

    /// Writes what all agents are shown into arrays, world by world and agent by agent.
    fn show<'py>(
        &self,
        py: Python<'py>,
        mut crops: Crops<'py>,
        mut own: Numbers<'py>,
        mut contacts: Numbers<'py>,
        mut frontiers: Numbers<'py>,
    ) -> PyResult<()> {
        let views = self.views(py, [&mut own, &mut contacts, &mut frontiers], &mut crops)?;
        let pool = pool()?;
        self.with(py, |worlds| {
            pool.install(|| worlds.par_iter_mut().zip(views).for_each(|(world, views)| views.show(world)));
            Ok(())
        })
    }

    /// Number of worlds.
    fn count(&self, py: Python<'_>) -> PyResult<usize> {
        self.with(py, |worlds| Ok(worlds.len()))
    }

    /// By world: explored share, whether its stop rule is met, and whether the time is over.
    fn status<'py>(&self, py: Python<'py>) -> PyResult<Status<'py>> {
        let status =
            |world: &Environment| (world.world().coverage().explored(), (world.is_done(), world.is_over_time()));
        let (shares, (explored, over)): (Vec<f64>, (Vec<bool>, Vec<bool>)) =
            self.with(py, |worlds| Ok(worlds.iter().map(status).unzip()))?;
        Ok((PyArray1::from_vec(py, shares), PyArray1::from_vec(py, explored), PyArray1::from_vec(py, over)))
    }

    /// True position (m) and heading (rad) of each agent of each world: float32, four numbers each.
    fn poses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let agents = self.agents;
        let flat = self.with(py, |worlds| {
            let mut flat = vec![0.0; 4 * agents * worlds.len()];
            worlds.iter().zip(flat.chunks_exact_mut(4 * agents)).for_each(|(world, out)| world.poses(out));
            Ok(flat)
        })?;
        Ok(PyArray1::from_vec(py, flat))
    }

    /// Which cells of a world the team has seen to be free, by index: uint8.
    fn team_map<'py>(&self, py: Python<'py>, world: usize) -> PyResult<Bound<'py, PyArray1<u8>>> {
        self.cells(py, world, Environment::team_map)
    }

    /// The `CellState`s of a layer of cells of a world, x fastest: uint8. Walls are those of the
    /// true map; free cells count as explored if some agent has seen them.
    fn layer<'py>(&self, py: Python<'py>, world: usize, z: u32) -> PyResult<Bound<'py, PyArray1<u8>>> {
        self.cells(py, world, |environment| environment.layer(z))
    }

    /// Frees the worlds; later calls raise.
    fn close(&self) {
        *self.worlds.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}
