//! The services and parameters of the server, and of a replay: what is asked becomes requests.
//!
//! Parameters are answered here at once; everything else waits in a queue until the run looks at it.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use msgs::parameters::{Named, Parameter, ParameterEvent, Parameters};
use msgs::service::{Ask, Service};
use msgs::simulation_interfaces::Result as Outcome;
use msgs::topics;
use ros_node::{Goal, Inbox, Outlet, RosError, StepsEvent, Tally, Workshop};
use ros2_client::Node;

use crate::control::{Request, Steps};
use simulation::parameters;
use simulation::scenario::Rtf;

/// Requests that wait at the most; one more is not answered.
const REQUESTS_MAX: usize = 256;

/// What has come in on a service.
pub(super) enum Asked {
    /// Something for the run.
    Request(Box<Request>),
    /// Parameters were set.
    Set(Vec<Named>),
    /// It needs nothing more.
    Done,
    /// Bytes that are no request.
    Undecodable(String),
}

/// What waits for the run.
pub(super) struct Services {
    /// The name of the node.
    name: &'static str,
    parameters: Rc<RefCell<Parameters>>,
    requests: VecDeque<Request>,
    /// The pace that was set last, if the run does not know of it yet.
    pace: Option<Rtf>,
    events: Outlet<ParameterEvent>,
    ignored: Tally,
    were_asked: bool,
}

impl Services {
    /// Offers the services of a run.
    pub(super) fn of_run<T: From<Asked> + 'static>(
        node: &mut Node,
        workshop: &mut Workshop,
        inbox: &mut Inbox<T>,
        declared: Vec<Parameter>,
    ) -> Result<Self, RosError> {
        let mut offer = Offer { name: "/sim_server", node, workshop, inbox };
        offer.time()?;
        offer.service("reset_simulation", Request::Reset)?;
        offer.service("get_entities", Request::Entities)?;
        offer.service("get_entity_state", Request::EntityState)?;
        offer.service("get_entities_states", Request::EntitiesStates)?;
        offer.service("get_entity_info", Request::EntityInfo)?;
        offer.service("get_entity_bounds", Request::EntityBounds)?;
        offer.service("set_entity_state", Request::SetEntityState)?;
        offer.service("delete_entity", Request::Delete)?;
        offer.service("spawn_entity", Request::Spawn)?;
        offer.parameters(declared)
    }

    /// Offers those of a recording that is played: its time alone can be controlled.
    pub(super) fn of_replay<T: From<Asked> + 'static>(
        node: &mut Node,
        workshop: &mut Workshop,
        inbox: &mut Inbox<T>,
        declared: Vec<Parameter>,
    ) -> Result<Self, RosError> {
        let mut offer = Offer { name: "/replay", node, workshop, inbox };
        offer.time()?;
        offer.parameters(declared)
    }

    /// Takes note of what has come in.
    pub(super) fn take_in(&mut self, node: &mut Node, asked: Asked) {
        self.were_asked = true;
        match asked {
            Asked::Request(request) if self.requests.len() < REQUESTS_MAX => self.requests.push_back(*request),
            Asked::Request(_) => self.ignored.add(&"too many are waiting"),
            Asked::Set(set) if set.is_empty() => {}
            Asked::Set(set) => {
                let pace = set.iter().rfind(|named| parameters::is_pace(&named.name));
                if let Some(Ok(rtf)) = pace.map(|named| parameters::pace(&named.name, named.value.double_value)) {
                    self.pace = Some(rtf);
                }
                self.tell_set(node, set);
            }
            Asked::Done => {}
            Asked::Undecodable(reason) => self.ignored.add(&reason),
        }
    }

    /// The pace is this one, whoever has set it.
    pub(super) fn tell_pace(&mut self, node: &mut Node, rtf: Rtf) {
        let named = Named { name: parameters::RTF.to_owned(), value: parameters::value_of(rtf).into() };
        let is_known = self.parameters.borrow().values(std::slice::from_ref(&named.name)) == [named.value.clone()];
        if !is_known && self.parameters.borrow_mut().set(&named).is_ok() {
            self.tell_set(node, vec![named]);
        }
    }

    fn tell_set(&mut self, node: &mut Node, changed_parameters: Vec<Named>) {
        let event = ParameterEvent { node: self.name.to_owned(), changed_parameters, ..ParameterEvent::default() };
        self.events.publish(node, &event);
    }

    /// Whether anybody has ever asked for anything, and so may wait for an answer.
    pub(super) fn were_asked(&self) -> bool {
        self.were_asked
    }

    /// Whether more may come in. What does not stays with the middleware, which keeps the latest ones of each service.
    pub(super) fn has_room(&self) -> bool {
        self.requests.len() < REQUESTS_MAX / 2
    }

    /// The next request for the run.
    pub(super) fn next(&mut self) -> Option<Request> {
        self.pace.take().map(Request::Rtf).or_else(|| self.requests.pop_front())
    }
}

