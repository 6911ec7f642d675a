// The part of rclcpp that examples/cpp uses, over the C library rcl: PyPI has wheels of rcl, of its
// middleware and of the generated messages, and none of rclcpp. A test compiles the example with it
// and runs it. Errors of rcl are exceptions; an executor serves one node in one thread.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <rcl/error_handling.h>
#include <rcl/rcl.h>
#include <rosidl_typesupport_cpp/message_type_support.hpp>

#define RCLCPP_ERROR(logger, format, ...) \
  std::fprintf(stderr, "[%s]: " format "\n", (logger).c_str() __VA_OPT__(, ) __VA_ARGS__)

namespace rclcpp
{
inline rcl_context_t context = rcl_get_zero_initialized_context();

inline void check(rcl_ret_t code)
{
  if (code != RCL_RET_OK) {
    const std::string reason = rcl_get_error_string().str;
    rcl_reset_error();
    throw std::runtime_error(reason);
  }
}

// What cannot be mended while something is destroyed.
inline void discard(rcl_ret_t) {rcl_reset_error();}

class QoS
{
public:
  explicit QoS(std::size_t depth) {profile.depth = depth;}

  QoS & reliable()
  {
    profile.reliability = RMW_QOS_POLICY_RELIABILITY_RELIABLE;
    return *this;
  }

  QoS & transient_local()
  {
    profile.durability = RMW_QOS_POLICY_DURABILITY_TRANSIENT_LOCAL;
    return *this;
  }

  rmw_qos_profile_t profile = rmw_qos_profile_default;
};

template<typename Message>
class Publisher
{
public:
  using SharedPtr = std::shared_ptr<Publisher>;

  Publisher(std::shared_ptr<rcl_node_t> node, const std::string & topic, const QoS & qos)
  : node_(std::move(node))
  {
    auto options = rcl_publisher_get_default_options();
    options.qos = qos.profile;
    const auto type = rosidl_typesupport_cpp::get_message_type_support_handle<Message>();
    check(rcl_publisher_init(&handle_, node_.get(), type, topic.c_str(), &options));
  }

  ~Publisher() {discard(rcl_publisher_fini(&handle_, node_.get()));}

  void publish(const Message & message) {check(rcl_publish(&handle_, &message, nullptr));}

private:
  std::shared_ptr<rcl_node_t> node_;
  rcl_publisher_t handle_ = rcl_get_zero_initialized_publisher();
};

class SubscriptionBase
{
public:
  virtual ~SubscriptionBase() = default;

  // Calls back with the oldest message, if there is one.
  virtual void take() = 0;

  rcl_subscription_t handle = rcl_get_zero_initialized_subscription();
};

template<typename Message>
class Subscription : public SubscriptionBase
{
public:
  using SharedPtr = std::shared_ptr<Subscription>;
  using Callback = std::function<void (const Message &)>;

  Subscription(std::shared_ptr<rcl_node_t> node, const std::string & topic, const QoS & qos, Callback callback)
  : node_(std::move(node)), callback_(std::move(callback))
  {
    auto options = rcl_subscription_get_default_options();
    options.qos = qos.profile;
    const auto type = rosidl_typesupport_cpp::get_message_type_support_handle<Message>();
    check(rcl_subscription_init(&handle, node_.get(), type, topic.c_str(), &options));
  }

  ~Subscription() override {discard(rcl_subscription_fini(&handle, node_.get()));}

  void take() override
  {
    Message message;
    const auto code = rcl_take(&handle, &message, nullptr, nullptr);
    if (code == RCL_RET_SUBSCRIPTION_TAKE_FAILED) {
      rcl_reset_error();
      return;
    }
    check(code);
    callback_(message);
  }

private:
  std::shared_ptr<rcl_node_t> node_;
  Callback callback_;
};

struct TimerBase
{
  using SharedPtr = std::shared_ptr<TimerBase>;
  using Clock = std::chrono::steady_clock;

