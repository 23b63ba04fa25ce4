//! Says how the program is linked: without a table of places to mend when it starts.
//!
//! A program that can be loaded anywhere has 200,000 of them, for the tables of its many generic functions. Writing those takes
//! 2 ms of each start, as much as everything else that a short command does.

fn main() {
    println!("cargo::rerun-if-changed=src/build.rs");
    let target = |name: &str| std::env::var(format!("CARGO_CFG_TARGET_{name}")).unwrap_or_default();
    if target("OS") == "linux" && target("ENV") == "gnu" {
        println!("cargo::rustc-link-arg-bins=-no-pie");
    }
}
