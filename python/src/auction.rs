//! The auction of goals, `agent_node::controllers::auction`, for controllers in Python.

use agent_node::controllers::auction::{Auction, AuctionParams};
use agent_node::controllers::settings::{SettingError, Settings};
use agent_node::observation::Contact;
use msgs::ids::Tick;
use protocol::message_type::MessageType;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use voxels::{Cell, Extent};

use crate::command::PyCommand;
use crate::ctx::{CellIndices, PyCtx, cell_of, finite, indices_of};
use crate::error::bad_input;
use crate::observation::PyObservation;

/// The claims of goals that an agent knows. A controller makes one at its first decision and keeps
/// it, gives it each observation, and adds its claims to commands.
#[pyclass(name = "Auction", module = "maes")]
pub(crate) struct PyAuction {
    auction: Auction,
    extent: Extent,
    agents: u32,
    now: Tick,
    contacts: Vec<Contact>,
}

impl PyAuction {
    fn cell(&self, name: &str, cell: CellIndices) -> PyResult<Cell> {
        let cell = cell_of(cell);
        if self.extent.contains(cell) {
            return Ok(cell);
        }
        let [x, y, z] = self.extent.size();
        Err(PyValueError::new_err(format!(
            "{name} = ({}, {}, {}): expected a cell of the map, which has ({x}, {y}, {z}) cells",
            cell.x, cell.y, cell.z
        )))
    }
}

fn length_m(name: &str, value: f64) -> PyResult<f64> {
    if finite(name, value)? >= 0.0 {
        return Ok(value);
    }
    Err(PyValueError::new_err(format!("{name} = {value}: expected a length from 0")))
}

#[pymethods]
impl PyAuction {
    /// An auction without claims; the parameters are the settings of `dsvp-auction` with their
    /// defaults: `spread_m`, `discount`, `conflict_penalty_m`, `detour`, `cruise_speed_m_s` and
    /// `lease_s`.
    #[new]
    #[pyo3(signature = (ctx, **params))]
    fn new(ctx: &PyCtx, params: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let texts = params.into_iter().flatten().map(|(key, value)| Ok(format!("{key}={value}")));
        let params = params_of(&texts.collect::<PyResult<Vec<String>>>()?).map_err(bad_input)?;
        ctx.with(|ctx| {
            let run_info = ctx.run_info();
            Self {
                auction: Auction::new(params, &run_info.bodies, ctx.agent(), run_info.extent),
                extent: run_info.extent,
                agents: run_info.agents,
                now: ctx.tick(),
                contacts: Vec::new(),
            }
        })
    }

    /// Merges the claims that have arrived, and drops those whose lease has ended. What the other
    /// methods say holds for the tick and the contacts of this observation.
    fn receive(&mut self, observation: &PyObservation) {
        let observation = &observation.0;
        self.now = observation.tick;
        self.contacts.clone_from(&observation.contacts);
        self.auction.receive(&observation.messages, self.now, self.agents);
    }

    /// Claims a goal; the bid is the length of the path to it, metres. The claim before is
    /// replaced.
    fn claim(&mut self, cell: CellIndices, path_m: f64) -> PyResult<()> {
        let (cell, path_m) = (self.cell("cell", cell)?, length_m("path_m", path_m)?);
        self.auction.claim(cell, path_m, self.now);
        Ok(())
    }

    /// Withdraws the own claim.
    fn withdraw(&mut self) {
        self.auction.withdraw();
    }

    /// Whether another agent has a better bid on a goal near the claimed one: then withdraw, and
    /// choose again.
    #[getter]
    fn is_outbid(&self) -> bool {
        self.auction.is_outbid(self.now)
    }

    /// All known claims, the own one included, by agent: cell, length of the path in metres, and
    /// the tick in which the lease ends.
    #[getter]
    fn claims(&self) -> Vec<(u32, CellIndices, f64, u64)> {
        let claims = self.auction.claims();
        claims.map(|(agent, claim)| (agent.0, indices_of(claim.cell), claim.path_m, claim.ends.0)).collect()
    }

    /// The factor on the utility of a goal at the end of a path of this length, from 0 to 1: 1 if
    /// no other claim is near.
    fn utility_factor(&self, cell: CellIndices, path_m: f64) -> PyResult<f64> {
        let (cell, path_m) = (self.cell("cell", cell)?, length_m("path_m", path_m)?);
        Ok(self.auction.utility_factor(cell, path_m, self.now))
    }

    /// The cost to add to the length of the path to a frontier, metres: 0 if no claim is near and
    /// no other agent will reach it sooner.
    fn penalty_m(&self, cell: CellIndices, path_m: f64) -> PyResult<f64> {
        let (cell, path_m) = (self.cell("cell", cell)?, length_m("path_m", path_m)?);
        Ok(self.auction.penalty_m(cell, path_m, &self.contacts, self.now))
    }

    /// The command with all known claims as a message to the agents in contact, if there are any.
    fn add_to(&self, command: &PyCommand) -> PyCommand {
        if self.contacts.is_empty() {
            return command.clone();
        }
        PyCommand(command.0.clone().with_message(None, MessageType::Claims.number(), self.auction.encode()))
    }
}

fn params_of(texts: &[String]) -> Result<AuctionParams, SettingError> {
    let mut settings = Settings::parse(texts)?;
    let params = AuctionParams::from_settings(&mut settings)?;
    settings.finish()?;
    Ok(params)
}
