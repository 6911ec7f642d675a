"""A participant of another DDS (Cyclone) that observes a run of two agents.

    cyclone_observer.py

Needs the package cyclonedds, and uses of ROS only the names of topics and types. Obeys
ROS_DOMAIN_ID, on this machine only. Prints `ready` when it has subscribed, and `received
everything` when it has. A failure goes to stderr, with exit code 1.
"""

import os
import sys
import time
from dataclasses import dataclass

# Discovery by unicast to the first participants, because loopback has no multicast.
os.environ["CYCLONEDDS_URI"] = """
<CycloneDDS><Domain>
  <General>
    <Interfaces><NetworkInterface address="127.0.0.1" multicast="false"/></Interfaces>
    <AllowMulticast>false</AllowMulticast>
  </General>
  <Discovery>
    <ParticipantIndex>auto</ParticipantIndex>
    <MaxAutoParticipantIndex>100</MaxAutoParticipantIndex>
    <Peers><Peer address="127.0.0.1"/></Peers>
  </Discovery>
</Domain></CycloneDDS>
"""

from cyclonedds.core import Policy, Qos  # noqa: E402
from cyclonedds.domain import DomainParticipant  # noqa: E402
from cyclonedds.idl import IdlStruct  # noqa: E402
from cyclonedds.idl.annotations import final  # noqa: E402
from cyclonedds.idl.types import array, float32, float64, int32, sequence, uint8, uint32  # noqa: E402
from cyclonedds.sub import DataReader  # noqa: E402
from cyclonedds.topic import Topic  # noqa: E402


@dataclass
@final
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
@final
class Duration(IdlStruct, typename="builtin_interfaces::msg::dds_::Duration_"):
    sec: int32
    nanosec: uint32


@dataclass
@final
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
@final
class ColorRGBA(IdlStruct, typename="std_msgs::msg::dds_::ColorRGBA_"):
    r: float32
    g: float32
    b: float32
    a: float32


