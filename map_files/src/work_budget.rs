//! The work of an import, counted in steps: a bound on its time that is the same on every machine.

use super::{FormatError, ImportSpec};

/// Steps of an import unless an option says otherwise: some seconds on an ordinary machine.
pub(super) const STEPS_MAX: u64 = 1 << 28;

/// Steps that are left to an import.
pub(super) struct WorkBudget {
    left: u64,
    steps_max: u64,
}

impl WorkBudget {
    /// All steps that the options allow.
    pub(super) fn new(spec: &ImportSpec) -> Self {
        let steps_max = spec.options.steps_max.unwrap_or(STEPS_MAX);
        Self { left: steps_max, steps_max }
    }

    /// Takes some steps.
    ///
    /// # Errors
    /// If less are left.
    pub(super) fn spend(&mut self, steps: usize) -> Result<(), FormatError> {
        match self.left.checked_sub(steps as u64) {
            Some(left) => {
                self.left = left;
                Ok(())
            }
            None => Err(FormatError::TooMuchWork { steps_max: self.steps_max }),
        }
    }
}
