//! The announcement of type hashes, by which ROS 2 tools check that two sides mean the same type.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use msgs::message::{ALL, MessageType};
pub(super) use msgs::type_hash::of;
#[cfg(feature = "zenoh")]
pub(super) use msgs::type_hash::{ActionHashes, of_action, of_service};

/// Lets all endpoints that this process makes from now on announce the hashes of their types.
///
/// The DDS library can do that with the fixes of `contrib/rustdds` only.
pub(super) fn announce() {
    /// What the published library does, which has no such function: a glob import shadows it.
    #[allow(dead_code, reason = "the copy with the fixes has the function")]
    fn set_type_user_data(_of_type: fn(&str) -> Option<Vec<u8>>) {}
    {
        #[allow(
            unused_imports,
            clippy::wildcard_imports,
            reason = "only the copy with the fixes has the function"
        )]
        use rustdds::discovery::*;
        set_type_user_data(user_data);
    }
}

/// The user data of an endpoint by the name that DDS has for its type, such as
/// `std_msgs::msg::dds_::Header_` (REP-2016).
fn user_data(dds_name: &str) -> Option<Vec<u8>> {
    static HASHES: OnceLock<BTreeMap<String, String>> = OnceLock::new();
    let hashes = HASHES.get_or_init(|| {
        let named = |message: &MessageType| format!("{}::msg::dds_::{}_", message.package, message.name);
        ALL.iter().map(|message| (named(message), of(*message))).collect()
    });
    hashes.get(dds_name).map(|hash| format!("typehash={hash};").into_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn endpoints_announce_the_hash_of_their_type() {
        let known = "typehash=RIHS01_b106235e25a4c5ed35098aa0a61a3ee9c9b18d197f398b0e4206cea9acf9c197;";
        assert_eq!(user_data("builtin_interfaces::msg::dds_::Time_").unwrap(), known.as_bytes());
        assert_eq!(user_data("std_msgs::msg::dds_::Unknown_"), None);
    }
}
