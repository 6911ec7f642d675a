//! The names that `rmw_zenoh` gives to topics, services and the entities of the graph.
//!
//! Data is under `<domain>/<topic>/<type>/<type hash>`. Each node and endpoint has a liveliness
//! token under `@ros2_lv`, from which others build the graph; the hash of the token is the
//! endpoint's id (GID). Slashes of names are percent signs in tokens.
//!
//! Pure: no function here knows a session.

use std::fmt;

use msgs::topics::{Durability, Qos, Reliability};
use twox_hash::XxHash3_128;

/// Where all tokens are.
const ADMIN_SPACE: &str = "@ros2_lv";

/// The depth that tokens leave out, the default of `rmw_zenoh`.
const DEFAULT_DEPTH: u32 = 42;

/// Chunks of the token of an endpoint.
const TOKEN_CHUNKS: usize = 13;

/// A node of this process, always in the root namespace and without an enclave.
pub(super) struct Node {
    pub(super) domain_id: u16,
    /// Id of the session, in hexadecimal digits.
    pub(super) session: String,
    pub(super) id: u64,
    pub(super) name: String,
}

/// What an endpoint carries.
pub(super) struct Endpoint {
    /// Topic or service, absolute.
    pub(super) name: String,
    /// The name of its type in DDS, such as `std_msgs::msg::dds_::Header_`.
    pub(super) type_name: String,
    pub(super) type_hash: String,
    pub(super) qos: Qos,
}

/// Which end it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum EndpointKind {
    Publisher,
    Subscription,
    ServiceServer,
}

impl EndpointKind {
    fn code(self) -> &'static str {
        match self {
            EndpointKind::Publisher => "MP",
            EndpointKind::Subscription => "MS",
            EndpointKind::ServiceServer => "SS",
        }
    }
}

impl Node {
    /// The token of the node.
    pub(super) fn token(&self) -> String {
        self.chunks(self.id, "NN")
    }

    /// The token of an endpoint of the node.
    pub(super) fn endpoint_token(&self, id: u64, kind: EndpointKind, endpoint: &Endpoint) -> String {
        let Endpoint { name, type_name, type_hash, qos } = endpoint;
        format!("{}/{}/{type_name}/{type_hash}/{}", self.chunks(id, kind.code()), mangled(name), qos_text(qos))
    }

    fn chunks(&self, id: u64, code: &str) -> String {
        let Node { domain_id, session, id: node, name } = self;
        format!("{ADMIN_SPACE}/{domain_id}/{session}/{node}/{id}/{code}/%/%/{}", mangled(name))
    }
}

impl fmt::Display for Endpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} [{}]", self.name, self.type_name)
    }
}

impl Endpoint {
    /// The key expression of the data.
    pub(super) fn key(&self, domain_id: u16) -> String {
        let Endpoint { name, type_name, type_hash, .. } = self;
        format!("{domain_id}/{}/{type_name}/{type_hash}", name.trim_matches('/'))
    }
}

/// The key expression of all tokens of a domain.
pub(super) fn tokens(domain_id: u16) -> String {
    format!("{ADMIN_SPACE}/{domain_id}/**")
}

/// The id of an endpoint by its token.
pub(super) fn gid(token: &str) -> [u8; 16] {
    XxHash3_128::oneshot(token.as_bytes()).to_le_bytes()
}

/// A publisher or subscription of any process.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Entity {
    pub(super) kind: EndpointKind,
    pub(super) topic: String,
    /// Its session in hexadecimal digits.
    pub(super) session: String,
}

impl Entity {
    /// The publisher or subscription of a token, if it is one of these.
    pub(super) fn of_token(token: &str) -> Option<Self> {
        let chunks: Vec<&str> = token.split('/').collect();
        if chunks.len() < TOKEN_CHUNKS || chunks[0] != ADMIN_SPACE {
            return None;
        }
        let kind =
            [EndpointKind::Publisher, EndpointKind::Subscription].into_iter().find(|of| of.code() == chunks[5])?;
        Some(Entity { kind, topic: chunks[9].replace('%', "/"), session: chunks[2].to_owned() })
    }
}

