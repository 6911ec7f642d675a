//! The services and parameters of the server and of a replay, converted into [`Request`]s.
//!
//! DeclaredParameter services are answered at once; all other requests are queued for the run loop.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use msgs::parameters::{DeclaredParameter, Parameters};
use msgs::rcl_interfaces::{Parameter, ParameterEvent};
use msgs::service::{Ask, Service};
use msgs::simulation_interfaces::Result as Outcome;
use msgs::topics;
use ros_node::{EndpointFactory, Goal, Inbox, Node, Publisher, RosError, StepsEvent, ThrottledWarning};

use simulation::parameters;
use simulation::scenario::Rtf;
use transport::control::{Request, Steps};

/// Maximum queued requests; a further one is not answered.
const REQUESTS_MAX: usize = 256;

/// An event on a service.
pub(super) enum ServiceEvent {
    /// A request for the run.
    Request(Box<Request>),
    Set(Vec<Parameter>),
    /// A request that was answered at once.
    Answered,
    /// Undecodable bytes.
    Undecodable(String),
}

/// The services with their queued requests.
pub(super) struct Services {
    /// Name of the node.
    name: &'static str,
    parameters: Rc<RefCell<Parameters>>,
    requests: VecDeque<Request>,
    /// The real-time factor that was set last, until the run takes it.
    rtf: Option<Rtf>,
    events: Publisher<ParameterEvent>,
    ignored: ThrottledWarning,
    was_called: bool,
}

impl Services {
    /// Offers the services of a run.
    pub(super) fn of_run<T: From<ServiceEvent> + 'static>(
        node: &mut Node,
        endpoints: &mut EndpointFactory,
        inbox: &mut Inbox<T>,
        declared: Vec<DeclaredParameter>,
    ) -> Result<Self, RosError> {
        let mut offer = ServiceOffer { name: "/sim_server", node, endpoints, inbox };
        offer.time_control()?;
        offer.service("reset_simulation", Request::Reset)?;
        offer.service("get_entities", Request::Entities)?;
        offer.service("get_entity_state", Request::EntityState)?;
        offer.service("get_entities_states", Request::EntitiesStates)?;
        offer.service("get_entity_info", Request::EntityInfo)?;
        offer.service("get_entity_bounds", Request::EntityBounds)?;
        offer.service("set_entity_state", Request::SetEntityState)?;
        offer.service("delete_entity", Request::Delete)?;
        offer.service("spawn_entity", Request::Spawn)?;
        offer.service("change_map", Request::ChangeMap)?;
        offer.parameters(declared)
    }

    /// Offers the services of a replay, which control time only.
    pub(super) fn of_replay<T: From<ServiceEvent> + 'static>(
        node: &mut Node,
        endpoints: &mut EndpointFactory,
        inbox: &mut Inbox<T>,
        declared: Vec<DeclaredParameter>,
    ) -> Result<Self, RosError> {
        let mut offer = ServiceOffer { name: "/replay", node, endpoints, inbox };
        offer.time_control()?;
        offer.parameters(declared)
    }

    /// Handles an event.
    pub(super) fn receive(&mut self, node: &mut Node, event: ServiceEvent) {
        self.was_called = true;
        match event {
            ServiceEvent::Request(request) if self.requests.len() < REQUESTS_MAX => self.requests.push_back(*request),
            ServiceEvent::Request(_) => self.ignored.add(&"too many requests are waiting"),
            ServiceEvent::Set(set) if set.is_empty() => {}
            ServiceEvent::Set(set) => {
                let rtf = set.iter().rfind(|named| parameters::is_pace(&named.name));
                if let Some(Ok(rtf)) = rtf.map(|named| parameters::pace(&named.name, named.value.double_value)) {
                    self.rtf = Some(rtf);
                }
                self.publish_event(node, set);
            }
            ServiceEvent::Answered => {}
            ServiceEvent::Undecodable(reason) => self.ignored.add(&reason),
        }
    }

    /// Sets the parameter of the real-time factor, whatever has changed it.
    pub(super) fn set_rtf(&mut self, node: &mut Node, rtf: Rtf) {
        let named = Parameter { name: parameters::RTF.to_owned(), value: parameters::value_of(rtf).into() };
        let is_known = self.parameters.borrow().values(std::slice::from_ref(&named.name)) == [named.value.clone()];
        if !is_known && self.parameters.borrow_mut().set(&named).is_ok() {
            self.publish_event(node, vec![named]);
        }
    }

    fn publish_event(&mut self, node: &mut Node, changed_parameters: Vec<Parameter>) {
        let event = ParameterEvent { node: self.name.to_owned(), changed_parameters, ..ParameterEvent::default() };
        self.events.publish(node, &event);
    }

    /// Whether a service was ever called, so that a caller may wait for a response.
    pub(super) fn was_called(&self) -> bool {
        self.was_called
    }

    /// Whether the queue has room. Requests beyond it stay with the middleware, which keeps the
    /// latest ones per service.
    pub(super) fn has_room(&self) -> bool {
        self.requests.len() < REQUESTS_MAX / 2
    }

    pub(super) fn next(&mut self) -> Option<Request> {
        self.rtf.take().map(Request::Rtf).or_else(|| self.requests.pop_front())
    }
}

