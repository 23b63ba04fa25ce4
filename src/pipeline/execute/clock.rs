//! Names the moment at which a run began.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use crate::store::Digest;

/// When a run began, and the id that it has from that.
pub(super) struct Begun {
    /// `20261122-130309-1a2b3c`: sorts by time; the end keeps apart what began in the same second.
    pub id: String,
    /// RFC 3339 in UTC, with milliseconds.
    pub started: String,
    pub instant: Instant,
}

impl Begun {
    pub(super) fn now() -> Self {
        static RUNS: AtomicU64 = AtomicU64::new(0);
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let unique = format!("{}-{}-{}", std::process::id(), since.as_nanos(), RUNS.fetch_add(1, Ordering::Relaxed));
        let ending = &Digest::of(unique.as_bytes()).to_hex()[..6];
        let (date, time) = date_and_time(since.as_secs());
        Self {
            id: format!("{}-{}-{ending}", date.replace('-', ""), time.replace(':', "")),
            started: written(since),
            instant: Instant::now(),
        }
    }
}

/// Returns the time as RFC 3339 has it, in UTC, with milliseconds.
#[must_use]
pub fn timestamp() -> String {
    written(SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default())
}

fn written(since: Duration) -> String {
    let (date, time) = date_and_time(since.as_secs());
    format!("{date}T{time}.{:03}Z", since.subsec_millis())
}

/// Returns the date and the time of day of a moment in seconds since 1970, UTC.
fn date_and_time(seconds: u64) -> (String, String) {
    // Days are counted in eras of 400 years, which are all alike, and years from March, so that the leap day is the last.
    let days = seconds / 86_400 + 719_468;
    let (era, day_of_era) = (days / 146_097, days % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 { month_from_march + 3 } else { month_from_march - 9 };
    let year = 400 * era + year_of_era + u64::from(month <= 2);
    let date = format!("{year:04}-{month:02}-{day:02}");
    (date, format!("{:02}:{:02}:{:02}", seconds / 3_600 % 24, seconds / 60 % 60, seconds % 60))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(seconds: u64, expected: &str) {
        let (date, time) = date_and_time(seconds);
        assert_eq!(format!("{date}T{time}"), expected);
    }

    #[test]
    fn moments_have_dates() {
        check(0, "1970-01-01T00:00:00");
        check(951_782_399, "2000-02-28T23:59:59");
        check(951_782_400, "2000-02-29T00:00:00");
        check(1_795_351_389, "2026-11-22T12:43:09");
        check(4_107_542_400, "2100-03-01T00:00:00");
    }

    #[test]
    fn runs_have_different_ids() {
        assert_ne!(Begun::now().id, Begun::now().id);
    }
}
