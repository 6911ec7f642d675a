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

impl PyWorlds {
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
            pool.install(|| seeds.into_par_iter().map(one).collect::<PyResult<Vec<_>>>())
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
            pool.install(|| all.par_iter_mut().enumerate().map(reset).collect())
        })
    }

    /// Steps every world; `actions` has the numbers of each agent of each world in turn. Returns,
    /// by agent and world: explored share gained, path length in m, and 1 for a collision.
    fn step<'py>(&self, py: Python<'py>, actions: PyReadonlyArray1<'_, f32>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let pool = pool()?;
        let actions = actions.as_slice().map_err(|error| PyValueError::new_err(format!("actions: {error}")))?;
        let width = self.shape.actions.width() * self.agents;
        let gains: Vec<Vec<Gain>> = self.with(py, |worlds| {
            let expected = worlds.len() * width;
            if actions.len() != expected {
                return Err(PyValueError::new_err(format!(
                    "actions has {} numbers: expected {expected}",
                    actions.len()
                )));
            }
            let one = |(number, (world, actions)): (usize, (&mut Environment, &[f32]))| {
                world.step(actions).map_err(|why| PyValueError::new_err(format!("world {number}: {why}")))
            };
            pool.install(|| worlds.par_iter_mut().zip(actions.par_chunks_exact(width)).enumerate().map(one).collect())
        })?;
        let rows = gains.into_iter().flatten();
        let flat: Vec<f64> =
            rows.flat_map(|gain| [gain.explored, gain.distance_m, f64::from(u8::from(gain.collided))]).collect();
        Ok(PyArray1::from_vec(py, flat))
    }

    /// Writes what all agents are shown into arrays, world by world and agent by agent.
    fn show(
        &self,
        py: Python<'_>,
        mut crops: Crops<'_>,
        mut own: Numbers<'_>,
        mut contacts: Numbers<'_>,
        mut frontiers: Numbers<'_>,
    ) -> PyResult<()> {
        let pool = pool()?;
        let side = 2 * self.shape.crop_radius as usize + 1;
        let (cells, others) = (side * side * side, PLACE_WIDTH * self.agents.saturating_sub(1).max(1));
        let places = PLACE_WIDTH * self.shape.frontiers;
        let worlds = self.count(py)?;
        let all = worlds * self.agents;
        let crops = slice("crops", &mut crops, all * cells)?;
        let own = slice("own", &mut own, all * OWN_WIDTH)?;
        let contacts = slice("contacts", &mut contacts, all * others)?;
        let frontiers = slice("frontiers", &mut frontiers, all * places)?;
        let agents = self.agents;
        self.with(py, |worlds| {
            let chunks = crops
                .par_chunks_exact_mut(cells * agents)
                .zip(own.par_chunks_exact_mut(OWN_WIDTH * agents))
                .zip(contacts.par_chunks_exact_mut(others * agents))
                .zip(frontiers.par_chunks_exact_mut(places * agents));
            pool.install(|| {
                worlds.par_iter_mut().zip(chunks).for_each(|(world, (((crops, own), contacts), frontiers))| {
                    for agent in 0..agents {
                        let view = View {
                            crop: &mut crops[agent * cells..][..cells],
                            own: &mut own[agent * OWN_WIDTH..][..OWN_WIDTH],
                            contacts: &mut contacts[agent * others..][..others],
                            frontiers: &mut frontiers[agent * places..][..places],
                        };
                        world.show(AgentId::from_index(agent), view);
                    }
                });
            });
            Ok(())
        })
    }

    /// Number of worlds.
    fn count(&self, py: Python<'_>) -> PyResult<usize> {
        self.with(py, |worlds| Ok(worlds.len()))
    }

    /// By world: explored share, whether all is explored, whether the time is over, and the tick.
    fn status(&self, py: Python<'_>) -> PyResult<Vec<(f64, bool, bool, u64)>> {
        self.with(py, |worlds| {
            let status = |world: &Environment| {
                let explored = world.world().coverage().explored();
                (explored, world.is_explored(), world.is_over_time(), world.world().tick().0)
            };
            Ok(worlds.iter().map(status).collect())
        })
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
        let known = self.with(py, |worlds| {
            let count = worlds.len();
            let outside = || bad_input(format!("world {world}: expected 0 to {}", count - 1));
            Ok(worlds.get(world).ok_or_else(outside)?.team_map())
        })?;
        Ok(PyArray1::from_vec(py, known))
    }

    /// Frees the worlds; later calls raise.
    fn close(&self) {
        *self.worlds.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}
