//! The server of the action `SimulateSteps`, which executes one goal at a time.
//!
//! An action is three services and two topics, which `dds` and `zenoh` offer. The inbox yields each
//! accepted goal; its executor reports feedback and the result. A goal that arrives while another
//! is executed is rejected. The results of the last [`RESULTS_MAX`] goals are kept for late result
//! requests.

mod dds;
#[cfg(feature = "zenoh")]
mod zenoh;

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use ros2_client::action::{
    CancelGoalRequest, CancelGoalResponse, GetResultRequest, GetResultResponse, GoalId, GoalInfo, GoalStatusEnum,
    SendGoalRequest, SendGoalResponse,
};
use ros2_client::action_msgs::{CancelGoalResponseEnum, GoalStatus, GoalStatusArray};
use ros2_client::builtin_interfaces::Time;
use serde::Deserialize;

use super::network::Network;
use super::services::Wire;
use super::{EndpointFactory, Inbox, Node, RosError, ThrottledWarning};
use msgs::cdr;
use msgs::service::Reply;
use msgs::simulation_interfaces::{Result as Outcome, SimulateStepsFeedback, SimulateStepsGoal, SimulateStepsResult};
use msgs::topics::Qos;

/// Maximum number of results kept, and of callers waiting for one.
const RESULTS_MAX: usize = 16;

/// QoS of the topics.
const FEEDBACK_QOS: Qos = Qos::reliable(64);
const STATUS_QOS: Qos = Qos::latched(1);

/// The requests, answers and messages of the action.
type GoalRequest = SendGoalRequest<Wire<SimulateStepsGoal>>;
type ResultAnswer = GetResultResponse<Wire<SimulateStepsResult>>;

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
    shared: Rc<RefCell<ActionState>>,
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

/// The topics of the action.
trait Topics {
    /// Publishes feedback of a goal, or says why that is not possible.
    fn feedback(&self, goal: GoalId, feedback: SimulateStepsFeedback) -> Result<(), String>;
    /// Publishes the status of all goals that are known, or says why that is not possible.
    fn status(&self, status: GoalStatusArray) -> Result<(), String>;
}

struct ActionState {
    topics: Box<dyn Topics>,
    /// The goal under execution, and whether it was cancelled.
    active: Option<(GoalId, bool)>,
    ended: VecDeque<(GoalId, GoalStatusEnum, Outcome)>,
    waiting: VecDeque<(GoalId, Reply<ResultAnswer>)>,
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
        match &self.context.network {
            Network::Dds(_) => self.dds_steps_action(node.dds(), name, inbox, Rc::new(convert)),
            #[cfg(feature = "zenoh")]
            Network::Zenoh(_) => zenoh::steps_action(node.zenoh(), name, inbox, Rc::new(convert)),
        }
    }
}

impl ActionState {
    fn new(name: &str, topics: Box<dyn Topics>) -> Rc<RefCell<Self>> {
        let unsent = ThrottledWarning::new(format!("{name}: not sent"));
        let (ended, waiting) = (VecDeque::new(), VecDeque::new());
        Rc::new(RefCell::new(ActionState { topics, active: None, ended, waiting, unsent }))
    }

    fn note<E: std::fmt::Display>(&mut self, sent: Result<(), E>) {
        if let Err(reason) = sent {
            self.unsent.add(&reason);
        }
    }

    fn accept(shared: &Rc<RefCell<Self>>, request: GoalRequest, reply: Reply<SendGoalResponse>) -> Option<StepsEvent> {
        let mut inner = shared.borrow_mut();
        let is_new = inner.active.is_none() && inner.ended.iter().all(|(known, ..)| *known != request.goal_id);
        reply.send(SendGoalResponse { accepted: is_new, stamp: Time::ZERO });
        if !is_new {
            return None;
        }
        inner.active = Some((request.goal_id, false));
        inner.publish_status();
        drop(inner);
        let Wire(SimulateStepsGoal { steps }) = request.goal;
        Some(StepsEvent::Goal(Goal { steps, shared: Rc::clone(shared), id: request.goal_id }))
    }

    fn feedback(&mut self, goal_id: GoalId, completed_steps: u64, remaining_steps: u64) {
        let sent = self.topics.feedback(goal_id, SimulateStepsFeedback { completed_steps, remaining_steps });
        self.note(sent);
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
        for (goal, reply) in ready {
            self.send_result(goal, reply);
        }
    }

    fn cancel(&mut self, request: &CancelGoalRequest, reply: Reply<CancelGoalResponse>) -> Option<StepsEvent> {
        let wanted = cdr::decode::<Cancelled>(cdr::encode(request).get(..20)?).ok()?;
        let active = self.active.filter(|(goal, _)| wanted.id == [0; 16] || wanted.id == *goal.uuid.as_bytes());
        reply.send(CancelGoalResponse {
            return_code: if active.is_some() {
                CancelGoalResponseEnum::None
            } else {
                CancelGoalResponseEnum::UnknownGoal
            },
            goals_canceling: active
                .iter()
                .map(|(goal_id, _)| GoalInfo { goal_id: *goal_id, stamp: Time::ZERO })
                .collect(),
        });
        let (goal, _) = active?;
        self.active = Some((goal, true));
        self.publish_status();
        Some(StepsEvent::Cancel)
    }

    fn result_wanted(&mut self, request: &GetResultRequest, reply: Reply<ResultAnswer>) {
        let is_active = self.active.is_some_and(|(goal, _)| goal == request.goal_id);
        if is_active && self.waiting.len() < RESULTS_MAX {
            self.waiting.push_back((request.goal_id, reply));
        } else {
            self.send_result(request.goal_id, reply);
        }
    }

    /// Responds with the result of a finished goal, or that the goal is unknown.
    fn send_result(&mut self, goal: GoalId, reply: Reply<ResultAnswer>) {
        let ended = self.ended.iter().find(|(known, ..)| *known == goal);
        let unknown = || (GoalStatusEnum::Unknown, Outcome::failure(Outcome::RESULT_NOT_FOUND, "no such goal"));
        let (status, result) = ended.map_or_else(unknown, |(_, status, outcome)| (*status, outcome.clone()));
        reply.send(GetResultResponse { status, result: Wire(SimulateStepsResult { result }) });
    }

    fn publish_status(&mut self) {
        let status = |goal_id, status| GoalStatus { goal_info: GoalInfo { goal_id, stamp: Time::ZERO }, status };
        let mut status_list: Vec<_> = self.ended.iter().map(|(goal, ended, _)| status(*goal, *ended)).collect();
        status_list.extend(self.active.map(|(goal, is_cancelled)| {
            status(goal, if is_cancelled { GoalStatusEnum::Canceling } else { GoalStatusEnum::Executing })
        }));
        let sent = self.topics.status(GoalStatusArray { status_list });
        self.note(sent);
    }
}
