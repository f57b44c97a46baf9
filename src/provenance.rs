//! Provenance: build and commit of this executable, and versions of the libraries on which results
//! depend.

use std::fs::File;
use std::io::{self, Read};
use std::path::PathBuf;
use std::sync::LazyLock;

use xxhash_rust::xxh64::Xxh64;

/// Hash of an executable. Different executables almost certainly have different hashes.
pub type BuildId = [u8; 8];

static BUILD_ID: LazyLock<Option<BuildId>> =
    LazyLock::new(|| hash(File::open(executable()).ok()?).ok());

/// Hash of the running executable, computed once; `None` if it cannot be read.
#[must_use]
pub fn build_id() -> Option<BuildId> {
    *BUILD_ID
}

/// Build id as text, such as `3f00a91c5e7d2b48`.
#[must_use]
pub fn format_build_id(build: Option<BuildId>) -> String {
    match build {
        Some(id) => format!("{:016x}", u64::from_be_bytes(id)),
        None => "unknown".to_owned(),
    }
}

/// Build id from its text; `None` for an unknown build.
pub(crate) fn parse_build_id(text: &str) -> Option<BuildId> {
    u64::from_str_radix(text, 16).ok().map(u64::to_be_bytes)
}

/// Commit from which seedbed was built, such as `2b3c86f1a09d`, with the suffix `-dirty` if there
/// were uncommitted changes; `None` if it was built without version control.
#[must_use]
pub fn commit() -> Option<&'static str> {
    // Set by `build.rs`.
    option_env!("SEEDBED_COMMIT")
}

/// Versions of the libraries for physics, linear algebra and recordings, such as `rapier2d 0.36.1`;
/// empty if they were unknown when seedbed was built.
#[must_use]
pub fn dependency_versions() -> Vec<&'static str> {
    // Set by `build.rs`.
    let versions = option_env!("SEEDBED_DEPENDENCIES").unwrap_or_default();
    versions.split_terminator(", ").collect()
}

/// What the CPU can execute: a level of x86-64, such as `x86-64-v3` with AVX2 and FMA, or the name of
/// another architecture. Results do not depend on it.
#[must_use]
pub fn cpu_level() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::is_x86_feature_detected as has;
        let has_v2 = has!("sse4.2") && has!("ssse3") && has!("popcnt") && has!("cmpxchg16b");
        let has_v3 = has!("avx2") && has!("fma") && has!("bmi1") && has!("bmi2") && has!("f16c");
        let has_v4 = has!("avx512f") && has!("avx512bw") && has!("avx512dq") && has!("avx512vl");
        match (has_v2, has_v2 && has_v3, has_v2 && has_v3 && has_v4) {
            (_, _, true) => "x86-64-v4",
            (_, true, _) => "x86-64-v3",
            (true, ..) => "x86-64-v2",
            _ => "x86-64-v1",
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    std::env::consts::ARCH
}

/// Path of the running executable. On Linux it refers to the running version even if the file was
/// replaced.
fn executable() -> PathBuf {
    if cfg!(target_os = "linux") {
        PathBuf::from("/proc/self/exe")
    } else {
        std::env::current_exe().unwrap_or_default()
    }
}

fn hash(mut file: impl Read) -> io::Result<BuildId> {
    let mut hash = Xxh64::new(0);
    let mut buffer = vec![0; 1 << 20];
    loop {
        match file.read(&mut buffer) {
            Ok(0) => return Ok(hash.digest().to_be_bytes()),
            Ok(count) => hash.update(&buffer[..count]),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// XXH64 of no bytes with seed 0 is 0xEF46DB3751D8E999 (test vectors of xxHash).
    #[test]
    fn the_build_id_depends_on_all_bytes() {
        assert_eq!(format_build_id(hash(&[][..]).ok()), "ef46db3751d8e999");
        let bytes = vec![7; (1 << 20) + 1];
        assert_ne!(hash(&bytes[..]).unwrap(), hash(&bytes[1..]).unwrap());
        assert_eq!(format_build_id(None), "unknown");
        assert_eq!(parse_build_id("ef46db3751d8e999"), hash(&[][..]).ok());
        assert_eq!(parse_build_id("unknown"), None);
    }

    #[test]
    fn the_running_executable_has_a_build_id() {
        assert!(build_id().is_some() && build_id() == build_id());
    }

    /// `Cargo.lock` has exactly one version of each of these libraries.
    #[test]
    fn dependency_versions_equal_those_of_the_lock_file() {
        let lock_file = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.lock"));
        let lock_file = lock_file.unwrap();
        let versions = dependency_versions();
        assert_eq!(versions.len(), 3, "{versions:?}");
        for (name, dependency) in ["rapier2d", "nalgebra", "rerun"].iter().zip(versions) {
            let version = dependency.strip_prefix(name).unwrap().trim();
            let lock_entry = format!("name = \"{name}\"\nversion = \"{version}\"\n");
            assert!(lock_file.contains(&lock_entry), "{dependency}");
        }
    }
}
