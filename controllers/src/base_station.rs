//! `base-station`: stays where it is, gathers the map of the team, and broadcasts how much it has.
//!
//! It looks once, at the start. Its map grows by sharing, like that of any agent; whenever it has,
//! or other agents are in contact, it broadcasts how many free cells it knows ([`AtBase`]).

use msgs::ids::Tick;
use protocol::event_mask::EventMask;

use super::report_to_base::AtBase;
use super::{Controller, Ctx};
use agent::command::{Command, Motion, ScanRequest, Stage, WakeCondition};
use agent::observation::Observation;

/// The controller of a base station.
#[derive(Debug, Default)]
pub(super) struct BaseStation {
    /// Free cells on its map at its last decision; `None` before the first.
    last_known_free: Option<u32>,
}

impl Controller for BaseStation {
    fn decide(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        let known_free = ctx.map().free() as u32;
        let events = EventMask::MESSAGE | EventMask::CONTACTS;
        // It waits until the run ends, and so has something to do.
        let end = Tick(ctx.run_info().duration.0.saturating_sub(1));
        let mut command = Command::new(Motion::Stop, WakeCondition { at: end, events }).with_stage(Stage::Waiting);
        if self.last_known_free.is_none() {
            command.lidar = ScanRequest::Never;
        }
        let is_due = self.last_known_free != Some(known_free) || observation.events.intersects(EventMask::CONTACTS);
        if is_due && !observation.contacts.is_empty() {
            command = AtBase::Knows(known_free).broadcast(command);
        }
        self.last_known_free = Some(known_free);
        command.with_info(format!("knows {known_free} free cells"))
    }
}

#[cfg(test)]
mod tests {
    use msgs::ids::AgentId;

    use super::*;
    use crate::testing::{World, flat};
    use agent::observation::Contact;
    use protocol::message_type::MessageType;

    #[test]
    fn broadcasts_when_its_map_grows_or_contacts_change() {
        let mut world = World::known("#####\n#...#\n#####\n", flat(1, 1));
        let mut station = BaseStation::default();
        let mut broadcast = |world: &mut World| -> Vec<Option<AtBase>> {
            let command = station.decide(&world.observation.clone(), &mut world.ctx());
            assert_eq!(command.motion, Motion::Stop);
            command.messages.iter().map(|message| AtBase::decode(message.kind, &message.data)).collect()
        };
        assert_eq!(broadcast(&mut world), []);
        let position = nalgebra::Point3::new(3.5, 1.5, 0.5);
        world.observation.contacts = vec![Contact { agent: AgentId(0), position }];
        world.observation.events = EventMask::CONTACTS;
        assert_eq!(broadcast(&mut world), [Some(AtBase::Knows(3))]);
        world.observation.events = EventMask::MESSAGE;
        assert_eq!(broadcast(&mut world), []);
        let wall = world.map.extent().index(flat(4, 1)).unwrap() as u32;
        world.map.note_free(&[wall]);
        assert_eq!(broadcast(&mut world), [Some(AtBase::Knows(4))]);
        assert_eq!(AtBase::decode(MessageType::Claims.number(), &[1, 0, 4, 0, 0, 0]), None);
    }
}
