//! Which build runs: a mark of its executable, and the versions of the parts that decide what comes out.

use std::fs::File;
use std::io::{self, Read};
use std::path::PathBuf;
use std::sync::LazyLock;

use xxhash_rust::xxh64::Xxh64;

/// Equal for executables of equal bytes; nearly always different for others.
pub type BuildMark = [u8; 8];

/// What physics, algebra and recordings rest on.
const PARTS: [&str; 3] = ["rapier2d", "nalgebra", "rerun"];

const LOCK: &str = include_str!("../../Cargo.lock");

static MARK: LazyLock<Option<BuildMark>> =
    LazyLock::new(|| hash(File::open(running().ok()?).ok()?).ok());

/// The mark of the running executable, worked out once; none where that cannot be read.
#[must_use]
pub fn mark() -> Option<BuildMark> {
    *MARK
}

/// Such as `3f00a91c5e7d2b48`.
#[must_use]
pub fn in_words(build: Option<BuildMark>) -> String {
    build.map_or_else(
        || "unknown".to_owned(),
        |mark| format!("{:016x}", u64::from_be_bytes(mark)),
    )
}

/// The versions of the parts, such as `rapier2d 0.31.0`.
#[must_use]
pub fn parts() -> Vec<String> {
    PARTS
        .iter()
        .flat_map(|part| locked(LOCK, part).map(move |version| format!("{part} {version}")))
        .collect()
}

/// What runs, even where its file was replaced since it started.
fn running() -> io::Result<PathBuf> {
    if cfg!(target_os = "linux") {
        Ok(PathBuf::from("/proc/self/exe"))
    } else {
        std::env::current_exe()
    }
}

fn hash(mut file: impl Read) -> io::Result<BuildMark> {
    let (mut hash, mut part) = (Xxh64::new(0), vec![0; 1 << 20]);
    loop {
        match file.read(&mut part) {
            Ok(0) => return Ok(hash.digest().to_be_bytes()),
            Ok(count) => hash.update(&part[..count]),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}

/// The versions of a package in a `Cargo.lock`.
fn locked<'a>(lock: &'a str, package: &'a str) -> impl Iterator<Item = &'a str> {
    let of = |block: &'a str, field: &str| {
        let line = block.lines().find_map(|line| line.strip_prefix(field))?;
        line.strip_prefix(" = \"")?.strip_suffix('"')
    };
    let blocks = lock
        .split("[[package]]")
        .filter(move |block| of(block, "name") == Some(package));
    blocks.filter_map(move |block| of(block, "version"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_those_of_the_lock_file() {
        let lock = "version = 4\n\n[[package]]\nname = \"a\"\nversion = \"1.2.3\"\ndependencies = [\n \"b\",\n]\n\n\
                    [[package]]\nname = \"b\"\nversion = \"0.1.0\"\n\n[[package]]\nname = \"a\"\nversion = \"2.0.0\"\n";
        assert_eq!(locked(lock, "a").collect::<Vec<_>>(), ["1.2.3", "2.0.0"]);
        assert_eq!(locked(lock, "b").collect::<Vec<_>>(), ["0.1.0"]);
        assert_eq!(locked(lock, "c").count(), 0);
        assert!(parts().len() >= PARTS.len(), "{:?}", parts());
    }

    /// XXH64 of no bytes with seed 0 is 0xEF46DB3751D8E999 (xxHash's own test vectors).
    #[test]
    fn a_mark_is_of_all_bytes() {
        assert_eq!(in_words(hash(&[][..]).ok()), "ef46db3751d8e999");
        let long = vec![7; (1 << 20) + 1];
        assert_ne!(hash(&long[..]).unwrap(), hash(&long[1..]).unwrap());
        assert_eq!(in_words(None), "unknown");
    }

    #[test]
    fn an_executable_has_a_mark() {
        assert!(mark().is_some() && mark() == mark());
    }
}