/// Refuses a real-time factor that is in range but not legal.
fn check_rtf(named: &Parameter) -> Result<(), String> {
    if parameters::is_pace(&named.name) {
        parameters::pace(&named.name, named.value.double_value).map(drop)
    } else {
        Ok(())
    }
}

/// The node on which services are offered.
struct ServiceOffer<'a, T> {
    /// Name of the node, the prefix of its service names.
    name: &'static str,
    node: &'a mut Node,
    endpoints: &'a mut EndpointFactory,
    inbox: &'a mut Inbox<T>,
}

impl<T: From<ServiceEvent> + 'static> ServiceOffer<'_, T> {
    fn service<S: Service + 'static>(&mut self, name: &str, request: fn(Ask<S>) -> Request) -> Result<(), RosError> {
        self.endpoints.service(self.node, &format!("{}/{name}", self.name), self.inbox, move |ask| {
            T::from(ask.map_or_else(ServiceEvent::Undecodable, |ask| ServiceEvent::Request(Box::new(request(ask)))))
        })
    }

    /// The services that control time, and the action.
    fn time_control(&mut self) -> Result<(), RosError> {
        self.service("get_simulator_features", Request::Features)?;
        self.service("get_simulation_state", Request::State)?;
        self.service("set_simulation_state", Request::SetState)?;
        self.service("step_simulation", Request::Step)?;
        self.endpoints.steps_action(self.node, &format!("{}/simulate_steps", self.name), self.inbox, |event| {
            T::from(match event {
                Ok(Some(StepsEvent::Goal(goal))) => {
                    ServiceEvent::Request(Box::new(Request::Steps(Box::new(ActionSteps(goal)))))
                }
                Ok(Some(StepsEvent::Cancel)) => ServiceEvent::Request(Box::new(Request::CancelSteps)),
                Ok(None) => ServiceEvent::Answered,
                Err(reason) => ServiceEvent::Undecodable(reason),
            })
        })
    }

    /// The parameters, which come last.
    fn parameters(self, declared: Vec<DeclaredParameter>) -> Result<Services, RosError> {
        let Self { name, node, endpoints, inbox } = self;
        let mut parameters = Parameters::default();
        parameters.declare(declared);
        let parameters = Rc::new(RefCell::new(parameters));
        endpoints.parameters(node, name, inbox, &parameters, check_rtf, |set| {
            T::from(set.map_or_else(ServiceEvent::Undecodable, ServiceEvent::Set))
        })?;
        let events = endpoints.publisher(node, &topics::parameter_events())?;
        let ignored = ThrottledWarning::new("request ignored".to_owned());
        Ok(Services { name, parameters, requests: VecDeque::new(), rtf: None, events, ignored, was_called: false })
    }
}

/// A goal of the action `SimulateSteps`.
struct ActionSteps(Goal);

impl Steps for ActionSteps {
    fn steps(&self) -> u64 {
        self.0.steps
    }

    fn feedback(&self, done: u64, left: u64) {
        self.0.feedback(done, left);
    }

    fn finish(self: Box<Self>, outcome: Outcome) {
        self.0.finish(outcome);
    }
}
