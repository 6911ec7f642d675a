//! The server of the action `SimulateSteps`, which executes one goal at a time.
//!
//! An action is three services and two topics. The inbox yields each accepted goal; its executor
//! reports feedback and the result. A goal that arrives while another is executed is rejected. The
//! results of the last [`RESULTS_MAX`] goals are kept for late result requests.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use ros2_client::action::{
    ActionServer, ActionServerQosPolicies, CancelGoalRequest, CancelGoalResponse, FeedbackMessage, GetResultRequest,
    GetResultResponse, GoalId, GoalInfo, GoalStatusEnum, SendGoalRequest, SendGoalResponse,
};
use ros2_client::action_msgs::{CancelGoalResponseEnum, GoalStatus, GoalStatusArray};
use ros2_client::builtin_interfaces::Time;
use ros2_client::{ActionTypeName, CreateError, Name, Node, RmwRequestId};
use serde::Deserialize;

use super::services::{CallerDiscovery, Wire, mapping, qos};
use super::{EndpointFactory, Inbox, RosError, ThrottledWarning, qos_profile};
use msgs::cdr;
use msgs::simulation_interfaces::{Result as Outcome, ResultResponse, StepRequest, StepsFeedback};
use msgs::topics::Qos;

type Steps = ActionServer<Wire<StepRequest>, Wire<ResultResponse>, Wire<StepsFeedback>>;

/// Maximum number of results kept, and of callers waiting for one.
const RESULTS_MAX: usize = 16;

/// An item that the action adds to the inbox.
pub enum StepsEvent {
    /// A goal was accepted.
    Goal(Goal),
    /// The goal under execution was cancelled.
    Cancel,
}

/// An accepted goal.
pub struct Goal {
    /// Number of ticks to simulate.
    pub steps: u64,
    shared: Rc<RefCell<Shared>>,
    id: GoalId,
}

impl Goal {
    /// Publishes feedback.
    pub fn feedback(&self, done: u64, left: u64) {
        self.shared.borrow_mut().feedback(self.id, done, left);
    }

    /// Ends the goal with its result.
    pub fn finish(self, outcome: Outcome) {
        self.shared.borrow_mut().end(self.id, outcome);
    }
}

struct Shared {
    server: Steps,
    /// The goal under execution, and whether it was cancelled.
    active: Option<(GoalId, bool)>,
    ended: VecDeque<(GoalId, GoalStatusEnum, Outcome)>,
    waiting: VecDeque<(GoalId, RmwRequestId)>,
    /// For the responses to goals, to cancellations and to result requests.
    callers: [CallerDiscovery; 3],
    feedback_readers: CallerDiscovery,
    unsent: ThrottledWarning,
}

/// The goal of a cancel request, whose fields are private to the ROS client; all zeros mean any
/// goal.
#[derive(Deserialize)]
struct Cancelled {
    id: [u8; 16],
}

impl EndpointFactory {
    /// Offers the action.
    ///
    /// # Errors
    /// If the middleware refuses it.
    pub fn steps_action<T>(
        &mut self,
        node: &mut Node,
        name: &str,
        inbox: &mut Inbox<T>,
        convert: impl Fn(Result<Option<StepsEvent>, String>) -> T + 'static,
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
            feedback_publisher: qos_profile(&Qos::reliable(64)),
            status_publisher: qos_profile(&Qos::latched(1)),
        };
        let kind = ActionTypeName::new("simulation_interfaces", "SimulateSteps");
        let server: Steps = node.create_action_server(mapping(), &parsed, &kind, policies).map_err(failed)?;
        let shared = Rc::new(RefCell::new(Shared {
            server,
            active: None,
            ended: VecDeque::new(),
            waiting: VecDeque::new(),
            callers: ["send_goal", "cancel_goal", "get_result"]
                .map(|service| CallerDiscovery::new(&self.participant, &format!("{name}/_action/{service}"))),
            feedback_readers: CallerDiscovery::of_topic(&self.participant, format!("rt{name}/_action/feedback")),
            unsent: ThrottledWarning::new(format!("{name}: not sent")),
        }));
        let convert = Rc::new(convert);
        let (of_goals, made) = (Rc::clone(&shared), Rc::clone(&convert));
        inbox.add(Box::new(move |context| {
            let taken =
                std::pin::pin!(of_goals.borrow_mut().server.goal_server().async_receive_request()).poll(context);
            taken.map(|taken| {
                made(taken.map_err(|error| error.to_string()).map(|(id, goal)| accept(&of_goals, id, goal)))
            })
        }));
        let (of_cancels, made) = (Rc::clone(&shared), Rc::clone(&convert));
        inbox.add(Box::new(move |context| {
            let mut shared = of_cancels.borrow_mut();
            let taken = std::pin::pin!(shared.server.cancel_server().async_receive_request()).poll(context);
            taken.map(|taken| {
                made(taken.map_err(|error| error.to_string()).map(|(id, request)| shared.cancel(id, &request)))
            })
        }));
        inbox.add(Box::new(move |context| {
            let mut shared = shared.borrow_mut();
            let taken = std::pin::pin!(shared.server.result_server().async_receive_request()).poll(context);
            taken.map(|taken| {
                convert(taken.map_err(|error| error.to_string()).map(|(id, request)| {
                    shared.result_wanted(id, &request);
                    None
                }))
            })
        }));
        Ok(())
    }
}

