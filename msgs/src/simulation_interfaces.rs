//! The part of the package `simulation_interfaces` that the server speaks: how simulators are
//! controlled by the standard.
//!
//! What is here is the same in the lines 1 and 2 of the package, with two exceptions: version 2
//! says in `SetEntityState` what is to be set, and a request of version 1, which does not, is
//! understood as well; of `SpawnEntity` only the layout is the same. The interface files under
//! `standard/simulation_interfaces` have the fields in the words of ROS; tests call the services
//! from a real ROS 2 that was built from them.

use std::fmt;

use serde::de::{SeqAccess, Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

use crate::geometry_msgs::{Accel, Pose, PoseStamped, Twist, Vector3};
use crate::service::services;
use crate::std_msgs::Header;

/// What became of a request.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Result {
    /// One of the constants, or a code of the service above 100.
    pub result: u8,
    /// For people; empty if all is well.
    pub error_message: String,
}

impl Result {
    /// The simulator cannot do this.
    pub const FEATURE_UNSUPPORTED: u8 = 0;
    /// Done.
    pub const OK: u8 = 1;
    /// There is no such thing.
    pub const NOT_FOUND: u8 = 2;
    /// Not in this state.
    pub const INCORRECT_STATE: u8 = 3;
    /// It was tried, and failed.
    pub const OPERATION_FAILED: u8 = 4;

    /// All is well.
    #[must_use]
    pub fn ok() -> Self {
        Result { result: Self::OK, error_message: String::new() }
    }

    /// It is not.
    #[must_use]
    pub fn failure(code: u8, message: impl Into<String>) -> Self {
        Result { result: code, error_message: message.into() }
    }

    /// Whether all is well.
    #[must_use]
    pub fn is_ok(&self) -> bool {
        self.result == Self::OK
    }
}

/// What a simulation is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SimulationState {
    /// One of the constants.
    pub state: u8,
}

impl SimulationState {
    /// At its beginning, and not begun.
    pub const STOPPED: u8 = 0;
    /// Time passes.
    pub const PLAYING: u8 = 1;
    /// Time stands still.
    pub const PAUSED: u8 = 2;
    /// About to end.
    pub const QUITTING: u8 = 3;
}

/// What a simulator can do.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SimulatorFeatures {
    /// Some of the constants.
    pub features: Vec<u16>,
    /// File formats of what can be spawned.
    pub spawn_formats: Vec<String>,
    /// For people.
    pub custom_info: String,
}

impl SimulatorFeatures {
    /// Entities can be added.
    pub const SPAWNING: u16 = 0;
    /// Entities can be taken away.
    pub const DELETING: u16 = 1;
    /// Filters know tags.
    pub const ENTITY_TAGS: u16 = 4;
    /// The space that an entity takes can be asked for, and filters know spheres.
    pub const ENTITY_BOUNDS: u16 = 5;
    /// Filters know boxes.
    pub const ENTITY_BOUNDS_BOX: u16 = 6;
    /// Filters know categories.
    pub const ENTITY_CATEGORIES: u16 = 8;
    /// States can be asked for.
    pub const ENTITY_STATE_GETTING: u16 = 10;
    /// States can be set.
    pub const ENTITY_STATE_SETTING: u16 = 11;
    /// Infos can be asked for.
    pub const ENTITY_INFO_GETTING: u16 = 12;
    /// The simulation can begin again.
    pub const SIMULATION_RESET: u16 = 20;
    /// The state of the simulation can be asked for.
    pub const SIMULATION_STATE_GETTING: u16 = 24;
    /// The state of the simulation can be set.
    pub const SIMULATION_STATE_SETTING: u16 = 25;
    /// The simulation can be paused.
    pub const SIMULATION_STATE_PAUSE: u16 = 26;
    /// One step can be made.
    pub const STEP_SIMULATION_SINGLE: u16 = 31;
    /// Several steps can be made.
    pub const STEP_SIMULATION_MULTIPLE: u16 = 32;
    /// There is the action of steps.
    pub const STEP_SIMULATION_ACTION: u16 = 33;
}

/// Where an entity is and how it moves.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EntityState {
    /// Sim time and frame; no frame is that of the world.
    pub header: Header,
    /// Where.
    pub pose: Pose,
    /// How it moves, in the frame of the header.
    pub twist: Twist,
    /// How that changes.
    pub acceleration: Accel,
}

/// What kind of thing an entity is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct EntityCategory {
    /// One of the constants.
    pub category: u8,
}

impl EntityCategory {
    /// A robot.
    pub const ROBOT: u8 = 1;
}

/// What there is to know of an entity beside its state.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct EntityInfo {
    /// Its kind.
    pub category: EntityCategory,
    /// For people.
    pub description: String,
    /// Words that filters know.
    pub tags: Vec<String>,
}

/// Which tags an entity must have.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TagsFilter {
    /// None: all entities pass.
    pub tags: Vec<String>,
    /// One of the constants.
    pub filter_mode: u8,
}

