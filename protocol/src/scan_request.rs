//! The request of an agent to its LiDAR.
//!
//! The message is `maes_msgs/ScanRequest`.

use thiserror::Error;

use msgs::maes_msgs;

/// When the LiDAR of an agent scans from now on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ScanRequest {
    /// The schedule does not change; at the start it is that of the scenario.
    #[default]
    Keep,
    /// No scans.
    Never,
    /// One scan in the next tick, none after it.
    Once,
    /// A scan every so many ticks (at least 1), the first one in the next tick.
    Every(u32),
}

/// A `maes_msgs/ScanRequest` that is no request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum ScanRequestError {
    /// Scans at intervals of 0 ticks.
    #[error("lidar.period_ticks = 0, at least 1 is allowed")]
    ZeroPeriod,
    /// The kind is none of the constants.
    #[error("lidar.kind = {0}, 0 to 3 are allowed")]
    UnknownKind(u8),
}

impl TryFrom<maes_msgs::ScanRequest> for ScanRequest {
    type Error = ScanRequestError;

    fn try_from(message: maes_msgs::ScanRequest) -> Result<Self, ScanRequestError> {
        match message.kind {
            maes_msgs::ScanRequest::KEEP => Ok(Self::Keep),
            maes_msgs::ScanRequest::NEVER => Ok(Self::Never),
            maes_msgs::ScanRequest::ONCE => Ok(Self::Once),
            maes_msgs::ScanRequest::EVERY if message.period_ticks >= 1 => Ok(Self::Every(message.period_ticks)),
            maes_msgs::ScanRequest::EVERY => Err(ScanRequestError::ZeroPeriod),
            other => Err(ScanRequestError::UnknownKind(other)),
        }
    }
}

impl From<ScanRequest> for maes_msgs::ScanRequest {
    fn from(request: ScanRequest) -> Self {
        let (kind, period_ticks) = match request {
            ScanRequest::Keep => (Self::KEEP, 0),
            ScanRequest::Never => (Self::NEVER, 0),
            ScanRequest::Once => (Self::ONCE, 0),
            ScanRequest::Every(period_ticks) => (Self::EVERY, period_ticks),
        };
        Self { kind, period_ticks }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn message_round_trips() {
        for request in [ScanRequest::Keep, ScanRequest::Never, ScanRequest::Once, ScanRequest::Every(3)] {
            assert_eq!(ScanRequest::try_from(maes_msgs::ScanRequest::from(request)), Ok(request));
        }
    }

    #[test]
    fn illegal_messages_are_refused() {
        let request = |kind, period_ticks| ScanRequest::try_from(maes_msgs::ScanRequest { kind, period_ticks });
        assert_eq!(request(maes_msgs::ScanRequest::EVERY, 0), Err(ScanRequestError::ZeroPeriod));
        assert_eq!(request(4, 1), Err(ScanRequestError::UnknownKind(4)));
    }
}
