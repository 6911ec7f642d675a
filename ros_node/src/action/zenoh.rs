//! The action over Zenoh: its services and topics, each by itself.

use std::cell::RefCell;
use std::rc::Rc;

use msgs::action_msgs::{CancelGoal, GoalStatusArray as StatusMessage};
use msgs::message::Message;
use msgs::service::{Action, Reply, Service};
use msgs::simulation_interfaces::{SimulateSteps, SimulateStepsFeedback};
use ros2_client::action::{
    CancelGoalRequest, CancelGoalResponse, FeedbackMessage, GetResultRequest, GoalId, SendGoalResponse,
};
use ros2_client::action_msgs::GoalStatusArray;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{ActionState, FEEDBACK_QOS, GoalRequest, ResultAnswer, STATUS_QOS, StepsEvent, Topics};
use crate::services::Wire;
use crate::type_hash::{self, ActionHashes};
use crate::zenoh::{Node, Writer};
use crate::{Inbox, RosError};

/// Of the action in DDS, before the names of its parts.
const TYPE_NAME: &str = "simulation_interfaces::action::dds_::SimulateSteps";

struct Published {
    feedback: RefCell<Writer>,
    status: RefCell<Writer>,
}

/// Offers the action.
pub(super) fn steps_action<T>(
    node: &mut Node,
    name: &str,
    inbox: &mut Inbox<T>,
    convert: Rc<impl Fn(Result<Option<StepsEvent>, String>) -> T + 'static>,
) -> Result<(), RosError> {
    let ActionHashes { send_goal, get_result, feedback } =
        type_hash::of_action(SimulateSteps::PACKAGE, SimulateSteps::NAME, SimulateSteps::DEFINITION);
    let cancel_goal = type_hash::of_service(CancelGoal::PACKAGE, CancelGoal::NAME, CancelGoal::DEFINITION);
    let of_action = |part: &str| format!("{name}/_action/{part}");
    let own = |part: &str| format!("{TYPE_NAME}_{part}_");
    let feedback = node.writer_of(&of_action("feedback"), own("FeedbackMessage"), feedback, FEEDBACK_QOS)?;
    let status_type = "action_msgs::msg::dds_::GoalStatusArray_".to_owned();
    let status = node.writer_of(&of_action("status"), status_type, type_hash::of(StatusMessage::TYPE), STATUS_QOS)?;
    let published = Published { feedback: RefCell::new(feedback), status: RefCell::new(status) };
    let shared = ActionState::new(name, Box::new(published));
    let (goals, cancels) = (Rc::clone(&shared), Rc::clone(&shared));
    serve(
        node,
        (&of_action("send_goal"), own("SendGoal"), send_goal),
        inbox,
        &convert,
        move |request: GoalRequest, reply: Reply<SendGoalResponse>| ActionState::accept(&goals, request, reply),
    )?;
    serve(
        node,
        (&of_action("cancel_goal"), "action_msgs::srv::dds_::CancelGoal_".to_owned(), cancel_goal),
        inbox,
        &convert,
        move |request: CancelGoalRequest, reply: Reply<CancelGoalResponse>| {
            cancels.borrow_mut().cancel(&request, reply)
        },
    )?;
    serve(
        node,
        (&of_action("get_result"), own("GetResult"), get_result),
        inbox,
        &convert,
        move |request: GetResultRequest, reply: Reply<ResultAnswer>| {
            shared.borrow_mut().result_wanted(&request, reply);
            None
        },
    )
}

/// Offers a service of the action: its name, the name of its type in DDS, and the hash of that.
fn serve<T, Q: DeserializeOwned + 'static, R: Serialize + 'static>(
    node: &mut Node,
    (name, type_name, type_hash): (&str, String, String),
    inbox: &mut Inbox<T>,
    convert: &Rc<impl Fn(Result<Option<StepsEvent>, String>) -> T + 'static>,
    handle: impl Fn(Q, Reply<R>) -> Option<StepsEvent> + 'static,
) -> Result<(), RosError> {
    let (server, convert) = (node.server_of(name, type_name, type_hash)?, Rc::clone(convert));
    inbox.add(Box::new(move |context| {
        server.take(context).map(|taken| convert(taken.map(|(request, reply)| handle(request, reply))))
    }));
    Ok(())
}

impl Topics for Published {
    fn feedback(&self, goal_id: GoalId, feedback: SimulateStepsFeedback) -> Result<(), String> {
        self.feedback.borrow_mut().publish(&FeedbackMessage { goal_id, feedback: Wire(feedback) })
    }

    fn status(&self, status: GoalStatusArray) -> Result<(), String> {
        self.status.borrow_mut().publish(&status)
    }
}
