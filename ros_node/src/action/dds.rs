//! The action over DDS, with the action server of the ROS client.

use std::cell::RefCell;
use std::pin::pin;
use std::rc::Rc;

use msgs::service::Reply;
use msgs::simulation_interfaces::{SimulateStepsFeedback, SimulateStepsGoal, SimulateStepsResult};
use ros2_client::action::{ActionServer, ActionServerQosPolicies, GoalId};
use ros2_client::action_msgs::GoalStatusArray;
use ros2_client::{ActionTypeName, CreateError, Name, Node, RmwRequestId};

use super::{ActionState, FEEDBACK_QOS, STATUS_QOS, StepsEvent, Topics};
use crate::dds::{qos_profile, topic_name};
use crate::services::{CallerDiscovery, Wire, mapping, qos};
use crate::{EndpointFactory, Inbox, RosError, ThrottledWarning};

type Steps = ActionServer<Wire<SimulateStepsGoal>, Wire<SimulateStepsResult>, Wire<SimulateStepsFeedback>>;

/// The server, and the callers of its services that are discovered.
struct Server {
    steps: RefCell<Steps>,
    goal_callers: CallerDiscovery,
    cancel_callers: CallerDiscovery,
    result_callers: CallerDiscovery,
    feedback_readers: CallerDiscovery,
    unsent: RefCell<ThrottledWarning>,
}

impl EndpointFactory {
    /// Offers the action.
    pub(super) fn dds_steps_action<T>(
        &mut self,
        node: &mut Node,
        name: &str,
        inbox: &mut Inbox<T>,
        convert: Rc<impl Fn(Result<Option<StepsEvent>, String>) -> T + 'static>,
    ) -> Result<(), RosError> {
        for _endpoint in 0..8 {
            self.pause();
        }
        let failed = |source| RosError::Endpoint {
            topic: format!("{name} [simulation_interfaces/action/SimulateSteps]"),
            source,
        };
        let parsed =
            Name::parse(name).map_err(|error| failed(CreateError::BadParameter { reason: error.to_string() }))?;
        let policies = ActionServerQosPolicies {
            goal_service: qos(),
            result_service: qos(),
            cancel_service: qos(),
            feedback_publisher: qos_profile(&FEEDBACK_QOS),
            status_publisher: qos_profile(&STATUS_QOS),
        };
        let kind = ActionTypeName::new("simulation_interfaces", "SimulateSteps");
        let steps: Steps = node.create_action_server(mapping(), &parsed, &kind, policies).map_err(failed)?;
        let participant = self.context.participant();
        let callers = |service| CallerDiscovery::new(&participant, &format!("{name}/_action/{service}"));
        let server = Rc::new(Server {
            steps: RefCell::new(steps),
            goal_callers: callers("send_goal"),
            cancel_callers: callers("cancel_goal"),
            result_callers: callers("get_result"),
            feedback_readers: CallerDiscovery::of_topic(&participant, topic_name(&format!("{name}/_action/feedback"))),
            unsent: RefCell::new(ThrottledWarning::new(format!("{name}: not sent"))),
        });
        let shared = ActionState::new(name, Box::new(Published(Rc::clone(&server))));
        let (of_goals, goals, made) = (Rc::clone(&server), Rc::clone(&shared), Rc::clone(&convert));
        inbox.add(Box::new(move |context| {
            let taken = pin!(of_goals.steps.borrow_mut().goal_server().async_receive_request()).poll(context);
            taken.map(|taken| {
                made(taken.map_err(|error| error.to_string()).map(|(id, request)| {
                    let reply = reply(&of_goals, id, |server, id, response| {
                        server.goal_callers.wait_for(&id);
                        server.feedback_readers.wait_for(&id);
                        server.steps.borrow().send_goal_response(id, response).map_err(|error| error.to_string())
                    });
                    ActionState::accept(&goals, request, reply)
                }))
            })
        }));
        let (of_cancels, cancels, made) = (Rc::clone(&server), Rc::clone(&shared), Rc::clone(&convert));
        inbox.add(Box::new(move |context| {
            let taken = pin!(of_cancels.steps.borrow_mut().cancel_server().async_receive_request()).poll(context);
            taken.map(|taken| {
                made(taken.map_err(|error| error.to_string()).map(|(id, request)| {
                    let reply = reply(&of_cancels, id, |server, id, response| {
                        server.cancel_callers.wait_for(&id);
                        server.steps.borrow().send_cancel_response(id, response).map_err(|error| error.to_string())
                    });
                    cancels.borrow_mut().cancel(&request, reply)
                }))
            })
        }));
        inbox.add(Box::new(move |context| {
            let taken = pin!(server.steps.borrow_mut().result_server().async_receive_request()).poll(context);
            taken.map(|taken| {
                convert(taken.map_err(|error| error.to_string()).map(|(id, request)| {
                    let reply = reply(&server, id, |server, id, response| {
                        server.result_callers.wait_for(&id);
                        server.steps.borrow().send_result(id, response).map_err(|error| error.to_string())
                    });
                    shared.borrow_mut().result_wanted(&request, reply);
                    None
                }))
            })
        }));
        Ok(())
    }
}

/// The way back to a caller; an answer that cannot be sent is counted.
fn reply<R: 'static>(
    server: &Rc<Server>,
    id: RmwRequestId,
    send: impl FnOnce(&Server, RmwRequestId, R) -> Result<(), String> + 'static,
) -> Reply<R> {
    let server = Rc::clone(server);
    Reply::new(move |response| {
        if let Err(reason) = send(&server, id, response) {
            server.unsent.borrow_mut().add(&reason);
        }
    })
}

struct Published(Rc<Server>);

impl Topics for Published {
    fn feedback(&self, goal: GoalId, feedback: SimulateStepsFeedback) -> Result<(), String> {
        self.0.steps.borrow().send_feedback(goal, Wire(feedback)).map_err(|error| error.to_string())
    }

    fn status(&self, status: GoalStatusArray) -> Result<(), String> {
        self.0.steps.borrow().send_goal_statuses(status).map_err(|error| error.to_string())
    }
}
