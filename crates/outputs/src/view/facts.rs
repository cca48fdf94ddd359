//! Facts about scenes that no publisher sends, since they take time to compute.
//!
//! In: the text of a scene, and the function that computes. Out: the facts, by the hash of the text. The command has the
//! function, so that this crate needs no solver; the reader of each publisher requests the facts of its scene.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::{Arc, PoisonError, RwLock};

use serde::Serialize;

use super::SceneHash;

/// Facts about a scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SceneFacts {
    /// Wall seconds for which a show that loops stands at its end; `None` for a scene that does not loop.
    pub loop_stand: Option<f64>,
    /// The clearance over the whole show; `None` where it is not known.
    pub clearance: Option<ClearanceCurve>,
}

/// The clearance over a show, metres.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ClearanceCurve {
    /// Points in order of time: simulated seconds, and metres, negative where boards overlap.
    pub points: Vec<[f64; 2]>,
    /// The exact least clearance.
    pub least: LeastOfShow,
}

/// The least clearance of a show.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LeastOfShow {
    /// Simulated seconds.
    pub time: f64,
    /// Metres.
    pub clearance: f64,
    /// The lower bench, from 0.
    pub bench_a: u32,
    /// The higher bench, from 0.
    pub bench_b: u32,
}

/// Computes the facts of the scene with this text; `None` for a text that is no scene.
pub type Compute = fn(&str) -> Option<SceneFacts>;

/// The facts about the scenes that publishers have shown.
#[derive(Debug)]
pub struct Facts {
    compute: Compute,
    /// `None` until the facts of a scene are computed.
    of: RwLock<HashMap<SceneHash, Option<Arc<SceneFacts>>>>,
}

impl Facts {
    /// Creates an empty store with the function that computes.
    pub fn new(compute: Compute) -> Self {
        Self { compute, of: RwLock::default() }
    }

    /// Begins to compute the facts of a scene on a separate thread, unless that has begun before.
    pub(super) fn request(self: &Arc<Self>, scene: SceneHash, text: &str) {
        if let Entry::Vacant(new) = self.of.write().unwrap_or_else(PoisonError::into_inner).entry(scene) {
            new.insert(None);
        } else {
            return;
        }
        let (facts, text) = (Arc::clone(self), text.to_owned());
        let computing = std::thread::Builder::new().name("scene facts".to_owned()).spawn(move || {
            let computed = (facts.compute)(&text).map(Arc::new);
            facts.of.write().unwrap_or_else(PoisonError::into_inner).insert(scene, computed);
        });
        if let Err(error) = computing {
            log::warn!("the page shows no clearance over the show: no thread can be started: {error}");
        }
    }

    /// Returns the facts about the scene with this hash, once they are computed.
    pub(super) fn of(&self, scene: &SceneHash) -> Option<Arc<SceneFacts>> {
        self.of.read().unwrap_or_else(PoisonError::into_inner).get(scene).cloned().flatten()
    }
}
