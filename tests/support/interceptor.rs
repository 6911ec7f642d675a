//! A server's end of the in-memory transport that a test interferes with.

use std::time::Duration;

use in_memory::ServerEnd;
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{JoinReply, Observation, Progress, Scenario};
use protocol::signed::Signed;
use transport::control::Request;
use transport::{AgentTransport, ControlInput, Incoming, ObserverOutput, Transport};

/// What a test does with the messages of a server; by default they pass unchanged.
pub(crate) trait Interceptor {
    /// Whether others than the agents can send.
    fn is_open(&self) -> bool {
        false
    }

    fn send(&mut self, inner: &mut ServerEnd, agent: AgentId, part: Signed<Observation>) {
        inner.send(agent, part);
    }

    fn receive(&mut self, inner: &mut ServerEnd, timeout: Duration) -> Option<Incoming> {
        inner.receive(timeout)
    }

    /// Called at each tick.
    fn clock(&mut self, _tick: Tick) {}

    fn request(&mut self) -> Option<Request> {
        None
    }
}

/// The server's end with its interceptor.
struct Intercepted<I> {
    inner: ServerEnd,
    interceptor: I,
}

/// The transport of a server whose messages go through an interceptor.
pub(crate) fn intercepted(inner: ServerEnd, interceptor: impl Interceptor + 'static) -> Box<dyn Transport> {
    Box::new(Intercepted { inner, interceptor })
}

impl<I: Interceptor> AgentTransport for Intercepted<I> {
    fn announce(&mut self, scenario: &Scenario) {
        self.inner.announce(scenario);
    }

    fn reply_join(&mut self, reply: &JoinReply) {
        self.inner.reply_join(reply);
    }

    fn send(&mut self, agent: AgentId, part: Signed<Observation>) {
        self.interceptor.send(&mut self.inner, agent, part);
    }

    fn is_open(&self) -> bool {
        self.interceptor.is_open()
    }

    fn receive(&mut self, timeout: Duration) -> Option<Incoming> {
        self.interceptor.receive(&mut self.inner, timeout)
    }
}

impl<I: Interceptor> ObserverOutput for Intercepted<I> {
    fn clock(&mut self, tick: Tick) {
        self.interceptor.clock(tick);
    }

    fn progress(&mut self, progress: &Progress) {
        self.inner.progress(progress);
    }
}

impl<I: Interceptor> ControlInput for Intercepted<I> {
    fn request(&mut self) -> Option<Request> {
        self.interceptor.request()
    }
}