fn accept(
    shared: &Rc<RefCell<Shared>>,
    id: RmwRequestId,
    request: SendGoalRequest<Wire<StepRequest>>,
) -> Option<StepsEvent> {
    let mut inner = shared.borrow_mut();
    let is_new = inner.active.is_none() && inner.ended.iter().all(|(known, ..)| *known != request.goal_id);
    let response = SendGoalResponse { accepted: is_new, stamp: Time::ZERO };
    inner.callers[0].wait_for(&id);
    inner.feedback_readers.wait_for(&id);
    if let Err(error) = inner.server.send_goal_response(id, response) {
        inner.unsent.add(&error);
    }
    if !is_new {
        return None;
    }
    inner.active = Some((request.goal_id, false));
    inner.publish_status();
    drop(inner);
    let Wire(StepRequest { steps }) = request.goal;
    Some(StepsEvent::Goal(Goal { steps, shared: Rc::clone(shared), id: request.goal_id }))
}

impl Shared {
    fn feedback(&mut self, goal_id: GoalId, completed_steps: u64, remaining_steps: u64) {
        let feedback = Wire(StepsFeedback { completed_steps, remaining_steps });
        let FeedbackMessage { goal_id, feedback } = FeedbackMessage { goal_id, feedback };
        if let Err(error) = self.server.send_feedback(goal_id, feedback) {
            self.unsent.add(&error);
        }
    }

    fn end(&mut self, id: GoalId, outcome: Outcome) {
        let was_cancelled = self.active.take().is_some_and(|(_, is_cancelled)| is_cancelled);
        let status = match (outcome.is_ok(), was_cancelled) {
            (true, _) => GoalStatusEnum::Succeeded,
            (false, true) => GoalStatusEnum::Canceled,
            (false, false) => GoalStatusEnum::Aborted,
        };
        self.ended.push_back((id, status, outcome));
        if self.ended.len() > RESULTS_MAX {
            self.ended.pop_front();
        }
        self.publish_status();
        let (ready, waiting): (VecDeque<_>, _) =
            std::mem::take(&mut self.waiting).into_iter().partition(|(goal, _)| *goal == id);
        self.waiting = waiting;
        for (goal, request) in ready {
            self.send_result(goal, request);
        }
    }

    fn cancel(&mut self, id: RmwRequestId, request: &CancelGoalRequest) -> Option<StepsEvent> {
        let wanted = cdr::decode::<Cancelled>(cdr::encode(request).get(..20)?).ok()?;
        let active = self.active.filter(|(goal, _)| wanted.id == [0; 16] || wanted.id == *goal.uuid.as_bytes());
        let response = CancelGoalResponse {
            return_code: if active.is_some() {
                CancelGoalResponseEnum::None
            } else {
                CancelGoalResponseEnum::UnknownGoal
            },
            goals_canceling: active
                .iter()
                .map(|(goal_id, _)| GoalInfo { goal_id: *goal_id, stamp: Time::ZERO })
                .collect(),
        };
        self.callers[1].wait_for(&id);
        if let Err(error) = self.server.send_cancel_response(id, response) {
            self.unsent.add(&error);
        }
        let (goal, _) = active?;
        self.active = Some((goal, true));
        self.publish_status();
        Some(StepsEvent::Cancel)
    }

    fn result_wanted(&mut self, id: RmwRequestId, request: &GetResultRequest) {
        let is_active = self.active.is_some_and(|(goal, _)| goal == request.goal_id);
        if is_active && self.waiting.len() < RESULTS_MAX {
            self.waiting.push_back((request.goal_id, id));
        } else {
            self.send_result(request.goal_id, id);
        }
    }

    /// Responds with the result of a finished goal, or that the goal is unknown.
    fn send_result(&mut self, goal: GoalId, request: RmwRequestId) {
        let ended = self.ended.iter().find(|(known, ..)| *known == goal);
        let unknown = || (GoalStatusEnum::Unknown, Outcome::failure(Outcome::NOT_FOUND, "no such goal"));
        let (status, result) = ended.map_or_else(unknown, |(_, status, outcome)| (*status, outcome.clone()));
        let response = GetResultResponse { status, result: Wire(ResultResponse { result }) };
        self.callers[2].wait_for(&request);
        if let Err(error) = self.server.send_result(request, response) {
            self.unsent.add(&error);
        }
    }

    fn publish_status(&mut self) {
        let status = |goal_id, status| GoalStatus { goal_info: GoalInfo { goal_id, stamp: Time::ZERO }, status };
        let mut status_list: Vec<_> = self.ended.iter().map(|(goal, ended, _)| status(*goal, *ended)).collect();
        status_list.extend(self.active.map(|(goal, is_cancelled)| {
            status(goal, if is_cancelled { GoalStatusEnum::Canceling } else { GoalStatusEnum::Executing })
        }));
        if let Err(error) = self.server.send_goal_statuses(GoalStatusArray { status_list }) {
            self.unsent.add(&error);
        }
    }
}
