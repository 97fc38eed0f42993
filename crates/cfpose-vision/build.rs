//! Sets `shared_data` where the real data are: tests that need them run there, and are listed as ignored elsewhere.

use std::path::PathBuf;

fn main() {
    println!("cargo::rustc-check-cfg=cfg(shared_data)");
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=CFPOSE_DATA");
    let folder = std::env::var_os("CFPOSE_DATA").map_or_else(|| PathBuf::from("../../../shared/data"), PathBuf::from);
    if folder.is_dir() {
        // Only a folder that is there is watched: cargo runs this again at every build for one that is not.
        println!("cargo::rerun-if-changed={}", folder.join("SOURCES.md").display());
        println!("cargo::rustc-cfg=shared_data");
    }
}
