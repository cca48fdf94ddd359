//! Certificates of events, checked while pages are served, and their proofs.
//!
//! In: files of `events --certify`. Out: the proofs of a scene, by the hash of its text, after [`proof`] has checked
//! its certificate. The command opens and checks the files; the reader of each publisher looks up the proofs of its
//! stage.

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Chain, Cursor, Read};
use std::path::{Path, PathBuf};
use std::sync::{Arc, PoisonError, RwLock};

use bench_dragon_messages::SCENE_HASH_BYTES;
use bench_dragon_proof::{LONGEST_LINE, Proved, ProvedEvent, Refused, scene_hash};

/// BLAKE3 of a scene's text.
pub type SceneHash = [u8; SCENE_HASH_BYTES];

/// A certificate whose first line has been read.
#[derive(Debug)]
pub struct Certificate {
    file: PathBuf,
    scene_hash: SceneHash,
    lines: Chain<Cursor<Vec<u8>>, BufReader<File>>,
}

impl Certificate {
    /// Opens a file and reads its scene.
    ///
    /// # Errors
    /// [`Refused`] for a file that cannot be read, or does not begin as a certificate.
    pub fn open(file: &Path) -> Result<Self, Refused> {
        let mut lines = BufReader::new(File::open(file).map_err(Refused::Unreadable)?);
        let mut first = Vec::new();
        lines.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut first).map_err(Refused::Unreadable)?;
        let scene_hash = scene_hash(&bench_dragon_proof::scene_of(&first)?);
        Ok(Self { file: file.to_owned(), scene_hash, lines: Cursor::new(first).chain(lines) })
    }

    /// Returns the file.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Checks the whole file, which takes seconds to minutes.
    ///
    /// # Errors
    /// [`Refused`]: the first line that is wrong.
    pub fn check(self) -> Result<Proved, Refused> {
        bench_dragon_proof::verify(self.lines, &mut |_| ())
    }
}

/// The proofs of scenes.
#[derive(Debug, Default)]
pub struct Proofs {
    /// The proofs of each scene with a certificate; `None` until the certificate has been checked.
    of: RwLock<HashMap<SceneHash, Option<Arc<[ProvedEvent]>>>>,
}

impl Proofs {
    /// Creates the proofs of these certificates' scenes, none of which is checked yet.
    pub fn expected<'a>(certificates: impl IntoIterator<Item = &'a Certificate>) -> Self {
        let of = certificates.into_iter().map(|certificate| (certificate.scene_hash, None)).collect();
        Self { of: RwLock::new(of) }
    }

    /// Adds the proofs of a certificate.
    pub fn add(&self, proved: &Proved) {
        let mut of = self.of.write().unwrap_or_else(PoisonError::into_inner);
        of.insert(scene_hash(&proved.scene), Some(proved.results.clone().into()));
    }

    /// Returns the proofs of the scene with this hash; `None` if there are none, or none yet.
    pub(super) fn of(&self, scene: &SceneHash) -> Option<Arc<[ProvedEvent]>> {
        let of = self.of.read().unwrap_or_else(PoisonError::into_inner);
        of.get(scene).cloned().flatten()
    }

    /// Returns true if there are certificates, and none for the scene with this hash.
    pub(super) fn are_of_others(&self, scene: &SceneHash) -> bool {
        let of = self.of.read().unwrap_or_else(PoisonError::into_inner);
        !of.is_empty() && !of.contains_key(scene)
    }
}
