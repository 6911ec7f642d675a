//! Where the wall time of a run goes: the loop of the server by phase, and the decisions of agents
//! that run in the same process.
//!
//! The session reports the end of each phase ([`RunObserver::phase_ended`]); what has passed since
//! the end of the one before belongs to it. So the phases add up to the time between the start of
//! the clock and the last report, and nothing is counted twice. Without a profile the session reads
//! no clock for this.
//!
//! Invariant: a profile changes no result. It does not say what the agents of other processes do
//! meanwhile: the server waits for them.

use std::fmt::Write as _;
use std::fs::{File, OpenOptions};
use std::io::{self, Seek as _, Write as _};
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::Context;
use msgs::ids::{AgentId, Tick};
use serde_json::{Value, json};
use transport::Level;
use world::World;

use crate::session::{Phase, PhaseTimes, RunObserver};
use system::wall_clock::now;

/// Shorter spans are not in the trace, only in the table: a run has millions of them.
const SPAN_MIN: Duration = Duration::from_micros(20);

/// Most spans of a trace, so that a viewer can open it.
const SPANS_MAX: usize = 200_000;

/// Decisions in the table.
const SLOWEST: usize = 5;

/// The profile of a run.
#[derive(Debug, Default)]
pub struct Profile {
    times: PhaseTimes,
    spans: Vec<Span>,
    /// Spans that are too many for the trace.
    omitted: usize,
}

#[derive(Debug)]
struct Span {
    phase: Phase,
    tick: Tick,
    start: Instant,
    duration: Duration,
}

/// A decision of an agent in this process.
#[derive(Debug, Clone, Copy)]
pub struct Decision {
    pub agent: AgentId,
    pub tick: Tick,
    pub start: Instant,
    pub duration: Duration,
}

/// Observes a run for its profile, if it has one, and passes all reports on.
pub struct Profiled<'a> {
    pub inner: &'a mut dyn RunObserver,
    pub profile: Option<&'a mut Profile>,
}

impl Profile {
    /// The wall time of each phase.
    #[must_use]
    pub fn times(&self) -> &PhaseTimes {
        &self.times
    }

    fn end(&mut self, phase: Phase, tick: Tick, now: Instant) {
        let Some((start, duration)) = self.times.end(phase, now) else { return };
        if duration < SPAN_MIN {
            return;
        }
        if self.spans.len() < SPANS_MAX {
            self.spans.push(Span { phase, tick, start, duration });
        } else {
            self.omitted += 1;
        }
    }

    /// The shares of the phases as a table, and the decisions of `controller`, if there are any.
    #[must_use]
    pub fn table(&self, controller: &str, decisions: &[Decision]) -> String {
        let total_s = self.times.total().as_secs_f64();
        let percent = |duration: Duration| 100.0 * duration.as_secs_f64() / total_s.max(f64::MIN_POSITIVE);
        let mut text = format!("profile of {total_s:.2} s of wall time:\n");
        let mut phases = Phase::ALL.map(|phase| (phase, self.times.of(phase)));
        phases.sort_by_key(|&(_, duration)| std::cmp::Reverse(duration));
        for (phase, duration) in phases {
            let (name, seconds) = (phase.name(), duration.as_secs_f64());
            // Writing to a string does not fail.
            let _ = writeln!(text, "  {:5.1} %  {seconds:8.3} s  {name}", percent(duration));
        }
        if decisions.is_empty() {
            return text.trim_end().to_owned();
        }
        let sum: Duration = decisions.iter().map(|decision| decision.duration).sum();
        let (count, sum_s) = (decisions.len(), sum.as_secs_f64());
        let _ = writeln!(text, "{count} decisions of {controller} took {sum_s:.3} s of all threads; the slowest:");
        let mut slowest: Vec<&Decision> = decisions.iter().collect();
        slowest.sort_by_key(|decision| (std::cmp::Reverse(decision.duration), decision.tick, decision.agent));
        for Decision { agent, tick, duration, .. } in slowest.into_iter().take(SLOWEST) {
            let _ = writeln!(text, "  {:8.3} ms  agent {agent}, tick {tick}", duration.as_secs_f64() * 1e3);
        }
        text.trim_end().to_owned()
    }

    /// The profile in the trace event format of Chrome and Perfetto: phases that took long enough,
    /// and all decisions that did, by agent.
    #[must_use]
    pub fn trace(&self, decisions: &[Decision]) -> Value {
        const SERVER: u32 = 0;
        let Some(origin) = self.times.started() else { return json!({ "traceEvents": [] }) };
        let thread = |number: u32, name: String| {
            let args = json!({ "name": name });
            json!({ "name": "thread_name", "ph": "M", "pid": 1, "tid": number, "args": args })
        };
        let span = |name: &str, thread: u32, tick: Tick, start: Instant, duration: Duration| {
            let start_us = start.saturating_duration_since(origin).as_secs_f64() * 1e6;
            let (duration_us, args) = (duration.as_secs_f64() * 1e6, json!({ "tick": tick.0 }));
            let times = [start_us, duration_us];
            json!({ "name": name, "ph": "X", "pid": 1, "tid": thread, "ts": times[0], "dur": times[1], "args": args })
        };
        let mut events = vec![thread(SERVER, "server".to_owned())];
        events.extend(self.spans.iter().map(|one| span(one.phase.name(), SERVER, one.tick, one.start, one.duration)));
        let mut agents: Vec<AgentId> = decisions.iter().map(|decision| decision.agent).collect();
        agents.sort_unstable();
        agents.dedup();
        events.extend(agents.into_iter().map(|agent| thread(agent.0 + 1, format!("agent {agent}"))));
        let long = decisions.iter().filter(|decision| decision.duration >= SPAN_MIN).take(SPANS_MAX);
        events.extend(long.map(|one| span("decide", one.agent.0 + 1, one.tick, one.start, one.duration)));
        let other = json!({ "omitted_spans": self.omitted, "least_span_us": SPAN_MIN.as_micros() });
        json!({ "traceEvents": events, "displayTimeUnit": "ms", "otherData": other })
    }
}

