// An agent in C++: straight on until something is in the way, then a random turn.
//
//     ros2 run maes_example_agent agent 0 &
//     maes run --agents 2 --external 0
//
// It speaks the protocol of docs/topics.md and nothing more; its decisions are in `decide`.
// examples/python/agent.py is the same in Python, with the same names.

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <string>

#include <maes_msgs/msg/command.hpp>
#include <maes_msgs/msg/join.hpp>
#include <maes_msgs/msg/join_reply.hpp>
#include <maes_msgs/msg/motion.hpp>
#include <maes_msgs/msg/observation.hpp>
#include <maes_msgs/msg/scenario.hpp>
#include <maes_msgs/msg/signed_command.hpp>
#include <maes_msgs/msg/signed_join.hpp>
#include <maes_msgs/msg/signed_observation.hpp>
#include <maes_msgs/msg/wake_condition.hpp>
#include <rclcpp/rclcpp.hpp>

using maes_msgs::msg::Command;
using maes_msgs::msg::Join;
using maes_msgs::msg::JoinReply;
using maes_msgs::msg::Motion;
using maes_msgs::msg::Observation;
using maes_msgs::msg::Scenario;
using maes_msgs::msg::SignedCommand;
using maes_msgs::msg::SignedJoin;
using maes_msgs::msg::SignedObservation;
using maes_msgs::msg::WakeCondition;

namespace
{
constexpr std::uint32_t PROTOCOL = 7;

// The distributions of standard libraries differ; this one gives the same numbers everywhere.
double uniform(std::mt19937_64 & rng, double from, double to)
{
  const double share = static_cast<double>(rng() >> 11) * 0x1.0p-53;
  return from + share * (to - from);
}

// Fills in the command for an observation. Every fragment has cells and messages; the first one has
// all other fields.
void decide(Command & command, const std::map<std::uint16_t, Observation> & parts, std::mt19937_64 & rng)
{
  const Observation & first = parts.begin()->second;
  command.wake.at_tick = std::numeric_limits<std::uint64_t>::max();
  command.wake.events = WakeCondition::TASK_DONE;
  if (first.task_status == Observation::ACTIVE) {
    command.motion.kind = Motion::KEEP;
  } else if (first.collision == Observation::NONE && first.tick > 0) {
    command.motion.kind = Motion::MOVE;
    command.motion.pitch_rad = uniform(rng, -0.5, 0.5);
    command.motion.distance_m = std::numeric_limits<double>::infinity();
  } else {
    command.motion.kind = Motion::TURN;
    command.motion.angle_rad = uniform(rng, -M_PI, M_PI);
  }
}

class Agent : public rclcpp::Node
{
public:
  explicit Agent(std::uint32_t number)
  : Node("agent_" + std::to_string(number)), number_(number), instance_(std::random_device{}())
  {
    const auto reliable = rclcpp::QoS(16).reliable();
    const auto latched = rclcpp::QoS(256).reliable().transient_local();
    const auto own = "/agent_" + std::to_string(number);
    join_topic_ = create_publisher<SignedJoin>(own + "/join", reliable);
    command_topic_ = create_publisher<SignedCommand>(own + "/command", reliable);
    scenarios_ = create_subscription<Scenario>(
      "/sim/scenario", latched, [this](const Scenario & scenario) {on_scenario(scenario);});
    replies_ = create_subscription<JoinReply>(
      "/sim/join_reply", latched, [this](const JoinReply & reply) {on_reply(reply);});
    observations_ = create_subscription<SignedObservation>(
      own + "/observation", reliable, [this](const SignedObservation & part) {on_observation(part.observation);});
    joining_ = create_wall_timer(std::chrono::milliseconds(200), [this] {join();});
  }

  bool is_done() const {return is_done_;}
  bool is_refused() const {return is_refused_;}

private:
  void on_scenario(const Scenario & scenario)
  {
    // Run number 0 is a replay, not a run. A reset run restarts with a higher number.
    const bool begins = !run_ && scenario.run != 0;
    if (begins || (run_ && scenario.origin == origin_ && scenario.run > *run_)) {
      run_ = scenario.run;
      origin_ = scenario.origin;
      is_accepted_ = false;
      parts_.clear();
      answer_.reset();
      std::seed_seq seed{
        static_cast<std::uint32_t>(scenario.agents_seed), static_cast<std::uint32_t>(scenario.agents_seed >> 32), number_};
      rng_.seed(seed);
    }
  }

