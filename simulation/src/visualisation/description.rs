//! The bodies with their sensors as URDF, so that tools draw them where `/tf` places them.

use std::fmt::Write;

use msgs::ids::AgentId;
use msgs::std_msgs;
use protocol::limits::{MESSAGE_BYTES_BARE, VIEW_BYTES_MAX};

use crate::wire::{body_frame, lidar_frame, obstacle_frame, optical_frame};
use world::World;
use world::collision::{Shape, Solid};
use world::lidar::{NamedScanner, PlaceOnBody};

/// One robot of all agents: the link `map`, and on it for each agent a sphere
/// `agent_<id>/base_link` with its LiDARs where they are mounted, of which the only one is
/// `agent_<id>/lidar`, and the optical frames of cameras; and for each moving obstacle a link
/// `obstacle_<number>`. What does not fit into a sample is left out.
pub(super) fn robots(world: &World) -> std_msgs::String {
    const END: &str = "</robot>\n";
    let mut data = "<?xml version=\"1.0\"?>\n<robot name=\"maes\">\n  <link name=\"map\"/>\n".to_owned();
    let robots = world.agents().map(|agent| {
        let radius_m = world.body(agent).model().radius_m;
        robot(agent, radius_m, world.sensors(agent).lidars())
    });
    for one in robots.chain(world.moving_obstacles().iter().enumerate().map(|(number, solid)| obstacle(number, solid)))
    {
        if data.len() + one.len() + END.len() + MESSAGE_BYTES_BARE > VIEW_BYTES_MAX {
            break;
        }
        data += &one;
    }
    data += END;
    std_msgs::String { data }
}

fn obstacle(number: usize, solid: &Solid) -> String {
    let shape = match solid.shape {
        Shape::Sphere { radius_m } => format!("<sphere radius=\"{radius_m}\"/>"),
        Shape::Box { half_m } => {
            let [x, y, z] = (half_m * 2.0).into();
            format!("<box size=\"{x} {y} {z}\"/>")
        }
    };
    let (link, shape) = (obstacle_frame(number), format!("<geometry>{shape}</geometry>"));
    format!(
        "  <link name=\"{link}\">\n    <visual>{shape}<material name=\"obstacle\"><color rgba=\"0.9 0.4 0.1 1\"/>\
         </material></visual>\n    <collision>{shape}</collision>\n  </link>\n  <joint name=\"{link}_joint\" \
         type=\"floating\"><parent link=\"map\"/><child link=\"{link}\"/></joint>\n"
    )
}

/// The optical frame in the frame of its camera.
const OPTICAL: &str = "<origin xyz=\"0 0 0\" rpy=\"-1.5707963267948966 0 -1.5707963267948966\"/>";

fn robot(agent: AgentId, radius_m: f64, lidars: &[NamedScanner]) -> String {
    let mut text = String::new();
    let body = &body_frame(agent);
    let sphere = format!("<geometry><sphere radius=\"{radius_m}\"/></geometry>");
    let written = (|| {
        writeln!(text, "  <link name=\"{body}\">")?;
        writeln!(
            text,
            "    <visual>{sphere}<material name=\"body\"><color rgba=\"0.2 0.5 0.9 1\"/></material></visual>"
        )?;
        writeln!(text, "    <collision>{sphere}</collision>\n  </link>")?;
        let mut joints = vec![("floating", "map".to_owned(), body.clone(), String::new())];
        for NamedScanner { name, scanner } in lidars {
            let PlaceOnBody { height_m, pitch_rad, is_camera } = scanner.place_on_body();
            let (lidar, optical) = (lidar_frame(agent, *name), optical_frame(agent, *name));
            writeln!(text, "  <link name=\"{lidar}\">\n    <visual><origin xyz=\"0 0 {radius_m}\"/><geometry>")?;
            let (radius, length) = (radius_m / 3.0, radius_m / 4.0);
            writeln!(text, "      <cylinder radius=\"{radius}\" length=\"{length}\"/></geometry></visual>\n  </link>")?;
            let place = match (height_m, pitch_rad) {
                (0.0, 0.0) => String::new(),
                _ => format!("<origin xyz=\"0 0 {height_m}\" rpy=\"0 {} 0\"/>", -pitch_rad),
            };
            joints.push(("fixed", body.clone(), lidar.clone(), place));
            if is_camera {
                writeln!(text, "  <link name=\"{optical}\"/>")?;
                joints.push(("fixed", lidar, optical, OPTICAL.to_owned()));
            }
        }
        for (kind, parent, child, place) in joints {
            writeln!(
                text,
                "  <joint name=\"{child}_joint\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/>{place}</joint>"
            )?;
        }
        std::fmt::Result::Ok(())
    })();
    written.expect("a text can be written to");
    text
}
