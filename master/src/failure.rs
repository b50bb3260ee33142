//! Why a command ended without success: the paragraph for the operator and the exit status.
//!
//! In: errors of the libraries. Out: one paragraph and a number. It must not print.

use std::fmt;

use master::StartError;

/// Exit status of a failure.
pub(crate) const FAILED: u8 = 1;
/// Exit status of wrong usage or configuration.
pub(crate) const USAGE: u8 = 2;

/// Why a command ended without success.
#[derive(Debug)]
pub(crate) enum Failure {
    /// What was asked for cannot be right: arguments, wall, scene, identity.
    Configuration(anyhow::Error),
    /// It was right, and did not work out.
    Failed(anyhow::Error),
}

impl Failure {
    /// A failure with a message of its own.
    pub(crate) fn failed(message: impl fmt::Display) -> Self {
        Self::Failed(anyhow::Error::msg(message.to_string()))
    }

    /// A wrong configuration with a message of its own.
    pub(crate) fn configuration(message: impl fmt::Display) -> Self {
        Self::Configuration(anyhow::Error::msg(message.to_string()))
    }

    /// A master that did not start: the files of its wall belong to its configuration.
    pub(crate) fn of_start(error: StartError) -> Self {
        match error {
            StartError::Surfaces(_) => Self::Configuration(error.into()),
            other => other.into(),
        }
    }

    /// The error inside, for another failure to carry on.
    pub(crate) fn into_error(self) -> anyhow::Error {
        let (Self::Configuration(error) | Self::Failed(error)) = self;
        error
    }

    /// The exit status.
    pub(crate) fn exit_code(&self) -> u8 {
        match self {
            Self::Configuration(_) => USAGE,
            Self::Failed(_) => FAILED,
        }
    }
}

impl fmt::Display for Failure {
    /// The whole chain of causes as one paragraph.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (Self::Configuration(error) | Self::Failed(error)) = self;
        let mut paragraph = String::new();
        for cause in error.chain() {
            let cause = cause
                .to_string()
                .lines()
                .map(str::trim)
                .collect::<Vec<_>>()
                .join(" ");
            // Many errors already repeat what caused them.
            if !paragraph.contains(cause.trim()) {
                paragraph.push_str(if paragraph.is_empty() { "" } else { ": " });
                paragraph.push_str(cause.trim());
            }
        }
        f.write_str(&paragraph)
    }
}

impl<E: Into<anyhow::Error>> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::Failed(error.into())
    }
}

/// Marks an error as one of configuration.
pub(crate) trait OrConfiguration<T> {
    /// The value, or the error with exit status 2.
    fn or_configuration(self) -> Result<T, Failure>;
}

impl<T, E: Into<anyhow::Error>> OrConfiguration<T> for Result<T, E> {
    fn or_configuration(self) -> Result<T, Failure> {
        self.map_err(|error| Failure::Configuration(error.into()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::anyhow;

    #[test]
    fn a_failure_is_one_paragraph_that_repeats_nothing() {
        let error = anyhow!("disk full")
            .context("cannot write report.json: disk full")
            .context("a\n  b");
        let failure = Failure::Failed(error);
        assert_eq!(
            failure.to_string(),
            "a b: cannot write report.json: disk full"
        );
        assert_eq!(
            (failure.exit_code(), Failure::configuration("x").exit_code()),
            (1, 2)
        );
    }
}
