//! Python classes as controllers: their registration, and the bridge to `Controller`.
//!
//! A class that was registered stays registered for the life of the process, since the registry
//! holds controllers by reference; registering it again costs nothing.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use agent_node::command::{Command, WakeCondition};
use agent_node::controllers::settings::{SettingError, Settings};
use agent_node::controllers::{Controller, Ctx, Failure, Registration, Registry, Setup};
use agent_node::observation::Observation;
use experiments::plan::KnownControllers;
use msgs::ids::Tick;
use pyo3::exceptions::{PyRuntimeError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyType};
use rand_chacha::ChaCha8Rng;

use crate::command::checked;
use crate::ctx::{PyCtx, SharedCtx};
use crate::error::bad_input;
use crate::interrupt::Deciding;
use crate::observation::PyObservation;
use crate::rng::PyRng;

/// Most classes that a process can register, each of which stays in memory.
const CLASSES_MAX: usize = 10_000;

/// A setting that a class declares.
#[derive(Debug, Clone)]
enum Declared {
    Number(f64, f64, f64),
    Integer(u64, u64, u64),
    Word(Vec<String>),
}

/// A setting with its value.
enum Taken {
    Number(f64),
    Integer(u64),
    Word(String),
}

/// Classes that were registered together, with their entries.
type Registered = (Vec<Py<PyType>>, &'static [Registration]);

/// All that were registered.
static KNOWN: Mutex<Vec<Registered>> = Mutex::new(Vec::new());

/// The built-in controllers, and these classes.
#[pyclass(name = "Controllers", module = "maes._maes", frozen)]
pub(crate) struct PyControllers {
    pub(crate) registry: Registry,
    /// The versions of the classes, by name.
    versions: BTreeMap<String, Option<String>>,
}

impl PyControllers {
    pub(crate) fn known(&self) -> KnownControllers<'_> {
        KnownControllers { registry: self.registry, versions: &self.versions }
    }
}

#[pymethods]
impl PyControllers {
    /// Registers subclasses of `maes.Controller` under their `name`, each with its version.
    #[new]
    fn new(classes: Vec<(Bound<'_, PyType>, Option<String>)>) -> PyResult<Self> {
        let (classes, versions): (Vec<_>, Vec<_>) = classes.into_iter().unzip();
        let versions_of = |own: &[Registration]| own.iter().map(|one| one.name.to_owned()).zip(versions).collect();
        if let Some(own) = known(&classes) {
            return Ok(Self { registry: Registry::with(own).map_err(bad_input)?, versions: versions_of(own) });
        }
        // Without the lock: Python code runs here, and may let other threads run.
        let entries = classes.iter().map(registration).collect::<PyResult<Vec<_>>>()?;
        let own: &'static [Registration] = Box::leak(entries.into_boxed_slice());
        let registry = Registry::with(own).map_err(bad_input)?;
        let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
        if known.len() >= CLASSES_MAX {
            let text = format!(
                "this process has registered {CLASSES_MAX} controller classes: define classes once, not in a loop"
            );
            return Err(PyRuntimeError::new_err(text));
        }
        known.push((classes.into_iter().map(Bound::unbind).collect(), own));
        Ok(Self { registry, versions: versions_of(own) })
    }

    /// Checks the name of a controller and its settings `KEY=VALUE`.
    fn check(&self, name: &str, settings: Vec<String>) -> PyResult<()> {
        self.registry.check(name, &settings).map_err(bad_input)
    }

    /// Name, description and settings of all controllers.
    fn text(&self) -> String {
        self.registry.text()
    }

    /// The names of all controllers.
    fn names(&self) -> Vec<&'static str> {
        self.registry.registrations().map(|registration| registration.name).collect()
    }
}

