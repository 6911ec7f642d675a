//! The random stream of a controller.

use std::sync::{Mutex, PoisonError};

use numpy::{PyArray1, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Random numbers that depend on the scenario's seed, the agent and the controller alone
/// (ChaCha8).
#[pyclass(name = "Rng", module = "maes", frozen)]
pub(crate) struct PyRng(Mutex<ChaCha8Rng>);

impl PyRng {
    pub(crate) fn new(rng: ChaCha8Rng) -> Self {
        Self(Mutex::new(rng))
    }

    pub(crate) fn with<T>(&self, draw: impl FnOnce(&mut ChaCha8Rng) -> T) -> T {
        draw(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

#[pymethods]
impl PyRng {
    #[new]
    fn from_seed(seed: u64) -> Self {
        Self::new(ChaCha8Rng::seed_from_u64(seed))
    }

    /// A number from 0 to 1, 1 excluded.
    fn random(&self) -> f64 {
        self.with(|rng| rng.random())
    }

    /// A number from `low` to `high`, `high` excluded.
    fn uniform(&self, low: f64, high: f64) -> PyResult<f64> {
        if !(low.is_finite() && high.is_finite() && low < high) {
            return Err(PyValueError::new_err(format!("uniform({low}, {high}): expected finite numbers, low < high")));
        }
        Ok(self.with(|rng| rng.random_range(low..high)))
    }

    /// A whole number from `low` to `high`, `high` excluded.
    fn integers(&self, low: i64, high: i64) -> PyResult<i64> {
        if low >= high {
            return Err(PyValueError::new_err(format!("integers({low}, {high}): expected low < high")));
        }
        Ok(self.with(|rng| rng.random_range(low..high)))
    }

    /// `count` numbers from 0 to 1, 1 excluded: float64, shape (count,).
    fn array<'py>(&self, py: Python<'py>, count: usize) -> Bound<'py, PyArray1<f64>> {
        let array = PyArray1::zeros(py, count, false);
        self.with(|rng| array.readwrite().as_array_mut().iter_mut().for_each(|value| *value = rng.random()));
        array
    }

    /// A seed for another generator, such as `numpy.random.default_rng`.
    fn seed(&self) -> u64 {
        self.with(Rng::next_u64)
    }
}
