//! What an operator ought to hear of the data behind a picture: repositories that do not answer, memory that is too small.
//! In: states as they are now, as often as one likes. Out: a sentence for each change. It mends nothing and keeps no log.

use std::collections::HashMap;
use std::time::Duration;

use repositories::RepositoryState;

/// A threshold is raised by factors of √2; less is rounding.
const RAISED: f64 = 1.01;

/// How fine the tiles of a picture are.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fineness {
    /// The side in wall pixels beyond which the scene wants tiles split.
    pub(crate) asked_px: f64,
    /// The side beyond which they were split.
    pub(crate) achieved_px: f64,
    /// A larger budget would not make them finer.
    pub(crate) is_device_bound: bool,
}

/// What was told.
#[derive(Debug, Default)]
pub(crate) struct Troubles {
    /// Repositories that did not answer when asked last, and for how long.
    away: HashMap<String, Duration>,
    /// The side of tiles that the scene asks for, and the largest that was told.
    told_px: [f64; 2],
}

impl Troubles {
    /// Sentences for repositories that have ceased to answer, or answer again.
    pub(crate) fn of_repositories(&mut self, states: &[RepositoryState]) -> Vec<String> {
        let mut sentences = Vec::new();
        for state in states {
            let address = &state.address;
            if state.reachable {
                if let Some(away) = self.away.remove(address) {
                    let seconds = away.as_secs_f64();
                    sentences.push(format!(
                        "{address} answers again, after at least {seconds:.0} s"
                    ));
                }
                continue;
            }
            let known = self.away.insert(address.clone(), state.unchanged_for);
            if known.is_none() {
                let why = state.last_failure.as_deref().unwrap_or("no answer");
                sentences.push(format!(
                    "{address} cannot be reached ({why}): what is not cached is shown coarser until it answers"
                ));
            }
        }
        sentences
    }

    /// A sentence where tiles are coarser than asked for, and coarser than was told before: `gpu_mib`, or the device,
    /// does not allow more.
    pub(crate) fn of_tiles(&mut self, fineness: Fineness, gpu_mib: u64) -> Option<String> {
        let Fineness {
            asked_px,
            achieved_px,
            is_device_bound,
        } = fineness;
        let told_px = match self.told_px {
            [asked, told] if asked == asked_px => told,
            _ => asked_px,
        };
        if achieved_px <= told_px * RAISED {
            return None;
        }
        self.told_px = [asked_px, achieved_px];
        let (what, remedy) = match is_device_bound {
            false => (
                format!("{gpu_mib} MiB of graphics memory do"),
                "raise cache.gpu_mib in the wall, or mesh.tile_px in the scene",
            ),
            true => (
                "the buffers that this graphics device can bind do".to_owned(),
                "give the node fewer pixels, or raise mesh.tile_px in the scene",
            ),
        };
        Some(format!(
            "{what} not hold what is seen at mesh.tile_px = {asked_px:.0}: tiles are split above {achieved_px:.0} \
             pixels instead; {remedy}"
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(reachable: bool, seconds: u64) -> RepositoryState {
        RepositoryState {
            address: "http://host/earth".to_owned(),
            reachable,
            unchanged_for: Duration::from_secs(seconds),
            requests: 1,
            retries: 0,
            failures: 0,
            bytes: 0,
            last_failure: Some("no answer within 10 s".to_owned()),
        }
    }

    #[test]
    fn an_outage_is_told_once_and_its_end_once() {
        let mut troubles = Troubles::default();
        assert!(troubles.of_repositories(&[state(true, 5)]).is_empty());
        let told = troubles.of_repositories(&[state(false, 0)]);
        assert!(
            told.len() == 1 && told.concat().contains("no answer within 10 s"),
            "{told:?}"
        );
        assert!(troubles.of_repositories(&[state(false, 61)]).is_empty());
        let told = troubles.of_repositories(&[state(true, 0)]);
        assert_eq!(
            told,
            ["http://host/earth answers again, after at least 61 s"]
        );
        assert!(troubles.of_repositories(&[state(true, 1)]).is_empty());
        assert_eq!(troubles.of_repositories(&[state(false, 0)]).len(), 1);
    }

    #[test]
    fn memory_that_is_too_small_is_told_when_it_gets_worse() {
        let mut troubles = Troubles::default();
        let fineness = |asked_px, achieved_px, is_device_bound| Fineness {
            asked_px,
            achieved_px,
            is_device_bound,
        };
        let mut told =
            |asked_px, achieved_px| troubles.of_tiles(fineness(asked_px, achieved_px, false), 64);
        assert_eq!(told(257.0, 257.0), None);
        let sentence = told(257.0, 363.5);
        assert!(
            sentence
                .is_some_and(|text| text.contains("364 pixels") && text.contains("cache.gpu_mib"))
        );
        assert_eq!(told(257.0, 363.5), None);
        assert_eq!(told(257.0, 257.0), None, "another view");
        assert_eq!(told(257.0, 363.5), None, "told before");
        assert!(told(257.0, 514.0).is_some());
        assert!(told(128.0, 181.0).is_some(), "another scene");
        assert_eq!(told(128.0, 181.0), None);
        let told = troubles.of_tiles(fineness(128.0, 512.0, true), 64);
        assert!(told.is_some_and(|text| text.contains("fewer pixels")));
    }
}