impl TagsFilter {
    /// One of the tags.
    pub const ANY: u8 = 0;
    /// All of the tags.
    pub const ALL: u8 = 1;
}

/// A part of space.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Bounds {
    /// One of the constants.
    pub r#type: u8,
    /// What the kind says.
    pub points: Vec<Vector3>,
}

impl Bounds {
    /// None given.
    pub const EMPTY: u8 = 0;
    /// Two opposite corners.
    pub const BOX: u8 = 1;
    /// Three points or more.
    pub const CONVEX_HULL: u8 = 2;
    /// The centre, and a point whose x is the radius.
    pub const SPHERE: u8 = 3;
}

/// Which entities are meant.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EntityFilters {
    /// A regular expression that is found in the name; empty: all names.
    pub filter: String,
    /// One of these; none: all.
    pub categories: Vec<EntityCategory>,
    /// Tags.
    pub tags: TagsFilter,
    /// A part of space that the entity touches.
    pub bounds: Bounds,
}

/// Where to find something, or the thing itself.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Resource {
    /// Where.
    pub uri: String,
    /// The thing, if there is no address.
    pub resource_string: String,
}

/// A request without fields.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct NoRequest {}

/// A request that names an entity.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct EntityRequest {
    /// Its name.
    pub entity: String,
}

/// A request about some entities.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FilterRequest {
    /// Which.
    pub filters: EntityFilters,
}

/// A request for a state of the simulation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SetSimulationStateRequest {
    /// Which.
    pub state: SimulationState,
}

/// A request for steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StepRequest {
    /// How many.
    pub steps: u64,
}

/// A request to begin again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ResetRequest {
    /// What of: [`SCOPE_DEFAULT`](Self::SCOPE_DEFAULT), or a sum of the other constants.
    pub scope: u8,
}

impl ResetRequest {
    /// `scope`: everything.
    pub const SCOPE_DEFAULT: u8 = 0;
    /// `scope`: the time.
    pub const SCOPE_TIME: u8 = 1;
    /// `scope`: the state of entities.
    pub const SCOPE_STATE: u8 = 2;
    /// `scope`: entities that were spawned.
    pub const SCOPE_SPAWNED: u8 = 4;
    /// `scope`: everything.
    pub const SCOPE_ALL: u8 = 255;
}

/// A request to put an entity somewhere.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SetEntityStateRequest {
    /// Its name.
    pub entity: String,
    /// Where, and how it is to move.
    pub state: EntityState,
    /// Whether to set the pose.
    pub set_pose: bool,
    /// Whether to set the motion.
    pub set_twist: bool,
    /// Whether to set how the motion changes.
    pub set_acceleration: bool,
}

/// A request to add an entity.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SpawnEntityRequest {
    /// Its name.
    pub name: String,
    /// Whether it may get another one.
    pub allow_renaming: bool,
    /// What it is.
    pub entity_resource: Resource,
    /// The namespace of its topics.
    pub entity_namespace: String,
    /// Where.
    pub initial_pose: PoseStamped,
}

/// The answer of most services.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ResultResponse {
    /// What became of it.
    pub result: Result,
}

/// What the simulator can do.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FeaturesResponse {
    /// The list.
    pub features: SimulatorFeatures,
}

/// What the simulation is doing.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StateResponse {
    /// The state.
    pub state: SimulationState,
    /// What became of the request.
    pub result: Result,
}

/// Which entities there are.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct EntitiesResponse {
    /// What became of the request.
    pub result: Result,
    /// Their names.
    pub entities: Vec<String>,
}

/// Where an entity is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EntityStateResponse {
    /// What became of the request.
    pub result: Result,
    /// Its state.
    pub state: EntityState,
}

/// Where entities are.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EntitiesStatesResponse {
    /// What became of the request.
    pub result: Result,
    /// Their names.
    pub entities: Vec<String>,
    /// Their states, in the same order.
    pub states: Vec<EntityState>,
}

/// What there is to know of an entity.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct EntityInfoResponse {
    /// What became of the request.
    pub result: Result,
    /// The info.
    pub info: EntityInfo,
}

/// The space that an entity takes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EntityBoundsResponse {
    /// What became of the request.
    pub result: Result,
    /// The space, about its pose.
    pub bounds: Bounds,
}

/// Whether an entity was added.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SpawnEntityResponse {
    /// What became of the request.
    pub result: Result,
    /// The name it got.
    pub entity_name: String,
}

/// How far the steps of the action have come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StepsFeedback {
    /// Done.
    pub completed_steps: u64,
    /// To be done.
    pub remaining_steps: u64,
}

/// Code of `SetSimulationState`: it is in that state.
pub const ALREADY_IN_TARGET_STATE: u8 = 101;
/// Code of `SetSimulationState`: there is no way from this state to that one.
pub const INCORRECT_TRANSITION: u8 = 103;
/// Code of `SetEntityState`: the entity cannot be there.
pub const INVALID_POSE: u8 = 101;

