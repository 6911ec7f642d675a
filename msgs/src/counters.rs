//! The counters of the result of a run: name, unit and meaning of each, declared once.

use std::fmt;

use crate::maes_msgs::{Counter, Result as RunResult};

/// How the names of counters of refused messages begin.
const REFUSED: &str = "refused_";

/// Declares the counters with one name.
macro_rules! counters {
    ($($counter:ident = $name:literal, $unit:literal, $meaning:literal;)*) => {
        /// What a counter of a result counts.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
        pub enum CounterName {
            $(#[doc = $meaning] $counter,)*
            /// Payload of the delivered messages of a type of [`crate::maes_msgs::AgentMessage`],
            /// bytes.
            MessageBytesOfType(u8),
            /// Tick in which the team had seen this share of the free cells, in thousandths.
            TickExplored {
                /// The share.
                permille: u64,
            },
        }

        impl CounterName {
            /// The counters with one name, in the order of the documentation.
            pub const PLAIN: &'static [Self] = &[$(Self::$counter),*];

            /// Name, unit and meaning; what varies is in angle brackets.
            #[must_use]
            pub fn info(self) -> CounterInfo {
                match self {
                    $(Self::$counter => CounterInfo { name: $name, unit: $unit, meaning: $meaning },)*
                    Self::MessageBytesOfType(_) => CounterInfo {
                        name: "message_bytes_delivered_kind_<type>",
                        unit: "bytes",
                        meaning: "Payload of the delivered messages of a type (1: maps, 2: claims).",
                    },
                    Self::TickExplored { .. } => CounterInfo {
                        name: "tick_explored_permille_<share>",
                        unit: "tick",
                        meaning: "Tick in which the team had seen 500 to 1000 thousandths of the free cells.",
                    },
                }
            }
        }
    };
}

counters! {
    FreeCells = "free_cells", "cells", "Free cells of the true map.";
    Decisions = "decisions", "commands", "Committed commands of agents.";
    FailedSearches = "failed_searches", "searches", "Searches of agents that found no path.";
    Scans = "scans", "scans", "LiDAR scans that were due.";
    ScansCast = "scans_cast", "scans", "Scans that were cast because they might show something new.";
    Collisions = "collisions", "contacts", "Contacts of bodies with walls and with each other.";
    MessagesSent = "messages_sent", "messages", "Messages between agents, once for each recipient.";
    MessagesDelivered = "messages_delivered", "messages", "Messages that reached their recipient.";
    MessagesOutOfContact = "messages_out_of_contact", "messages", "Messages to agents out of contact.";
    MessagesInboxFull = "messages_inbox_full", "messages", "Messages dropped by a full inbox.";
    MessageBytesDelivered = "message_bytes_delivered", "bytes", "Payload of the delivered messages.";
    AgentsDropped = "agents_dropped", "agents", "Agents that the run lost.";
    MessagesLostRadio = "messages_lost_radio", "messages", "Messages that the radio lost, if it loses any.";
    MessagesQueueFull = "messages_queue_full", "messages", "Messages dropped by a full radio queue, if its rate is bounded.";
    RelaysLeft = "relays_left", "relays", "Relays that agents left, if they have any.";
    RelaysRefused = "relays_refused", "relays", "Relays that could not be left where an agent was.";
    RelayWritings = "relay_writings", "messages", "Messages written to relays.";
    RelayWritingsLost = "relay_writings_lost", "messages", "Messages to relays that were lost.";
    RelayReadings = "relay_readings", "messages", "Messages read from relays.";
    AttainablePpm = "attainable_ppm", "millionths", "Share of the free cells that a team of bodies wider than a cell can see.";
    EnergyUsed = "energy_used_millijoules", "mJ", "Energy that all bodies have drawn, if they need any.";
    RanEmpty = "ran_empty", "times", "How often a body has run out of energy, if bodies need any.";
    TickHome = "tick_home_permille_990", "tick", "First tick in which the whole team rests in its bases and has seen 990 thousandths of the free cells.";
    TickKnownAtBase = "tick_known_at_base_permille_990", "tick", "First tick since which a base station knows 990 thousandths of the free cells, if there is one.";
    PositionError = "position_error_micrometres", "um", "Root mean square of the distance between believed and true positions, over agents and every 10 ticks, if localisation drifts.";
    MapCells = "map_cells", "cells", "Cells that the own sensors of agents have entered on their maps, summed over the agents, if localisation drifts.";
    MapCellsOffBy1 = "map_cells_off_by_1", "cells", "Those that are off by 1 cell.";
    MapCellsOffBy2 = "map_cells_off_by_2", "cells", "Those that are off by 2 cells.";
    MapCellsOffByMore = "map_cells_off_by_more", "cells", "Those that are off by more than 2 cells.";
    MapBlocks = "map_blocks", "blocks", "Blocks of their maps that agents have begun after their first, if localisation drifts.";
    LoopClosures = "loop_closures", "closures", "Loops that agents have closed, if localisation drifts.";
    Interventions = "interventions", "changes", "Changes of the world by services, if there were any.";
    MapChanges = "map_changes", "changes", "Changes of the map by events and requests, if there were any.";
    RefusedOtherRun = "refused_other_run", "messages", "Refused: of another run.";
    RefusedUnknownAgent = "refused_unknown_agent", "messages", "Refused: an id that is not in the run.";
    RefusedWrongTopic = "refused_wrong_topic", "messages", "Refused: names another agent than its topic.";
    RefusedIdTaken = "refused_id_taken", "messages", "Refused: an id that another process holds.";
    RefusedOtherController = "refused_other_controller", "messages", "Refused: a replacement with another controller.";
    RefusedWrongProtocol = "refused_wrong_protocol", "messages", "Refused: another version of the protocol.";
    RefusedNotJoined = "refused_not_joined", "messages", "Refused: a command of a process that has not joined.";
    RefusedWrongTick = "refused_wrong_tick", "messages", "Refused: a reply to a tick that is not awaited.";
    RefusedSecondAnswer = "refused_second_answer", "messages", "Refused: a second, different reply to a tick.";
    RefusedIllegalCommand = "refused_illegal_command", "messages", "Refused: a value that is not allowed.";
    RefusedUndecodable = "refused_undecodable", "messages", "Refused: bytes that do not decode.";
    RefusedUnprovenJoin = "refused_unproven_join", "messages", "Refused: a join without proof of the secret, if there was any.";
    RefusedForgedCommand = "refused_forged_command", "messages", "Refused: a command with a wrong signature, if there was any.";
}

/// The documentation of a counter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CounterInfo {
    /// As in results.
    pub name: &'static str,
    /// What is counted, or the unit of a value that is no number of things.
    pub unit: &'static str,
    /// One sentence.
    pub meaning: &'static str,
}