/// The bytes of a session id that is given in hexadecimal digits, which begin with the last byte.
pub(super) fn session_bytes(digits: &str) -> Option<[u8; 16]> {
    u128::from_str_radix(digits, 16).ok().map(u128::to_le_bytes)
}

fn mangled(name: &str) -> String {
    if name.is_empty() { "%".to_owned() } else { name.replace('/', "%") }
}

/// A QoS as tokens have it: each policy that is not the default of `rmw_zenoh`, by its number
/// there.
fn qos_text(qos: &Qos) -> String {
    let reliability = match qos.reliability {
        Reliability::Reliable => "",
        Reliability::BestEffort => "2",
    };
    let durability = match qos.durability {
        Durability::Volatile => "",
        Durability::TransientLocal => "1",
    };
    let depth = if qos.depth == DEFAULT_DEPTH { String::new() } else { qos.depth.to_string() };
    format!("{reliability}:{durability}:,{depth}:,:,:,,")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node() -> Node {
        Node { domain_id: 2, session: "aac3178e146ba6f1fc6e6a4085e77f21".to_owned(), id: 0, name: "talker".to_owned() }
    }

    fn chatter(qos: Qos) -> Endpoint {
        let type_hash = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18".to_owned();
        let type_name = "std_msgs::msg::dds_::String_".to_owned();
        Endpoint { name: "/robot1/chatter".to_owned(), type_name, type_hash, qos }
    }

    /// The examples of the design document of `rmw_zenoh`.
    #[test]
    fn names_are_those_of_rmw_zenoh() {
        let endpoint = chatter(Qos::reliable(7));
        let hash = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18";
        assert_eq!(endpoint.key(2), format!("2/robot1/chatter/std_msgs::msg::dds_::String_/{hash}"));
        assert_eq!(node().token(), "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/talker");
        assert_eq!(
            node().endpoint_token(10, EndpointKind::Publisher, &endpoint),
            format!(
                "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/10/MP/%/%/talker/%robot1%chatter/\
                 std_msgs::msg::dds_::String_/{hash}/::,7:,:,:,,"
            )
        );
    }

    #[test]
    fn tokens_state_what_is_not_the_default() {
        let unacknowledged = Qos { reliability: Reliability::BestEffort, ..Qos::reliable(42) };
        assert_eq!(qos_text(&Qos::latched(1)), ":1:,1:,:,:,,");
        assert_eq!(qos_text(&unacknowledged), "2::,:,:,:,,");
    }

    #[test]
    fn tokens_of_endpoints_are_read() {
        for kind in [EndpointKind::Publisher, EndpointKind::Subscription] {
            let token = node().endpoint_token(3, kind, &chatter(Qos::reliable(1)));
            let expected = Entity { kind, topic: "/robot1/chatter".to_owned(), session: node().session };
            assert_eq!(Entity::of_token(&token), Some(expected));
        }
        let service = node().endpoint_token(3, EndpointKind::ServiceServer, &chatter(Qos::reliable(1)));
        for other in [&service, &node().token(), "", "@ros2_lv/0", &service.replace("@ros2_lv", "lv")] {
            assert_eq!(Entity::of_token(other), None, "{other}");
        }
    }

    #[test]
    fn session_digits_are_its_bytes_from_the_last() {
        let mut bytes = [0; 16];
        bytes[..2].copy_from_slice(&[0x21, 0x7f]);
        assert_eq!(session_bytes("7f21"), Some(bytes));
        assert_eq!(session_bytes("x"), None);
        assert_eq!(session_bytes(""), None);
    }

    /// By the reference implementation of XXH3 with 128 bits (`xxhash` of PyPI).
    #[test]
    fn ids_are_hashes_of_tokens() {
        let expected = 0x6083_17bb_7bc8_44ee_da0f_3674_7c1e_e1a4;
        assert_eq!(gid("@ros2_lv/0/1/0/0/NN/%/%/listener"), u128::to_le_bytes(expected));
    }
}