/// A pace that there is not is refused, though it lies in the range.
fn check_pace(named: &Named) -> Result<(), String> {
    if parameters::is_pace(&named.name) {
        parameters::pace(&named.name, named.value.double_value).map(drop)
    } else {
        Ok(())
    }
}

/// Where services are offered.
struct Offer<'a, T> {
    /// The name of the node, with which those of its services begin.
    name: &'static str,
    node: &'a mut Node,
    workshop: &'a mut Workshop,
    inbox: &'a mut Inbox<T>,
}

impl<T: From<Asked> + 'static> Offer<'_, T> {
    fn service<S: Service + 'static>(&mut self, name: &str, request: fn(Ask<S>) -> Request) -> Result<(), RosError> {
        self.workshop.service(self.node, &format!("{}/{name}", self.name), self.inbox, move |ask| {
            T::from(ask.map_or_else(Asked::Undecodable, |ask| Asked::Request(Box::new(request(ask)))))
        })
    }

    /// The services that are about time alone, and the action.
    fn time(&mut self) -> Result<(), RosError> {
        self.service("get_simulator_features", Request::Features)?;
        self.service("get_simulation_state", Request::State)?;
        self.service("set_simulation_state", Request::SetState)?;
        self.service("step_simulation", Request::Step)?;
        self.workshop.steps_action(self.node, &format!("{}/simulate_steps", self.name), self.inbox, |event| {
            T::from(match event {
                Ok(Some(StepsEvent::Goal(goal))) => {
                    Asked::Request(Box::new(Request::Steps(Box::new(WantedSteps(goal)))))
                }
                Ok(Some(StepsEvent::Cancel)) => Asked::Request(Box::new(Request::CancelSteps)),
                Ok(None) => Asked::Done,
                Err(reason) => Asked::Undecodable(reason),
            })
        })
    }

    /// The parameters, after everything else.
    fn parameters(self, declared: Vec<Parameter>) -> Result<Services, RosError> {
        let Self { name, node, workshop, inbox } = self;
        let mut parameters = Parameters::default();
        parameters.declare(declared);
        let parameters = Rc::new(RefCell::new(parameters));
        workshop.parameters(node, name, inbox, &parameters, check_pace, |set| {
            T::from(set.map_or_else(Asked::Undecodable, Asked::Set))
        })?;
        let events = workshop.outlet(node, &topics::parameter_events())?;
        let ignored = Tally::new("request ignored".to_owned());
        Ok(Services { name, parameters, requests: VecDeque::new(), pace: None, events, ignored, were_asked: false })
    }
}

/// A goal of the action.
struct WantedSteps(Goal);

impl Steps for WantedSteps {
    fn steps(&self) -> u64 {
        self.0.steps
    }

    fn tell(&self, done: u64, left: u64) {
        self.0.tell(done, left);
    }

    fn end(self: Box<Self>, outcome: Outcome) {
        self.0.end(outcome);
    }
}