/// Where the trace of a profile goes, for runs one after the other: a file, or nowhere.
#[derive(Debug)]
pub struct TraceFile(Option<File>);

impl TraceFile {
    /// Opens the file before the run, so that a name that cannot be written to costs no result; an
    /// empty name is no file. A trace that is there stays until the next one is written.
    ///
    /// # Errors
    /// If it cannot be created; the error names the flag and the file.
    pub fn create(name: &Path) -> anyhow::Result<Self> {
        let is_file = !name.as_os_str().is_empty();
        let open = || OpenOptions::new().write(true).create(true).truncate(false).open(name);
        let file = is_file.then(|| open().with_context(|| format!("--profile {}", name.display()))).transpose()?;
        Ok(Self(file))
    }

    /// Writes [`Profile::trace`], in place of that of a run before.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&self, profile: &Profile, decisions: &[Decision]) -> io::Result<()> {
        let Some(mut file) = self.0.as_ref() else { return Ok(()) };
        file.set_len(0)?;
        file.rewind()?;
        file.write_all((profile.trace(decisions).to_string() + "\n").as_bytes())
    }
}

impl RunObserver for Profiled<'_> {
    fn waiting(&mut self, missing: &[AgentId]) {
        self.inner.waiting(missing);
    }

    fn started(&mut self) {
        self.inner.started();
        if let Some(profile) = &mut self.profile {
            profile.times.start(now());
        }
    }

    fn progress(&mut self, world: &World) {
        self.inner.progress(world);
    }

    fn note(&mut self, level: Level, text: &str) {
        self.inner.note(level, text);
    }

    fn phase_ended(&mut self, phase: Phase, tick: Tick) {
        if let Some(profile) = &mut self.profile {
            profile.end(phase, tick, now());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::NullObserver;

    #[test]
    fn phases_add_up_to_the_total_and_are_all_in_the_trace() {
        let outer = now();
        let mut profile = Profile::default();
        let mut inner = NullObserver;
        let mut observer = Profiled { inner: &mut inner, profile: Some(&mut profile) };
        observer.phase_ended(Phase::Pace, Tick(0));
        observer.started();
        for tick in (0..50).map(Tick) {
            for phase in Phase::ALL {
                observer.phase_ended(phase, tick);
            }
        }
        let (times, total) = (profile.times(), profile.times().total());
        assert_eq!(Phase::ALL.map(|phase| times.of(phase)).iter().sum::<Duration>(), total);
        assert!(total <= outer.elapsed());
        let start = times.started().unwrap();
        profile.end(Phase::Scan, Tick(50), start + total + Duration::from_millis(3));
        let decision = |millis, agent| Decision {
            agent: AgentId(agent),
            tick: Tick(7),
            start,
            duration: Duration::from_millis(millis),
        };
        let decisions = [decision(1, 0), decision(9, 2), decision(0, 1)];
        let trace: Value = serde_json::from_str(&profile.trace(&decisions).to_string()).unwrap();
        let events = trace["traceEvents"].as_array().unwrap();
        let spans: Vec<&Value> = events.iter().filter(|event| event["ph"] == "X").collect();
        assert!(spans.iter().any(|span| span["name"] == "scan" && span["dur"] == 3000.0 && span["args"]["tick"] == 50));
        assert_eq!(spans.iter().filter(|span| span["name"] == "decide").count(), 2, "the third took no time");
        assert!(spans.iter().all(|span| span["ts"].as_f64().unwrap() >= 0.0));
        let table = profile.table("dsvp", &decisions);
        assert!(table.contains("3 decisions of dsvp took 0.010 s"), "{table}");
        assert!(table.lines().last().unwrap().contains("agent 1"), "{table}");
        assert!(table.find("agent 2") < table.find("agent 0"), "the slowest comes first: {table}");
    }

    #[test]
    fn trace_is_bounded() {
        let mut profile = Profile::default();
        let start = now();
        profile.times.start(start);
        for number in 1..=SPANS_MAX as u32 + 5 {
            profile.end(Phase::Scan, Tick(0), start + SPAN_MIN * number);
        }
        assert_eq!((profile.spans.len(), profile.omitted), (SPANS_MAX, 5));
        assert_eq!(profile.times().total(), SPAN_MIN * (SPANS_MAX as u32 + 5));
    }
}
