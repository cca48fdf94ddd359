//! Certificates of events, checked while pages are served, and what they prove.
//!
//! In: files of `events --certify`. Out: what is proved of a scene, by the hash of its text, as soon as its certificate has been
//! checked by [`proof`]. The command opens the files and has them checked; the reader of each publisher asks whether its stage
//! is of one of them.

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Chain, Cursor, Read};
use std::path::{Path, PathBuf};
use std::sync::{Arc, PoisonError, RwLock};

use bench_dragon_messages::SCENE_HASH_BYTES;
use bench_dragon_proof::{Proved, ProvedEvent, Refused, scene_hash};

/// Bytes of the longest first line, which holds the scene's text.
const LONGEST_FIRST_LINE: u64 = 1 << 26;

/// BLAKE3 of a scene's text.
pub type SceneHash = [u8; SCENE_HASH_BYTES];

/// A certificate of which the first line alone has been read.
#[derive(Debug)]
pub struct Certificate {
    file: PathBuf,
    scene_hash: SceneHash,
    lines: Chain<Cursor<Vec<u8>>, BufReader<File>>,
}

impl Certificate {
    /// Opens a file and reads of which scene it is.
    ///
    /// # Errors
    /// [`Refused`] for a file that cannot be read, or does not begin as a certificate.
    pub fn open(file: &Path) -> Result<Self, Refused> {
        let mut lines = BufReader::new(File::open(file).map_err(Refused::Unreadable)?);
        let mut first = Vec::new();
        lines.by_ref().take(LONGEST_FIRST_LINE).read_until(b'\n', &mut first).map_err(Refused::Unreadable)?;
        let scene_hash = scene_hash(&bench_dragon_proof::scene_of(&first)?);
        Ok(Self { file: file.to_owned(), scene_hash, lines: Cursor::new(first).chain(lines) })
    }

    /// The file.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Checks all of it, which takes seconds to minutes.
    ///
    /// # Errors
    /// [`Refused`]: the first line that is wrong.
    pub fn check(self) -> Result<Proved, Refused> {
        bench_dragon_proof::verify(self.lines, &mut |_| ())
    }
}

/// What is proved of which scenes.
#[derive(Debug, Default)]
pub struct Proofs {
    /// Of the scenes that there is a certificate of, what it proves; `None` until it has been checked.
    of: RwLock<HashMap<SceneHash, Option<Arc<[ProvedEvent]>>>>,
}

impl Proofs {
    /// Nothing is proved yet; of the scenes of these certificates something may be.
    pub fn expected<'a>(certificates: impl IntoIterator<Item = &'a Certificate>) -> Self {
        let of = certificates.into_iter().map(|certificate| (certificate.scene_hash, None)).collect();
        Self { of: RwLock::new(of) }
    }

    /// Adds what a certificate has proved.
    pub fn add(&self, proved: &Proved) {
        let mut of = self.of.write().unwrap_or_else(PoisonError::into_inner);
        of.insert(scene_hash(&proved.scene), Some(proved.results.clone().into()));
    }

    /// What is proved of the scene with this hash; `None` where nothing is, or not yet.
    pub(super) fn of(&self, scene: &SceneHash) -> Option<Arc<[ProvedEvent]>> {
        let of = self.of.read().unwrap_or_else(PoisonError::into_inner);
        of.get(scene).cloned().flatten()
    }

    /// Whether there are certificates, and none of them is of the scene with this hash.
    pub(super) fn are_of_others(&self, scene: &SceneHash) -> bool {
        let of = self.of.read().unwrap_or_else(PoisonError::into_inner);
        !of.is_empty() && !of.contains_key(scene)
    }
}