  void join()
  {
    if (!run_ || is_accepted_) {return;}
    // A nonce of zeros says that the commands are not signed, which --external allows.
    SignedJoin unsigned_join;
    Join & join = unsigned_join.join;
    join.run = *run_;
    join.agent = number_;
    join.instance = instance_;
    join.protocol = PROTOCOL;
    join.controller = "example";
    join.last_tick = Join::NONE;
    join_topic_->publish(unsigned_join);
  }

  void on_reply(const JoinReply & reply)
  {
    if (reply.run != run_ || reply.agent != number_ || reply.instance != instance_) {return;}
    // Held by a process that may have to be replaced: the join is repeated.
    if (reply.code == JoinReply::HELD) {return;}
    is_accepted_ = reply.accepted;
    is_refused_ = !reply.accepted;
    if (is_refused_) {RCLCPP_ERROR(get_logger(), "refused: %s", reply.reason.c_str());}
  }

  void on_observation(const Observation & part)
  {
    if (!is_accepted_ || part.run != run_) {return;}
    if (part.phase == Observation::RUNNING && answer_ && part.tick <= answer_->tick) {
      // A resent observation: retransmit the command, once for the whole observation.
      if (part.tick == answer_->tick && part.part + 1 == part.parts) {publish(*answer_);}
      return;
    }
    if (!parts_.empty()) {
      const Observation & present = parts_.begin()->second;
      if (present.tick != part.tick || present.phase != part.phase) {parts_.clear();}
    }
    parts_[part.part] = part;
    if (parts_.size() < part.parts) {return;}
    answer_.emplace();
    answer_->tick = part.tick;
    answer_->run = *run_;
    answer_->agent = number_;
    if (part.phase == Observation::ENDED) {
      is_done_ = true;
    } else {
      decide(*answer_, parts_, rng_);
    }
    parts_.clear();
    publish(*answer_);
  }

  void publish(const Command & command)
  {
    SignedCommand unsigned_command;
    unsigned_command.command = command;
    command_topic_->publish(unsigned_command);
  }

  std::uint32_t number_;
  std::uint64_t instance_;
  std::mt19937_64 rng_;
  std::optional<std::uint64_t> run_;               // from the scenario
  std::uint64_t origin_ = 0;                       // the same
  std::map<std::uint16_t, Observation> parts_;     // fragments of the arriving observation
  std::optional<Command> answer_;                  // the last command, for retransmission
  bool is_accepted_ = false;
  bool is_refused_ = false;
  bool is_done_ = false;
  rclcpp::Publisher<SignedJoin>::SharedPtr join_topic_;
  rclcpp::Publisher<SignedCommand>::SharedPtr command_topic_;
  rclcpp::Subscription<Scenario>::SharedPtr scenarios_;
  rclcpp::Subscription<JoinReply>::SharedPtr replies_;
  rclcpp::Subscription<SignedObservation>::SharedPtr observations_;
  rclcpp::TimerBase::SharedPtr joining_;
};
}  // namespace

int main(int argc, char ** argv)
{
  const auto arguments = rclcpp::init_and_remove_ros_arguments(argc, argv);
  if (arguments.size() != 2) {
    std::fprintf(stderr, "usage: agent NUMBER\n");
    return EXIT_FAILURE;
  }
  auto agent = std::make_shared<Agent>(static_cast<std::uint32_t>(std::stoul(arguments[1])));
  rclcpp::executors::SingleThreadedExecutor executor;
  executor.add_node(agent);
  while (rclcpp::ok() && !agent->is_done() && !agent->is_refused()) {
    executor.spin_once();
  }
  // Time for the acknowledgement to leave.
  executor.spin_once(std::chrono::milliseconds(300));
  const bool is_refused = agent->is_refused();
  rclcpp::shutdown();
  return is_refused ? EXIT_FAILURE : EXIT_SUCCESS;
}