@dataclass
@final
class Point(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    x: float64
    y: float64
    z: float64


@dataclass
@final
class Vector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    x: float64
    y: float64
    z: float64


@dataclass
@final
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
@final
class Pose(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    position: Point
    orientation: Quaternion


@dataclass
@final
class PoseWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::PoseWithCovariance_"):
    pose: Pose
    covariance: array[float64, 36]


@dataclass
@final
class Twist(IdlStruct, typename="geometry_msgs::msg::dds_::Twist_"):
    linear: Vector3
    angular: Vector3


@dataclass
@final
class TwistWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::TwistWithCovariance_"):
    twist: Twist
    covariance: array[float64, 36]


@dataclass
@final
class Clock(IdlStruct, typename="rosgraph_msgs::msg::dds_::Clock_"):
    clock: Time


@dataclass
@final
class Odometry(IdlStruct, typename="nav_msgs::msg::dds_::Odometry_"):
    header: Header
    child_frame_id: str
    pose: PoseWithCovariance
    twist: TwistWithCovariance


@dataclass
@final
class PointField(IdlStruct, typename="sensor_msgs::msg::dds_::PointField_"):
    name: str
    offset: uint32
    datatype: uint8
    count: uint32


@dataclass
@final
class PointCloud2(IdlStruct, typename="sensor_msgs::msg::dds_::PointCloud2_"):
    header: Header
    height: uint32
    width: uint32
    fields: sequence[PointField]
    is_bigendian: bool
    point_step: uint32
    row_step: uint32
    data: sequence[uint8]
    is_dense: bool


@dataclass
@final
class CompressedImage(IdlStruct, typename="sensor_msgs::msg::dds_::CompressedImage_"):
    header: Header
    format: str
    data: sequence[uint8]


@dataclass
@final
class UVCoordinate(IdlStruct, typename="visualization_msgs::msg::dds_::UVCoordinate_"):
    u: float32
    v: float32


@dataclass
@final
class MeshFile(IdlStruct, typename="visualization_msgs::msg::dds_::MeshFile_"):
    filename: str
    data: sequence[uint8]


@dataclass
@final
class Marker(IdlStruct, typename="visualization_msgs::msg::dds_::Marker_"):
    header: Header
    ns: str
    id: int32
    type: int32
    action: int32
    pose: Pose
    scale: Vector3
    color: ColorRGBA
    lifetime: Duration
    frame_locked: bool
    points: sequence[Point]
    colors: sequence[ColorRGBA]
    texture_resource: str
    texture: CompressedImage
    uv_coordinates: sequence[UVCoordinate]
    text: str
    mesh_resource: str
    mesh_file: MeshFile
    mesh_use_embedded_materials: bool


RELIABLE = Policy.Reliability.Reliable(0)
LATCHED = Policy.Durability.TransientLocal
TOPICS = {
    "/clock": (Clock, [RELIABLE], 20),
    "/agent_0/odom": (Odometry, [RELIABLE], 5),
    "/agent_1/points": (PointCloud2, [Policy.Reliability.BestEffort], 3),
    "/sim/map": (Marker, [RELIABLE, LATCHED], 1),
    "/sim/unexplored": (Marker, [RELIABLE, LATCHED], 1),
}


def check(holds, words):
    if not holds:
        sys.exit(f"wrong: {words}")


def listen(participant, name, kind, policies):
    qos = Qos(Policy.History.KeepLast(100), Policy.DataRepresentation(use_cdrv0_representation=True), *policies)
    return DataReader(participant, Topic(participant, f"rt{name}", kind, qos=qos), qos=qos)


# Row by row, without correlations: 1e-9 m^2 and rad^2.
EXACT = [1e-9 if place % 7 == 0 else 0.0 for place in range(36)]


def check_what_came(received):
    times_ns = [clock.clock.sec * 1_000_000_000 + clock.clock.nanosec for clock in received["/clock"]]
    check(times_ns == sorted(set(times_ns)), "the clock runs forwards")
    check(all(time_ns % 20_000_000 == 0 for time_ns in times_ns), "the clock shows fixed updates")
    for odometry in received["/agent_0/odom"]:
        check((odometry.header.frame_id, odometry.child_frame_id) == ("map", "agent_0/base_link"), "frames of odometry")
        check(0.0 < odometry.pose.pose.position.x < 20.0, f"the agent is in the map: {odometry.pose.pose.position}")
        check(list(odometry.pose.covariance) == EXACT, "the truth is exact")
    for cloud in received["/agent_1/points"]:
        check(cloud.header.frame_id == "agent_1/base_link", f"frame of points: {cloud.header.frame_id}")
        check([field.name for field in cloud.fields] == ["x", "y", "z"], "fields of points")
        check(len(cloud.data) == cloud.row_step == cloud.width * 12 > 0, "length of points")
    for marker in received["/sim/map"] + received["/sim/unexplored"]:
        check(marker.type == 6 and marker.header.frame_id == "map", "cubes in the map")
        check(len(marker.points) > 0 or marker.action == 2, "a marker without points is a deletion")
        check(all(0.0 < point.x < 20.0 for point in marker.points), "cubes are in the map")


def main():
    participant = DomainParticipant(int(os.environ["ROS_DOMAIN_ID"]))
    readers = {name: listen(participant, name, kind, policies) for name, (kind, policies, _) in TOPICS.items()}
    received = {name: [] for name in TOPICS}
    print("ready", flush=True)
    printed = time.monotonic()
    while any(len(received[name]) < wanted for name, (_, _, wanted) in TOPICS.items()):
        for name, reader in readers.items():
            received[name].extend(sample for sample in reader.take(100) if sample.__class__ is TOPICS[name][0])
        time.sleep(0.02)
        if time.monotonic() - printed > 10.0:
            printed = time.monotonic()
            print(f"received: {({name: len(came) for name, came in received.items()})}", file=sys.stderr, flush=True)
    check_what_came(received)
    print("received everything", flush=True)


if __name__ == "__main__":
    main()
