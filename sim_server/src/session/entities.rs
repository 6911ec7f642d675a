//! The agents as entities of `simulation_interfaces`: their names, states, bounds and poses.
//!
//! Entity `agent_3` is agent 3: category `ROBOT`, tagged with its controller. Its state is the
//! ground truth, in the frame `map`.
//!
//! Invariant: no response is longer than the transport can send; a longer one is refused.

use msgs::cdr;
use msgs::geometry_msgs::{Accel, Point, PoseStamped, Quaternion, Twist, Vector3 as Triple};
use msgs::ids::AgentId;
use msgs::simulation_interfaces::{
    Bounds, EntityCategory, EntityFilters, EntityInfo, EntityState, GetEntitiesResponse, GetEntitiesStatesResponse,
    GetEntityBoundsResponse, GetEntityInfoResponse, GetEntityStateResponse, Resource, Result as Outcome,
    SetEntityStateRequest, SetEntityStateResponse, SpawnEntityRequest, SpawnEntityResponse, TagsFilter,
};
use nalgebra::{Point3, Vector3};
use regex_lite::{Regex, RegexBuilder};
use serde::Serialize;

use simulation::wire;
use world::body::Pose;
use world::{World, collision};

/// Maximum bytes of a regular expression, and of its compiled form.
const FILTER_BYTES_MAX: usize = 1024;
const FILTER_SIZE_MAX: usize = 1 << 20;

/// Maximum names in an error.
const NAMES_MAX: usize = 10;

/// Maximum characters quoted from a foreign text.
const TEXT_CHARS_MAX: usize = 200;

/// Tolerance of an orientation: deviation from upright, and of its norm from 1.
const TILT_MAX: f64 = 1e-3;

/// The agents of a run, as far as services need them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Team<'a> {
    pub(super) world: &'a World,
    /// Controller label, by agent.
    pub(super) controllers: &'a [String],
    /// Whether an agent has left the run, by agent.
    pub(super) has_left: &'a [bool],
    /// Longest response, bytes.
    pub(super) answer_bytes_max: usize,
}

#[must_use]
pub(super) fn name(agent: AgentId) -> String {
    format!("agent_{agent}")
}

