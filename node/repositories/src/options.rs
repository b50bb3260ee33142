//! How patient and how greedy the client of repositories is.
//! In: figures. Out: checked figures. It must not read the environment.

use std::path::PathBuf;
use std::time::Duration;

use thiserror::Error;

/// Most attempts for one file.
const MOST_ATTEMPTS: u32 = 20;
/// Most requests in flight.
const MOST_IN_FLIGHT: usize = 1_024;
/// Longest duration of any kind.
const LONGEST: Duration = Duration::from_secs(600);

/// Patience and limits. The defaults are for a wall that shares a site's link.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// Longest time for one attempt until the answer begins; its body gets 1 s more per 64 KiB. Over 0, at most
    /// 10 min.
    pub attempt_timeout: Duration,
    /// Attempts for one file, the first included: 1…20.
    pub attempts: u32,
    /// Requests at the same time, over all repositories: 1…1024.
    pub requests_in_flight: usize,
    /// The pause before the second attempt is a random part of this; each later one of twice as much.
    pub first_pause: Duration,
    /// A pause is never longer. A server that asks for more by `Retry-After` counts as unreachable until then.
    pub longest_pause: Duration,
    /// After so many failed attempts in a row, over all threads, a repository counts as unreachable: 1…1000.
    pub give_up_after: u32,
    /// How long after that the first probe follows; the pauses between probes double.
    pub first_probe: Duration,
    /// The longest pause between probes: how late the return of a server may be noticed.
    pub longest_probe: Duration,
    /// Credentials for `s3://`, beside those of the environment. `None`: the environment alone.
    pub credentials_file: Option<PathBuf>,
}

/// Why options were refused.
#[derive(Debug, Error, PartialEq, Eq)]
#[error("{key} = {value} is out of range: {range}")]
pub struct OptionsError {
    /// The option.
    pub key: &'static str,
    /// Its value.
    pub value: String,
    /// What is allowed.
    pub range: &'static str,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            attempt_timeout: Duration::from_secs(10),
            attempts: 4,
            requests_in_flight: 32,
            first_pause: Duration::from_millis(200),
            longest_pause: Duration::from_secs(5),
            give_up_after: 8,
            first_probe: Duration::from_millis(500),
            longest_probe: Duration::from_secs(4),
            credentials_file: None,
        }
    }
}

/// The variable that names a node's file with credentials for `s3://`.
pub const CREDENTIALS_VARIABLE: &str = "TERRAWALL_CREDENTIALS";

impl Options {
    /// The defaults, with the credentials file that [`CREDENTIALS_VARIABLE`] names, if it names one.
    #[must_use]
    pub fn from_environment() -> Self {
        let file = std::env::var_os(CREDENTIALS_VARIABLE).filter(|file| !file.is_empty());
        Self {
            credentials_file: file.map(PathBuf::from),
            ..Self::default()
        }
    }

    /// Whether all figures are in their ranges.
    ///
    /// # Errors
    /// [`OptionsError`], for the first that is not.
    pub fn check(&self) -> Result<(), OptionsError> {
        for (key, value) in [
            ("attempt_timeout", self.attempt_timeout),
            ("first_pause", self.first_pause),
            ("longest_pause", self.longest_pause),
            ("first_probe", self.first_probe),
            ("longest_probe", self.longest_probe),
        ] {
            if value.is_zero() || value > LONGEST {
                return Err(OptionsError {
                    key,
                    value: format!("{value:?}"),
                    range: "more than 0, at most 600 s",
                });
            }
        }
        let counts = [
            (
                "attempts",
                self.attempts as usize,
                MOST_ATTEMPTS as usize,
                "1…20",
            ),
            (
                "requests_in_flight",
                self.requests_in_flight,
                MOST_IN_FLIGHT,
                "1…1024",
            ),
            (
                "give_up_after",
                self.give_up_after as usize,
                1_000,
                "1…1000",
            ),
        ];
        for (key, value, most, range) in counts {
            if !(1..=most).contains(&value) {
                return Err(OptionsError {
                    key,
                    value: value.to_string(),
                    range,
                });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_are_allowed_and_nonsense_is_named() {
        assert_eq!(Options::default().check(), Ok(()));
        let options = |change: fn(&mut Options)| {
            let mut options = Options::default();
            change(&mut options);
            options.check().map_err(|error| error.key)
        };
        assert_eq!(options(|o| o.attempts = 0), Err("attempts"));
        assert_eq!(options(|o| o.attempts = 21), Err("attempts"));
        assert_eq!(
            options(|o| o.requests_in_flight = 0),
            Err("requests_in_flight")
        );
        assert_eq!(
            options(|o| o.attempt_timeout = Duration::ZERO),
            Err("attempt_timeout")
        );
        assert_eq!(
            options(|o| o.longest_probe = Duration::from_secs(601)),
            Err("longest_probe")
        );
        assert_eq!(options(|o| o.give_up_after = 0), Err("give_up_after"));
    }
}
