//! How long what is asked of a shared store may take.

use std::time::Duration;

/// How long a request may take that moves little, with all that is tried again.
pub(super) const SMALL: Duration = Duration::from_secs(20);
/// How long a download may stand still.
pub(super) const STILL: Duration = Duration::from_secs(20);
/// The slowest line on which an upload is waited for, in bytes a second.
const SLOWEST: u64 = 32 << 10;
/// How long a thing may take to be given up after somebody wants to stop.
pub(super) const PARTING: Duration = Duration::from_secs(2);

/// The longest that a run waits for a store elsewhere that does not answer, before it goes on without.
pub const LONGEST: Duration = SMALL;
/// How old must be what `gc` takes from a shared store: uploads that are under way end within that time.
pub const GRACE: Duration = Duration::from_secs(24 * 3600);
/// How young an object must be that a push relies on without giving it again.
pub(super) const RELIABLE: Duration = Duration::from_secs(12 * 3600);

/// The most requests at a time.
pub(super) const AT_ONCE: usize = 16;

/// Returns how long an upload of so many bytes may take.
pub(super) fn upload(bytes: u64) -> Duration {
    SMALL + Duration::from_secs(bytes / SLOWEST)
}
