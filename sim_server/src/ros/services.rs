//! The services and parameters of the server: what is asked becomes requests.
//!
//! Parameters are answered here at once; everything else waits in a queue until the run looks at it.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use msgs::parameters::{Named, Parameter, ParameterEvent, Parameters};
use msgs::ros::{Goal, Inbox, Outlet, RosError, StepsEvent, Tally, Workshop};
use msgs::service::{Ask, Service};
use msgs::simulation_interfaces::Result as Outcome;
use msgs::topics;
use ros2_client::Node;

use crate::control::{Request, Steps};
use crate::parameters;
use crate::scenario::Rtf;

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
    requests: VecDeque<Request>,
    /// The pace that was set last, if the run does not know of it yet.
    pace: Option<Rtf>,
    events: Outlet<ParameterEvent>,
    ignored: Tally,
}

/// The name of the node, with which those of its services begin.
const NODE: &str = "/sim_server";

impl Services {
    /// Offers the services.
    pub(super) fn new<T: From<Asked> + 'static>(
        node: &mut Node,
        workshop: &mut Workshop,
        inbox: &mut Inbox<T>,
        declared: Vec<Parameter>,
    ) -> Result<Self, RosError> {
        let mut offer = Offer { node, workshop, inbox };
        offer.service("get_simulator_features", Request::Features)?;
        offer.service("get_simulation_state", Request::State)?;
        offer.service("set_simulation_state", Request::SetState)?;
        offer.service("step_simulation", Request::Step)?;
        offer.service("reset_simulation", Request::Reset)?;
        offer.service("get_entities", Request::Entities)?;
        offer.service("get_entity_state", Request::EntityState)?;
        offer.service("get_entities_states", Request::EntitiesStates)?;
        offer.service("get_entity_info", Request::EntityInfo)?;
        offer.service("get_entity_bounds", Request::EntityBounds)?;
        offer.service("set_entity_state", Request::SetEntityState)?;
        offer.service("delete_entity", Request::Delete)?;
        offer.service("spawn_entity", Request::Spawn)?;
        let Offer { node, workshop, inbox } = offer;
        workshop.steps_action(node, &format!("{NODE}/simulate_steps"), inbox, |event| {
            T::from(match event {
                Ok(Some(StepsEvent::Goal(goal))) => {
                    Asked::Request(Box::new(Request::Steps(Box::new(WantedSteps(goal)))))
                }
                Ok(Some(StepsEvent::Cancel)) => Asked::Request(Box::new(Request::CancelSteps)),
                Ok(None) => Asked::Done,
                Err(reason) => Asked::Undecodable(reason),
            })
        })?;
        let mut parameters = Parameters::default();
        parameters.declare(declared);
        let parameters = Rc::new(RefCell::new(parameters));
        workshop.parameters(node, NODE, inbox, &parameters, check_pace, |set| {
            T::from(set.map_or_else(Asked::Undecodable, Asked::Set))
        })?;
        let events = workshop.outlet(node, &topics::parameter_events())?;
        let ignored = Tally::new("request ignored".to_owned());
        Ok(Services { requests: VecDeque::new(), pace: None, events, ignored })
    }

    /// Takes note of what has come in.
    pub(super) fn take_in(&mut self, node: &mut Node, asked: Asked) {
        match asked {
            Asked::Request(request) if self.requests.len() < REQUESTS_MAX => self.requests.push_back(*request),
            Asked::Request(_) => self.ignored.add(&"too many are waiting"),
            Asked::Set(set) if set.is_empty() => {}
            Asked::Set(set) => {
                let pace = set.iter().rfind(|named| named.name == parameters::RTF);
                if let Some(Ok(rtf)) = pace.map(|named| parameters::rtf(named.value.double_value)) {
                    self.pace = Some(rtf);
                }
                let event =
                    ParameterEvent { node: NODE.to_owned(), changed_parameters: set, ..ParameterEvent::default() };
                self.events.publish(node, &event);
            }
            Asked::Done => {}
            Asked::Undecodable(reason) => self.ignored.add(&reason),
        }
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
    if named.name == parameters::RTF { parameters::rtf(named.value.double_value).map(drop) } else { Ok(()) }
}

/// Where services are offered.
struct Offer<'a, T> {
    node: &'a mut Node,
    workshop: &'a mut Workshop,
    inbox: &'a mut Inbox<T>,
}

impl<T: From<Asked> + 'static> Offer<'_, T> {
    fn service<S: Service + 'static>(&mut self, name: &str, request: fn(Ask<S>) -> Request) -> Result<(), RosError> {
        self.workshop.service(self.node, &format!("{NODE}/{name}"), self.inbox, move |ask| {
            T::from(ask.map_or_else(Asked::Undecodable, |ask| Asked::Request(Box::new(request(ask)))))
        })
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