impl CounterName {
    /// Whether it counts messages that the server refused.
    #[must_use]
    pub fn is_refusal(self) -> bool {
        self.info().name.starts_with(REFUSED)
    }

    /// Whether it stands in a result only if it is not zero, so that the recording of an
    /// undisturbed run is that of earlier versions.
    #[must_use]
    pub fn is_left_out_at_zero(self) -> bool {
        matches!(self, Self::Interventions | Self::MapChanges | Self::RefusedUnprovenJoin | Self::RefusedForgedCommand)
    }

    /// The counter with this name, also if a build with protocol 6 or earlier wrote it, which
    /// called messages of agents parcels.
    #[must_use]
    pub fn parse(name: &str) -> Option<Self> {
        let name = &*present_name(name);
        let number = |of: Self| name.strip_prefix(of.info().name.split_once('<')?.0)?.parse::<u64>().ok();
        let plain = Self::PLAIN.iter().copied().find(|counter| counter.info().name == name);
        let of_type = || u8::try_from(number(Self::MessageBytesOfType(0))?).ok().map(Self::MessageBytesOfType);
        let explored = || Some(Self::TickExplored { permille: number(Self::TickExplored { permille: 0 })? });
        plain.or_else(of_type).or_else(explored)
    }
}

impl fmt::Display for CounterName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = self.info().name;
        let (before, _) = name.split_once('<').unwrap_or((name, ""));
        match self {
            Self::MessageBytesOfType(message_type) => write!(f, "{before}{message_type}"),
            Self::TickExplored { permille } => write!(f, "{before}{permille}"),
            _ => f.write_str(before),
        }
    }
}

fn present_name(name: &str) -> String {
    name.strip_prefix("parcel").map_or_else(|| name.to_owned(), |rest| format!("message{rest}"))
}

impl Counter {
    /// A counter with its value.
    #[must_use]
    pub fn new(name: CounterName, value: u64) -> Self {
        Self { name: name.to_string(), value }
    }

    /// Whether it counts messages that the server refused, also for a reason that this build does
    /// not know.
    #[must_use]
    pub fn is_refusal(&self) -> bool {
        self.name.starts_with(REFUSED)
    }

    /// The name that the counter has today.
    #[must_use]
    pub fn present_name(&self) -> String {
        present_name(&self.name)
    }
}

impl RunResult {
    /// The counters that this build knows, in the order of the message.
    pub fn known_counters(&self) -> impl Iterator<Item = (CounterName, u64)> {
        self.counters.iter().filter_map(|counter| Some((CounterName::parse(&counter.name)?, counter.value)))
    }

    /// The value of a counter; `None` if the result lacks it.
    #[must_use]
    pub fn counter(&self, name: CounterName) -> Option<u64> {
        self.known_counters().find(|(known, _)| *known == name).map(|(_, value)| value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip() {
        let varying = [CounterName::MessageBytesOfType(2), CounterName::TickExplored { permille: 999 }];
        for counter in CounterName::PLAIN.iter().copied().chain(varying) {
            assert_eq!(CounterName::parse(&counter.to_string()), Some(counter));
        }
        assert_eq!(CounterName::parse("parcels_sent"), Some(CounterName::MessagesSent));
        assert_eq!(CounterName::parse("message_bytes_delivered_kind_256"), None);
        assert_eq!(CounterName::parse("tick_explored_permille_<share>"), None);
    }
}