/// Code of `SpawnEntity`: the name is taken.
pub const NAME_NOT_UNIQUE: u8 = 101;
/// Code of `SpawnEntity`: no entity can have this name.
pub const NAME_INVALID: u8 = 102;
/// Code of `SpawnEntity`: the simulator does not read such a resource.
pub const UNSUPPORTED_FORMAT: u8 = 103;
/// Code of `SpawnEntity`: the entity cannot have this namespace.
pub const NAMESPACE_INVALID: u8 = 105;
/// Code of `SpawnEntity`: the entity cannot be there.
pub const INVALID_SPAWN_POSE: u8 = 109;

services! { "simulation_interfaces" {
    /// What the simulator can do.
    GetSimulatorFeatures: NoRequest => FeaturesResponse;
    /// What the simulation is doing.
    GetSimulationState: NoRequest => StateResponse;
    /// Plays, pauses, stops or quits.
    SetSimulationState: SetSimulationStateRequest => ResultResponse;
    /// Makes steps; the answer comes when they are done.
    StepSimulation: StepRequest => ResultResponse;
    /// Begins again.
    ResetSimulation: ResetRequest => ResultResponse;
    /// Which entities there are.
    GetEntities: FilterRequest => EntitiesResponse;
    /// Where an entity is.
    GetEntityState: EntityRequest => EntityStateResponse;
    /// Where entities are.
    GetEntitiesStates: FilterRequest => EntitiesStatesResponse;
    /// What there is to know of an entity.
    GetEntityInfo: EntityRequest => EntityInfoResponse;
    /// The space that an entity takes.
    GetEntityBounds: EntityRequest => EntityBoundsResponse;
    /// Puts an entity somewhere.
    SetEntityState: SetEntityStateRequest => ResultResponse;
    /// Takes an entity away.
    DeleteEntity: EntityRequest => ResultResponse;
    /// Adds an entity.
    SpawnEntity: SpawnEntityRequest => SpawnEntityResponse;
} }

impl<'de> Deserialize<'de> for SetEntityStateRequest {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        const FIELDS: &[&str] = &["entity", "state", "set_pose", "set_twist", "set_acceleration"];
        deserializer.deserialize_struct("SetEntityStateRequest", FIELDS, OfEitherVersion)
    }
}

/// Reads a request of version 2, or one of version 1, which ends with the state: then the pose is
/// to be set.
struct OfEitherVersion;

impl<'de> Visitor<'de> for OfEitherVersion {
    type Value = SetEntityStateRequest;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a request to set the state of an entity")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut fields: A) -> std::result::Result<Self::Value, A::Error> {
        let missing = |field| serde::de::Error::missing_field(field);
        let entity = fields.next_element()?.ok_or_else(|| missing("entity"))?;
        let state = fields.next_element()?.ok_or_else(|| missing("state"))?;
        let (mut set_pose, mut set_twist, mut set_acceleration) = (true, false, false);
        // Any byte is a number, so what fails is that there is none.
        if let Ok(Some(flag)) = fields.next_element::<u8>() {
            let no_flag = || serde::de::Error::invalid_value(Unexpected::Unsigned(flag.into()), &"0 or 1");
            set_pose = [false, true].get(usize::from(flag)).copied().ok_or_else(no_flag)?;
            set_twist = fields.next_element()?.ok_or_else(|| missing("set_twist"))?;
            set_acceleration = fields.next_element()?.ok_or_else(|| missing("set_acceleration"))?;
        }
        Ok(SetEntityStateRequest { entity, state, set_pose, set_twist, set_acceleration })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cdr;

    #[test]
    fn a_request_of_either_version_to_set_a_state_is_understood() {
        let request = SetEntityStateRequest {
            entity: "agent_1".to_owned(),
            state: EntityState::default(),
            set_pose: false,
            set_twist: true,
            set_acceleration: false,
        };
        let bytes = cdr::encode(&request);
        assert_eq!(cdr::decode::<SetEntityStateRequest>(&bytes).unwrap(), request);
        let old: SetEntityStateRequest = cdr::decode(&bytes[..bytes.len() - 3]).unwrap();
        assert_eq!((old.set_pose, old.set_twist, &old.state), (true, false, &request.state));
        assert!(cdr::decode::<SetEntityStateRequest>(&bytes[..bytes.len() - 20]).is_err());
        for flags in [[7, 0, 0], [0, 7, 0], [0, 0, 7]] {
            let broken = [&bytes[..bytes.len() - 3], &flags].concat();
            assert!(cdr::decode::<SetEntityStateRequest>(&broken).is_err());
        }
    }

    #[test]
    fn a_request_without_fields_may_have_the_hidden_one() {
        for bytes in [&[0, 1, 0, 0][..], &[0, 1, 0, 0, 0], &[0, 1, 0, 0, 9]] {
            assert!(cdr::decode::<NoRequest>(bytes).is_ok());
        }
    }
}
