//! Static peers: machines that a process announces itself to beside those that multicast reaches.
//!
//! One side of a pair is enough, because a participant answers an announcement to the addresses in
//! it. The DDS library has such a list with the fixes of `contrib/rustdds` only.

use std::net::{IpAddr, SocketAddr, ToSocketAddrs};

use super::RosError;
use super::dds::{DISCOVERABLE_IDS, discovery_port, has_fixes};
use crate::ros_env::RosEnv;

/// The addresses that announcements go to: the discovery ports of the first participants of each
/// machine.
pub(super) fn destinations(env: &RosEnv) -> Result<Vec<SocketAddr>, RosError> {
    let mut destinations = Vec::new();
    for peer in &env.static_peers {
        let failed = |reason: String| RosError::StaticPeer { peer: peer.clone(), reason };
        let addresses = (peer.as_str(), 0).to_socket_addrs().map_err(|error| failed(error.to_string()))?;
        let machine = addresses.map(|address| address.ip()).find(IpAddr::is_ipv4);
        let machine = machine.ok_or_else(|| failed("it has no IPv4 address".to_owned()))?;
        let ports = (0..DISCOVERABLE_IDS).map(|id| discovery_port(env.domain_id, id));
        destinations.extend(ports.map(|port| SocketAddr::new(machine, port)));
    }
    if !destinations.is_empty() && !has_fixes() {
        tracing::warn!(
            "ROS_STATIC_PEERS has no effect: this program was built without the fixes of contrib/rustdds, which \
             launch_scripts/build.sh builds with"
        );
    }
    Ok(destinations)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ros_env::DiscoveryRange;

    fn of(peers: &[&str]) -> Result<Vec<SocketAddr>, RosError> {
        let static_peers = peers.iter().map(|&peer| peer.to_owned()).collect();
        destinations(&RosEnv { domain_id: 1, range: DiscoveryRange::Subnet, static_peers, ..RosEnv::default() })
    }

    #[test]
    fn announcements_go_to_the_first_discovery_ports_of_a_machine() {
        let addresses = of(&["192.0.2.1", "localhost"]).unwrap();
        assert_eq!(addresses.len(), 2 * usize::from(DISCOVERABLE_IDS));
        assert_eq!(addresses[0], "192.0.2.1:7660".parse().unwrap());
        assert_eq!(addresses[1], "192.0.2.1:7662".parse().unwrap());
        assert_eq!(addresses[12].ip(), IpAddr::from([127, 0, 0, 1]));
        assert_eq!(of(&[]).unwrap(), []);
    }

    #[test]
    fn a_peer_without_an_address_is_named() {
        for wrong in ["no such machine", "::1"] {
            let error = of(&[wrong]).unwrap_err().to_string();
            assert!(error.starts_with(&format!("ROS_STATIC_PEERS: {wrong}: ")), "{error}");
        }
    }
}
