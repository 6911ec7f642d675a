//! The batteries of the bodies as messages.

use msgs::ids::AgentId;
use msgs::sensor_msgs::BatteryState;
use msgs::std_msgs::Header;

use crate::wire::header;
use world::World;

/// The battery of an agent; `None` if bodies need no energy. What a battery of joules does not have
/// (a voltage, a current, a charge in ampere hours, a temperature) is NaN.
pub(super) fn battery_state(world: &World, agent: AgentId) -> Option<BatteryState> {
    let energy = world.energy(agent)?;
    let (left_j, capacity_j) = (energy.left_j, energy.model.capacity_j);
    let status = match world.is_home(agent) {
        true if left_j >= capacity_j => BatteryState::POWER_SUPPLY_STATUS_FULL,
        true if energy.model.charge_w > 0.0 => BatteryState::POWER_SUPPLY_STATUS_CHARGING,
        true => BatteryState::POWER_SUPPLY_STATUS_NOT_CHARGING,
        false => BatteryState::POWER_SUPPLY_STATUS_DISCHARGING,
    };
    Some(BatteryState {
        header: Header { frame_id: String::new(), ..header(world.tick()) },
        voltage: f32::NAN,
        temperature: f32::NAN,
        current: f32::NAN,
        charge: f32::NAN,
        capacity: f32::NAN,
        design_capacity: f32::NAN,
        percentage: (left_j / capacity_j) as f32,
        power_supply_status: status,
        power_supply_health: BatteryState::POWER_SUPPLY_HEALTH_UNKNOWN,
        power_supply_technology: BatteryState::POWER_SUPPLY_TECHNOLOGY_UNKNOWN,
        present: true,
        ..BatteryState::default()
    })
}
