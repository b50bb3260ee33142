//! How long to wait before the next attempt.
//!
//! In: how many attempts failed, what the server asked for, a random number. Out: a pause. It must not wait or look
//! at a clock. "Full jitter": a pause is a random part of an exponentially growing bound, which spreads the
//! clients of a failed server best (Brooker, "Exponential Backoff And Jitter", AWS Architecture Blog, 2015).

use std::hash::{BuildHasher as _, Hasher as _, RandomState};
use std::time::{Duration, SystemTime};

/// The pause after the `failed`-th failure in a row (1, 2, …): a part `random` (0…1) of `first` · 2^(failed − 1),
/// bounded by `longest`, but not less than what the server asked for. `None` if the server asked for more than
/// `longest`: then nobody should wait for it.
pub(crate) fn pause(
    failed: u32,
    random: f64,
    first: Duration,
    longest: Duration,
    asked: Option<Duration>,
) -> Option<Duration> {
    if asked.is_some_and(|asked| asked > longest) {
        return None;
    }
    let jitter = bound(failed, first, longest).mul_f64(random.clamp(0.0, 1.0));
    Some(jitter.max(asked.unwrap_or_default()))
}

/// `first` · 2^(failed − 1), at most `longest`.
pub(crate) fn bound(failed: u32, first: Duration, longest: Duration) -> Duration {
    let doublings = failed.saturating_sub(1).min(31);
    first.saturating_mul(1 << doublings).min(longest)
}

/// What a `Retry-After` header asks for: seconds, or a date (RFC 9110, §10.2.3). `None` if it is neither.
pub(crate) fn retry_after(text: &str, now: SystemTime) -> Option<Duration> {
    let text = text.trim();
    if !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit()) {
        // More digits than a number has are "very long".
        return Some(Duration::from_secs(text.parse().unwrap_or(u64::MAX)));
    }
    let date = httpdate::parse_http_date(text).ok()?;
    Some(date.duration_since(now).unwrap_or_default())
}

/// A number in 0…1 that differs between threads, processes and calls. Not for secrets.
pub(crate) fn random() -> f64 {
    let bits = RandomState::new().build_hasher().finish();
    (bits >> 11) as f64 / (1_u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;
    use proptest::prelude::*;

    const FIRST: Duration = Duration::from_millis(200);
    const LONGEST: Duration = Duration::from_secs(5);

    #[test]
    fn bounds_double_up_to_the_longest() {
        let bounds: Vec<u128> = (1..=7)
            .map(|failed| bound(failed, FIRST, LONGEST).as_millis())
            .collect();
        assert_eq!(bounds, [200, 400, 800, 1_600, 3_200, 5_000, 5_000]);
        assert_eq!(bound(u32::MAX, FIRST, LONGEST), LONGEST);
    }

    proptest! {
        #[test]
        fn pauses_are_between_nothing_and_the_bound(failed in 1_u32.., random in 0.0..1.0) {
            let pause = pause(failed, random, FIRST, LONGEST, None).unwrap();
            prop_assert!(pause <= bound(failed, FIRST, LONGEST));
            let due = bound(failed, FIRST, LONGEST).as_secs_f64() * random;
            prop_assert!((pause.as_secs_f64() - due).abs() < 1e-6);
        }
    }

    #[test]
    fn the_servers_wish_is_honoured_or_nothing_is_waited_for() {
        let asked = |seconds| {
            pause(
                1,
                0.5,
                FIRST,
                LONGEST,
                Some(Duration::from_secs_f64(seconds)),
            )
        };
        assert_eq!(asked(0.0), Some(Duration::from_millis(100)));
        assert_eq!(asked(2.0), Some(Duration::from_secs(2)));
        assert_eq!(asked(5.0), Some(LONGEST));
        assert_eq!(asked(5.1), None);
    }

    #[test]
    fn retry_after_is_seconds_or_a_date() {
        let now = SystemTime::UNIX_EPOCH + Duration::from_secs(784_111_777);
        let seconds = |text| retry_after(text, now).map(|wait| wait.as_secs());
        assert_eq!(seconds("120"), Some(120));
        assert_eq!(seconds(" 0 "), Some(0));
        // The example of RFC 9110, §5.6.7, is the moment 784111777.
        assert_eq!(seconds("Sun, 06 Nov 1994 08:49:47 GMT"), Some(10));
        assert_eq!(seconds("Sun, 06 Nov 1994 08:49:27 GMT"), Some(0));
        assert_eq!(seconds("99999999999999999999999"), Some(u64::MAX));
        for nonsense in ["", "-1", "soon", "1.5"] {
            assert_eq!(seconds(nonsense), None, "{nonsense}");
        }
    }

    #[test]
    fn random_numbers_are_spread() {
        let numbers: Vec<f64> = (0..1_000).map(|_| random()).collect();
        assert!(numbers.iter().all(|number| (0.0..1.0).contains(number)));
        let mean = numbers.iter().sum::<f64>() / 1_000.0;
        assert!((0.4..0.6).contains(&mean), "{mean}");
    }
}
