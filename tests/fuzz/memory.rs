//! An allocator that counts, and refuses what a case may not have.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicBool, AtomicIsize, Ordering};

/// What a case may hold at once.
pub const LIMIT: isize = 2 << 30;

/// The system's allocator; where [`limit`] has been called it counts what is held.
pub struct Counting;

static COUNTS: AtomicBool = AtomicBool::new(false);
static HELD: AtomicIsize = AtomicIsize::new(0);
static MOST: AtomicIsize = AtomicIsize::new(0);

/// Limits the process from now on: an allocation beyond [`LIMIT`] fails, which ends the process.
pub fn limit() {
    COUNTS.store(true, Ordering::Relaxed);
}

/// Starts counting anew; returns the most that was held since the last time, in bytes.
pub fn start() -> usize {
    HELD.store(0, Ordering::Relaxed);
    usize::try_from(MOST.swap(0, Ordering::Relaxed)).unwrap_or(0)
}

fn take(size: usize) -> bool {
    if !COUNTS.load(Ordering::Relaxed) {
        return true;
    }
    let size = isize::try_from(size).unwrap_or(isize::MAX);
    let held = HELD.fetch_add(size, Ordering::Relaxed).saturating_add(size);
    if held > LIMIT {
        HELD.fetch_sub(size, Ordering::Relaxed);
        return false;
    }
    MOST.fetch_max(held, Ordering::Relaxed);
    true
}

fn give(size: usize) {
    if COUNTS.load(Ordering::Relaxed) {
        HELD.fetch_sub(size as isize, Ordering::Relaxed);
    }
}

// SAFETY: every call goes to the system's allocator as it came, or fails as an allocator may.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if !take(layout.size()) {
            return std::ptr::null_mut();
        }
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        if !take(layout.size()) {
            return std::ptr::null_mut();
        }
        // SAFETY: the caller keeps the contract of `alloc_zeroed`.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        give(layout.size());
        // SAFETY: the caller keeps the contract of `dealloc`.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        if !take(size) {
            return std::ptr::null_mut();
        }
        give(layout.size());
        // SAFETY: the caller keeps the contract of `realloc`.
        unsafe { System.realloc(pointer, layout, size) }
    }
}