  Clock::duration period;
  std::function<void ()> callback;
  Clock::time_point due = Clock::now() + period;
};

class Node
{
public:
  explicit Node(const std::string & name)
  : name_(name), node_(new rcl_node_t(rcl_get_zero_initialized_node()), [](rcl_node_t * node) {
        discard(rcl_node_fini(node));
        delete node;
      })
  {
    const auto options = rcl_node_get_default_options();
    check(rcl_node_init(node_.get(), name.c_str(), "", &context, &options));
  }

  template<typename Message>
  typename Publisher<Message>::SharedPtr create_publisher(const std::string & topic, const QoS & qos)
  {
    return std::make_shared<Publisher<Message>>(node_, topic, qos);
  }

  template<typename Message, typename Callback>
  typename Subscription<Message>::SharedPtr create_subscription(
    const std::string & topic, const QoS & qos, Callback callback)
  {
    auto subscription = std::make_shared<Subscription<Message>>(node_, topic, qos, callback);
    subscriptions.push_back(subscription);
    return subscription;
  }

  template<typename Callback>
  TimerBase::SharedPtr create_wall_timer(TimerBase::Clock::duration period, Callback callback)
  {
    timers.push_back(std::make_shared<TimerBase>(TimerBase{period, callback}));
    return timers.back();
  }

  std::string get_logger() const {return name_;}

  std::vector<std::shared_ptr<SubscriptionBase>> subscriptions;
  std::vector<TimerBase::SharedPtr> timers;

private:
  std::string name_;
  std::shared_ptr<rcl_node_t> node_;
};

namespace executors
{
class SingleThreadedExecutor
{
public:
  ~SingleThreadedExecutor() {discard(rcl_wait_set_fini(&waits_));}

  void add_node(std::shared_ptr<Node> node)
  {
    node_ = std::move(node);
    check(
      rcl_wait_set_init(
        &waits_, node_->subscriptions.size(), 0, 0, 0, 0, 0, &context, rcl_get_default_allocator()));
  }

  // Waits until something is there, a timer is due or the time is over, and calls back once for each.
  void spin_once(TimerBase::Clock::duration timeout = std::chrono::hours(1))
  {
    auto until = TimerBase::Clock::now() + timeout;
    for (const auto & timer : node_->timers) {until = std::min(until, timer->due);}
    check(rcl_wait_set_clear(&waits_));
    for (const auto & subscription : node_->subscriptions) {
      check(rcl_wait_set_add_subscription(&waits_, &subscription->handle, nullptr));
    }
    const std::chrono::nanoseconds rest = until - TimerBase::Clock::now();
    const auto code = rcl_wait(&waits_, std::max<std::int64_t>(rest.count(), 0));
    if (code == RCL_RET_TIMEOUT) {rcl_reset_error();} else {check(code);}
    for (std::size_t i = 0; code == RCL_RET_OK && i < node_->subscriptions.size(); ++i) {
      if (waits_.subscriptions[i]) {node_->subscriptions[i]->take();}
    }
    for (const auto & timer : node_->timers) {
      if (timer->due <= TimerBase::Clock::now()) {
        timer->due += timer->period;
        timer->callback();
      }
    }
  }

private:
  std::shared_ptr<Node> node_;
  rcl_wait_set_t waits_ = rcl_get_zero_initialized_wait_set();
};
}  // namespace executors

inline std::vector<std::string> init_and_remove_ros_arguments(int argc, char ** argv)
{
  auto options = rcl_get_zero_initialized_init_options();
  check(rcl_init_options_init(&options, rcl_get_default_allocator()));
  check(rcl_init(argc, argv, &options, &context));
  check(rcl_init_options_fini(&options));
  return std::vector<std::string>(argv, argv + argc);
}

inline bool ok() {return rcl_context_is_valid(&context);}

inline void shutdown() {check(rcl_shutdown(&context));}
}  // namespace rclcpp
