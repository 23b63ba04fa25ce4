//! Parses, runs, and returns the exit code.

use std::process::ExitCode;

// Training allocates and frees large buffers all the time; this allocator keeps their pages.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    trodden::run(&trodden::stages::register())
}
