//! Names of counters, and those that earlier versions of the protocol had.

use crate::maes_msgs::Counter;

impl Counter {
    /// The name that the counter has today. Builds with protocol 6 or earlier called messages of
    /// agents parcels.
    #[must_use]
    pub fn present_name(&self) -> String {
        self.name.strip_prefix("parcel").map_or_else(|| self.name.clone(), |rest| format!("message{rest}"))
    }
}