/// The entries of classes that were registered before.
fn known(classes: &[Bound<'_, PyType>]) -> Option<&'static [Registration]> {
    let known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    let is_same =
        |of: &[Py<PyType>]| of.len() == classes.len() && of.iter().zip(classes).all(|(one, other)| other.is(one));
    known.iter().find(|(of, _)| is_same(of)).map(|(_, own)| *own)
}

fn leaked(text: String) -> &'static str {
    Box::leak(text.into_boxed_str())
}

fn declared(key: &str, value: &Bound<'_, PyAny>) -> PyResult<Declared> {
    let checked = |is_inside: bool, declared| {
        let reason = || bad_input(format!("setting {key} = {value}: expected a default from the low to the high end"));
        if is_inside { Ok(declared) } else { Err(reason()) }
    };
    let unfit = || {
        let text = format!(
            "setting {key} = {value}: expected (default, low, high), all float or all int, or a list of words, the \
             first of which is the default"
        );
        PyTypeError::new_err(text)
    };
    if let Ok((default, low, high)) = value.extract::<(u64, u64, u64)>() {
        return checked((low..=high).contains(&default), Declared::Integer(default, low, high));
    }
    if let Ok((default, low, high)) = value.extract::<(f64, f64, f64)>() {
        return checked((low..=high).contains(&default), Declared::Number(default, low, high));
    }
    match value.extract::<Vec<String>>() {
        Ok(words) if !words.is_empty() => Ok(Declared::Word(words)),
        _ => Err(unfit()),
    }
}

fn registration(class: &Bound<'_, PyType>) -> PyResult<Registration> {
    let name: String = class.getattr("name")?.extract()?;
    let stream: Option<String> = class.getattr("stream")?.extract()?;
    let description: Option<String> = class.getattr("__doc__")?.extract()?;
    let description = description.unwrap_or_default();
    let description = description.trim().lines().next().unwrap_or_default().to_owned();
    let mut settings: Vec<(&'static str, Declared)> = Vec::new();
    for item in class.getattr("settings")?.call_method0("items")?.try_iter()? {
        let (key, value): (String, Bound<'_, PyAny>) = item?.extract()?;
        let value = declared(&key, &value)?;
        settings.push((leaked(key), value));
    }
    let class = class.clone().unbind();
    let name = leaked(name);
    let construct = move |given: &mut Settings, setup: Setup<'_>| {
        let taken = take(&settings, given)?;
        Ok(Box::new(Bridge::new(&class, &taken, setup.rng)) as Box<dyn Controller>)
    };
    Ok(Registration {
        name,
        description: leaked(format!("{name}: {description}")),
        stream: stream.map_or(name, leaked),
        construct: Box::leak(Box::new(construct)),
    })
}

fn take(
    declared: &[(&'static str, Declared)],
    given: &mut Settings,
) -> Result<Vec<(&'static str, Taken)>, SettingError> {
    let one = |(key, value): &(&'static str, Declared)| {
        let taken = match value {
            Declared::Number(default, low, high) => Taken::Number(given.number(key, *default, *low, *high)?),
            Declared::Integer(default, low, high) => Taken::Integer(given.integer(key, *default, *low, *high)?),
            Declared::Word(words) => {
                let list: Vec<&str> = words.iter().map(String::as_str).collect();
                Taken::Word(words[given.word(key, &list)?].clone())
            }
        };
        Ok((*key, taken))
    };
    declared.iter().map(one).collect()
}

/// A Python object as a controller.
struct Bridge {
    /// `None` if its construction has failed.
    object: Option<Py<PyAny>>,
    shared: Arc<SharedCtx>,
    failure: Option<PyErr>,
}

impl Bridge {
    fn new(class: &Py<PyType>, settings: &[(&'static str, Taken)], rng: ChaCha8Rng) -> Self {
        let built = Python::attach(|py| -> PyResult<Py<PyAny>> {
            let values = PyDict::new(py);
            for (key, value) in settings {
                match value {
                    Taken::Number(number) => values.set_item(key, number)?,
                    Taken::Integer(number) => values.set_item(key, number)?,
                    Taken::Word(word) => values.set_item(key, word)?,
                }
            }
            Ok(class.bind(py).call1((PyRng::new(rng), values))?.unbind())
        });
        let (object, failure) = match built {
            Ok(object) => (Some(object), None),
            Err(error) => (None, Some(error)),
        };
        Self { object, shared: Arc::default(), failure }
    }

    fn called(&self, observation: &Observation, ctx: &mut Ctx<'_>) -> PyResult<Command> {
        let Some(object) = &self.object else {
            return Err(PyRuntimeError::new_err("the controller could not be constructed"));
        };
        let (agent, agents) = (ctx.agent(), ctx.run_info().agents);
        Python::attach(|py| {
            let _deciding = Deciding::here(py)?;
            let shown = PyObservation(observation.clone());
            let lent = PyCtx(Arc::clone(&self.shared));
            let returned = self.shared.loan.lend(ctx, || object.bind(py).call_method1("decide", (shown, lent)))?;
            checked(&returned, agent, observation.tick, agents)
        })
    }
}

impl Controller for Bridge {
    fn decide(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        if self.failure.is_none() {
            match self.called(observation, ctx) {
                Ok(command) => return command,
                Err(error) => self.failure = Some(error),
            }
        }
        Command::keep(WakeCondition::at(Tick(u64::MAX)))
    }

    fn failure(&mut self) -> Option<Failure> {
        self.failure.take().map(|error| Box::new(error) as Failure)
    }
}