impl Team<'_> {
    /// The agents that have not left, ascending.
    fn agents(&self) -> impl Iterator<Item = AgentId> {
        self.world.agents().filter(|agent| !self.has_left.get(agent.index()).copied().unwrap_or(false))
    }

    /// The agent with this name.
    ///
    /// # Errors
    /// The result that names the unknown entity.
    pub(super) fn find(&self, entity: &str) -> Result<AgentId, Outcome> {
        self.agents().find(|&agent| name(agent) == entity).ok_or_else(|| {
            let shown: String = entity.chars().take(64).collect();
            Outcome::failure(
                Outcome::RESULT_NOT_FOUND,
                format!("there is no entity `{shown}`; agents are agent_0, agent_1 ..."),
            )
        })
    }

    /// The agents that pass a filter, ascending.
    ///
    /// # Errors
    /// The result that names the illegal filter.
    pub(super) fn filtered(&self, filters: &EntityFilters) -> Result<Vec<AgentId>, Outcome> {
        let EntityFilters { filter, categories, tags, bounds } = filters;
        let pattern = pattern(filter)?;
        let region = Region::new(bounds)?;
        if tags.filter_mode > TagsFilter::FILTER_MODE_ALL {
            return Err(failed(format!("filters.tags.filter_mode = {}: expected 0 or 1", tags.filter_mode)));
        }
        let is_meant = |&agent: &AgentId| {
            let has = |tag: &String| self.tags(agent).contains(tag);
            let are_there = match tags.filter_mode {
                TagsFilter::FILTER_MODE_ALL => tags.tags.iter().all(has),
                _ => tags.tags.is_empty() || tags.tags.iter().any(has),
            };
            (categories.is_empty() || categories.contains(&EntityCategory { category: EntityCategory::CATEGORY_ROBOT }))
                && are_there
                && pattern.as_ref().is_none_or(|pattern| pattern.is_match(&name(agent)))
                && region.touches(&self.world.body(agent).sphere())
        };
        Ok(self.agents().filter(is_meant).collect())
    }

    /// Name of the controller, without its settings.
    fn tags(&self, agent: AgentId) -> Vec<String> {
        let controller = self.controllers.get(agent.index()).and_then(|label| label.split_whitespace().next());
        controller.into_iter().map(|name| name.chars().take(TEXT_CHARS_MAX).collect()).collect()
    }

    fn fits(&self, response: &impl Serialize) -> bool {
        cdr::encode(response).len() <= self.answer_bytes_max
    }

    fn too_many(&self, what: &str, count: usize) -> Outcome {
        let max = self.answer_bytes_max;
        failed(format!("the {what} of {count} entities do not fit into an answer of {max} bytes: filter for fewer"))
    }

    /// The answer to `GetEntities`.
    #[must_use]
    pub(super) fn entities(&self, filters: &EntityFilters) -> GetEntitiesResponse {
        match self.filtered(filters) {
            Ok(agents) => {
                let count = agents.len();
                let entities = agents.into_iter().map(name).collect();
                let response = GetEntitiesResponse { result: Outcome::ok(), entities };
                let refused = || GetEntitiesResponse { result: self.too_many("names", count), entities: Vec::new() };
                if self.fits(&response) { response } else { refused() }
            }
            Err(result) => GetEntitiesResponse { result, entities: Vec::new() },
        }
    }

    /// The answer to `GetEntitiesStates`.
    #[must_use]
    pub(super) fn states(&self, filters: &EntityFilters) -> GetEntitiesStatesResponse {
        let refused = |result| GetEntitiesStatesResponse { result, ..GetEntitiesStatesResponse::default() };
        match self.filtered(filters) {
            Ok(agents) => {
                let states = agents.iter().map(|&agent| self.state_of(agent)).collect();
                let entities = agents.into_iter().map(name).collect();
                let response = GetEntitiesStatesResponse { result: Outcome::ok(), entities, states };
                let count = response.entities.len();
                if self.fits(&response) { response } else { refused(self.too_many("states", count)) }
            }
            Err(result) => refused(result),
        }
    }

    /// The answer to `GetEntityState`.
    #[must_use]
    pub(super) fn state(&self, entity: &str) -> GetEntityStateResponse {
        match self.find(entity) {
            Ok(agent) => GetEntityStateResponse { result: Outcome::ok(), state: self.state_of(agent) },
            Err(result) => GetEntityStateResponse { result, state: EntityState::default() },
        }
    }

    fn state_of(&self, agent: AgentId) -> EntityState {
        let body = self.world.body(agent);
        EntityState {
            header: wire::header(self.world.tick()),
            pose: wire::pose(body.pose()),
            twist: Twist {
                linear: wire::vector(&body.velocity_in_map_m_s()),
                angular: Triple { x: 0.0, y: 0.0, z: body.yaw_rate_rad_s() },
            },
            acceleration: Accel::default(),
        }
    }

    /// The answer to `GetEntityInfo`.
    #[must_use]
    pub(super) fn info(&self, entity: &str) -> GetEntityInfoResponse {
        match self.find(entity) {
            Ok(agent) => {
                let tags = self.tags(agent);
                let label = self.controllers.get(agent.index()).map_or("", String::as_str);
                let controller: String = label.chars().take(TEXT_CHARS_MAX).collect();
                let description = format!("agent {agent}, controller {controller}");
                let info = EntityInfo {
                    category: EntityCategory { category: EntityCategory::CATEGORY_ROBOT },
                    description,
                    tags,
                };
                GetEntityInfoResponse { result: Outcome::ok(), info }
            }
            Err(result) => GetEntityInfoResponse { result, info: EntityInfo::default() },
        }
    }

    /// The answer to `GetEntityBounds`: the bounding box of a spherical body.
    #[must_use]
    pub(super) fn bounds(&self, entity: &str) -> GetEntityBoundsResponse {
        match self.find(entity) {
            Ok(agent) => {
                let radius_m = self.world.body(agent).model().radius_m;
                let corner = |length| Triple { x: length, y: length, z: length };
                let points = vec![corner(radius_m), corner(-radius_m)];
                GetEntityBoundsResponse { result: Outcome::ok(), bounds: Bounds { r#type: Bounds::TYPE_BOX, points } }
            }
            Err(result) => GetEntityBoundsResponse { result, bounds: Bounds::default() },
        }
    }

    /// The agent and pose of a request.
    ///
    /// # Errors
    /// The result that explains the refusal. Free space is not checked here.
    pub(super) fn placement(&self, request: &SetEntityStateRequest) -> Result<(AgentId, Pose), Outcome> {
        let SetEntityStateRequest { entity, state, set_pose, set_twist, set_acceleration } = request;
        let agent = self.find(entity)?;
        if *set_twist || *set_acceleration {
            return Err(Outcome::failure(
                Outcome::RESULT_FEATURE_UNSUPPORTED,
                "the agent's task moves its body: only the pose can be set",
            ));
        }
        if !set_pose {
            return Err(failed("nothing is to be set: expected set_pose = true"));
        }
        let invalid = |reason: String| Outcome::failure(SetEntityStateResponse::INVALID_POSE, reason);
        let pose = pose("state.", &state.header.frame_id, &state.pose).map_err(invalid)?;
        Ok((agent, pose))
    }

    /// The agent of the reserve that a request means, and its pose. `waiting` are those that have
    /// not joined. A position of zeros, which is a wall in every map, stands for the start pose.
    ///
    /// # Errors
    /// The result that explains the refusal. Free space is not checked here.
    pub(super) fn to_spawn(
        self,
        request: &SpawnEntityRequest,
        waiting: &[AgentId],
    ) -> Result<(AgentId, Pose), Outcome> {
        let SpawnEntityRequest { name: wanted, allow_renaming, entity_resource, entity_namespace, initial_pose } =
            request;
        let Some(&first) = waiting.first() else {
            let reason = "no agent waits; a scenario lists those that may join in agents.reserve";
            return Err(Outcome::failure(Outcome::RESULT_FEATURE_UNSUPPORTED, reason));
        };
        let is_taken = self.find(wanted).is_ok();
        let agent = match waiting.iter().find(|&&agent| name(agent) == *wanted) {
            Some(&agent) => agent,
            None if *allow_renaming => first,
            None if is_taken => {
                return Err(Outcome::failure(
                    SpawnEntityResponse::NAME_NOT_UNIQUE,
                    format!("{wanted} is in the world"),
                ));
            }
            None => {
                let names: Vec<String> = waiting.iter().take(NAMES_MAX).map(|&agent| name(agent)).collect();
                let more = if waiting.len() > NAMES_MAX { " ..." } else { "" };
                let expected = format!("name: expected one of {}{more}, or allow_renaming", names.join(", "));
                return Err(Outcome::failure(SpawnEntityResponse::NAME_INVALID, expected));
            }
        };
        if *entity_resource != Resource::default() {
            let reason = "entity_resource: expected nothing, because an agent of the scenario joins";
            return Err(Outcome::failure(SpawnEntityResponse::UNSUPPORTED_FORMAT, reason));
        }
        if !["".to_owned(), name(agent), format!("/{}", name(agent))].contains(entity_namespace) {
            let reason = format!("entity_namespace: expected {} or nothing", name(agent));
            return Err(Outcome::failure(SpawnEntityResponse::NAMESPACE_INVALID, reason));
        }
        let PoseStamped { header, pose: wished } = initial_pose;
        if wished.position == Point::default() {
            return Ok((agent, *self.world.body(agent).pose()));
        }
        let invalid = |reason: String| Outcome::failure(SpawnEntityResponse::INVALID_POSE, reason);
        Ok((agent, pose("initial_pose.", &header.frame_id, wished).map_err(invalid)?))
    }
}

/// A pose of a request in the frame `map`, or what is wrong with it; `place` names the part of the
/// request.
fn pose(place: &str, frame: &str, pose: &msgs::geometry_msgs::Pose) -> Result<Pose, String> {
    if !matches!(frame, "" | wire::MAP_FRAME) {
        return Err(format!("{place}header.frame_id: expected {} or nothing", wire::MAP_FRAME));
    }
    let position = pose.position;
    if ![position.x, position.y, position.z].iter().all(|number| number.is_finite()) {
        let Point { x, y, z } = position;
        return Err(format!("{place}pose.position: x = {x}, y = {y}, z = {z}: expected finite numbers"));
    }
    let yaw_rad = yaw(&pose.orientation).ok_or_else(|| {
        let Quaternion { x, y, z, w } = pose.orientation;
        format!(
            "{place}pose.orientation: x = {x}, y = {y}, z = {z}, w = {w}: expected a unit quaternion that turns about \
             z only"
        )
    })?;
    Ok(Pose { position: Point3::new(position.x, position.y, position.z), yaw_rad })
}

/// Yaw of an upright orientation, rad; `None` if it is no unit quaternion or is tilted.
fn yaw(rotation: &Quaternion) -> Option<f64> {
    let Quaternion { x, y, z, w } = *rotation;
    let length = (x * x + y * y + z * z + w * w).sqrt();
    let is_upright = x.abs() <= TILT_MAX && y.abs() <= TILT_MAX;
    ((length - 1.0).abs() <= TILT_MAX && is_upright).then(|| 2.0 * libm::atan2(z, w))
}

fn pattern(filter: &str) -> Result<Option<Regex>, Outcome> {
    if filter.is_empty() {
        return Ok(None);
    }
    if filter.len() > FILTER_BYTES_MAX {
        let length = filter.len();
        return Err(failed(format!("filters.filter has {length} bytes, at most {FILTER_BYTES_MAX} are allowed")));
    }
    let built = RegexBuilder::new(filter).size_limit(FILTER_SIZE_MAX).build();
    let shortened = |error: regex_lite::Error| error.to_string().chars().take(TEXT_CHARS_MAX).collect::<String>();
    built.map(Some).map_err(|error| failed(format!("filters.filter: {}", shortened(error))))
}

/// A region to filter by.
enum Region {
    Everywhere,
    Sphere { centre: Point3<f64>, radius_m: f64 },
    Box { low: Point3<f64>, high: Point3<f64> },
}

impl Region {
    fn new(bounds: &Bounds) -> Result<Self, Outcome> {
        let point = |point: &Triple| Point3::new(point.x, point.y, point.z);
        let is_finite = |point: &Triple| [point.x, point.y, point.z].iter().all(|number| number.is_finite());
        let legal = |expected: &str| failed(format!("filters.bounds: expected {expected}"));
        match (bounds.r#type, &bounds.points[..]) {
            (Bounds::TYPE_EMPTY, _) => Ok(Self::Everywhere),
            (Bounds::TYPE_SPHERE, [centre, radius]) if is_finite(centre) && radius.x >= 0.0 => {
                Ok(Self::Sphere { centre: point(centre), radius_m: radius.x })
            }
            (Bounds::TYPE_SPHERE, _) => Err(legal("a centre and a point whose x is a radius of at least 0")),
            (Bounds::TYPE_BOX, [one, other]) if is_finite(one) && is_finite(other) => {
                Ok(Self::Box { low: point(one).inf(&point(other)), high: point(one).sup(&point(other)) })
            }
            (Bounds::TYPE_BOX, _) => Err(legal("two opposite corners")),
            (Bounds::TYPE_CONVEX_HULL, _) => Err(Outcome::failure(
                Outcome::RESULT_FEATURE_UNSUPPORTED,
                "filters.bounds: a box or a sphere is understood",
            )),
            (other, _) => Err(legal(&format!("type 0, 1 or 3, got {other}"))),
        }
    }

    fn touches(&self, body: &collision::Sphere) -> bool {
        let &collision::Sphere { centre: position, radius_m } = body;
        match self {
            Self::Everywhere => true,
            Self::Sphere { centre, radius_m: own } => (position - centre).norm() <= own + radius_m,
            Self::Box { low, high } => {
                let apart: Vector3<f64> = position - position.sup(low).inf(high);
                apart.norm() <= radius_m
            }
        }
    }
}

fn failed(reason: impl Into<String>) -> Outcome {
    Outcome::failure(Outcome::RESULT_OPERATION_FAILED, reason)
}

#[cfg(test)]
mod tests;
